"""Plates that are turned or mirrored in the file: one correction would put the centre of pressure under the feet.

A load goes from the heel to the ball of its foot. On fourteen sound trials it is 16 to 75 mm from there (RMS over a
whole contact); about the middle of a turned or mirrored plate, 106 mm and more.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.diagnostics.evidence.foot_ways import FootWay
from kinertia.diagnostics.evidence.load_contacts import Contact, load_points
from kinertia.trial.data import FloatArray, PlateLoads

_WRONG_M, _RIGHT_M, _CLEARLY_BEST = 0.1, 0.08, 0.6
_ORDER = "correct the order of its corners"
_TURNS = (
    # places (x, z) from the plate's middle; from Z to X is a positive turn about Y
    ("turned by 180 degrees about the vertical", ((-1, 0), (0, -1)), _ORDER),
    ("turned by 90 degrees about the vertical", ((0, -1), (1, 0)), _ORDER),
    ("turned by -90 degrees about the vertical", ((0, 1), (-1, 0)), _ORDER),
    ("mirrored along X about its middle", ((-1, 0), (0, 1)), "correct the sign of its moment about Z"),
    ("mirrored along Z about its middle", ((1, 0), (0, -1)), "correct the sign of its moment about X"),
)


def turned_plates_trouble(plates: PlateLoads, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> str:
    """Which single correction of one plate, or of all alike, puts all loads under the feet; empty where they are there,
    or where none does, or several do.
    """
    steps = [one for one in contacts if one.is_step]
    if plates.corners is None or not steps:
        return ""
    place = _places(plates, steps)
    read_m = _off_paths(steps, place, ways)
    if read_m.max() < _WRONG_M:
        return ""
    middle = plates.corners.mean(axis=1)[:, [0, 2]]
    used = sorted({one.plate for one in steps})
    offset = np.mean([one.off_own_m for one in steps], axis=0)
    left_m: dict[tuple[int, ...], FloatArray] = {(): _off_paths(steps, [each - offset for each in place], ways)}
    for k, (_, matrix, _) in enumerate(_TURNS):
        turned = [
            middle[one.plate] + (each - middle[one.plate]) @ np.array(matrix).T
            for one, each in zip(steps, place, strict=True)
        ]
        turned_m = _off_paths(steps, turned, ways)
        for which in {*((p,) for p in used), tuple(used)}:
            left_m[(k, *which)] = np.where([one.plate in which for one in steps], turned_m, read_m)
    best, second = sorted(left_m, key=lambda one: _rms(left_m[one]))[:2]
    only = sum(each.max() <= _RIGHT_M for each in left_m.values()) == 1
    clearly = only or _rms(left_m[best]) < _CLEARLY_BEST * _rms(left_m[second])
    if not best or left_m[best].max() > _RIGHT_M or not clearly:
        return ""
    cause, _, remedy = _TURNS[best[0]]
    names = [plates.names[p] for p in best[1:]]
    return (
        f"the centre of pressure of {' and '.join(names)} is {cause}: loads are up to {1e3 * read_m.max():.0f} mm from "
        f"where they go from heel to ball of the foot, and {1e3 * left_m[best].max():.0f} mm once that is taken back "
        "(RMS over a contact), which no other single turn, mirror or offset does; "
        f"{remedy}{' (of each of these plates)' if len(names) > 1 else ''} and export again"
    )


def _places(plates: PlateLoads, steps: Sequence[Contact]) -> list[FloatArray]:
    """(k, 2) m of each, centres of pressure."""
    point = load_points(plates)
    return [point[np.searchsorted(plates.time, one.time), one.plate] for one in steps]


def _off_paths(steps: Sequence[Contact], place: Sequence[FloatArray], ways: tuple[FootWay, FootWay]) -> FloatArray:
    """m (RMS), of each step, from where the load of the nearer foot is expected."""
    errors = []
    for one, each in zip(steps, place, strict=True):
        off = [np.square(each - way.load_path(one.time, one.weight)).sum(axis=1) for way in ways]
        errors.append(min(float(np.sqrt(np.average(square, weights=one.weight))) for square in off))
    return np.array(errors)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.square(values).mean()))
