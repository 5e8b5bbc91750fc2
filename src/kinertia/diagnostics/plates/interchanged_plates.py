"""Finds loads at the position of another plate: the channels, or corners, of two plates are interchanged."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.contact_fit import Feet, Hypothesis
from kinertia.diagnostics.evidence.plate_contacts import COP_MIN_FORCE_N, FAR_M, contacts_of, cop_horizontal, displaced
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import FloatArray, PlateLoads

_DIFFERENCE = 0.25
"""Share of their distance by which the displacements of two plates may differ from being opposite."""


def interchanged_plates(context: RecordingContext) -> Iterator[Hypothesis]:
    """Report P241: loads that are under no foot at their own position, but under one at another plate's."""
    plates, feet, contacts = context.plates, context.foot_trajectories, context.contacts
    if plates is None or feet is None or len({one.plate for one in contacts}) < 2:
        return
    before = max(one.distance_m for one in contacts)
    if before <= FAR_M:
        return
    used = sorted({one.plate for one in contacts})
    middle = _middles(plates, used)
    tried = []
    for pair in combinations(used, 2):
        by = np.zeros((len(plates.names), 2))
        by[pair[0]], by[pair[1]] = middle[pair[1]] - middle[pair[0]], middle[pair[0]] - middle[pair[1]]
        moved = displaced(plates, by)
        tried.append((max(one.distance_m for one in contacts_of(moved, feet)), pair, moved))
    after, pair, moved = min(tried, key=lambda one: one[0])
    if after > min(FAR_M / 2, before):
        yield from _opposite(context, plates, feet)
        return
    yield _interchanged(context, pair, moved, before, after)


def _interchanged(
    context: RecordingContext, pair: Sequence[int], corrected: PlateLoads, before_m: float, after_m: float
) -> Hypothesis:
    names = [corrected.names[p] for p in pair]
    found = finding(
        "P241",
        context.at(),
        before_m=Quantity(before_m, "m", limit=FAR_M),
        after_m=Quantity(after_m, "m", limit=FAR_M / 2),
        plate=Quantity(names[0]),
        other=Quantity(names[1]),
    )
    return Hypothesis(found, corrected)


def _middles(plates: PlateLoads, used: Sequence[int]) -> dict[int, FloatArray]:
    """Return the middle (2,) m of each plate: from its corners, or from where it is loaded."""
    if plates.corners is not None:
        return {p: plates.corners[p].mean(axis=0)[[0, 2]] for p in used}
    point = cop_horizontal(plates)
    loaded = {p: plates.force[:, p, 1] > COP_MIN_FORCE_N for p in used}
    return {p: np.average(point[loaded[p], p], axis=0, weights=plates.force[loaded[p], p, 1]) for p in used}


def _opposite(context: RecordingContext, plates: PlateLoads, feet: Feet) -> Iterator[Hypothesis]:
    """Yield loads of two plates, or belts, displaced equally in opposite directions, each by a constant amount."""
    steps = [one for one in context.contacts if one.is_step]
    used = sorted({one.plate for one in steps})
    if len(used) != 2:
        return
    offsets: dict[int, list[FloatArray]] = {p: [] for p in used}
    for one in steps:
        from_feet = [one.place - foot.expected_cop(one.time, one.weight) for foot in feet]
        mean = [np.average(each, axis=0, weights=one.weight) for each in from_feet]
        # the swinging foot moves away
        foot = int(np.argmin([np.square(each - m).sum(axis=1).mean() for each, m in zip(from_feet, mean, strict=True)]))
        offsets[one.plate].append(mean[foot])
    first, second = (np.mean(offsets[p], axis=0) for p in used)
    half = (first - second) / 2
    size = float(np.linalg.norm(half))
    residual = max(
        float(np.linalg.norm(each - sign * half)) for p, sign in zip(used, (1, -1), strict=True) for each in offsets[p]
    )
    if size < FAR_M or residual > min(FAR_M / 2, _DIFFERENCE * size):
        return
    by = np.zeros((len(plates.names), 2))
    by[used[0]], by[used[1]] = -half, half
    yield _interchanged(context, used, displaced(plates, by), size, residual)
