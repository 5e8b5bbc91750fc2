"""What goes wrong with markers over time: spikes, jumps, exchanged labels, frozen or invented stretches, lost frames.

A body is slow: from one frame to the next a marker goes nearly as far as it did before and will do after. By how much
it does not, its step, is at most 12 mm on the sound trials at hand (60 frames a second and more, runs and jumps
included; 28 mm where one marker was labelled anew), and that of the median marker 1.5 mm.
"""

from __future__ import annotations

import numpy as np

from kinertia.trial.data import BoolArray, FloatArray, Markers
from kinertia.trial.sampled_time import runs

_SPIKE_M, _FEW_SPIKES = 0.08, 2
_STEP_M = 0.04
_ALONE = 1.5
"""A single frame is off by twice as much as it makes those beside it look; one before or after a jump, by as much."""
_LANDING_M = 0.04
"""Two markers exchanged their labels where each is this near to the other's way."""
_LOST_M, _LOST_TIMES = 0.006, 3.0
"""Step of the median marker where frames are missing: at least so far, and so many times as far as it usually is. Noisy
cameras move all markers, in every frame."""
_USUAL_HZ = 60.0
"""At lower rates steps are larger, with the square of the time between frames."""
_STRAIGHT_M = 1.5e-4
"""Nothing alive moves so straight, at a constant speed, for `_STRAIGHT_S`; cameras err by more."""
_STRAIGHT_S = 0.15
_OFF_M = 0.015
_LISTED = 6


def spikes_trouble(markers: Markers) -> str:
    """Which markers leave their way for single frames, how far and how often; empty where none does more than twice.

    Judged is how far a marker is from the middle between the frames before and after: bodies' accelerations account for
    less than 20 mm at 60 frames a second.
    """
    if len(markers.time) < 3:
        return ""
    away = _away(markers.positions)
    # of three frames around a spike the middle one is farthest away
    beside = np.pad(away, ((1, 1), (0, 0)))
    spike = (away > _SPIKE_M) & (away >= beside[2:]) & (away >= beside[:-2])
    often = np.flatnonzero(spike.sum(axis=0) > _FEW_SPIKES)
    if not often.size:
        return ""
    named = ", ".join(f"{markers.labels[k]} ({spike[:, k].sum()} times)" for k in often[:_LISTED])
    more = f" and {often.size - _LISTED} more" if often.size > _LISTED else ""
    first = float(markers.time[1 + int(np.argmax(spike[:, often[0]]))])
    return (
        f"spikes: single frames in which markers are up to {1e3 * away[spike].max():.0f} mm off their way: "
        f"{named}{more}; the first at {first:.3f} s: delete those frames of the marker, a gap is bridged, or label them"
    )


def lost_frames_trouble(markers: Markers) -> str:
    """Where most markers step at once: frames are missing there, and the time was closed up; empty where nowhere."""
    if len(markers.time) < 5:
        return ""
    size = np.linalg.norm(_steps(markers.positions), axis=-1)
    shown = np.isfinite(size).sum(axis=1) > 0.5 * len(markers.labels)
    median = np.zeros(len(size))
    median[shown] = np.nanmedian(size[shown], axis=1)
    usually = float(np.median(median[shown])) if shown.any() else 0.0
    if not (median > max(_LOST_M * _slowness(markers), _LOST_TIMES * usually)).any():
        return ""
    worst = int(np.argmax(median))
    went = np.linalg.norm(np.diff(markers.positions, axis=0), axis=-1)
    usual = float(np.nanmedian(np.concatenate([went[worst : worst + 1], went[worst + 2 : worst + 3]])))
    times = float(np.nanmedian(went[worst + 1])) / max(usual, 1e-4)
    where = f"between {markers.time[worst + 1]:.3f} and {markers.time[worst + 2]:.3f} s"
    lost = max(1, round(times) - 1)
    return (
        f"most markers jump at once, {where}, by {1e3 * median[worst]:.0f} mm (median): frames are missing there "
        f"(about {lost}) and the time was closed up, or two recordings were put together; export every frame, or use "
        "the part on one side"
    )


