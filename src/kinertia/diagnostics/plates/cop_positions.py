"""Are loads under the feet, on their plates, and in time? The explanations of those that are not compete.

On fault-free trials, measured in six laboratories and made by OpenSim, loads act within 40 mm of the line from heel to
toe (median over the load), and right and left loads are equally far outside that line, within 8 mm (26 mm with one
plate displaced by 20 mm).

In people who land on the toes, sway or hold a foot in the air, markers of the feet are slow, or fast, at other times
than plates are loaded. But a landing changes the body's velocity by metres a second, which shows a delay.

From the first third of a step to the last the centre of pressure moves forwards on the foot by 0.06 to 0.82 of the
distance from heel to forefoot in the walks and runs of 14 people, most of them children (in a drop jump by 16 to 20
mm), and by -0.37 or less on a plate that is mirrored along the walk. People who land on the toes also push off from
them, and a load that both feet bear moves from foot to foot: neither counts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.ambiguous_loads import FOOT_ENDS, off_plate
from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.diagnostics.evidence.plate_contacts import (
    FAR_M,
    Hypothesis,
    PlateContact,
    displaced,
)
from kinertia.diagnostics.plates.contact_delays import (
    BOTH_ENDS_S,
    DELAY_S,
    LEAST_RATE_ERROR,
    LONGEST_DELAY_S,
    RATE_ERROR_OF_FEW,
    RATES,
    contact_delays,
    fitted_rate_or_delay,
    forces_keep_time,
    stance_durations,
)
from kinertia.diagnostics.plates.plate_positions import WRONG_M, interchanged_plates, rotated_plates
from kinertia.diagnostics.plates.steps import (
    BACK_M,
    FORWARD_M,
    OF_HEIGHT,
    USUAL_ALONG_M,
    ahead_of_usual_m,
    goes_forwards,
    heel_steps,
    one_foot_loads,
    shows_feet_equally,
    steps_alone,
)
from kinertia.diagnostics.runner import NEEDS_LOADS_UNDER_FEET, check
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity
from kinertia.findings.rule import rule
from kinertia.trial.data import FloatArray

_OTHER_UNIT_M = Limit(5.0, "m")
_OFFSET_M = Limit(0.03, "m", usual=(-0.008, 0.008))
_BESIDE_M = Limit(0.035, "m", usual=(0.0, 0.022))
"""Distance of one foot's load from the line between heel and second metatarsal; other feet's lines are up to 50 mm from
their loads. Of 25 feet of 11 people that have markers there alone, it is 1 to 22 mm."""
_USUAL_BEGIN_M, _USUAL_END_M = (0.035, 0.1), (-0.06, 0.025)
_BEGIN_M, _END_M = Limit(-0.015, "m", usual=_USUAL_BEGIN_M), Limit(0.06, "m", usual=_USUAL_END_M)
"""There is no foot behind the marker at the back of the heel: on fault-free trials, from squats to forefoot runs, the
first twentieth of a load is 36 to 99 mm in front of it. The last one is at most 25 mm in front of the foremost marker,
which may be on the metatarsals."""
_BOTH_BACK_M, _BOTH_FORWARD_M = (0.02, -0.07), (0.13, 0.035)
"""Where the first twentieth of steps and their last one are both, on average, farther back, or farther forward, landing
or pushing off cannot be the reason. On nine fault-free trials they are 36 to 85 mm and -58 to 25 mm."""
_EACH_SHARE = 0.5
"""Displaced plates move the centre of pressure by as much at the beginning as at push-off: each must exceed this
share of the limit. On a fault-free synthetic person, who lands behind the heel, the mean is -35 mm, but that at
push-off only -12 mm."""
_FIXED_M = Limit(0.002, "m")
_USUAL = (0.06, 0.82)
_BACKWARDS, _FORWARDS = Limit(-0.35, usual=_USUAL), Limit(0.25)
"""Shares of the distance from heel to forefoot."""
OFF_PLATE_SHARE = Limit(0.05)
"""Share of the load with its centre of pressure off the plate that is reported; half of it is wrong."""
_MOST_SHARE = Limit(0.5)


@check(
    "P204",
    "P241",
    "P242",
    "P243",
    "P244",
    "T201",
    "T211",
    "T212",
    unless=("P201", "P202", "P203", "P107"),
    beyond=_OTHER_UNIT_M,
    far=FAR_M,
    offset=_OFFSET_M,
    beside=_BESIDE_M,
    begin=_BEGIN_M,
    end=_END_M,
    back=BACK_M,
    forward=FORWARD_M,
    wrong=WRONG_M,
    least_ratio=RATES[0],
    most_ratio=RATES[1],
    growth=LEAST_RATE_ERROR,
    of_few=RATE_ERROR_OF_FEW,
    delay=DELAY_S,
    ends=BOTH_ENDS_S,
    longest=LONGEST_DELAY_S,
)
def loads_and_feet(context: RecordingContext) -> Iterator[Finding]:
    """Report P204, P24, T20, T21 and P243: the explanation that leaves loads nearest to the feet and to their times,
    with the others among its causes; of equally good ones the first tested. Where loads fit: P243 of small offsets.
    """
    if context.is_static or context.foot_trajectories is None or not context.contacts:
        return
    if unit := list(_other_unit(context)):
        yield from unit
        return
    if not context.shows_whole_feet:
        return
    feet = context.foot_trajectories
    timely = not context.has_strides and forces_keep_time(context)
    hypotheses = list(
        chain(
            () if timely else fitted_rate_or_delay(context),
            () if timely else stance_durations(context),
            interchanged_plates(context),
            () if timely else contact_delays(context),
            rotated_plates(context),
            _displaced(context),
        )
    )
    if hypotheses:
        ranked = sorted(hypotheses, key=lambda hypothesis: hypothesis.misfit(feet))
        yield _with_runners_up([hypothesis.finding for hypothesis in ranked])
        return
    if goes_forwards(context) and shows_feet_equally(context):
        yield from _offset(context)


def _with_runners_up(ranked: Sequence[Finding]) -> Finding:
    best = ranked[0]
    others = {
        hypothesis.code: f"{hypothesis.code} {hypothesis.message}"
        for hypothesis in ranked[1:]
        if hypothesis.code != best.code
    }
    return replace(best, causes=(*(best.causes or rule(best.code).causes), *others.values())) if others else best


def _other_unit(context: RecordingContext) -> Iterator[Finding]:
    """Report P204: plates whose loads are all outside the laboratory: one plate, where each has columns of its own."""
    plates = context.plates
    assert plates is not None
    nearest: dict[int, float] = {}
    for contact in context.contacts:
        nearest[contact.plate] = min(contact.distance_m, nearest.get(contact.plate, np.inf))
    far = {p: distance for p, distance in nearest.items() if distance >= _OTHER_UNIT_M}
    for p, distance in far.items():
        yield finding(
            "P204",
            context.at(plate=plates.names[p]),
            distance_m=Quantity(distance, "m", limit=_OTHER_UNIT_M),
            plates=Quantity(plates.names[p]),
        )


def _displaced(context: RecordingContext) -> Iterator[Hypothesis]:
    """Yield hypotheses for loads that are under no foot: all displaced equally (P243), or not (P244)."""
    plates = context.plates
    assert plates is not None
    # a load of both feet is under neither (P276)
    loads = [contact for contact in context.contacts if not contact.between]
    far = [load for load in loads if load.distance_m > FAR_M]
    if not far or len(far) < len(loads) / 2:
        return
    offsets = np.array([load.own_offset_m for load in loads])
    mean = offsets.mean(axis=0)
    if np.abs(offsets - mean).max() < FAR_M / 2:
        offset = Quantity((float(mean[0]), float(mean[1])), "m", limit=FAR_M)
        found = _origin(context, offset, len(loads), "all loads")
        yield Hypothesis(found.at(Severity.ERROR), displaced(plates, -mean))
        return
    worst = far[0]
    found = finding(
        "P244",
        context.at(plate=plates.names[worst.plate], span_s=(float(worst.time[0]), float(worst.time[-1]))),
        distance_m=Quantity(worst.distance_m, "m", limit=FAR_M, usual=(0.0, 0.04)),
    )
    yield Hypothesis(found, None)


def _offset(context: RecordingContext) -> Iterator[Finding]:
    """Report P243: the loads of both feet are displaced in the same direction of the laboratory; or, where one foot is
    measured, its loads lie beside its axis; or all loads are displaced along the feet.
    """
    contacts = one_foot_loads(context)
    means = [[_foot_offset_m(contact) for contact in contacts if contact.foot == foot] for foot in range(2)]
    if all(means):
        mean = (np.mean(means[0], axis=0) + np.mean(means[1], axis=0)) / 2
        if np.linalg.norm(mean) > _OFFSET_M:
            offset = Quantity((float(mean[0]), float(mean[1])), "m", limit=_OFFSET_M, usual=_OFFSET_M.usual)
            method = "loads of both feet displaced from the line between heel and toe"
            yield _origin(context, offset, len(contacts), method)
            return
    steps = heel_steps(context)
    beside = None if all(means) else _beside(context, steps)
    if beside is not None:
        offset = Quantity((float(beside[0]), float(beside[1])), "m", limit=_BESIDE_M, usual=_BESIDE_M.usual)
        yield _origin(context, offset, len(steps), "loads of one foot beside the line from heel to second metatarsal")
        return
    ends = next(_ends(context, steps), None) if steps and all(means) else None
    if ends is not None:
        yield ends
    else:
        yield from _along_feet(context, steps)


def _beside(context: RecordingContext, steps: Sequence[PlateContact]) -> FloatArray | None:
    """Return the mean offset (2,) m of one foot's steps if it is too large; None of feet with other markers, too."""
    labels = [context.seen_labels.intersection(context.feet["rl"[step.foot]]) for step in steps if context.feet]
    if not labels or context.shared_loads or any(len(of_foot) != len(FOOT_ENDS) for of_foot in labels):
        return None
    mean: FloatArray = np.mean([step.own_offset_m for step in steps], axis=0)
    return mean if np.linalg.norm(mean) > _BESIDE_M else None


