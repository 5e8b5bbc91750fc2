"""Where the feet are and when they stand, from their markers alone: what loads on plates are compared with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.trial.belt import Belt
from kinertia.trial.data import FEET, BoolArray, FloatArray, Markers, runs
from kinertia.trial.ground_contact import bridged

_LOW = 0.15
"""Share of the frames in which a foot is lowest: then it goes with the ground, or with a treadmill's belt."""
_LEAST_BELT_M_S = 0.3
_BELT_APART = 0.25
"""Share by which a stated speed may differ from that of standing feet, which roll."""
_SLOW, _SLOW_M_S = 0.15, (0.3, 1.0)
"""A foot stands while one of its markers is slower than this share of its own fast speed, within these limits."""
_LEAST_SWING_M_S = 1.0
"""Who does not move the feet faster takes no steps."""
_SHORTEST_S = 0.1
_LANDING_S = 0.05
"""A foot may bear load so long before it stands and after."""


@dataclass(frozen=True, eq=False)
class FootWay:
    """One foot.

    Attributes:
        time: (n,) s.
        back, front: (n, 2) m, horizontal places (x, z) of the two markers that are farthest apart, interpolated where
            they are not seen; the same for a foot with one marker. The foot swings forwards from back to front.
        stands: first and last time (s) of every stretch in which it stands, and whether the trial shows both ends.
    """

    time: FloatArray
    back: FloatArray
    front: FloatArray
    stands: tuple[tuple[float, float, bool], ...]

    def standing(self, time: FloatArray) -> BoolArray:
        """(k,) whether it stands then, or a little before or after; everywhere where that cannot be told."""
        if not self.stands:
            return np.ones(len(time), dtype=bool)
        spans = [(time >= start - _LANDING_S) & (time <= end + _LANDING_S) for start, end, _ in self.stands]
        result: BoolArray = np.any(spans, axis=0)
        return result

    def beyond(self, time: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(k,) m, how far places (k, 2) at times (k,) are in front of the back, and in front of the front."""
        back, front = (self._at(end, time) for end in (self.back, self.front))
        along = front - back
        length = np.maximum(np.linalg.norm(along, axis=1), 1e-6)
        ahead: FloatArray = ((place - back) * along).sum(axis=1) / length
        return ahead, ahead - length

    def _at(self, end: FloatArray, time: FloatArray) -> FloatArray:
        return np.column_stack([np.interp(time, self.time, end[:, axis]) for axis in range(2)])

    def off_foot(self, time: FloatArray, place: FloatArray) -> FloatArray:
        """(k, 2) m from the nearest point between back and front to places (k, 2) on the ground at times (k,)."""
        back, front = (self._at(end, time) for end in (self.back, self.front))
        along = front - back
        share = ((place - back) * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-12)
        result: FloatArray = place - back - np.clip(share, 0.0, 1.0)[:, None] * along
        return result


def foot_ways(
    markers: Markers, feet: Mapping[str, Sequence[str]], belt: Belt | None = None
) -> tuple[FootWay, FootWay] | None:
    """Right and left foot; None where a foot is hardly seen.

    Args:
        markers: of a motion, Y up.
        feet: labels of the markers on each foot, "r" and "l".
        belt: of the treadmill, where its speed is stated.
    """
    places = [markers.select([label for label in feet[side] if label in markers.labels]).positions for side in FEET]
    if len(markers.time) < 5 or min(np.count_nonzero(_seen(place)) for place in places) == 0:
        return None
    ways = []
    for place, velocity in zip(places, _velocities(markers, places, belt), strict=True):
        back, front = _ends(markers.time, place)
        if _swing(velocity, front - back) < 0:
            back, front = front, back
        stands = _stands(markers.time, np.linalg.norm(velocity, axis=2))
        ways.append(FootWay(markers.time, back, front, stands))
    return ways[0], ways[1]


def _swing(velocity: FloatArray, along: FloatArray) -> float:
    """Positive where the foot is mostly fast (n, m, 3) along this direction (n, 2), not against it."""
    shown = _seen(velocity).any(axis=1)
    mean = np.nanmean(velocity[shown][..., [0, 2]], axis=1)
    return float(((mean * along[shown]).sum(axis=1) * np.linalg.norm(mean, axis=1)).sum())


def _seen(place: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(place).all(axis=2))


def _velocities(markers: Markers, places: Sequence[FloatArray], stated: Belt | None) -> list[FloatArray]:
    """(n, m, 3) m/s of every marker of each foot against the ground."""
    velocities = [np.gradient(place, markers.time, axis=0) for place in places]
    belt = _belt(places, velocities)
    if stated is not None:
        return [velocity - stated.velocity(markers.time, belt)[:, None] for velocity in velocities]
    if np.linalg.norm(belt) < _LEAST_BELT_M_S:
        belt = np.zeros(3)
    return [velocity - belt for velocity in velocities]


def belt_doubts(markers: Markers, feet: Mapping[str, Sequence[str]], belt: Belt) -> list[str]:
    """A stated speed of the belt that is not that of the standing feet."""
    places = [markers.select([label for label in feet[side] if label in markers.labels]).positions for side in FEET]
    if len(markers.time) < 5 or min(np.count_nonzero(_seen(place)) for place in places) == 0:
        return []
    velocities = [np.gradient(place, markers.time, axis=0) for place in places]
    shown = float(np.linalg.norm(_belt(places, velocities)))
    stated = belt.way_m(markers.time[0], markers.time[-1]) / float(np.ptp(markers.time))
    if abs(shown - stated) <= max(_BELT_APART * max(stated, shown), _LEAST_BELT_M_S):
        return []
    ratio = stated / max(shown, 1e-9)
    unit = "; it looks to be in km/h" if abs(ratio / 3.6 - 1) < _BELT_APART else ""
    return [
        f"the stated speed of the belt is {stated:.2f} m/s on average, but standing feet go {shown:.2f} m/s{unit}: "
        "correct belt_speed_m_s (m/s), or leave it out"
    ]


def _belt(places: Sequence[FloatArray], velocities: Sequence[FloatArray]) -> FloatArray:
    """(3,) m/s, horizontal: median velocity of feet that are lowest."""
    low = []
    for place, velocity in zip(places, velocities, strict=True):
        shown = _seen(velocity).any(axis=1) & _seen(place).any(axis=1)
        height = np.full(len(place), np.inf)
        height[shown] = np.nanmean(place[shown, :, 1], axis=1)
        near = shown & (height <= np.quantile(height[shown], _LOW)) if shown.any() else shown
        low.append(np.nanmean(velocity[near], axis=1))
    every = np.concatenate(low)
    return np.median(every, axis=0) * np.array([1.0, 0.0, 1.0]) if len(every) else np.zeros(3)


def _stands(time: FloatArray, speed: FloatArray) -> tuple[tuple[float, float, bool], ...]:
    slowest = np.nan_to_num(speed, nan=np.inf).min(axis=1)
    known = slowest[np.isfinite(slowest)]
    fast = float(np.quantile(known, 0.95)) if known.size else 0.0
    if fast < _LEAST_SWING_M_S:
        return ()
    stands = bridged(time, slowest < np.clip(_SLOW * fast, *_SLOW_M_S))
    return tuple(
        (float(time[first]), float(time[last]), bool(first > 0 and last < len(time) - 1))
        for first, last in runs(stands)
        if time[last] - time[first] >= _SHORTEST_S
    )


def _ends(time: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    flat = place[..., [0, 2]]
    shown = np.flatnonzero(_seen(place).any(axis=0))
    apart = np.linalg.norm(flat[:, shown, None] - flat[:, None, shown], axis=-1)
    together = np.isfinite(apart).any(axis=0)
    usual = np.where(together, np.nanmedian(np.where(together, apart, 0.0), axis=0), 0.0)
    one, other = np.unravel_index(int(np.argmax(usual)), usual.shape)
    return _filled(time, flat[:, shown[one]]), _filled(time, flat[:, shown[other]])


def _filled(time: FloatArray, way: FloatArray) -> FloatArray:
    known = np.isfinite(way).all(axis=1)
    return np.column_stack([np.interp(time, time[known], way[known, axis]) for axis in range(2)])
