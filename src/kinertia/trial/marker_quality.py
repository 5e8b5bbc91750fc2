"""Checks markers before any model is used: gaps, the vertical axis, the direction of travel, whether anyone moves."""

from dataclasses import dataclass

import numpy as np

from kinertia.trial.data import BoolArray, FloatArray, Markers
from kinertia.trial.sampled_data import runs

STANDING_RANGE_M = 0.03
"""In a standing trial the median marker stays within this (5th to 95th percentile)."""
LEAST_WALK_M = 0.5
"""Least distance that counts as net travel."""
UPRIGHT_SHARE = 0.7
STILL_M_S = 0.1
"""Speed limit of standing: markers move by a few cm/s in standing, by about 1 m/s in walking."""
_WITHIN_S = 0.1
_SHARE, _LEAST_STILL_S = 0.9, 0.5


def speed_m_s(markers: Markers) -> float:
    """Return the median marker speed (m/s) over a tenth of a second, its 90th percentile over the frames.

    It is zero for a shorter recording, and infinite if no marker is visible that long.

    >>> still = np.ones((50, 2, 3))
    >>> speed_m_s(Markers(np.arange(50) / 100, ("A", "B"), still))
    0.0
    """
    if not 0 < _step(markers) < len(markers.time):
        return 0.0
    speeds = _speeds(markers)
    seen = speeds[np.isfinite(speeds)]
    return float(np.quantile(seen, _SHARE)) if len(seen) else float("inf")


def still_span_s(markers: Markers) -> tuple[float, float] | None:
    """Return first and last time (s) of the longest part in which nobody moves; None if it is shorter than 0.5 s."""
    step = _step(markers)
    if not 0 < step < len(markers.time):
        return None
    still = runs(np.nan_to_num(_speeds(markers), nan=np.inf) < STILL_M_S)
    first, last = max(still, key=lambda run: run[1] - run[0], default=(0, 0))
    start, end = float(markers.time[first]), float(markers.time[last + step])
    return (start, end) if last > first and end - start >= _LEAST_STILL_S else None


def _step(markers: Markers) -> int:
    """Return the number of frames over which speeds are measured."""
    return int(np.searchsorted(markers.time - markers.time[0], _WITHIN_S))


def _speeds(markers: Markers) -> FloatArray:
    """Return the median speed (n - step,) m/s of the markers from each frame on; NaN where none is seen."""
    positions, time, step = markers.positions, markers.time, _step(markers)
    speed = np.linalg.norm(positions[step:] - positions[:-step], axis=2) / (time[step] - time[0])
    seen = np.isfinite(speed).any(axis=1)
    result = np.full(len(speed), np.nan)
    result[seen] = np.nanmedian(speed[seen], axis=1)
    return result


@dataclass(frozen=True)
class Visibility:
    """Share of a trial in which one marker is seen.

    Attributes:
        label: the marker's name.
        share: of the frames, 0 to 1.
        longest_gap_s: longest run of frames without it; those at the ends of the trial count.
    """

    label: str
    share: float
    longest_gap_s: float


@dataclass(frozen=True)
class Travel:
    """Direction and speed of travel of the person, in ground axes.

    Attributes:
        kind: "stands still", "no net travel" or "walks".
        distance_m: covered while markers are seen.
        speed_m_s: mean, 0 unless walking.
        direction_deg: about the vertical from +X towards -Z, so that 90 is along -Z; NaN unless walking.
    """

    kind: str
    distance_m: float
    speed_m_s: float
    direction_deg: float

    def sentence(self) -> str:
        """Return the travel in words: "walks along +X (12 degrees off), 2.1 m at 1.30 m/s"."""
        if self.kind == "no net travel":
            return "no net travel (treadmill or in place)"
        if self.kind != "walks":
            return self.kind
        quarter = round(self.direction_deg / 90)
        off = abs(self.direction_deg - 90 * quarter)
        axis = ("+X", "-Z", "-X", "+Z")[quarter % 4]
        aside = f" ({off:.0f} degrees off)" if off >= 1 else ""
        return f"walks along {axis}{aside}, {self.distance_m:.2f} m at {self.speed_m_s:.2f} m/s"


def visibility(markers: Markers) -> tuple[Visibility, ...]:
    """Return the visibility of every marker, in the order of the file."""
    seen = markers.seen
    frame_s = 0.0 if len(markers.time) < 2 else 1.0 / markers.rate_hz
    return tuple(
        Visibility(label, float(shown.mean()), frame_s * _longest(~shown))
        for label, shown in zip(markers.labels, seen.T, strict=True)
    )


def _longest(missing: BoolArray) -> int:
    return max((last - first + 1 for first, last in runs(missing)), default=0)


def travel(markers: Markers) -> Travel:
    """Determine the person's travel from the displacement of the median marker between its first and last frames."""
    shown = markers.seen
    spans = [(k, np.flatnonzero(on)) for k, on in enumerate(shown.T) if on.any()]
    moved = [
        np.linalg.norm(np.ptp(np.percentile(markers.positions[frames, k], (5, 95), axis=0), axis=0))
        for k, frames in spans
    ]
    if not moved or float(np.median(moved)) < STANDING_RANGE_M:
        return Travel("stands still", 0.0, 0.0, np.nan)
    took = np.array([np.ptp(markers.time[frames]) for _, frames in spans])
    way = np.array([markers.positions[frames[-1], k] - markers.positions[frames[0], k] for k, frames in spans])
    long = took >= 0.5 * took.max()
    velocity = np.median(way[long] / took[long, None], axis=0)
    speed = float(np.hypot(velocity[0], velocity[2]))
    distance = float(speed * np.ptp(markers.time[shown.any(axis=1)]))
    if distance < LEAST_WALK_M:
        return Travel("no net travel", distance, 0.0, np.nan)
    return Travel("walks", distance, speed, float(np.degrees(np.arctan2(-velocity[2], velocity[0]))))


def extent_m(markers: Markers) -> FloatArray:
    """Return the extent (3,) m of the visible markers along x, y, z, median over the frames; NaN where unknown."""
    shown = markers.positions[markers.seen.sum(axis=1) >= 2]
    if not len(shown):
        return np.full(3, np.nan)
    return np.asarray(np.median(np.nanmax(shown, axis=1) - np.nanmin(shown, axis=1), axis=0))
