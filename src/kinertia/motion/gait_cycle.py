"""Finds strides of a trial, from heel strike to the next of the same foot, and phases of contact that are no stride.

Plates measure few of the contacts that strides consist of. So heel strikes and toe offs are first detected from the
motion: a foot lands about when its heel is farthest in front of the pelvis, and leaves about when its toes are farthest
behind it (Zeni et al. 2008, Gait Posture 27:710). The mean error of these times is derived from the contacts that
plates measured in the same trial. If a load begins or ends at such a time, its time is used, else that of an event
stated in the file, unless the forces contradict one of these.

A stance lasts from foot contact to foot off, a landing from the contact that ends a fall until the pelvis is lowest.
They are `Stride`s of another `phase`, so that curves and peaks are read from them alike.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import LONGEST_BRIDGE_S, Kinematics
from kinertia.motion.workload import pieces
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, Trial
from kinertia.trial.file_contents import GaitEvent, nearest_event
from kinertia.trial.ground_contact import CONTACT_SLACK_S, bridged
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, gaussian_mean, runs, within
from kinertia.trial.stances import gait_events, load_edges, stances_of, usable_events

PERCENT = np.arange(101.0)
"""Percentages of the gait cycle at which curves are given."""
_LEAST_SWING_M = 0.1
"""Least movement of a foot back and forth under the pelvis in gait."""
_SAME_EVENT_S = 0.1
"""Largest difference between plates and motion for one event."""
_SAME_STEP_S = 0.3
"""Events of one foot and kind that are farther apart belong to different steps."""
_STRIDE_S = (0.4, 3.0)
_PHASE = (0.15, 0.85)
"""Part of a stride in which the other foot lands: not so in squats and jumps, where both feet move together."""
_HEADING_S = 0.25
Phase = Literal["stride", "stance", "landing"]
_SAME_BEGINNING_S = 0.1
"""Largest difference between the beginnings of a stance and of the stride that it is part of."""
_LONGEST_LANDING_S, _SHORTEST_LANDING_S = 1.0, 0.03
_FALLING_M_S = 0.5
"""Least speed of a fall; in walking the pelvis moves up and down with at most 0.3 m/s."""
_MOSTLY = 0.5
"""A phase is on plates if the foot is loaded in so much of it."""


@dataclass(frozen=True)
class Stride:
    """One stride of one foot; times in s.

    Attributes:
        side: "r" or "l".
        number: counted from 1, per trial and side.
        start_s, end_s: heel strikes.
        toe_off_s: between them; NaN if it was not found.
        opposite_toe_off_s, opposite_strike_s: of the other foot, between them; the first may be NaN.
        on_plates: whether plates measured both heel strikes; else at least one comes from the motion.
        phase: "stride"; or "stance", "landing" for what is no stride (`contact_phases`), which ends at `toe_off_s`.

    Examples:
        >>> stride = fit.strides[0]
        >>> bool(stride.start_s < stride.toe_off_s < stride.end_s)
        True
    """

    side: str
    number: int
    start_s: float
    end_s: float
    toe_off_s: float
    opposite_toe_off_s: float
    opposite_strike_s: float
    on_plates: bool
    phase: Phase = "stride"

    @property
    def time(self) -> np.ndarray:
        """Times (101,) s at 0, 1, ..., 100 % of the cycle."""
        return self.start_s + PERCENT / 100.0 * (self.end_s - self.start_s)

    def percent(self, time_s: float) -> float:
        """Return the percentage of the stride completed at this time."""
        return 100.0 * (time_s - self.start_s) / (self.end_s - self.start_s)


@dataclass(frozen=True, eq=False)
class FeetUnderPelvis:
    """Positions of heels, toes and pelvis, from inverse kinematics.

    Attributes:
        time: (n,) s.
        heading: (n, 3) horizontal unit vectors: direction that the pelvis faces, averaged over about a step.
        pelvis: (n, 3) m.
        heel, toe: per side (n, 3) m, the rearmost and the foremost marker of the foot.
    """

    time: np.ndarray
    heading: np.ndarray
    pelvis: np.ndarray
    heel: Mapping[str, np.ndarray]
    toe: Mapping[str, np.ndarray]

    def ahead(self, points: np.ndarray) -> np.ndarray:
        """Return the distance (n,) m by which points (n, 3) are in front of the pelvis."""
        return np.asarray(((points - self.pelvis) * self.heading).sum(axis=1))


def feet_under_pelvis(skeleton: Skeleton, kinematics: Kinematics) -> FeetUnderPelvis:
    """Compute heels, toes and pelvis in all frames between the first and the last that inverse kinematics solved."""
    time = kinematics.spline.time
    places = {side: _heel_and_toe(skeleton, segment) for side, segment in zip(FEET, skeleton.feet, strict=True)}
    rows = {side: skeleton.segments.index(segment) for side, segment in zip(FEET, skeleton.feet, strict=True)}
    parts: list[list[np.ndarray]] = []
    for some in pieces(len(time)):
        pose = skeleton.pose(kinematics.spline(time[some]))
        feet = [
            pose.rotation[:, rows[side]] @ place + pose.translation[:, rows[side]]
            for side in FEET
            for place in places[side]
        ]
        parts.append([pose.rotation[:, 0, :, 0], pose.translation[:, 0], *feet])
    facing, pelvis, *points = (np.concatenate(column) for column in zip(*parts, strict=True))
    facing = gaussian_mean(facing, _HEADING_S * len(time) / max(np.ptp(time), 1e-9))
    facing = facing * [1.0, 0.0, 1.0]
    heading = facing / np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-9)
    return FeetUnderPelvis(
        time, heading, pelvis, dict(zip(FEET, points[0::2], strict=True)), dict(zip(FEET, points[1::2], strict=True))
    )


def _heel_and_toe(skeleton: Skeleton, segment: str) -> tuple[np.ndarray, np.ndarray]:
    """Return heel and toe (3,) m in the foot's frame: rearmost and foremost marker, or its origin without markers."""
    positions = [marker.position for marker in skeleton.markers if marker.segment == segment] or [np.zeros(3)]
    along = [position[0] for position in positions]
    return positions[int(np.argmin(along))], positions[int(np.argmax(along))]


