"""Finds impossible trajectories: spikes, jumps, frozen markers, gaps filled with straight lines, copied frames.

Bodies move smoothly: from one frame to the next a marker moves nearly as far as in the frames before and after. The
difference, its step, is at most 12 mm on the fault-free reference trials (60 frames a second and more, runs and jumps
included; 28 mm where one marker was relabelled), and 1.5 mm for the median marker.

On 17 measured recordings of motions and ten synthetic ones no frame repeats the one before it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kinertia.diagnostics.evidence.marker_precision import USUAL_HZ
from kinertia.findings.quantity import Limit
from kinertia.trial.data import BoolArray, FloatArray, Markers
from kinertia.trial.sampled_data import runs

BODY_M = 0.02
SPIKE_M = Limit(0.08, "m", usual=(0.0, BODY_M))
"""Off the middle of its neighbours: a body's accelerations account for less than the former at 60 Hz."""
STEP_M = Limit(0.04, "m", usual=(0.0, 0.012))
STRAIGHT_M = Limit(1.5e-4, "m")
"""Nothing alive moves so straight, at a constant speed, for `STRAIGHT_S`; cameras err by more."""
STRAIGHT_S = Limit(0.15, "s")
OFF_M = 0.015
"""Change of a marker's distances in its segment while it is frozen or moves straight, and the segment does not."""
_SINGLE = 1.5
"""A single displaced frame is displaced by twice as much as its neighbours seem to be; one before or after a jump, by
the same."""
BRIEF_S = Limit(0.06, "s")
"""Steps to and from a displaced position belong to one spike if they are within this; anything longer is a jump."""
_FROZEN_M = 1e-3
COPIED_SHARE = Limit(0.25)
"""Share of copies beyond which the recording was upsampled: at half the rate, each repeated once, half are copies."""
FEWEST_FRAMES = 11
LEAST_MOTION_M = 1e-3
_LONGEST_S = 0.15
"""Longest time between two measured frames; a person who stands still, or a frozen marker, does so for longer."""
_ALIKE = 0.9
"""Share of the markers that are still at the same time, although they move in other frames."""


@dataclass(frozen=True)
class Fault:
    """Fault of one marker for a while."""

    label: str
    span_s: tuple[float, float]


@dataclass(frozen=True)
class Spikes(Fault):
    """Single frames, or a few, in which one marker is displaced.

    Attributes:
        distance_m: largest distance from the middle of its neighbours, or from the line across a few frames.
        frames: number of displaced frames.
        far_frames: how many of them are beyond `spike_limit_m`.
    """

    distance_m: float
    frames: int
    far_frames: int


@dataclass(frozen=True)
class Jump(Fault):
    """Lasting step (m) of one marker."""

    step_m: float


@dataclass(frozen=True)
class Filled(Fault):
    """Interval in which one marker is frozen, or moves along a straight line, while its segment (m) does not."""

    frozen: bool
    relative_motion_m: float


@dataclass(frozen=True)
class TrajectoryFaults:
    """Faults of single marker trajectories."""

    spikes: tuple[Spikes, ...] = ()
    jumps: tuple[Jump, ...] = ()
    filled: tuple[Filled, ...] = ()

    @classmethod
    def of(cls, markers: Markers, segments: Mapping[str, Sequence[str]], coarse: bool = False) -> Self:
        """Find the faults of all markers, besides frames that are left out (`beside_gaps`).

        Args:
            markers: of a motion, or of a person who stands.
            segments: labels of the markers on each segment.
            coarse: coordinates are rounded, or noisy, so that all markers seem to jump and to stand still: then
                repeated large spikes count only.
        """
        if len(markers.time) < 3:
            return cls()
        markers = without_frames_beside_gaps(markers)
        off = _off_neighbours(markers.positions)
        far = _local_peaks(off) & (off > spike_limit_m(markers.rate_hz))
        if coarse or len(markers.time) < 5:
            return cls(_spikes(markers, off, far, np.zeros_like(far)))
        size = np.nan_to_num(np.linalg.norm(steps(markers.positions), axis=-1))
        size[size <= step_limit_m(markers.rate_hz)] = 0.0
        # a frame that is off makes a step to it, and one from it
        step = np.pad(size > 0.0, ((1, 1), (0, 0)))
        single = _is_single(off) & (step[1:] | step[:-1])
        # and makes those beside them look half as large
        near = np.pad(single, ((2, 2), (0, 0)))
        size[near[3:-2] | near[2:-3] | near[1:-4] | near[4:-1]] = 0.0
        spikes, jumps = _brief_or_lasting(markers, _jumps(markers, size))
        return cls(_by_marker([*_spikes(markers, off, far, single), *spikes]), tuple(jumps), _filled(markers, segments))

    @property
    def labels(self) -> frozenset[str]:
        """Labels of all markers with faults."""
        found: tuple[Fault, ...] = (*self.spikes, *self.jumps, *self.filled)
        return frozenset(fault.label for fault in found)


