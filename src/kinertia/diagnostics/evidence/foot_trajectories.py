"""Follows feet by their markers: where they are, when they stand, and how long strides last."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Self

import numpy as np

from kinertia.diagnostics.evidence.landmarks import bridged_trajectory
from kinertia.trial.data import FEET, BoolArray, FloatArray, FootLoads, Markers
from kinertia.trial.file_contents import Belt
from kinertia.trial.ground_contact import bridged
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, nearest_samples, runs, span_s

_LOW = 0.15
"""Share of the frames in which a foot is lowest: then it goes with the ground, or with a treadmill's belt."""
LEAST_BELT_M_S = 0.3
_SLOW, _SLOW_M_S = 0.15, (0.3, 1.0)
"""A foot is in stance while one of its markers is slower than this share of its own fast speed, within these limits."""
_LEAST_SWING_M_S = 1.0
"""A person whose feet never move faster takes no steps."""
_NOISE_M_S, _FARTHEST_S = 0.15, 0.05
"""A speed known to the former needs no frames farther apart; frames the latter apart still show landing and leaving."""
_THIRD_DIFFERENCE = 0.6745 * np.sqrt(20.0)
"""Median size of third differences of white noise with an SD of one."""
_SHORTEST_S, _MOSTLY = 0.1, 0.5
_LOAD_BEGINS, _LOAD_GOES_ON = 0.25, 0.65
"""Shares of the line between a foot's outermost markers."""
_TOES = 0.35
"""Length of the toes over that from heel to metatarsal heads."""
_FOOT_FLAT, _HEEL_UP, _HEEL_FALLS = 0.25, 0.2, 0.05
"""Share of a load after which the foot is flat, and shares of the foot's length. As loads begin, the heel marker is
0.36 below to 0.1 above the front one in the steps of ten people, and rises against it by 0.04 to 0.4; of one who climbs
stairs on the toes it is 0.28 to 0.48 above, and falls by 0.1 to 0.2."""
_LANDING_S = 0.05
"""A foot may bear load for this long before and after its stance phase."""
_TOGETHER = 0.2
"""Share of the time between two landings of a foot within which the other foot lands with it."""
_SHORTEST_STEP_S = 0.2
"""Feet that land or leave within less do so together: a sprinter's steps last longer."""
_LONGEST_SWING_S = 1.0
"""A foot that is in the air for longer is held up while the person lands on the other one."""


