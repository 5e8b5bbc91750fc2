"""Loads that lie where another plate is: channels, or corners, of two plates exchanged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from kinertia.diagnostics.evidence.foot_ways import FootWay
from kinertia.diagnostics.evidence.load_contacts import FAR_M, FIRM_N, Contact, half_within, load_points
from kinertia.trial.data import FloatArray, PlateLoads

_APART = 0.25
"""Share of their distance by which two plates may be off by other than the opposite."""


def exchanged_plates_trouble(plates: PlateLoads, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> str:
    """Loads that are under no foot where they are, but under one where another plate is."""
    used = sorted({contact.plate for contact in contacts})
    whole = [half_within(one) for one in contacts]
    if len(used) < 2 or max(whole) <= FAR_M:
        return ""
    point = load_points(plates)
    middle = _middles(plates, point, used)
    best = (max(whole), (0, 0))
    for one, other in combinations(used, 2):
        moved = point.copy()
        moved[:, one] += middle[other] - middle[one]
        moved[:, other] += middle[one] - middle[other]
        far = []
        for contact in contacts:
            rows = np.searchsorted(plates.time, contact.time)
            off = np.stack([way.off_foot(contact.time, moved[rows, contact.plate]) for way in ways])
            far.append(half_within(replace(contact, off_m=off)))
        if max(far) < best[0]:
            best = (max(far), (one, other))
    if best[0] > FAR_M / 2:
        return _opposite_trouble(plates, contacts, ways)
    names = " and ".join(plates.names[p] for p in best[1])
    return (
        f"the loads of {names} are {1e3 * max(whole):.0f} mm from the feet, and {1e3 * best[0]:.0f} mm once they are "
        f"exchanged: their channels or their corners are exchanged; correct the order of the plates"
    )


def _middles(plates: PlateLoads, point: FloatArray, used: Sequence[int]) -> dict[int, FloatArray]:
    if plates.corners is not None:
        return {p: plates.corners[p].mean(axis=0)[[0, 2]] for p in used}
    firm = {p: plates.force[:, p, 1] > FIRM_N for p in used}
    return {p: np.average(point[firm[p], p], axis=0, weights=plates.force[firm[p], p, 1]) for p in used}


def _opposite_trouble(plates: PlateLoads, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> str:
    """Loads of two plates, or belts, that are off by as much in opposite directions, each by the same all the time."""
    steps = [one for one in contacts if one.is_step]
    used = sorted({one.plate for one in steps})
    if len(used) != 2:
        return ""
    point = load_points(plates)
    off: dict[int, list[FloatArray]] = {p: [] for p in used}
    for one in steps:
        place = point[np.searchsorted(plates.time, one.time), one.plate]
        from_feet = [place - way.load_path(one.time, one.weight) for way in ways]
        mean = [np.average(each, axis=0, weights=one.weight) for each in from_feet]
        # the foot that swings goes away
        foot = int(np.argmin([np.square(each - m).sum(axis=1).mean() for each, m in zip(from_feet, mean, strict=True)]))
        off[one.plate].append(mean[foot])
    first, second = (np.mean(off[p], axis=0) for p in used)
    way = (first - second) / 2
    left = max(
        float(np.linalg.norm(each - sign * way)) for p, sign in zip(used, (1, -1), strict=True) for each in off[p]
    )
    if np.linalg.norm(way) < FAR_M or left > min(FAR_M / 2, _APART * float(np.linalg.norm(way))):
        return ""
    names = [plates.names[p] for p in used]
    return (
        f"the loads of {names[0]} are off their foot by {1e3 * first[0]:+.0f} mm along X and {1e3 * first[1]:+.0f} mm "
        f"along Z, those of {names[1]} by {1e3 * second[0]:+.0f} and {1e3 * second[1]:+.0f} mm, which is the opposite: "
        "the plates or belts are exchanged, their channels or their corners; correct the order of the plates"
    )