def exchanged_trouble(markers: Markers) -> str:
    """Which two markers have each other's labels for a while; empty where none do."""
    if len(markers.time) < 5:
        return ""
    step = np.nan_to_num(np.linalg.norm(_steps(markers.positions), axis=-1))
    limit = _STEP_M * _slowness(markers)
    for frame in np.flatnonzero((step > limit).sum(axis=1) >= 2):
        jumping = np.flatnonzero(step[frame] > limit)
        before, after = markers.positions[frame + 1], markers.positions[frame + 2]
        for n, a in enumerate(jumping):
            for b in jumping[n + 1 :]:
                apart = float(np.linalg.norm(before[a] - before[b]))
                crossed = max(float(np.linalg.norm(after[i] - before[k])) for i, k in ((a, b), (b, a)))
                if crossed < min(_LANDING_M, 0.5 * apart):
                    return (
                        f"the markers {markers.labels[a]} and {markers.labels[b]} exchange their places from one frame "
                        f"to the next at {markers.time[frame + 2]:.3f} s, {1e3 * apart:.0f} mm apart: their labels are "
                        "swapped before or after; correct them"
                    )
    return ""


def jump_doubts(markers: Markers) -> list[str]:
    """Markers that leave their way for single frames, which `spikes_trouble` found to be small or few, and markers that
    step once or twice, and stay.
    """
    if len(markers.time) < 5:
        return []
    size = np.nan_to_num(np.linalg.norm(_steps(markers.positions), axis=-1))
    size[size <= _STEP_M * _slowness(markers)] = 0.0
    # a frame that is off makes a step to it, and one from it
    step = np.pad(size > 0.0, ((1, 1), (0, 0)))
    away = _away(markers.positions)
    spike = _alone(away) & (step[1:] | step[:-1])
    size[spike[1:] | spike[:-1]] = 0.0
    return [*_spikes_doubt(markers, np.where(spike, away, 0.0)), *_jumps_doubt(markers, size)]


def _spikes_doubt(markers: Markers, away: FloatArray) -> list[str]:
    """Of how far (n - 2, m) m single frames are off; 0 where they are not."""
    worn = np.flatnonzero(away.any(axis=0))
    if not worn.size:
        return []
    named = ", ".join(
        f"{markers.labels[k]} by up to {1e3 * away[:, k].max():.0f} mm ({np.count_nonzero(away[:, k])} times, first at "
        f"{markers.time[1 + int(np.argmax(away[:, k] > 0))]:.3f} s)"
        for k in worn[:_LISTED]
    )
    more = f" and {worn.size - _LISTED} more" if worn.size > _LISTED else ""
    return [
        f"spikes: single frames in which markers are off their way: {named}{more}; delete those frames of the marker, "
        "a gap is bridged"
    ]


def _jumps_doubt(markers: Markers, size: FloatArray) -> list[str]:
    """Of steps (n - 3, m) m; 0 where there are none."""
    jumps = []
    for k in np.flatnonzero(size.any(axis=0)):
        frame = int(np.argmax(size[:, k]))
        jumps.append(f"{markers.labels[k]} by {1e3 * size[frame, k]:.0f} mm at {markers.time[frame + 2]:.3f} s")
    if not jumps:
        return []
    more = f" and {len(jumps) - _LISTED} more" if len(jumps) > _LISTED else ""
    return [
        f"markers jump from one frame to the next: {', '.join(jumps[:_LISTED])}{more}; another marker or a reflection "
        "has their label from then on, or until then: correct the labels, or delete that part of the marker"
    ]