@dataclass(frozen=True, eq=False)
class FootTrajectory:
    """Trajectory of one foot, with its stance phases.

    Attributes:
        time: (n,) s.
        back, front: (n, 2) m, horizontal positions (x, z) of the two markers farthest apart, interpolated where
            they are not visible; equal for a foot with one marker. The foot swings forwards from back to front.
        shown: (n,) whether both are visible, but for short gaps.
        stands: first and last time (s) of every stance phase, and whether the trial shows both ends.
        rise: (n,) m, height of the back above the front.
    """

    time: FloatArray
    back: FloatArray
    front: FloatArray
    shown: BoolArray
    stance_spans: tuple[tuple[float, float, bool], ...]
    rise: FloatArray

    def lands_on_forefoot(self, start_s: float, end_s: float) -> bool:
        """Return whether a load begins with the heel in the air, or the heel comes down in its first quarter; false
        where the trial does not show when the load begins or ends."""
        if not np.isfinite(end_s - start_s):
            return False
        landing, flat = np.interp([start_s, start_s + _FOOT_FLAT * (end_s - start_s)], self.time, self.rise)
        return bool(landing > _HEEL_UP * self.length_m or landing - flat > _HEEL_FALLS * self.length_m)

    def seen(self, time: FloatArray) -> BoolArray:
        """Return (k,) whether both ends of the foot are visible, not interpolated, at these times."""
        return self.shown[nearest_samples(self.time, time)]

    def standing(self, time: FloatArray) -> BoolArray:
        """Return (k,) whether the foot stands at these times, or just before or after; true where that is unknown."""
        if not self.stance_spans:
            return np.ones(len(time), dtype=bool)
        slack_s = _LANDING_S + TIME_TOLERANCE_S
        spans = [(time >= start - slack_s) & (time <= end + slack_s) for start, end, _ in self.stance_spans]
        result: BoolArray = np.any(spans, axis=0)
        return result

    @property
    def length_m(self) -> float:
        """Median distance (m) from heel to forefoot."""
        return float(np.median(np.linalg.norm(self.front - self.back, axis=1)))

    def beyond(self, time: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far (k,) m positions (k, 2) at times (k,) are in front of the back, and in front of the front."""
        back, front = (self._at(end, time) for end in (self.back, self.front))
        along = front - back
        length = np.maximum(np.linalg.norm(along, axis=1), 1e-6)
        ahead: FloatArray = ((place - back) * along).sum(axis=1) / length
        return ahead, ahead - length

    def with_toes(self) -> Self:
        """Return the foot extended by toes in front of the metatarsal heads, where no marker shows them."""
        return replace(self, front=self.front + _TOES * (self.front - self.back))

    def heading(self, time: FloatArray, weight: FloatArray) -> FloatArray:
        """Return the mean direction (2,) from heel to forefoot, a unit vector, weighted over these times (k,)."""
        along: FloatArray = weight @ (self._at(self.front, time) - self._at(self.back, time))
        return along / np.linalg.norm(along)

    def expected_cop(self, time: FloatArray, weight: FloatArray) -> FloatArray:
        """Predict the centre of pressure (k, 2) m of a step with this vertical force (k,) N at these times (k,)."""
        back, front = (self._at(end, time) for end in (self.back, self.front))
        share = _LOAD_BEGINS + _LOAD_GOES_ON * np.cumsum(weight) / weight.sum()
        result: FloatArray = back + (front - back) * share[:, None]
        return result

    def _at(self, end: FloatArray, time: FloatArray) -> FloatArray:
        return np.column_stack([np.interp(time, self.time, end[:, axis]) for axis in range(2)])

    def offset_m(self, time: FloatArray, place: FloatArray) -> FloatArray:
        """Return offsets (k, 2) m to ground positions (k, 2) at times (k,) from the nearest point of the foot axis."""
        back, front = (self._at(end, time) for end in (self.back, self.front))
        along = front - back
        share = np.einsum("kx,kx->k", place - back, along) / np.maximum(np.einsum("kx,kx->k", along, along), 1e-12)
        result: FloatArray = place - back - np.clip(share, 0.0, 1.0)[:, None] * along
        return result


def foot_trajectories(
    markers: Markers, feet: Mapping[str, Sequence[str]], belt: Belt | None = None
) -> tuple[FootTrajectory, FootTrajectory] | None:
    """Compute the trajectories of the right and the left foot; None where a foot is hardly visible.

    Args:
        markers: of a motion, Y up.
        feet: labels of the markers on each foot, "r" and "l".
        belt: belt of the treadmill, where its speed is stated.
    """
    places = _foot_places(markers, feet)
    if places is None:
        return None
    places = [_short_gaps_filled(markers.time, place) for place in places]
    trajectories = []
    for place, velocity in zip(places, _velocities(markers, places, belt), strict=True):
        back, front, shown = _ends(markers.time, place)
        if _swing(velocity, (front - back)[:, [0, 2]]) < 0:
            back, front = front, back
        spans = _stance_spans(markers.time, np.linalg.norm(velocity, axis=2))
        trajectories.append(
            FootTrajectory(markers.time, back[:, [0, 2]], front[:, [0, 2]], shown, spans, (back - front)[:, 1])
        )
    return trajectories[0], trajectories[1]


def _swing(velocity: FloatArray, along: FloatArray) -> float:
    """Return a value that is positive where the foot moves fast (n, m, 3) along, not against, this direction (n, 2)."""
    shown = _seen(velocity).any(axis=1)
    mean = np.nanmean(velocity[shown][..., [0, 2]], axis=1)
    return float(((mean * along[shown]).sum(axis=1) * np.linalg.norm(mean, axis=1)).sum())


def _seen(place: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(place).all(axis=2))


def _velocities(markers: Markers, places: Sequence[FloatArray], stated: Belt | None) -> list[FloatArray]:
    """Compute velocities (n, m, 3) m/s of every marker of each foot relative to the ground."""
    velocities = [_velocity(markers.time, place) for place in places]
    belts = _belts(places, velocities)
    if stated is None:
        belts = [belt if np.linalg.norm(belt) >= LEAST_BELT_M_S else np.zeros(3) for belt in belts]
    else:
        belts = [stated.under(foot).velocity(markers.time, belt)[:, None] for foot, belt in enumerate(belts)]
    return [velocity - belt for velocity, belt in zip(velocities, belts, strict=True)]


def _velocity(time: FloatArray, place: FloatArray) -> FloatArray:
    """Compute velocities (n, m, 3) m/s of markers (n, m, 3) between neighbouring frames or, where noisy, frames farther
    apart.

    Noise is estimated from third differences, which contain little of the feet's motion: poses from video jitter by
    some mm in every frame, an apparent speed of 0.4 m/s in a foot on the ground.
    """
    step = float(np.median(np.diff(time)))
    third = np.abs(np.diff(place, 3, axis=0))
    noise_m = float(np.nanmedian(third)) / _THIRD_DIFFERENCE if np.isfinite(third).any() else 0.0
    farthest = max(round(_FARTHEST_S / step), 1)
    k = int(np.clip(np.ceil(noise_m * np.sqrt(1.5) / (step * _NOISE_M_S)), 1, farthest))
    velocity = np.gradient(place, time, axis=0)
    if k > 1 and len(time) > 2 * k:
        velocity[k:-k] = (place[2 * k :] - place[: -2 * k]) / (time[2 * k :] - time[: -2 * k])[:, None, None]
    return velocity


def standing_speeds(markers: Markers, feet: Mapping[str, Sequence[str]]) -> tuple[float, float] | None:
    """Compute velocities (m/s) of the surfaces under the right and left foot; None where a foot is hardly visible."""
    places = _foot_places(markers, feet)
    if places is None:
        return None
    right, left = _belts(places, [_velocity(markers.time, place) for place in places])
    return float(np.linalg.norm(right)), float(np.linalg.norm(left))


def _foot_places(markers: Markers, feet: Mapping[str, Sequence[str]]) -> list[FloatArray] | None:
    """Return the positions (n, m, 3) m of the markers of each foot; None where a foot is hardly visible."""
    places = [markers.select([label for label in feet[side] if label in markers.labels]).positions for side in FEET]
    hardly = len(markers.time) < 5 or min(np.count_nonzero(_seen(place)) for place in places) == 0
    return None if hardly else places


def _belts(places: Sequence[FloatArray], velocities: Sequence[FloatArray]) -> list[FloatArray]:
    """Compute the velocity (3,) m/s of each foot's surface: one for both feet unless their belts differ in speed."""
    of_each_foot = [_belt([place], [velocity]) for place, velocity in zip(places, velocities, strict=True)]
    moving = min(float(np.linalg.norm(belt)) for belt in of_each_foot) >= LEAST_BELT_M_S
    apart = float(np.linalg.norm(of_each_foot[0] - of_each_foot[1])) >= LEAST_BELT_M_S
    return of_each_foot if moving and apart else [_belt(places, velocities)] * len(of_each_foot)


def _belt(places: Sequence[FloatArray], velocities: Sequence[FloatArray]) -> FloatArray:
    """Compute the horizontal belt velocity (3,) m/s: the median velocity of the feet while they are lowest."""
    low = []
    for place, velocity in zip(places, velocities, strict=True):
        shown = _seen(velocity).any(axis=1) & _seen(place).any(axis=1)
        height = np.full(len(place), np.inf)
        height[shown] = np.nanmean(place[shown, :, 1], axis=1)
        near = shown & (height <= np.quantile(height[shown], _LOW)) if shown.any() else shown
        low.append(np.nanmean(velocity[near], axis=1))
    every = np.concatenate(low)
    return np.median(every, axis=0) * np.array([1.0, 0.0, 1.0]) if len(every) else np.zeros(3)


def _short_gaps_filled(time: FloatArray, place: FloatArray) -> FloatArray:
    """Bridge gaps up to `_SHORTEST_S` in positions (n, m, 3) linearly: flickering markers do not end a stance phase."""
    filled = place.copy()
    for marker, seen in enumerate(_seen(place).T):
        frames = np.flatnonzero(seen)
        for first, last in runs(~seen):
            inside = len(frames) > 0 and frames[0] < first and last < frames[-1]
            if inside and span_s(time, first - 1, last + 1) <= _SHORTEST_S:
                for axis in range(3):
                    ends = place[[first - 1, last + 1], marker, axis]
                    gap = slice(first, last + 1)
                    filled[gap, marker, axis] = np.interp(time[gap], time[[first - 1, last + 1]], ends)
    return filled


def _stance_spans(time: FloatArray, speed: FloatArray) -> tuple[tuple[float, float, bool], ...]:
    """Find stance phases from the speeds (n, m) of a foot's markers; missing markers may hide a start or an end."""
    slowest = np.nan_to_num(speed, nan=np.inf).min(axis=1)
    known = slowest[np.isfinite(slowest)]
    fast = float(np.quantile(known, 0.95)) if known.size else 0.0
    if fast < _LEAST_SWING_M_S:
        return ()
    seen = np.isfinite(speed)
    hidden = np.asarray(~seen[:, seen.mean(axis=0) > _MOSTLY].all(axis=1))

    def whole(first: int, last: int) -> bool:
        return first > 0 and last < len(time) - 1 and not bool(hidden[[first - 1, first, last, last + 1]].any())

    stands = bridged(time, slowest < np.clip(_SLOW * fast, *_SLOW_M_S))
    return tuple(
        (float(time[first]), float(time[last]), whole(first, last))
        for first, last in runs(stands)
        if span_s(time, first, last) >= _SHORTEST_S
    )


def _ends(time: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return the positions (n, 3) m of the two markers farthest apart, of those often visible together, and (n,) where
    both are visible."""
    flat, seen = place[..., [0, 2]], _seen(place)
    often = (seen[:, :, None] & seen[:, None]).sum(axis=0)
    shown = np.flatnonzero(seen.any(axis=0))
    apart = np.linalg.norm(flat[:, :, None] - flat[:, None], axis=-1)
    usual = np.full(often.shape, -1.0)
    for landmark in shown:
        for other in shown:
            if often[landmark, other] >= _MOSTLY * often.max():
                usual[landmark, other] = float(np.nanmedian(apart[:, landmark, other]))
    landmark, other = np.unravel_index(int(np.argmax(usual)), usual.shape)
    both = seen[:, landmark] & seen[:, other]
    return bridged_trajectory(time, place[:, landmark]), bridged_trajectory(time, place[:, other]), both


def periods(loads: FootLoads) -> tuple[list[float], list[float]]:
    """Return times (s) between foot contacts, and foot-offs, of one foot; and from each to the other foot's next.

    Both are empty where the feet do not alternate, as in jumps, squats and when sitting down: there are no strides.
    """
    strides, steps = [], []
    contacts = [runs(bridged(loads.time, loads.force[:, foot, 1] > 0)) for foot in range(len(FEET))]
    for edge, unseen in ((0, 0), (1, len(loads.time) - 1)):  # no event where a contact lasts to the end
        events = [[float(loads.time[run[edge]]) for run in spans if run[edge] != unseen] for spans in contacts]
        if not _alternating(*events):
            continue
        both = sorted((time, foot) for foot, times in enumerate(events) for time in times)
        between = [b - a for (a, foot), (b, other) in pairwise(both) if foot != other]
        if 2 * sum(round(step, 6) < _SHORTEST_STEP_S for step in between) > len(between):
            continue
        strides += [b - a for times in events for a, b in combinations(times, 2)]
        steps += between
    return strides, steps


def swing_in_turn(feet: tuple[FootTrajectory, FootTrajectory], part_s: tuple[float, float]) -> bool:
    """Return whether one foot swings and then the other, by their markers: one step on a plate shows no stride.

    Feet that leave and land together jump; a foot that lands while the other stays lifted is a landing.

    Args:
        feet: right and left.
        part_s: first and last time of the part that counts.
    """
    right, left = (
        [(leaves, lands) for leaves, lands in _swings(foot) if not (lands < part_s[0] or leaves > part_s[1])]
        for foot in feet
    )
    for swing in right if left else ():
        nearest = min(
            (_later_s(swing, other) for other in left), key=lambda later: abs(float(np.mean(later or np.inf)))
        )
        size = np.abs(np.round(nearest, 6))
        in_step = (size >= _SHORTEST_STEP_S) & (size <= _LONGEST_SWING_S)
        if nearest and in_step.all() and abs(np.sign(nearest).sum()) == len(nearest):
            return True
    return False


def _swings(foot: FootTrajectory) -> list[tuple[float, float]]:
    """Find when a foot leaves the ground and lands (NaN where not shown), except swings that are too long."""
    spans, time = foot.stance_spans, foot.time
    if not spans:
        return []
    edges = [
        (-np.inf, spans[0][0]),
        *((before[1], after[0]) for before, after in pairwise(spans)),
        (spans[-1][1], np.inf),
    ]
    frame_s = span_s(time) / max(len(time) - 1, 1)
    kept = []
    for leaves, lands in edges:
        lifted = foot.shown & (time > leaves) & (time < lands)
        if lifted.any() and lifted.sum() * frame_s <= _LONGEST_SWING_S + TIME_TOLERANCE_S:
            kept.append((leaves if np.isfinite(leaves) else np.nan, lands if np.isfinite(lands) else np.nan))
    return kept


def _later_s(swing: tuple[float, float], other: tuple[float, float]) -> list[float]:
    """Return the delays (s) of another swing's foot off and foot contact, where both are known."""
    return [second - first for first, second in zip(swing, other, strict=True) if np.isfinite(second - first)]


def _alternating(right: Sequence[float], left: Sequence[float]) -> bool:
    """Return whether the known events of one foot lie well between those of the other."""
    phases = [
        (between - start) / (end - start)
        for stances, other in ((right, left), (left, right))
        for start, end in pairwise(stances)
        for between in other
        if start - _TOGETHER * (end - start) <= between < end + _TOGETHER * (end - start)
    ]
    apart = [_TOGETHER < phase < 1.0 - _TOGETHER for phase in phases]
    return 2 * sum(apart) >= len(apart)
