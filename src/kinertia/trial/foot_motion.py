"""Measures how foot markers move against the ground: height above it, and speed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.errors import MarkerSetError, problem_of
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.trial.data import BoolArray, FloatArray, Markers
from kinertia.trial.file_contents import Belt
from kinertia.trial.sampled_data import runs, span_s, within

AROUND_LOAD_S = 0.25
"""Frames so long before the first and after the last load help to interpret frames under load."""
_SPEED_SPAN_S = 0.01
_FILLED_GAP_S, _SEEN_SHARE = 0.2, 0.5
_STEP_M = 0.03
"""Contacts whose heights differ by more are on steps, boxes or a ramp; smaller differences come from how a foot lands
and rolls."""
_STILL_M_S, _STILL_SPAN_S, _STILL_S = 0.05, 0.1, 0.2
"""A foot stands still while one of its markers is slower than this, measured over the second, for at least the third: a
heel that is lifted leaves the toes where they are."""


@dataclass(frozen=True, eq=False)
class FootMotion:
    """Height (n, m) m and velocity (n, m, 3) m/s of the markers of a foot; NaN where they are not seen.

    Attributes:
        still: (n,) True where a marker stays in its place, against the ground or, as beside a treadmill's belt, in the
            laboratory.
    """

    height: FloatArray
    velocity: FloatArray
    still: BoolArray

    def slowest(self, clearance: float) -> FloatArray:
        """Return the speed (n,) m/s of the slowest marker not above this clearance (m); infinite without one."""
        speed = np.linalg.norm(self.velocity, axis=2)
        result: FloatArray = np.where(self.height <= clearance, speed, np.inf).min(axis=1)
        return result

    def planted(self, clearance: float, landing: float, leaving: float) -> BoolArray:
        """Return the mask (n,) of frames from landing to leaving, and of frames in which a marker is missing."""
        slowest = self.slowest(clearance)
        planted = np.zeros(len(slowest), dtype=bool)
        for first, last in runs(slowest <= leaving):
            below = np.flatnonzero(slowest[first : last + 1] <= landing)
            if below.size:
                planted[first + below[0] : last + 1] = True
        return planted | np.isnan(self.height).any(axis=1)

    def over(self, first: int, last: int) -> "FootMotion":
        """Return the motion with heights relative to the markers' level in these frames, for markers seen in them."""
        seen = np.isfinite(self.height[first : last + 1]).any(axis=0)
        if not seen.any():
            return self
        level = np.nanmedian(self.height[first : last + 1, seen], axis=0)
        return FootMotion(self.height[:, seen] - level, self.velocity[:, seen], self.still)


def foot_motions(feet: Sequence[Markers], loaded: BoolArray, belt: Belt | None = None) -> list[FootMotion]:
    """Compute the motion of the markers of both feet, which stand on loaded plates in the frames `loaded` (n, 2).

    Heights are above the surface that a foot may stand on: each marker's own lowest height under load or, where plates
    stand at several heights, the highest of them that the marker is not below. Velocities are relative to the ground
    under the loaded feet: the median velocity of the lowest marker, zero on a floor, the belt's on a treadmill. If the
    speed of a belt is stated, this only gives its direction. A foot that is never loaded takes the other foot's value.
    """
    near = _near(feet[0].time, np.asarray(loaded.any(axis=1)))
    places = [_short_gaps_filled(markers, near) for markers in feet]
    moves = [_velocity(markers, place, _SPEED_SPAN_S) for markers, place in zip(feet, places, strict=True)]
    heights = [_above_lowest(place[..., 1], loaded[:, foot]) for foot, place in enumerate(places)]
    ground = []
    for foot, (height, velocity) in enumerate(zip(heights, moves, strict=True)):
        frames = np.flatnonzero(loaded[:, foot] & np.isfinite(height).any(axis=1))
        if frames.size:
            lowest = velocity[frames, np.nanargmin(height[frames], axis=1)]
            lowest = lowest[np.isfinite(lowest).all(axis=1)]
            ground += [np.median(lowest, axis=0) * [1, 0, 1]] if len(lowest) else []
    velocities = ground if len(ground) == 2 else (ground or [np.zeros(3)]) * 2
    steps = _steps(heights, loaded)
    result = []
    for foot, (markers, place, height, velocity) in enumerate(zip(feet, places, heights, moves, strict=True)):
        of_ground = velocities[foot]
        if belt is not None:
            of_ground = belt.under(foot).velocity(markers.time, of_ground)[:, None]
        slow = _velocity(markers, place, _STILL_SPAN_S)
        still = _still(markers.time, slow - of_ground) | _still(markers.time, slow)
        result.append(FootMotion(_over(steps, height), velocity - of_ground, still))
    return result


