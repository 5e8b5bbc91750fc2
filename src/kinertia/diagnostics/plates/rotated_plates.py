"""Plates that are rotated or mirrored in the file: one correction would put the centre of pressure under the feet.

A load goes from the heel to the ball of its foot. On fourteen fault-free trials it is 16 to 75 mm from there (RMS over
a whole contact); about the middle of a rotated or mirrored plate, 106 mm and more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.contact_fit import Feet, Hypothesis
from kinertia.diagnostics.evidence.plate_contacts import PlateContact, cop_horizontal, displaced
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import FloatArray, PlateLoads

_WRONG_M, _RIGHT_M, _CLEARLY_BEST = 0.1, 0.08, 0.6
_ORDER = "a wrong order of the corners"
_OPERATIONS = (
    # places (x, z) from the plate's middle; from Z to X is a positive rotation about Y
    ("rotated by 180 degrees", ((-1, 0), (0, -1)), _ORDER),
    ("rotated by 90 degrees", ((0, -1), (1, 0)), _ORDER),
    ("rotated by -90 degrees", ((0, 1), (-1, 0)), _ORDER),
    ("mirrored along X", ((-1, 0), (0, 1)), "a wrong sign of the plate moment about Z"),
    ("mirrored along Z", ((1, 0), (0, -1)), "a wrong sign of the plate moment about X"),
)


def rotated_plates(context: RecordingContext) -> Iterator[Hypothesis]:
    """P242: the one correction of one plate, or of all alike, that puts all loads under the feet; nothing where none
    does, or several do.
    """
    plates, feet = context.plates, context.foot_trajectories
    steps = [one for one in context.contacts if one.is_step]
    if plates is None or feet is None or plates.corners is None or not steps:
        return
    point = cop_horizontal(plates)
    read = _places(plates, point, steps)
    read_m = _distances(steps, read, feet)
    if read_m.max() < _WRONG_M:
        return
    middle = plates.corners.mean(axis=1)[:, [0, 2]]
    used = sorted({one.plate for one in steps})
    offset = np.mean([one.own_offset_m for one in steps], axis=0)
    left_m: dict[tuple[int, ...], FloatArray] = {(): _distances(steps, [each - offset for each in read], feet)}
    for k, (_, matrix, _) in enumerate(_OPERATIONS):
        turned = middle + (point - middle) @ np.array(matrix).T
        turned_m = _distances(steps, _places(plates, turned, steps), feet)
        for which in {*((p,) for p in used), tuple(used)}:
            left_m[(k, *which)] = np.where([one.plate in which for one in steps], turned_m, read_m)
    best, second = sorted(left_m, key=lambda one: _rms(left_m[one]))[:2]
    only = sum(each.max() <= _RIGHT_M for each in left_m.values()) == 1
    clearly = only or _rms(left_m[best]) < _CLEARLY_BEST * _rms(left_m[second])
    if not best or left_m[best].max() > _RIGHT_M or not clearly:
        return
    wrong = list(best[1:])
    by = np.zeros_like(point)
    by[:, wrong] = (middle + (point - middle) @ np.array(_OPERATIONS[best[0]][1]).T - point)[:, wrong]
    operation, _, cause = _OPERATIONS[best[0]]
    found = finding(
        "P242",
        context.at(plate=plates.names[wrong[0]] if len(wrong) == 1 else None),
        causes=(cause,),
        before_m=Quantity(float(read_m.max()), "m", limit=_WRONG_M, usual=(0.016, 0.075)),
        after_m=Quantity(float(left_m[best].max()), "m", limit=_RIGHT_M),
        operation=Quantity(operation),
        plates=Quantity(" and ".join(plates.names[p] for p in wrong)),
    )
    yield Hypothesis(found, displaced(plates, by))


def _places(plates: PlateLoads, point: FloatArray, steps: Sequence[PlateContact]) -> list[FloatArray]:
    """(k, 2) m of each, centres of pressure."""
    return [point[np.searchsorted(plates.time, one.time), one.plate] for one in steps]


def _distances(steps: Sequence[PlateContact], place: Sequence[FloatArray], feet: Feet) -> FloatArray:
    """m (RMS), of each step, from where the load of the nearer foot is expected."""
    errors = []
    for one, each in zip(steps, place, strict=True):
        off = [np.square(each - foot.expected_cop(one.time, one.weight)).sum(axis=1) for foot in feet]
        errors.append(min(float(np.sqrt(np.average(square, weights=one.weight))) for square in off))
    return np.array(errors)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.square(values).mean()))