def found_events(skeleton: Skeleton, kinematics: Kinematics) -> list["FoundEvent"]:
    """Detect all heel strikes and toe offs of a trial, in order of time.

    Events of the file before or after the frames with a motion are left out, as a file keeps when it is cropped.
    """
    (first, last), edges = kinematics.spline.time[[0, -1]], load_edges(kinematics.trial.loads)
    by_motion = _from_motion(feet_under_pelvis(skeleton, kinematics))
    slack = 0.5 / kinematics.trial.markers.rate_hz
    usable = usable_events(kinematics.trial, by_motion)
    stated = [event for event in usable if first - slack <= event.time_s <= last + slack]
    known = [*edges, *stated]
    events = [
        event
        for event in by_motion
        if _foot_is_shown(skeleton, kinematics, event) or nearest_event(known, event, _SAME_EVENT_S) is not None
    ]
    return _timed(events, gait_events(kinematics.trial), edges, stated)


def _foot_is_shown(skeleton: Skeleton, kinematics: Kinematics, event: GaitEvent) -> bool:
    """Decide whether markers determine all coordinates from the ground to the foot around the event.

    Short gaps count as known. In longer ones the spline turns where no foot did.
    """
    foot = skeleton.segments.index(skeleton.feet[FEET.index(event.side)])
    columns = np.unique(skeleton.map.owner[skeleton.support[foot]])
    ik, half = kinematics.ik, LONGEST_BRIDGE_S / 2
    known = ik.time[np.isfinite(ik.q[:, columns]).all(axis=1)]
    start, end = np.clip([event.time_s - half, event.time_s + half], *kinematics.spline.time[[0, -1]])
    first, last = np.searchsorted(known, start, "right") - 1, np.searchsorted(known, end, "left")
    if first < 0 or last >= len(known):
        return False
    return bool((np.diff(known[first : last + 1]) <= LONGEST_BRIDGE_S + TIME_TOLERANCE_S).all())


