"""Do plates show the same body as equally heavy?

While one foot stands alone, its plate carries and accelerates all of it: on the sound trials at hand two plates agree
within 2 %, and within 6 % where the estimate finds a gain of 6 %. Over a second and more, the ups and downs of the body
tell more: a plate that reads too much pushes it up whenever it is stood on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinertia.diagnostics.evidence.caused_velocity import CausedVelocity
from kinertia.diagnostics.evidence.markers_centre import markers_centre
from kinertia.diagnostics.evidence.ups_and_downs import ups_and_downs_of
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.smoothing import SmoothingError, smooth
from kinertia.trial.data import FloatArray, Recording, Trial
from kinertia.trial.sampled_time import nearest_samples, runs, span_s, within

_CENTRE_HZ = 8.0
_ALONE_N, _IDLE_N, _SHORTEST_S = 50.0, 10.0, 0.2
_APART = 0.075
_LEAST_WINDOW_S, _LEAST_GAIN, _LEFT = 1.0, 0.025, 0.9
"""Of 31 sound trials gains by pelvis and by markers' centre are of one sign and both beyond 0.5 % in eight, and beyond
1 % in one. They must also explain so much, which a jump's do not."""


def gain_doubts(
    recording: Recording, trial: Trial, owners: Mapping[str, str], parts: Sequence[CausedVelocity]
) -> list[str]:
    """Plates by which the body is heavier than by others.

    Args:
        recording: as read.
        trial: the same with measured frames.
        owners: the segment that each marker is on.
        parts: the trial's `caused_velocities`.
    """
    return _single_supports(_masses(recording, trial, owners)) or _ups_and_downs(recording, parts)


def _single_supports(mass_kg: Mapping[str, float]) -> list[str]:
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


def _ups_and_downs(recording: Recording, parts: Sequence[CausedVelocity]) -> list[str]:
    """The plate whose other gain explains how the body goes up and down, better than another rate would."""
    plates = recording.plates
    if plates is None or len(plates.names) < 2:
        return []
    for part in parts:
        if span_s(part.time) < _LEAST_WINDOW_S:
            continue
        read, rate = ups_and_downs_of(part), ups_and_downs_of(part, growing=True)
        own = [part.by(plates.time, vertical) for vertical in plates.force[..., 1].T]
        used = [p for p, caused in enumerate(own) if np.ptp(caused) > 0.0]
        by_plate = {p: found for p in used if (found := ups_and_downs_of(part, own[p]))}
        if not read or len(by_plate) < 2:
            continue
        best = min(by_plate, key=lambda p: sum(each.left for each in by_plate[p]))
        gain, left = np.array([(each.gain, each.left) for each in by_plate[best]]).T
        rivals = np.array([_LEFT * each.left for each in read]), np.array([each.left for each in rate or read])
        if abs(np.sign(gain).sum()) < len(gain) or np.abs(gain).min() < _LEAST_GAIN or (left > rivals).any():
            continue
        one, others = plates.names[best], " and ".join(plates.names[p] for p in used if p != best)
        heavy, light = (others, one) if gain.mean() > 0 else (one, others)
        as_read = np.mean([each.left for each in read])
        return [
            f"the gain of {heavy} or of {light} is wrong, or the zero of one of them: the body goes up and down as its "
            f"markers show if {one} should read {100 * gain.mean():+.1f} % beside {others} (which leaves "
            f"{100 * left.mean():.0f} % of the velocity, and {100 * as_read:.0f} % as it is); check the sensitivities "
            "of both plates with a known weight, and their zeros, or see whether a part of the weight was on no plate "
            f"over {light} (a handrail, a crutch)"
        ]
    return []


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
    measured &= within(plates.time, markers.time[0], markers.time[-1])
    by_plate = {}
    for p, name in enumerate(plates.names):
        vertical: FloatArray = plates.force[:, p, 1]
        alone = (vertical > _ALONE_N) & (np.delete(plates.force[..., 1], p, axis=1).max(axis=1) < _IDLE_N) & measured
        masses_kg = []
        for first, last in runs(alone):
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
