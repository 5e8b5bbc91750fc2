"""Are plates where the file says? Finds repeated, interchanged, rotated, mirrored ones, and those at a wrong height.

A load moves from the heel to the ball of its foot. On fourteen fault-free trials it is 16 to 75 mm from that line (RMS
over a whole contact); with a plate rotated or mirrored about its middle, 106 mm and more.

While a plate is loaded, the lowest marker of the foot on it is 7 to 51 mm above it: on 60 contacts of 20 people, from
standing children to runs in shoes.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.evidence.body_motion import push_share
from kinertia.diagnostics.evidence.plate_contacts import (
    COP_MIN_FORCE_N,
    FAR_M,
    Feet,
    Hypothesis,
    PlateContact,
    contacts_of,
    cop_horizontal,
    displaced,
)
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads
from kinertia.trial.sampled_data import rms

WRONG_M, _RIGHT_M, _CLEARLY_BEST = Limit(0.1, "m", usual=(0.016, 0.075)), 0.08, 0.6
_ORDER = "a wrong order of the corners"
_CHANNELS = "interchanged channels of the plate moments Mx and My"
_ABOUT_X, _ABOUT_Z = (f"a wrong sign of the plate moment about {axis}" for axis in "XZ")
_TILTING = "wrong signs of the plate moments Mx and My, or eight channels numbered from the opposite corner"
_MENDING = {
    _ORDER: "Correct the order of the corners",
    _TILTING: "Reverse Mx and My; of eight channels, interchange Fz1 with Fz3, Fz2 with Fz4, Fx12 with Fx34 and Fy14 "
    "with Fy23 (the last two unless Mz is right)",
    _ABOUT_X: "Reverse the plate moment about X",
    _ABOUT_Z: "Reverse the plate moment about Z",
    _CHANNELS: "Interchange the channels of Mx and My",
}
_HALF_TURN = "rotated by 180 degrees"
LEAST_PUSH = 0.02
"""Of forces that go with the motion; a plate that is rotated by its corners shows them reversed."""
_OPERATIONS = (
    # places (x, z) from the plate's middle; from Z to X is a positive rotation about Y
    (_HALF_TURN, ((-1, 0), (0, -1)), _ORDER),
    ("rotated by 90 degrees", ((0, -1), (1, 0)), _ORDER),
    ("rotated by -90 degrees", ((0, 1), (-1, 0)), _ORDER),
    ("mirrored along X", ((-1, 0), (0, 1)), _ABOUT_Z),
    ("mirrored along Z", ((1, 0), (0, -1)), _ABOUT_X),
    ("mirrored along a diagonal", ((0, 1), (1, 0)), _CHANNELS),
    ("mirrored along a diagonal", ((0, -1), (-1, 0)), _CHANNELS),
)
_DIFFERENCE = 0.25
"""Share of their distance by which the displacements of two plates may differ from being opposite."""
_EQUAL = Limit(0.03)
"""RMS difference of two forces over their peak. Both feet in a squat, which load two plates alike, differ by 0.1, since
each pushes outwards."""
_OF_VARIATION = 0.3
"""The same over the variation of the force under load: a person who stands evenly loads two plates alike, and sways
from one to the other."""
_PROPORTIONAL, _SAME_PLACE_M = Limit(0.99), 0.02
_LOADED_N = 5 * LOAD_THRESHOLD_N
_FEWEST = 20
"""Samples under load."""
_USUAL_M = (0.007, 0.051)
_LEAST_M = Limit(0.0, "m", usual=_USUAL_M)
_LOW = 10.0
"""Percentile of a marker's height: it is low for a part of a step only."""


