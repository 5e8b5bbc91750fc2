"""Weighs a person who stands still on plates, on one with both feet or on several."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.evidence.plate_edges import OVERHANG_M, beyond_edges
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import FEET, FloatArray, Markers, PlateLoads
from kinertia.trial.ground_contact import FootMarkers
from kinertia.trial.sampled_time import TIME_TOLERANCE_S, within

_WINDOW_S, _STILL_M = 0.2, 0.005
"""A standing person moves by less within this time: in quiet standing 1 to 3 mm."""
_CHANGE_SD_M_S = 0.01
"""SD of the change of vertical velocity between both ends (`force_mass.CHANGE_SD_M_S`)."""
_BETWEEN, _ASIDE_M = (0.15, 0.85), 0.15
"""Range between the feet of the load of both: beyond it, one of them also stands on something else."""


@dataclass(frozen=True)
class StandingMass:
    """Mass that the plates support while a person stands still.

    Attributes:
        mass_kg, sd_kg: the mass, and its SD from the person's sway.
        span_s: first and last time of standing still.
        plates: names of the plates that support the mass.
    """

    mass_kg: float
    sd_kg: float
    span_s: tuple[float, float]
    plates: tuple[str, ...]


def standing_mass(plates: PlateLoads, markers: Markers, feet: FootMarkers) -> StandingMass | None:
    """Weigh the person in the longest interval of standing still with both feet on plates; None without one."""
    total = plates.wrench.sum(axis=1)
    best: StandingMass | None = None
    for start_s, end_s in _still_spans(markers):
        here = within(plates.time, start_s, end_s)
        if here.sum() < 2 or total[here, 1].min() < FIRM_LOAD_N:
            continue
        right, left = (_places(markers, feet[side], start_s) for side in FEET)
        if not _under_both(total[here], right, left) or _beyond_plates(plates, np.concatenate([right, left])):
            continue
        lasts_s = end_s - start_s
        if best is None or lasts_s > best.span_s[1] - best.span_s[0]:
            mass_kg = float(total[here, 1].mean()) / GRAVITY_M_S2
            sd_kg = mass_kg * _CHANGE_SD_M_S / (lasts_s * GRAVITY_M_S2)
            on = plates.force[here, :, 1].mean(axis=0) > 0.0
            names = tuple(name for name, loaded in zip(plates.names, on, strict=True) if loaded)
            best = StandingMass(mass_kg, sd_kg, (start_s, end_s), names)
    return best


def _still_spans(markers: Markers) -> list[tuple[float, float]]:
    """Find intervals (s) in which the median marker stays in place, joined where they follow each other."""
    if len(markers.time) < 2:
        return []
    every = max(2, round(_WINDOW_S * markers.rate_hz))
    spans: list[tuple[float, float]] = []
    for first in range(0, len(markers.time) - every + 1, every):
        place = markers.positions[first : first + every][:, markers.seen[first : first + every].all(axis=0)]
        if not place.shape[1] or np.median(np.linalg.norm(np.ptp(place, axis=0), axis=1)) > _STILL_M:
            continue
        start_s, end_s = float(markers.time[first]), float(markers.time[first + every - 1])
        if spans and start_s - spans[-1][1] < 1.5 / markers.rate_hz:
            start_s = spans.pop()[0]
        spans.append((start_s, end_s))
    return spans


def _places(markers: Markers, labels: Sequence[str], at_s: float) -> FloatArray:
    """Return horizontal positions (m, 2) m of the markers of one foot that are visible at this time."""
    first = int(np.searchsorted(markers.time, at_s - TIME_TOLERANCE_S))
    place = markers.select(labels).positions[first][:, [0, 2]]
    result: FloatArray = place[np.isfinite(place).all(axis=1)]
    return result


def _under_both(total: FloatArray, right: FloatArray, left: FloatArray) -> bool:
    """Return whether the whole load (k, 6) is between both feet (m, 2)."""
    if not len(right) or not len(left):
        return False
    mean, start, along = total.mean(axis=0), right.mean(axis=0), left.mean(axis=0) - right.mean(axis=0)
    point = np.array([mean[5], -mean[3]]) / mean[1]
    share = float((point - start) @ along / max(float(along @ along), 1e-12))
    aside = float(np.linalg.norm(point - start - share * along))
    return _BETWEEN[0] < share < _BETWEEN[1] and aside < _ASIDE_M


def _beyond_plates(plates: PlateLoads, feet: FloatArray) -> bool:
    """Return whether a marker on the feet (m, 2) is beyond the edges of all plates, whose corners are known."""
    if plates.corners is None:
        return False
    each = np.stack([beyond_edges(corners, feet) for corners in plates.corners])
    return bool((each.min(axis=0) > OVERHANG_M).any())
