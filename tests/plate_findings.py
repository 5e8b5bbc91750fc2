"""Findings about plates, and walks with other forces, in tests."""

from dataclasses import replace

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.registry import LOADED_CHECKS, SIGNAL_CHECKS
from kinertia.diagnostics.runner import asked, explained
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.data import Markers, Recording
from kinertia.trial.ground_contact import centre_of_pressure

MARKERS = Markers(np.arange(2) / 100, ("A", "B"), np.zeros((2, 2, 3)))


def context_of(recording, marker_set=None, **stated):
    """A recording with the markers of a preset, unless others are given."""
    return RecordingContext(recording, marker_set or choose_marker_set(recording.markers.labels), **stated)


def plates_alone(plates, **stated):
    """Plates without feet."""
    return RecordingContext(Recording("walk", MARKERS, plates), **stated)


def found_in(context):
    """All that is found of a recording's plates, with what explains what."""
    return explained(asked((*SIGNAL_CHECKS, *LOADED_CHECKS), context))


def codes(findings):
    """Of findings that no other explains."""
    return [finding.code for finding in findings if finding.is_open]


def with_force(walk, change, torque=1.0):
    """The walk with other forces at the same centres of pressure, and torques times a factor."""
    plates = walk.plates
    point = centre_of_pressure(plates.wrench)
    free = torque * (plates.moment - np.cross(point, plates.force)) * [0, 1, 0]
    force = change(plates.force)
    return replace(walk, plates=replace(plates, force=force, moment=np.cross(point, force) + free))