MOST_SPIKES = Limit(2)
"""Number of far frames of one marker up to which they may be an accident of labelling."""


def spike_limit_m(rate_hz: float) -> float:
    """Return the distance (m) from the neighbours' middle beyond which a frame is a spike; 80 mm from 60 Hz up."""
    return SPIKE_M + BODY_M * (slowness(rate_hz) - 1.0)


def step_limit_m(rate_hz: float) -> float:
    """Return the step (m) beyond which a marker jumps."""
    return STEP_M * slowness(rate_hz)


def slowness(rate_hz: float) -> float:
    """Return how much farther accelerations move a marker from frame to frame than at 60 Hz."""
    return max(1.0, USUAL_HZ / rate_hz) ** 2


def steps(position: FloatArray) -> FloatArray:
    """Compute (n - 3, m, 3) m, how much each displacement i + 1 to i + 2 differs from those before and after."""
    way = np.diff(position, axis=0)
    return way[1:-1] - (way[:-2] + way[2:]) / 2


def _spikes(markers: Markers, off: FloatArray, far: BoolArray, single: BoolArray) -> tuple[Spikes, ...]:
    """Collect spikes from frames (n - 2, m) that are far displaced, and from single displaced frames."""
    found = []
    for k in range(len(markers.labels)):
        often = np.count_nonzero(far[:, k]) > MOST_SPIKES
        frames = np.flatnonzero(single[:, k] | far[:, k] if often else single[:, k])
        if not frames.size:
            continue
        span = (float(markers.time[1 + frames[0]]), float(markers.time[1 + frames[-1]]))
        count = int(np.count_nonzero(far[frames, k]))
        found.append(Spikes(markers.labels[k], span, float(off[frames, k].max()), len(frames), count))
    return tuple(found)


def _jumps(markers: Markers, size: FloatArray) -> tuple[Jump, ...]:
    """Collect jumps from steps (n - 3, m) m, 0 where there are none; of adjacent steps the largest is the jump."""
    return tuple(
        Jump(markers.labels[k], (float(markers.time[frame + 1]), float(markers.time[frame + 2])), float(size[frame, k]))
        for k in np.flatnonzero(size.any(axis=0))
        for frame in (first + int(np.argmax(size[first : last + 1, k])) for first, last in runs(size[:, k] > 0.0))
    )


def _brief_or_lasting(markers: Markers, jumps: Sequence[Jump]) -> tuple[list[Spikes], list[Jump]]:
    """Separate spikes of a few frames, which begin or end with a step, from the steps that stay."""
    spikes, lasting = [], []
    for jump in jumps:
        place = markers.positions[:, markers.labels.index(jump.label)]
        frame = int(np.searchsorted(markers.time, jump.span_s[0] - 0.5 / markers.rate_hz))
        off = _frames_off(place, frame, markers.rate_hz)
        if off is None:
            lasting.append(jump)
            continue
        first, last = off
        share = np.linspace(0.0, 1.0, last - first + 3)[1:-1, None]
        line = (1.0 - share) * place[first - 1] + share * place[last + 1]
        distance_m = float(np.nanmax(np.linalg.norm(place[first : last + 1] - line, axis=1), initial=0.0))
        span = (float(markers.time[first]), float(markers.time[last]))
        far = int(distance_m > spike_limit_m(markers.rate_hz))
        spikes.append(Spikes(jump.label, span, distance_m, last - first + 1, far))
    return spikes, lasting


def _frames_off(place: FloatArray, frame: int, rate_hz: float) -> tuple[int, int] | None:
    """Find the fewest frames around a step from `frame` to the next without which a marker (n, 3) continues as before;
    None where the step stays.
    """
    limit_m = step_limit_m(rate_hz) / 2
    for count in range(1, max(2, round(BRIEF_S * rate_hz)) + 1):
        for first in range(frame + 1 - count, frame + 2):
            a, b = first - 1, first + count
            if a < 1 or b > len(place) - 2:
                continue
            speed = (place[a] - place[a - 1] + place[b + 1] - place[b]) / 2
            if np.linalg.norm(place[b] - place[a] - (b - a) * speed) < limit_m:
                return first, b - 1
    return None


