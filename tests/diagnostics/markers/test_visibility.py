"""Markers that are rarely or never seen, and segments without any, are found."""

import numpy as np
import pytest

from kinertia.diagnostics.markers.trajectories import visible
from kinertia.io.marker_set_file import read_marker_set
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers
from marker_contexts import codes, context_of

SET = read_marker_set("plug-in-gait")
TRUNK = SET.segments["torso"]


def markers_of(labels, **hidden):
    """A second of markers at 100 Hz, of which these frames are not seen."""
    positions = np.zeros((100, len(labels), 3))
    for label, frames in hidden.items():
        positions[frames, labels.index(label)] = np.nan
    return Markers(np.arange(100) / 100, labels, positions)


def found(markers, marker_set=SET, **options):
    return list(visible(context_of(markers, marker_set, **options)))


def test_gaps():
    markers = markers_of(SET.labels, LKNE=slice(0, 100), RTHI=slice(0, 60), RHEE=slice(20, 40), LHEE=slice(50, 59))
    never, rare, gap = sorted(found(markers), key=lambda finding: finding.code)
    assert (never.code, never.where.markers) == ("M101", ("LKNE",))
    assert (rare.code, rare.where.markers, rare.evidence["share"].value) == ("M102", ("RTHI",), 0.4)
    assert (gap.code, gap.where.markers) == ("M103", ("RHEE",))
    assert gap.evidence["gap_s"].value == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("segment", "words"),
    [("pelvis", ["pelvis"]), ("foot_l", ["left foot"]), ("torso", []), ("forearm_r", []), ("shank_r", ["right shank"])],
)
def test_segments_without_markers(segment, words):
    """Neither arms nor a trunk need be seen."""
    labels = tuple(label for label in SET.labels if label not in SET.segments[segment])
    parts = [finding.where.part for finding in found(markers_of(labels)) if finding.code == "M104"]
    assert parts == words


def test_a_trunk_that_the_static_trial_shows_has_to_be_seen():
    labels = tuple(label for label in SET.labels if label not in TRUNK)
    static = context_of(markers_of(SET.labels), SET)
    assert [finding.where.part for finding in found(markers_of(labels), static=static)] == ["torso"]
    assert found(markers_of(labels), static=context_of(markers_of(labels), SET)) == []


def test_a_foot_whose_markers_are_never_seen():
    hidden = dict.fromkeys(SET.segments["foot_r"], slice(0, 100))
    assert codes(found(markers_of(SET.labels, **hidden))) == ["M101", "M101", "M104"]


def test_a_model_needs_markers_on_both_feet():
    model = MarkerSet("scaled.osim", {}, {"foot_r": ("A",), "foot_l": (), "toes": ("B",)}, {})
    assert [finding.where.part for finding in found(markers_of(("A",)), model)] == ["left foot"]