def rotated_plates(context: RecordingContext) -> Iterator[Hypothesis]:
    """Report P242: the one correction of one plate, or of all equally, that puts all loads under the feet; nothing
    where none does, or also one of other plates. Other operations on the same plates that do are among its causes.
    """
    plates, feet = context.plates, context.foot_trajectories
    steps = [contact for contact in context.contacts if contact.is_step]
    if plates is None or feet is None or plates.corners is None or not steps or not context.has_strides:
        return
    read_m = _distances(steps, [step.place for step in steps], feet)
    if read_m.max() < WRONG_M:
        return
    middle = plates.corners.mean(axis=1)[:, [0, 2]]
    used = sorted({step.plate for step in steps})
    offset = np.mean([step.own_offset_m for step in steps], axis=0)
    left_m: dict[tuple[int, ...], FloatArray] = {(): _distances(steps, [step.place - offset for step in steps], feet)}
    for k, (_, matrix, _) in enumerate(_OPERATIONS):
        turned_m = _distances(steps, [_turned(step.place, middle[step.plate], matrix) for step in steps], feet)
        for which in {*((p,) for p in used), tuple(used)}:
            left_m[(k, *which)] = np.where([step.plate in which for step in steps], turned_m, read_m)
    best, *others = sorted(left_m, key=lambda candidate: rms(left_m[candidate]))
    rivals = [candidate for candidate in others if candidate[1:] != best[1:]]
    only = not any(left_m[candidate].max() <= _RIGHT_M for candidate in rivals)
    clearly = only or rms(left_m[best]) < _CLEARLY_BEST * rms(left_m[rivals[0]])
    if not best or left_m[best].max() > _RIGHT_M or not clearly:
        return
    # of a step along the middle of its plate, a half turn is hardly another operation than mirroring along the walk
    alike = [candidate for candidate in others if candidate[1:] == best[1:] and left_m[candidate].max() <= _RIGHT_M]
    wrong = list(best[1:])
    operation, matrix, cause = _OPERATIONS[best[0]]
    if operation == _HALF_TURN and min(push_share(plates, p, context.travel) or 0.0 for p in wrong) > LEAST_PUSH:
        cause = _TILTING
    point = cop_horizontal(plates)
    by = np.zeros_like(point)
    by[:, wrong] = (_turned(point, middle, matrix) - point)[:, wrong]
    found = finding(
        "P242",
        context.at(plate=plates.names[wrong[0]] if len(wrong) == 1 else None),
        causes=(cause, *(f"{name}: {other}" for name, _, other in (_OPERATIONS[candidate[0]] for candidate in alike))),
        mend=Quantity(_MENDING[cause]),
        before_m=Quantity(float(read_m.max()), "m", limit=WRONG_M, usual=WRONG_M.usual),
        after_m=Quantity(float(left_m[best].max()), "m", limit=_RIGHT_M),
        operation=Quantity(operation),
        plates=Quantity(" and ".join(plates.names[p] for p in wrong)),
    )
    yield Hypothesis(found, displaced(plates, by))


def _turned(place: FloatArray, middle: FloatArray, matrix: Sequence[Sequence[int]]) -> FloatArray:
    """Rotate positions (..., 2) m about the middle of their plate."""
    result: FloatArray = middle + (place - middle) @ np.array(matrix).T
    return result


def _distances(steps: Sequence[PlateContact], place: Sequence[FloatArray], feet: Feet) -> FloatArray:
    """Return the distance (m, RMS) of each step from where the load of the nearer foot is expected."""
    errors = []
    for step, centres in zip(steps, place, strict=True):
        off = [np.square(centres - foot.expected_cop(step.time, step.weight)).sum(axis=1) for foot in feet]
        errors.append(min(float(np.sqrt(np.average(square, weights=step.weight))) for square in off))
    return np.array(errors)


def interchanged_plates(context: RecordingContext) -> Iterator[Hypothesis]:
    """Report P241: loads that are under no foot at their own position, but under one at another plate's; those that
    would else be of another person or a thing, too.
    """
    plates, feet, contacts = context.plates, context.foot_trajectories, context.contacts
    if context.stray_contacts and context.recorded_plates is not None and feet is not None:
        every = [*contacts, *context.stray_contacts]
        found = list(_interchanged_pair(context, context.recorded_plates, feet, every))
        if found:
            yield from found
            return
    if plates is None or feet is None:
        return
    if max((contact.distance_m for contact in contacts), default=0.0) > FAR_M:
        yield from _interchanged_pair(context, plates, feet, contacts) or _opposite(context, plates, feet)