def strides_of(skeleton: Skeleton, kinematics: Kinematics) -> tuple[Stride, ...]:
    """Find all strides of a trial, right foot first; none without walking or running."""
    events = found_events(skeleton, kinematics)
    strikes = {side: [e for e in events if e.event.side == side and e.event.kind == "heel strike"] for side in FEET}
    offs = {side: [e.event.time_s for e in events if e.event[1:] == (side, "toe off")] for side in FEET}
    strides = []
    for side, opposite in zip(FEET, reversed(FEET), strict=True):
        number = 0
        for first, second in zip(strikes[side], strikes[side][1:], strict=False):
            start, end = first.event.time_s, second.event.time_s
            across = _between([e.event.time_s for e in strikes[opposite]], start, end)
            usual = _STRIDE_S[0] <= round(end - start, 6) <= _STRIDE_S[1] and len(across) == 1
            if not usual or not _PHASE[0] <= (across[0] - start) / (end - start) <= _PHASE[1]:
                continue
            number += 1
            off = _only(_between(offs[side], start, end))
            other_off = _only(_between(offs[opposite], start, across[0]))
            on_plates = first.source == second.source == "force plate"
            strides.append(Stride(side, number, start, end, off, other_off, across[0], on_plates))
    return tuple(strides)


def _between(times: Sequence[float], start: float, end: float) -> list[float]:
    return [time for time in times if start < time < end]


def _only(times: Sequence[float]) -> float:
    """Return the single time; NaN if there is none, or several."""
    return times[0] if len(times) == 1 else float("nan")


EventSource = Literal["force plate", "file", "motion"]


class FoundEvent(NamedTuple):
    """An event, and the source of its time: a force plate, an event of the file, or the motion of the feet."""

    event: GaitEvent
    source: EventSource


def _from_motion(feet: FeetUnderPelvis) -> list[GaitEvent]:
    events = []
    for side in FEET:
        for frame in turning_points(feet.ahead(feet.heel[side]), _LEAST_SWING_M):
            events.append(GaitEvent(float(feet.time[frame]), side, "heel strike"))
        for frame in turning_points(-feet.ahead(feet.toe[side]), _LEAST_SWING_M):
            events.append(GaitEvent(float(feet.time[frame]), side, "toe off"))
    return sorted(events)


def turning_points(values: np.ndarray, least: float) -> list[int]:
    """Return indices of the maxima of values (n,) that exceed the values before and after by at least `least`."""
    maxima: list[int] = []
    high = low = 0
    rising = False
    for k, value in enumerate(values):
        if rising:
            if value > values[high]:
                high = k
            elif values[high] - value >= least:
                maxima.append(high)
                rising, low = False, k
        elif value < values[low]:
            low = k
        elif value - values[low] >= least:
            rising, high = True, k
    return maxima


def _timed(
    events: Sequence[GaitEvent],
    certain: Sequence[GaitEvent],
    edges: Sequence[GaitEvent],
    stated: Sequence[GaitEvent],
) -> list[FoundEvent]:
    """Set the times of events: from plates (edges), else the file (stated), else the corrected motion.

    The correction is the mean error against certain events. Events of the file that the motion does not show are added.
    """
    early = {}
    for kind in ("heel strike", "toe off"):
        gaps = [
            seen.time_s - event.time_s
            for event in events
            if event.kind == kind and (seen := nearest_event(certain, event, _SAME_EVENT_S)) is not None
        ]
        early[kind] = float(np.median(gaps)) if gaps else 0.0
    moved = [event._replace(time_s=event.time_s + early[event.kind]) for event in events]
    shown = [_of_file(event, nearest_event(stated, event, _SAME_EVENT_S)) for event in moved]
    shown += [FoundEvent(event, "file") for event in stated if nearest_event(moved, event, _SAME_STEP_S) is None]
    placed = []
    for found in shown:
        seen = nearest_event(edges, found.event, CONTACT_SLACK_S)
        placed.append(found if seen is None else FoundEvent(seen, "force plate"))
    return sorted(placed)


def _of_file(event: GaitEvent, stated: GaitEvent | None) -> FoundEvent:
    return FoundEvent(event, "motion") if stated is None else FoundEvent(stated, "file")