def _by_marker(spikes: Sequence[Spikes]) -> tuple[Spikes, ...]:
    """Merge spikes into one entry per marker."""
    found: dict[str, Spikes] = {}
    for spike in spikes:
        merged = found.get(spike.label, spike)
        span = (min(merged.span_s[0], spike.span_s[0]), max(merged.span_s[1], spike.span_s[1]))
        frames, far = (0, 0) if merged is spike else (merged.frames, merged.far_frames)
        distance_m = max(merged.distance_m, spike.distance_m)
        found[spike.label] = Spikes(spike.label, span, distance_m, frames + spike.frames, far + spike.far_frames)
    return tuple(found.values())


def _filled(markers: Markers, segments: Mapping[str, Sequence[str]]) -> tuple[Filled, ...]:
    count = max(4, round(STRAIGHT_S * markers.rate_hz))
    if len(markers.time) < max(count, STRAIGHT_S * markers.rate_hz + 1):
        return ()
    found = []
    straight = _straight(markers.positions, count)
    for k, label in enumerate(markers.labels):
        of_segment = next((labels for labels in segments.values() if label in labels), ())
        mates = [markers.labels.index(mate) for mate in of_segment if mate != label and mate in markers.labels]
        for first, last in runs(straight[:, k]):
            inside = slice(first, last + count)
            way = markers.positions[inside, k]
            moved = float(np.linalg.norm(way[-1] - way[0]))
            # comparing with the whole body would tell nothing about a foot on the ground
            relative = _relative_motion_m(way, markers.positions[inside][:, mates]) if mates else moved / 2
            if relative > OFF_M:
                span = (float(markers.time[first]), float(markers.time[last + count - 1]))
                found.append(Filled(label, span, moved < _FROZEN_M, relative))
    return tuple(found)


def _relative_motion_m(way: FloatArray, others: FloatArray) -> float:
    """Return by how much (m) the distance of a trajectory (f, 3) from markers (f, m, 3) changes; 0 where unknown."""
    distance = np.linalg.norm(others - way[:, None], axis=-1)
    if not np.isfinite(distance).all(axis=0).any():
        return 0.0
    seen = distance[:, np.isfinite(distance).any(axis=0)]
    return float(np.max(np.nanmax(seen, axis=0) - np.nanmin(seen, axis=0)))


def _straight(position: FloatArray, count: int) -> BoolArray:
    """Find (n - count + 1, m) where the next `count` frames of a marker lie on a line, at a constant speed."""
    first, last = position[: len(position) - count + 1], position[count - 1 :]
    result = np.isfinite(first).all(axis=-1) & np.isfinite(last).all(axis=-1)
    for k in range(1, count - 1):
        between = position[k : len(position) - count + 1 + k]
        share = k / (count - 1)
        off = np.abs(between - (1 - share) * first - share * last).max(axis=-1)
        result &= np.nan_to_num(off, nan=np.inf) < STRAIGHT_M
    return np.asarray(result)


def _off_neighbours(position: FloatArray) -> FloatArray:
    """Return the distance (n - 2, m) m from the middle between the frames before and after; 0 where one is missing."""
    off = np.linalg.norm(position[1:-1] - (position[2:] + position[:-2]) / 2, axis=-1)
    result: FloatArray = np.nan_to_num(off)
    return result


def _local_peaks(off: FloatArray) -> BoolArray:
    """Find local peaks: of three frames around a spike the middle one is displaced most."""
    beside = np.pad(off, ((1, 1), (0, 0)))
    return np.asarray((off >= beside[2:]) & (off >= beside[:-2]))


def _is_single(off: FloatArray) -> BoolArray:
    """Find single displaced frames: their neighbours are then displaced by half as much, but equally where a marker
    jumps."""
    beside = np.pad(off, ((1, 1), (0, 0)))
    return np.asarray(off > _SINGLE * np.maximum(beside[2:], beside[:-2]))


@dataclass(frozen=True, eq=False)
class CopiedFrames:
    """Frames that repeat the one before them.

    Attributes:
        copied: (n,) which marker frames are copies.
        amid_motion: markers stop in them and go on just before and after; those at the ends do not count.
        insertions: how many of them were put in between two consecutive frames, which delays everything after them,
            whereas the others replace dropped frames.
    """

    copied: BoolArray
    amid_motion: bool
    insertions: int

    @classmethod
    def of(cls, markers: Markers) -> Self:
        """Find the copied frames of the markers of a motion."""
        if len(markers.time) < FEWEST_FRAMES:
            return cls(np.zeros(len(markers.time), dtype=bool), False, 0)
        distance = np.linalg.norm(np.diff(markers.positions, axis=0), axis=2)
        repeated = brief_runs(_repeated(distance), markers.rate_hz)
        copied = np.concatenate([[False], repeated])
        return cls(copied, _amid_motion(distance, repeated), _insertions(markers.positions, distance, repeated))

    @property
    def share(self) -> float:
        """Share of the steps from frame to frame that are copies."""
        return float(self.copied[1:].mean()) if len(self.copied) > 1 else 0.0

    @property
    def fill_lost_frames(self) -> bool:
        """Whether the copies fill single dropped frames, rather than upsample the whole recording."""
        return 0.0 < self.share <= COPIED_SHARE and self.amid_motion