def _foot_offset_m(contact: PlateContact) -> FloatArray:
    """Return the mean offset (2,) m of a load from its foot; of one that lands on the forefoot with the toes, which
    bear part of it for longer."""
    if not contact.trajectory.lands_on_forefoot(contact.start_s, contact.end_s):
        return contact.own_offset_m
    offset_m = contact.trajectory.with_toes().offset_m(contact.time, contact.place)
    return np.average(offset_m, axis=0, weights=contact.weight)


def _ends(context: RecordingContext, contacts: Sequence[PlateContact]) -> Iterator[Finding]:
    """Report P243: loads that begin behind the heel or end in front of the toes, as happens first with an offset along
    the foot."""
    # both of two contacts, so that a second foot on one plate does not count
    ends = np.sort([contact.ends_m for contact in contacts], axis=0)
    begin, end = float(ends[len(ends) // 2, 0]), float(ends[(len(ends) - 1) // 2, 1])
    steps = [contact.ends_m for contact in contacts if np.isfinite(contact.end_s - contact.start_s)]
    excess = 0.0
    if begin < _BEGIN_M:
        excess = begin - _USUAL_BEGIN_M[0]
    elif end > _END_M:
        excess = end - _USUAL_END_M[1]
    elif steps:
        begin, end = (float(mean_end) for mean_end in np.mean(steps, axis=0))
        excess = _excess_of_both(begin, end)
    if excess:
        yield _origin(
            context,
            Quantity(excess, "m"),
            len(contacts),
            "where loads begin and end on the feet",
            begin_m=Quantity(begin, "m", usual=_USUAL_BEGIN_M),
            end_m=Quantity(end, "m", usual=_USUAL_END_M),
        )


def _along_feet(context: RecordingContext, steps: Sequence[PlateContact]) -> Iterator[Finding]:
    """Report P243: steps wholly on plates whose centre of pressure is farther back, or forward, than feet are long."""
    alone = steps_alone(context, steps)
    if context.height_m is None or not alone:
        return
    offsets = np.mean([ahead_of_usual_m(step, context.height_m) for step in alone], axis=0)
    excess = float(offsets.mean())
    limit = BACK_M if excess < 0 else FORWARD_M
    if abs(excess) <= abs(limit) or (offsets / limit).min() < _EACH_SHARE:
        return
    begin, late = offsets + context.height_m * OF_HEIGHT
    yield _origin(
        context,
        Quantity(excess, "m", limit=limit, usual=USUAL_ALONG_M),
        len(alone),
        "where loads act on feet of this person's length",
        begin_m=Quantity(float(begin), "m"),
        push_off_m=Quantity(float(late), "m"),
    )


def _excess_of_both(begin_m: float, end_m: float) -> float:
    """Return by how much (m) steps both begin and end too far back (negative), or forward; 0 where they do not."""
    if begin_m < _BOTH_BACK_M[0] and end_m < _BOTH_BACK_M[1]:
        return max(begin_m - _USUAL_BEGIN_M[0], end_m - _USUAL_END_M[0])
    if begin_m > _BOTH_FORWARD_M[0] and end_m > _BOTH_FORWARD_M[1]:
        return min(begin_m - _USUAL_BEGIN_M[1], end_m - _USUAL_END_M[1])
    return 0.0


def _origin(context: RecordingContext, offset: Quantity, contacts: int, method: str, **measured: Quantity) -> Finding:
    how = {"contacts": Quantity(contacts, "1"), "method": Quantity(method)}
    return with_evidence("P243", context.at(), {"offset_m": offset, **measured, **how})


@check("P251", "P252", unless=NEEDS_LOADS_UNDER_FEET, fixed=_FIXED_M, backwards=_BACKWARDS, forwards=_FORWARDS)
def cop_progression(context: RecordingContext) -> Iterator[Finding]:
    """Report P251 and P252: plates whose centre of pressure never moves during a step (P251), or moves from toe to heel
    while on another plate it moves from heel to toe (P252).
    """
    plates, feet = context.plates, context.foot_trajectories
    if plates is None or feet is None or context.is_static:
        return
    steps = [step for step in heel_steps(context) if step.is_step]
    progression: dict[int, float] = {}
    for p in sorted({step.plate for step in steps}):
        of_plate = [step for step in steps if step.plate == p]
        range_m = max(float(np.ptp(step.place, axis=0).max()) for step in of_plate)
        if range_m < _FIXED_M:
            yield finding("P251", context.at(plate=plates.names[p]), range_m=Quantity(range_m, "m", limit=_FIXED_M))
        progression[p] = float(np.median([_progression_m(step, feet[step.foot]) for step in of_plate]))
    length_m = float(np.mean([foot.length_m for foot in feet]))
    if all(progressed_m <= _FORWARDS * length_m for progressed_m in progression.values()):
        return
    usual = (_USUAL[0] * length_m, _USUAL[1] * length_m)
    for p, progressed_m in progression.items():
        if progressed_m < _BACKWARDS * length_m:
            measured = Quantity(progressed_m, "m", limit=_BACKWARDS * length_m, usual=usual)
            yield finding("P252", context.at(plate=plates.names[p]), progression_m=measured)


def _progression_m(contact: PlateContact, foot: FootTrajectory) -> float:
    """Return how much farther forwards (m) on its foot a load is in its last third than in its first."""
    ahead = foot.beyond(contact.time, contact.place)[0]
    third = max(len(ahead) // 3, 1)
    return float(np.median(ahead[-third:]) - np.median(ahead[:third]))


@check("P245", unless=("P204",), off_plate=OFF_PLATE_SHARE, most=_MOST_SHARE)
def cop_on_plate(context: RecordingContext) -> Iterator[Finding]:
    """Report P245: loads that act outside the corners of their plate."""
    if context.plates is None:
        return
    for p, name in enumerate(context.plates.names):
        off = off_plate(context.plates, p)
        if off is not None and off[0] > OFF_PLATE_SHARE:
            severity = Severity.ERROR if off[0] > _MOST_SHARE else None
            share = Quantity(off[0], "1", limit=OFF_PLATE_SHARE)
            yield finding("P245", context.at(plate=name), severity, share=share, distance_m=Quantity(off[1], "m"))
