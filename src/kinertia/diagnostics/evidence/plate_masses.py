"""Weighs the body on each plate alone, while one foot stands on it and nothing else is loaded."""

from collections.abc import Mapping

import numpy as np

from kinertia.diagnostics.evidence.body_centre import body_centre
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.smoothing import SmoothingError, smooth
from kinertia.trial.data import FloatArray, Markers, PlateLoads, Trial
from kinertia.trial.foot_motion import AROUND_LOAD_S
from kinertia.trial.sampled_time import nearest_samples, runs, span_s, within

_CENTRE_HZ = 8.0
_ALONE_N, _UNLOADED_N, _SHORTEST_S = 50.0, 10.0, 0.2


def plate_masses(
    plates: PlateLoads, trial: Trial, markers: Markers, segment_of_label: Mapping[str, str]
) -> dict[str, float]:
    """Compute body mass (kg) by plate, of a body that moves like the marker-based centre; only plates that for a while
    support it alone.

    Args:
        plates: plates of the recording.
        trial: the recording with loads sorted by foot; it knows in which frames ground contact is measured.
        markers: all markers of the recording.
        segment_of_label: which marker is on which segment.
    """
    windows = trial.windows()
    if not windows:
        return {}
    markers = markers.cut(
        min(start for start, _ in windows) - AROUND_LOAD_S, max(end for _, end in windows) + AROUND_LOAD_S
    )
    place = body_centre(segment_of_label, markers)
    if place is None:
        return {}
    try:
        centre = smooth(markers.time, place[:, 1], _CENTRE_HZ)
    except SmoothingError:
        return {}
    measured = trial.measured[nearest_samples(trial.markers.time, plates.time)]
    measured &= within(plates.time, markers.time[0], markers.time[-1])
    by_plate = {}
    for p, name in enumerate(plates.names):
        vertical: FloatArray = plates.force[:, p, 1]
        others = np.delete(plates.force[..., 1], p, axis=1).max(axis=1, initial=0.0)
        masses_kg = []
        for first, last in runs((vertical > _ALONE_N) & (others < _UNLOADED_N) & measured):
            span = span_s(plates.time, first, last)
            if span < _SHORTEST_S:
                continue
            step = np.diff(plates.time[first : last + 1])
            impulse = float(((vertical[first + 1 : last + 1] + vertical[first:last]) / 2 * step).sum())
            velocity = centre(plates.time[[first, last]], 1)
            masses_kg.append(impulse / (GRAVITY_M_S2 * span + float(velocity[1] - velocity[0])))
        if masses_kg:
            by_plate[name] = float(np.mean(masses_kg))
    return by_plate