def without_copied_frames(markers: Markers) -> Markers:
    """Return the markers with copies of dropped frames as gaps (NaN), which are bridged; unchanged without copies.

    Upsampled recordings, more than a quarter of which is copied, are left as they are.
    """
    copies = CopiedFrames.of(markers)
    if not copies.fill_lost_frames:
        return markers
    return replace(markers, positions=np.where(copies.copied[:, None, None], np.nan, markers.positions))


def beside_gaps(markers: Markers) -> BoolArray:
    """Find frames (n, m) just before or after a gap of a marker, from which it jumps to where it then goes on."""
    position, limit_m = markers.positions, step_limit_m(markers.rate_hz)
    found = np.zeros(position.shape[:2], dtype=bool)
    for order in (slice(None), slice(None, None, -1)):
        seen, way = markers.seen[order], np.diff(position[order], axis=0)
        turned = np.linalg.norm(np.diff(way, axis=0), axis=-1)
        found[order][1:-3] |= ~seen[:-4] & (turned[1:-1] > limit_m) & (turned[2:] < limit_m / 2)
    return found


def without_frames_beside_gaps(markers: Markers) -> Markers:
    """Return the markers with gaps extended by frames in which another marker has the label (`beside_gaps`)."""
    off = beside_gaps(markers)
    return replace(markers, positions=np.where(off[..., None], np.nan, markers.positions)) if off.any() else markers


def brief_runs(mask: BoolArray, rate_hz: float) -> BoolArray:
    """Return the mask without runs that last longer than the time between two measured frames."""
    kept = mask.copy()
    for first, last in runs(mask):
        if last - first + 1 > _LONGEST_S * rate_hz:
            kept[first : last + 1] = False
    return kept


def _repeated(distance: FloatArray) -> BoolArray:
    """Find frames (n - 1,) in which nearly all markers stay exactly where they were although the person moves."""
    seen = np.isfinite(distance)
    count = seen.sum(axis=1)
    same = (seen & (distance == 0.0)).sum(axis=1) > _ALIKE * np.maximum(count, 1)
    goes_on = distance[~same][seen[~same]]
    if not goes_on.size or np.median(goes_on) < LEAST_MOTION_M:
        return np.zeros(len(distance), dtype=bool)
    return np.asarray(same & (count > 0))


def _amid_motion(distance: FloatArray, repeated: BoolArray) -> bool:
    """Return whether markers stop in repeated frames (n - 1,) and move on beside them.

    Rounded coordinates also repeat while a person hardly moves.
    """
    if not repeated.any():
        return False
    hidden = ~np.isfinite(distance).any(axis=1, keepdims=True)
    distance = np.where(hidden, 0.0, distance)
    moving = float(np.nanmedian(distance[~repeated])) if (~repeated).any() else np.inf
    beside = [np.nanmedian(distance[[first - 1, last + 1]], axis=1).min() for first, last in _inner(repeated)]
    return max(beside, default=0.0) > max(LEAST_MOTION_M, 0.5 * moving)


def _insertions(position: FloatArray, distance: FloatArray, repeated: BoolArray) -> int:
    """Count copies after which the motion resumes where it stopped; after dropped frames it resumes farther away."""
    inserted = 0
    for first, last in _inner(repeated):
        if first < 1 or last + 3 > len(position) - 1:
            continue
        gone = np.linalg.norm(position[last + 2] - position[first], axis=1)
        step = (distance[first - 1] + distance[last + 2]) / 2
        known = np.isfinite(gone) & np.isfinite(step)
        if known.any() and np.median(step[known]) > LEAST_MOTION_M:
            inserted += (last - first + 1) * bool(
                gone[known].sum() < (1.0 + (last - first + 1) / 2) * step[known].sum()
            )
    return inserted


def _inner(repeated: BoolArray) -> list[tuple[int, int]]:
    return [run for run in runs(repeated) if run[0] > 0 and run[1] < len(repeated) - 1]
