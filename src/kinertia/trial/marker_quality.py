"""Checks markers before any model is used: gaps, the vertical axis, the direction of travel."""

from dataclasses import dataclass

import numpy as np

from kinertia.trial.data import BoolArray, FloatArray, Markers
from kinertia.trial.sampled_time import runs

STANDING_RANGE_M = 0.03
"""In a standing trial the median marker stays within this (5th to 95th percentile)."""
_LEAST_WALK_M = 0.5
"""Least distance that counts as net travel."""
UPRIGHT_SHARE = 0.7


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
    if distance < _LEAST_WALK_M:
        return Travel("no net travel", distance, 0.0, np.nan)
    return Travel("walks", distance, speed, float(np.degrees(np.arctan2(-velocity[2], velocity[0]))))


def extent_m(markers: Markers) -> FloatArray:
    """Return the extent (3,) m of the visible markers along x, y, z, median over the frames; NaN where unknown."""
    shown = markers.positions[markers.seen.sum(axis=1) >= 2]
    if not len(shown):
        return np.full(3, np.nan)
    return np.asarray(np.median(np.nanmax(shown, axis=1) - np.nanmin(shown, axis=1), axis=0))