def _interchanged_pair(
    context: RecordingContext, plates: PlateLoads, feet: Feet, contacts: Sequence[PlateContact]
) -> list[Hypothesis]:
    """Return the two plates, if any, whose interchange puts all these loads under feet; one of them may be unloaded, if
    the file has its corners."""
    used = sorted({contact.plate for contact in contacts})
    every = used if plates.corners is None else list(range(len(plates.names)))
    pairs = [pair for pair in combinations(every, 2) if not set(pair).isdisjoint(used)]
    if not pairs:
        return []
    before = max(contact.distance_m for contact in contacts)
    middle = _middles(plates, every)
    tried = []
    for pair in pairs:
        by = np.zeros((len(plates.names), 2))
        by[pair[0]], by[pair[1]] = middle[pair[1]] - middle[pair[0]], middle[pair[0]] - middle[pair[1]]
        moved = displaced(plates, by)
        tried.append((max(contact.distance_m for contact in contacts_of(moved, feet)), pair, moved))
    after, pair, moved = min(tried, key=lambda candidate: candidate[0])
    return [] if after > min(FAR_M / 2, before) else [_interchanged(context, pair, moved, before, after)]


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
    steps = [contact for contact in context.contacts if contact.is_step]
    used = sorted({step.plate for step in steps})
    if len(used) != 2:
        return
    offsets: dict[int, list[FloatArray]] = {p: [] for p in used}
    for step in steps:
        from_feet = [step.place - foot.expected_cop(step.time, step.weight) for foot in feet]
        mean = [np.average(offset, axis=0, weights=step.weight) for offset in from_feet]
        # the swinging foot moves away
        foot = int(
            np.argmin([np.square(offset - m).sum(axis=1).mean() for offset, m in zip(from_feet, mean, strict=True)])
        )
        offsets[step.plate].append(mean[foot])
    first, second = (np.mean(offsets[p], axis=0) for p in used)
    half = (first - second) / 2
    size = float(np.linalg.norm(half))
    residual = max(
        float(np.linalg.norm(offset - sign * half))
        for p, sign in zip(used, (1, -1), strict=True)
        for offset in offsets[p]
    )
    if size < FAR_M or residual > min(FAR_M / 2, _DIFFERENCE * size):
        return
    by = np.zeros((len(plates.names), 2))
    by[used[0]], by[used[1]] = -half, half
    yield _interchanged(context, used, displaced(plates, by), size, residual)


@check("P287", equal=_EQUAL, proportional=_PROPORTIONAL)
def repeated_plates(context: RecordingContext) -> Iterator[Finding]:
    """Report P287: the load of a plate is another plate's, or two others' together."""
    plates = context.recording.plates
    if plates is None:
        return
    used = [p for p in range(len(plates.names)) if (plates.force[:, p, 1] > _LOADED_N).sum() >= _FEWEST]
    repeated: dict[int, tuple[tuple[int, ...], float]] = {}
    for p in used:
        others = [other for other in used if other != p and p not in repeated.get(other, ((),))[0]]
        single = [(other,) for other in others if other < p and other not in repeated]
        for parts in (*single, *combinations([plate for plate in others if plate not in repeated], 2)):
            difference = _difference(plates, p, parts)
            if difference < _EQUAL or _at_the_same_place(plates, p, parts):
                repeated[p] = parts, difference
                break
    unrepeated = ", ".join(f'"{plates.names[p]}"' for p in used if p not in repeated)
    for p, (parts, difference) in repeated.items():
        yield finding(
            "P287",
            context.at(plate=plates.names[p]),
            difference=Quantity(difference, "1", limit=_EQUAL),
            others=Quantity(" and ".join(plates.names[part] for part in parts)),
            names=Quantity(unrepeated),
        )


