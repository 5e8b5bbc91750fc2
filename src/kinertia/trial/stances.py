"""Finds each leg's heel strikes and toe offs, and in which part of stances and strides its loads are known."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np

from kinertia.findings.quantity import Limit
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, BoolArray, FootLoads, Trial
from kinertia.trial.file_contents import SAME_EVENT_S, FileEvent, GaitEvent, nearest_event
from kinertia.trial.ground_contact import BRIDGED_GAP_S, CONTACT_SLACK_S, bridged
from kinertia.trial.plate_assignment import FOOT_NAMES, SHORTEST_CONTACT_S
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, nearest_samples, runs, span_s, within

LOADING_END, MID_STANCE_END = Limit(0.15), Limit(0.65)
_LOADED, _PASSED = round(100 * LOADING_END), round(100 * MID_STANCE_END)
STANCE_PHASES = {"loading response": (0, _LOADED), "mid-stance": (_LOADED, _PASSED), "push-off": (_PASSED, 100)}
"""Parts of stance, in percent of the time from foot contact to foot off."""
_PERCENT = np.arange(101)
_SAMPLING = 3
"""Percent of a stance that a frame or two take: gaps as short are none."""
OF_PHASE, _OF_STANCE = Limit(0.9), 0.1
"""A phase is known if so much of it is; a stance has moments at all if so much of it has."""
_STANCE_S, _STRIDE_S = (0.1, 3.0), (0.4, 3.0)
_SAME_CONTACT_S = 2 * CONTACT_SLACK_S
EVENT_LIMIT_S = 0.03
"""Largest accepted difference: events of 14 recordings, set by Vicon or by hand, are within 17 ms of the forces."""
_PLAINLY = 2
"""Ratio of counts required: where a foot leaves the plates but not the ground, a load may end with a step of the other
foot."""
_SAME_STEP_EVENT_S = 0.1
"""Largest difference between an event and the motion or the load of the foot that makes it."""
_OTHER = dict(zip(FEET, reversed(FEET), strict=True))


@dataclass(frozen=True)
class Stance:
    """One contact of a foot with the ground, on a plate or not; times in s.

    Attributes:
        side: "r" or "l".
        number: counted from 1, per trial and side.
        start_s, end_s: foot contact and foot off; the one that the record lacks is a usual stance away from the other.
        whole: whether the record has both.
    """

    side: str
    number: int
    start_s: float
    end_s: float
    whole: bool


def stances_of(trial: Trial) -> tuple[Stance, ...]:
    """Return the stances of the right, then the left foot; none where it is unknown when the feet are on the ground.

    Foot contact and foot off are those of the plates where a load begins or ends with the contact. A contact at the
    beginning or end of the record takes as long as the others do. Those shorter than 0.1 s or longer than 3 s are no
    stances.
    """
    if trial.on_ground is None:
        return ()
    last = len(trial.markers.time) - 1
    found: list[tuple[int, float, float, bool, bool]] = []
    for foot in range(len(FEET)):
        for a, b in runs(trial.on_ground[:, foot]):
            found.append((foot, *_by_plates(trial, foot, a, b), a > 0, b < last))
    whole = [end - start for _, start, end, begins, ends in found if begins and ends]
    whole = [span for span in whole if _STANCE_S[0] <= span <= _STANCE_S[1]]
    usual = float(np.median(whole)) if whole else np.nan
    result: list[Stance] = []
    for foot, side in enumerate(FEET):
        number = 0
        for start, end, begins, ends in (span[1:] for span in found if span[0] == foot):
            if begins and ends and not _STANCE_S[0] <= end - start <= _STANCE_S[1]:
                continue
            if not (begins or ends) or not ((begins and ends) or end - start <= _STANCE_S[1]) or not whole:
                continue
            number += 1
            first = start if begins else min(start, end - usual)
            final = end if ends else max(end, start + usual)
            result.append(Stance(side, number, first, final, begins and ends))
    return tuple(result)


def _by_plates(trial: Trial, foot: int, first: int, last: int) -> tuple[float, float]:
    """Return the times (s) of foot contact and foot off: of the load, if these frames differ from it by little."""
    start, end = (float(trial.markers.time[k]) for k in (first, last))
    near = within(trial.loads.time, start - _SAME_CONTACT_S, end + _SAME_CONTACT_S)
    time = trial.loads.time[near]
    loaded = time[trial.loads.force[near, foot, 1] >= LOAD_THRESHOLD_N]
    if len(loaded):
        start = float(loaded[0]) if time[0] < loaded[0] <= start + _SAME_CONTACT_S else start
        end = float(loaded[-1]) if end - _SAME_CONTACT_S <= loaded[-1] < time[-1] else end
    return start, end


@dataclass(frozen=True, eq=False)
class LegCoverage:
    """Part of stance and stride in which the loads of one leg are known, in any of its stances and strides.

    Attributes:
        side: "r" or "l".
        stance: (101,) from foot contact (0 %) to foot off (100 %).
        stride: (101,) from foot contact to the next one of the same foot; None where no stride is seen.
    """

    side: str
    stance: BoolArray
    stride: BoolArray | None

    @property
    def word(self) -> str:
        """The side in words: "right" or "left"."""
        return FOOT_NAMES[FEET.index(self.side)]

    @property
    def none(self) -> bool:
        """Whether hardly anything of stance is known."""
        return bool(self.stance.mean() < _OF_STANCE)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the phases of stance that are not known."""
        return tuple(
            name for name, (start, end) in STANCE_PHASES.items() if self.stance[start : end + 1].mean() < OF_PHASE
        )

    @property
    def ranges(self) -> str:
        """What is known of the stride, or of stance without one: "0 to 48 % of the stride"."""
        return _ranges(self.stance, "stance") if self.stride is None else _ranges(self.stride, "the stride")

    @property
    def sentence(self) -> str:
        """Describe the leg: "left: 0 to 48 % of the stride, no push-off"."""
        if self.none:
            return f"{self.word}: none in stance"
        if not self.missing:
            return f"{self.word}: whole {'stride' if self.stride is not None and self.stride.all() else 'stance'}"
        return f"{self.word}: {self.ranges}, no {listed(self.missing, 'or')}"

    def joined(self, other: Self) -> Self:
        """Return what is known in either."""
        strides = [share for share in (self.stride, other.stride) if share is not None]
        stride = np.logical_or.reduce(strides) if strides else None
        return type(self)(self.side, self.stance | other.stance, stride)

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON content: percentages, and the phases of stance that are missing."""
        stride = None if self.stride is None else _parts(self.stride)
        return {"stride_percent": stride, "stance_percent": _parts(self.stance), "missing": list(self.missing)}


def leg_coverage(trial: Trial, known: BoolArray) -> tuple[LegCoverage, ...]:
    """Return the coverage of the right and the left leg; of none if the trial shows no stances.

    Args:
        trial: with the frames in which each foot is on the ground.
        known: (n, 2) marker frames in which the loads of the right, left leg are known.
    """
    stances, time = stances_of(trial), trial.markers.time
    if not stances:
        return ()
    result = []
    for foot, side in enumerate(FEET):
        of_side = [stance_of_foot for stance_of_foot in stances if stance_of_foot.side == side]
        starts = [stance_of_foot.start_s for stance_of_foot in of_side]
        strides = [(a, b) for a, b in pairwise(starts) if _STRIDE_S[0] <= b - a <= _STRIDE_S[1]]
        stance = _union(
            time, known[:, foot], [(stance_of_foot.start_s, stance_of_foot.end_s) for stance_of_foot in of_side]
        )
        result.append(LegCoverage(side, stance, _union(time, known[:, foot], strides) if strides else None))
    return tuple(result)


def joined_coverage(trials: Iterable[Sequence[LegCoverage]]) -> tuple[LegCoverage, ...]:
    """Return what is known of each leg in any of several trials."""
    result: dict[str, LegCoverage] = {}
    for coverage in (leg for legs in trials for leg in legs):
        result[coverage.side] = result[coverage.side].joined(coverage) if coverage.side in result else coverage
    return tuple(result.values())


def listed(names: Sequence[str], last: str = "and") -> str:
    """Join names: "loading response, mid-stance and push-off"."""
    return f" {last} ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _union(time: np.ndarray, known: BoolArray, spans: Sequence[tuple[float, float]]) -> BoolArray:
    """Return the percentages (101,) of the spans (s) that are known in any of them, short gaps closed."""
    result = np.zeros(len(_PERCENT), dtype=bool)
    for start, end in spans:
        at = start + _PERCENT / 100.0 * (end - start)
        inside = (at >= time[0] - TIME_TOLERANCE_S) & (at <= time[-1] + TIME_TOLERANCE_S)
        result |= known[nearest_samples(time, at)] & inside
    for first, last in runs(~result):
        if last - first < _SAMPLING and result.any():
            result[first : last + 1] = True
    return result


def _parts(mask: BoolArray) -> list[list[int]]:
    return [[int(first), int(last)] for first, last in runs(mask)]


def _ranges(mask: BoolArray, whole: str) -> str:
    return f"{' and '.join(f'{first} to {last} %' for first, last in _parts(mask)) or 'nothing'} of {whole}"


def gait_events(trial: Trial) -> list[GaitEvent]:
    """Return all events between measured frames, in order of time.

    Elsewhere a load may begin or end at the edge of a plate.
    """
    frames, edges = trial.markers.time, load_edges(trial.loads)
    near = [np.abs(frames - event.time_s) <= BRIDGED_GAP_S + TIME_TOLERANCE_S for event in edges]
    return [event for event, around in zip(edges, near, strict=True) if around.any() and trial.measured[around].all()]


def load_edges(loads: FootLoads) -> list[GaitEvent]:
    """Return when the load under each foot begins and ends, in order: at foot contact, or at the edge of a plate."""
    edges = []
    for foot, side in enumerate(FEET):
        loaded = bridged(loads.time, loads.force[:, foot, 1] > LOAD_THRESHOLD_N)
        for first, last in runs(loaded):
            if span_s(loads.time, first, last) < SHORTEST_CONTACT_S:
                continue
            if first > 0:
                edges.append(GaitEvent(float(loads.time[first]), side, "heel strike"))
            if last < len(loads.time) - 1:
                edges.append(GaitEvent(float(loads.time[last]), side, "toe off"))
    return sorted(edges)


def contradicted_events(trial: Trial) -> list[tuple[FileEvent, GaitEvent]]:
    """Return the stated events that are more than `EVENT_LIMIT_S` from the detected ones, in pairs."""
    shown = gait_events(trial)
    pairs = [
        (event, nearest_event(shown, event.of_gait, SAME_EVENT_S))
        for event in trial.events
        if event.of_gait is not None
    ]
    return [
        (event, near) for event, near in pairs if near is not None and abs(event.time_s - near.time_s) > EVENT_LIMIT_S
    ]


def sides_exchanged(trial: Trial) -> bool:
    """Decide whether the events coincide with the loads of the other foot, and hardly any with their own."""
    edges, stated = load_edges(trial.loads), _stated(trial)
    return _agreeing(_exchanged(stated), edges) > _PLAINLY * _agreeing(stated, edges)


def counted_from_first_frame(trial: Trial) -> bool:
    """Decide whether more events coincide with loads if their times count from the first frame: two at least, and more
    than with the other foot's.
    """
    edges, stated = load_edges(trial.loads), _stated(trial)
    first_s = float(trial.markers.time[0])
    later = _agreeing([event._replace(time_s=event.time_s + first_s) for event in stated], edges)
    return later > max(1, _agreeing(stated, edges), _agreeing(_exchanged(stated), edges))


def events_of_other_foot(events: Iterable[FileEvent], shown: Sequence[GaitEvent]) -> list[FileEvent]:
    """Return the stated events that match the other foot at their times, but not their own foot."""
    wrong = []
    for event in events:
        if (stated := event.of_gait) is None:
            continue
        other = nearest_event(shown, stated._replace(side=_OTHER[stated.side]), _SAME_STEP_EVENT_S)
        if other is not None and nearest_event(shown, stated, SAME_EVENT_S) is None:
            wrong.append(event)
    return wrong


def usable_events(trial: Trial, by_motion: Sequence[GaitEvent]) -> list[GaitEvent]:
    """Return all gait events that the file states, or none if forces or the motion of the feet contradict one."""
    if contradicted_events(trial) or sides_exchanged(trial) or counted_from_first_frame(trial):
        return []
    if events_of_other_foot(trial.events, [*gait_events(trial), *by_motion]):
        return []
    return _stated(trial)


def _stated(trial: Trial) -> list[GaitEvent]:
    return [event.of_gait for event in trial.events if event.of_gait is not None]


def _exchanged(events: Sequence[GaitEvent]) -> list[GaitEvent]:
    return [event._replace(side=_OTHER[event.side]) for event in events]


def _agreeing(events: Sequence[GaitEvent], edges: Sequence[GaitEvent]) -> int:
    return sum(nearest_event(edges, event, EVENT_LIMIT_S) is not None for event in events)