def contact_phases(skeleton: Skeleton, kinematics: Kinematics, strides: Sequence[Stride]) -> tuple[Stride, ...]:
    """Return the phases of feet on plates that are part of no stride and that markers show, right foot first.

    In a landing these are the landings, in squats there are none, in everything else there are stances.

    Args:
        skeleton: the calibrated model.
        kinematics: of the trial.
        strides: of the trial.
    """
    trial = kinematics.trial
    if trial.on_ground is None or trial.task == "squat":
        return ()
    found = _landings(skeleton, kinematics) if trial.task == "landing" else _stances(trial, strides)
    result: list[Stride] = []
    events: list[GaitEvent] | None = None
    shown_from, shown_to = kinematics.spline.time[[0, -1]]
    for side, phase, start, end in found:
        if start < shown_from or end > shown_to:
            continue
        number = 1 + sum(earlier.side == side for earlier in result)
        other = np.nan, np.nan
        if phase == "stance":
            events = (
                [found_event.event for found_event in found_events(skeleton, kinematics)] if events is None else events
            )
            other = _other_foot(trial, events, side, start, end)
        result.append(Stride(side, number, start, end, end, *other, True, phase))
    return tuple(result)


def _stances(trial: Trial, strides: Sequence[Stride]) -> Iterator[tuple[str, Phase, float, float]]:
    """Yield side, phase, first and last time of whole stances on plates with which no stride begins."""
    for stance in stances_of(trial):
        part = any(
            stride.side == stance.side and abs(stride.start_s - stance.start_s) < _SAME_BEGINNING_S
            for stride in strides
        )
        if stance.whole and not part and _on_plates(trial, FEET.index(stance.side), stance.start_s, stance.end_s):
            yield stance.side, "stance", stance.start_s, stance.end_s


def _other_foot(
    trial: Trial, events: Sequence[GaitEvent], side: str, start_s: float, end_s: float
) -> tuple[float, float]:
    """Return when the other foot leaves the ground in a stance, and when it is back; NaN where it does not.

    Where there is an event, which is not rounded to frames, its time is used.
    """
    assert trial.on_ground is not None  # else there are no stances
    during = within(trial.markers.time, start_s, end_s)
    time, ground = trial.markers.time[during], trial.on_ground[during, 1 - FEET.index(side)]
    swing = np.flatnonzero(~ground)
    if not len(swing):
        return np.nan, np.nan
    lifts = float(time[swing[0]]) if swing[0] > 0 else np.nan
    lands = float(time[swing[-1] + 1]) if swing[-1] + 1 < len(time) else np.nan
    opposite = FEET[1 - FEET.index(side)]
    inside = [event for event in events if start_s < event.time_s < end_s]
    off, strike = (
        nearest_event(inside, frame, _SAME_EVENT_S) or frame
        for frame in (GaitEvent(lifts, opposite, "toe off"), GaitEvent(lands, opposite, "heel strike"))
    )
    return off.time_s, strike.time_s


def _landings(skeleton: Skeleton, kinematics: Kinematics) -> Iterator[tuple[str, Phase, float, float]]:
    """Yield side, phase, first and last time of landings on plates: contacts that begin while the pelvis falls.

    They begin with a frame of the markers: before it, the foot may have been on a box.
    """
    loads, feet = kinematics.trial.loads, feet_under_pelvis(skeleton, kinematics)
    height_m = feet.pelvis[:, 1]
    speed_m_s = np.gradient(height_m, feet.time)
    for foot, side in enumerate(FEET):
        for a, b in runs(bridged(loads.time, loads.force[:, foot, 1] >= LOAD_THRESHOLD_N)):
            start, end = float(loads.time[a]), float(loads.time[b])
            frames = np.flatnonzero(within(feet.time, start, min(end, start + _LONGEST_LANDING_S)))
            if len(frames) and speed_m_s[frames[0]] <= -_FALLING_M_S:
                lowest = int(np.argmin(height_m[frames]))
                # otherwise the contact or the record ends before the pelvis rises again
                if lowest < len(frames) - 1 and feet.time[frames[lowest]] - start >= _SHORTEST_LANDING_S:
                    yield side, "landing", float(feet.time[frames[0]]), float(feet.time[frames[lowest]])


def _on_plates(trial: Trial, foot: int, start_s: float, end_s: float) -> bool:
    during = within(trial.loads.time, start_s, end_s)
    return bool(during.any() and (trial.loads.force[during, foot, 1] >= LOAD_THRESHOLD_N).mean() >= _MOSTLY)