def straight_doubts(markers: Markers, segments: dict[str, tuple[str, ...]]) -> list[str]:
    """Markers that stand still, or go along a straight line at a constant speed, while the rest of the segment does
    not.

    Args:
        markers: of a motion.
        segments: labels of the markers on each segment.
    """
    if len(markers.time) < _STRAIGHT_S * markers.rate_hz + 1:
        return []
    count = max(4, round(_STRAIGHT_S * markers.rate_hz))
    still: list[str] = []
    line: list[str] = []
    straight = _straight(markers.positions, count)
    for k, label in enumerate(markers.labels):
        own = next((labels for labels in segments.values() if label in labels), ())
        mates = [markers.labels.index(one) for one in own if one != label and one in markers.labels]
        for first, last in runs(straight[:, k]):
            inside = slice(first, last + count)
            way = markers.positions[inside, k]
            others = markers.positions[inside][:, mates or range(len(markers.labels))]
            if not _leaves(way, others, alone=not mates):
                continue
            stretch = f"{label} from {markers.time[first]:.3f} to {markers.time[last + count - 1]:.3f} s"
            (still if np.linalg.norm(way[-1] - way[0]) < 1e-3 else line).append(stretch)
            break
    doubts = []
    if still:
        doubts.append(
            f"a marker stands still while its segment moves: {', '.join(still[:_LISTED])}; it was not seen, and its "
            "last place was written: delete that part, a short gap is bridged"
        )
    if line:
        doubts.append(
            f"a marker goes along a straight line at a constant speed while its segment does not: "
            f"{', '.join(line[:_LISTED])}; a gap was filled with it: leave it empty, or fill it from the other markers"
        )
    return doubts


def _leaves(way: FloatArray, others: FloatArray, alone: bool) -> bool:
    """Whether a straight way (f, 3) is not that of the other markers (f, m, 3)."""
    if alone:  # of the whole body: that some marker moves otherwise says nothing of a foot on the ground
        return bool(np.linalg.norm(way[-1] - way[0]) > 2 * _OFF_M)
    apart = np.linalg.norm(others - way[:, None], axis=-1)
    if not np.isfinite(apart).all(axis=0).any():
        return False
    return bool(np.nanmax(np.nanmax(apart, axis=0) - np.nanmin(apart, axis=0)) > _OFF_M)


def _straight(place: FloatArray, count: int) -> BoolArray:
    """(n - count + 1, m) where the next `count` frames of a marker are on a line, at a constant speed."""
    first, last = place[: len(place) - count + 1], place[count - 1 :]
    result = np.isfinite(first).all(axis=-1) & np.isfinite(last).all(axis=-1)
    for k in range(1, count - 1):
        between = place[k : len(place) - count + 1 + k]
        share = k / (count - 1)
        off = np.abs(between - (1 - share) * first - share * last).max(axis=-1)
        result &= np.nan_to_num(off, nan=np.inf) < _STRAIGHT_M
    return np.asarray(result)


def _away(place: FloatArray) -> FloatArray:
    """(n - 2, m) m, from the middle between the frames before and after; 0 where one of them is not seen."""
    result: FloatArray = np.nan_to_num(np.linalg.norm(place[1:-1] - (place[2:] + place[:-2]) / 2, axis=-1))
    return result


def _alone(away: FloatArray) -> BoolArray:
    """Where single frames are off: those beside them are half as far off then, and as far where a marker jumps."""
    beside = np.pad(away, ((1, 1), (0, 0)))
    return np.asarray(away > _ALONE * np.maximum(beside[2:], beside[:-2]))


def _slowness(markers: Markers) -> float:
    """How much farther steps of a sound marker may be than at `_USUAL_HZ`."""
    return max(1.0, _USUAL_HZ / markers.rate_hz) ** 2


def _steps(place: FloatArray) -> FloatArray:
    """(n - 3, m, 3) m, by how much the way from frame i + 1 to i + 2 differs from those before and after it."""
    way = np.diff(place, axis=0)
    result: FloatArray = way[1:-1] - (way[:-2] + way[2:]) / 2
    return result