def _difference(plates: PlateLoads, p: int, parts: tuple[int, ...]) -> float:
    """Return the RMS difference of a plate's force from the sum of others', over its peak; infinite where one of them
    is unloaded while the plate is loaded, or where the forces vary differently.
    """
    force, total = plates.force[:, p], plates.force[:, list(parts)].sum(axis=1)
    loaded = (force[:, 1] > _LOADED_N) | (total[:, 1] > _LOADED_N)
    if any((plates.force[loaded, part, 1] > _LOADED_N).sum() < _FEWEST for part in parts):
        return np.inf
    off, varying = force[loaded] - total[loaded], force[loaded] - force[loaded].mean(axis=0)
    rms, variation = (float(np.sqrt(np.square(offset).sum(axis=1).mean())) for offset in (off, varying))
    return rms / float(force[:, 1].max()) if rms < _OF_VARIATION * variation else np.inf


def _at_the_same_place(plates: PlateLoads, p: int, parts: tuple[int, ...]) -> bool:
    """Decide whether a plate is at the place of one other, and its load is proportional to that one's."""
    if len(parts) != 1 or plates.corners is None:
        return False
    (other,) = parts
    first, second = (plates.force[:, plate, 1] for plate in (p, other))
    loaded = (first > _LOADED_N) | (second > _LOADED_N)
    middles: FloatArray = plates.corners[[p, other]].mean(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = np.corrcoef(first[loaded], second[loaded])[0, 1] > _PROPORTIONAL
    return bool(alike and np.linalg.norm(middles[0] - middles[1]) < _SAME_PLACE_M)


@check("P249", unless=("M143",), height=_LEAST_M)
def plate_heights(context: PersonContext) -> Iterator[Finding]:
    """Report P249: plates, or centres of pressure in a file, above the lowest markers of all feet on them."""
    for trial in context.trials:
        for plate, (height_m, surface_m) in heights_on_plates(trial).items():
            if height_m - surface_m < _LEAST_M:
                yield finding(
                    "P249",
                    trial.at(plate=plate),
                    depth_m=Quantity(surface_m - height_m, "m", limit=-_LEAST_M, usual=(-_USUAL_M[1], -_USUAL_M[0])),
                    surface_m=Quantity(surface_m, "m"),
                )


def heights_on_plates(trial: RecordingContext) -> dict[str, tuple[float, float]]:
    """Return height (m) of the lowest marker of the feet on each loaded plate, in the step in which it is highest, and
    of the plate's surface; NaN where that is unknown."""
    plates = trial.recorded_plates
    lowest: dict[int, float] = {}
    for contact in () if plates is None else trial.contacts:
        height_m = _lowest_m(trial, contact)
        if height_m is not None:
            lowest[contact.plate] = max(height_m, lowest.get(contact.plate, -np.inf))
    return (
        {} if plates is None else {plates.names[p]: (lowest_m, _surface_m(plates, p)) for p, lowest_m in lowest.items()}
    )


def _surface_m(plates: PlateLoads, plate: int) -> float:
    """Return the height (m) of a plate by its corners or else by its centres of pressure; NaN where it is unknown."""
    if plates.corners is not None:
        return float(plates.corners[plate, :, 1].mean())
    return np.nan if plates.torques is None else plates.torques[plate].height_m


def _lowest_m(trial: RecordingContext, contact: PlateContact) -> float | None:
    """Return the height (m) of the lowest marker of the foot that loads the plate; None where none is visible."""
    if trial.feet is None:
        return None
    markers = trial.all_markers.cut(float(contact.time[0]), float(contact.time[-1]))
    heights = markers.select(trial.feet["rl"[contact.foot]]).positions[..., 1]
    shown = heights[:, np.isfinite(heights).any(axis=0)]
    return float(np.nanpercentile(shown, _LOW, axis=0).min()) if shown.size else None