def _velocity(markers: Markers, place: FloatArray, span_s: float) -> FloatArray:
    """Return the velocity (n, m, 3) m/s as a central difference over this time before and after each frame."""
    span = max(1, round(span_s * markers.rate_hz))
    frames = np.arange(len(place))
    after, before = np.minimum(frames + span, len(frames) - 1), np.maximum(frames - span, 0)
    elapsed = (markers.time[after] - markers.time[before])[:, None, None]
    return np.asarray((place[after] - place[before]) / elapsed)


def _above_lowest(height: FloatArray, loaded: BoolArray) -> FloatArray:
    """Return heights (n, m) m above each marker's lowest under load, or its lowest of all if never seen under load."""
    stance = height[loaded]
    if not np.isfinite(stance).any() or not np.isfinite(stance).any(axis=0).all():
        stance = height
    return height - np.nanpercentile(stance, 2, axis=0)


def _steps(heights: Sequence[FloatArray], loaded: BoolArray) -> list[float]:
    """Return the heights (m) of the surfaces that carry loads above the lowest of them, ascending."""
    lowest = []
    for foot, height in enumerate(heights):
        for first, last in runs(loaded[:, foot]):
            shown = height[first : last + 1][:, np.isfinite(height[first : last + 1]).any(axis=0)]
            if shown.size:
                lowest.append(float(np.nanmin(np.nanpercentile(shown, 10, axis=0))))
    steps = [0.0]
    for level in sorted(lowest):
        if level > steps[-1] + _STEP_M:
            steps.append(level)
    return steps


def _over(steps: Sequence[float], height: FloatArray) -> FloatArray:
    """Return heights above the highest step that they are not below."""
    below = np.searchsorted(np.array(steps[1:]) - _STEP_M / 2, height, side="right")
    result: FloatArray = height - np.array(steps)[np.where(np.isnan(height), 0, below)]
    return result


def _still(time: FloatArray, velocity: FloatArray) -> BoolArray:
    """Return the mask (n,) of intervals in which one marker does not move."""
    still = np.zeros(len(time), dtype=bool)
    for slow in (np.linalg.norm(velocity, axis=2) <= _STILL_M_S).T:
        for first, last in runs(slow):
            still[first : last + 1] |= span_s(time, first, last) >= _STILL_S
    return still


def _near(time: FloatArray, loaded: BoolArray) -> BoolArray:
    """Return the mask (n,) from shortly before the first to shortly after the last loaded frame; all True if none."""
    frames = np.flatnonzero(loaded)
    if not frames.size:
        return np.ones(len(time), dtype=bool)
    return within(time, time[frames[0]] - AROUND_LOAD_S, time[frames[-1]] + AROUND_LOAD_S)


def _short_gaps_filled(markers: Markers, near: BoolArray) -> FloatArray:
    """Return positions of the markers seen in at least half of these frames (n,), short gaps filled linearly.

    Use them only to decide whether a foot is on the ground.
    """
    seen = markers.seen
    share = seen[near].mean(axis=0)
    kept = np.flatnonzero(share >= _SEEN_SHARE)
    if not kept.size:
        where = Where(part="foot", markers=markers.labels)
        share = Quantity(float(share.max()), "1", limit=_SEEN_SHARE)
        found = finding("M104", where, share=share, labels=Quantity(", ".join(markers.labels)))
        raise MarkerSetError(problem_of(found), markers.labels).with_finding(found)
    positions = markers.positions[:, kept].copy()
    for column, marker in enumerate(kept):
        for first, last in runs(~seen[:, marker]):
            if span_s(markers.time, first, last) > _FILLED_GAP_S:
                continue
            for axis in range(3):
                positions[first : last + 1, column, axis] = np.interp(
                    markers.time[first : last + 1],
                    markers.time[seen[:, marker]],
                    markers.positions[seen[:, marker], marker, axis],
                )
    return positions
