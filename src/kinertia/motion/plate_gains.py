"""Do plates show the same body as equally heavy? While one foot stands alone, its plate carries and accelerates all of
it.

On the sound trials at hand two plates agree within 2 %, and within 6 % where the estimate finds a gain of 6 %.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.markers_centre import markers_centre
from kinertia.motion.smoothing import SmoothingError, smooth
from kinertia.trial.data import FloatArray, Recording, Trial, nearest_samples, runs

_CENTRE_HZ = 8.0
_ALONE_N, _IDLE_N, _SHORTEST_S = 50.0, 10.0, 0.2
_APART = 0.075


def gain_doubts(recording: Recording, trial: Trial, owners: Mapping[str, str]) -> list[str]:
    """Plates by which the body is heavier than by others.

    Args:
        recording: as read.
        trial: the same with measured frames.
        owners: the segment that each marker is on.
    """
    mass_kg = _masses(recording, trial, owners)
    if len(mass_kg) < 2:
        return []
    heavy, light = (pick(mass_kg, key=lambda name: mass_kg[name]) for pick in (max, min))
    ratio = mass_kg[heavy] / mass_kg[light]
    if ratio <= 1 + _APART:
        return []
    return [
        f"the gain of {heavy} or of {light} is wrong: while one foot stands alone, the body weighs "
        f"{mass_kg[heavy]:.1f} kg by the one and {mass_kg[light]:.1f} kg by the other ({100 * (ratio - 1):.0f} % "
        "apart), with what its markers say of its acceleration; check the sensitivities of both plates with a known "
        f"weight, or see whether a part of the weight was on no plate over {light} (a handrail, a crutch)"
    ]


def _masses(recording: Recording, trial: Trial, owners: Mapping[str, str]) -> dict[str, float]:
    """kg, by plate, of a body that moves like the markers' centre."""
    plates, markers = recording.plates, recording.markers
    place = None if plates is None else markers_centre(owners, markers)
    if plates is None or place is None or len(plates.names) < 2:
        return {}
    try:
        centre = smooth(markers.time, place[:, 1], _CENTRE_HZ)
    except SmoothingError:
        return {}
    measured = trial.measured[nearest_samples(markers.time, plates.time)]
    measured &= (plates.time >= markers.time[0]) & (plates.time <= markers.time[-1])
    by_plate = {}
    for p, name in enumerate(plates.names):
        vertical: FloatArray = plates.force[:, p, 1]
        alone = (vertical > _ALONE_N) & (np.delete(plates.force[..., 1], p, axis=1).max(axis=1) < _IDLE_N) & measured
        masses_kg = []
        for first, last in runs(alone):
            span = float(plates.time[last] - plates.time[first])
            if span < _SHORTEST_S:
                continue
            step = np.diff(plates.time[first : last + 1])
            impulse = float(((vertical[first + 1 : last + 1] + vertical[first:last]) / 2 * step).sum())
            velocity = centre(plates.time[[first, last]], 1)
            masses_kg.append(impulse / (GRAVITY_M_S2 * span + float(velocity[1] - velocity[0])))
        if masses_kg:
            by_plate[name] = float(np.mean(masses_kg))
    return by_plate
