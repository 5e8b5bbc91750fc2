"""How finely were markers recorded, in time and in place? Made-up frames, rounded coordinates, noise.

On 17 measured recordings of motions and ten synthetic ones no frame repeats the one before it, and hardly any lies in
the middle between its neighbours; coordinates have steps of 0.08 mm at most, and noise is 0.25 mm at most (0.8 mm in
synthetic laboratories with cameras of 1 mm).
"""

from __future__ import annotations

import numpy as np

from kinertia.trial.data import BoolArray, FloatArray, Markers
from kinertia.trial.sampled_time import runs

_FEWEST_FRAMES = 11
_REPEATED_SHARE, _BETWEEN_SHARE = 0.25, 0.4
"""Frames at half the rate, each held once, repeat in one of two; drawn as straight lines, half lie between others."""
_ALIKE, _BETWEEN, _LEAST_MOTION_M = 0.9, 0.03, 1e-3
"""Most markers stand still at once, while in other frames they go on; and of how much the quick frames bend, the others
bend less."""
_LONGEST_S = 0.15
"""Between two frames that were measured; who stands still, or is frozen, is so for longer."""
_COARSE_M, _STEPS = 0.0015, 1e-3
_NOISY_M, _USUAL_HZ = 0.0025, 60.0
_THIRD_DIFFERENCE = float(np.sqrt(20.0))
"""Deviation of the third differences of noise over its own; motions hardly have any at 60 Hz and more."""
_GAUSSIAN = 1.4826


def made_up_frames_trouble(markers: Markers) -> str:
    """Frames that were not measured but copied, or drawn between others, to reach a higher rate; empty where none were.

    Args:
        markers: of a motion.
    """
    place = markers.positions
    if len(place) < _FEWEST_FRAMES:
        return ""
    repeated = _for_moments(_repeated(place), markers.rate_hz)
    if 0.0 < repeated.mean() <= _REPEATED_SHARE and _amid_motion(place, repeated):
        return (
            f"{repeated.sum()} of {len(place)} marker frames repeat the one before them, in all markers at once, the "
            f"first at {markers.time[1 + int(np.argmax(repeated))]:.3f} s: lost frames were filled so, or frames were "
            "put in, and the markers stop there and jump on; export the frames that were measured, lost ones as gaps"
        )
    between = _for_moments(_between(place), markers.rate_hz)
    if repeated.mean() > _REPEATED_SHARE:
        true_hz, what = markers.rate_hz * (1.0 - repeated.mean()), "repeats the one before it, in all markers at once"
        share = repeated.mean()
    elif between.mean() > _BETWEEN_SHARE:
        true_hz, what = (
            markers.rate_hz * (1.0 - between.mean()),
            "lies on a straight line between others, in all markers",
        )
        share = between.mean()
    else:
        return ""
    return (
        f"{100 * share:.0f} % of the marker frames were not measured: each of them {what}; the cameras ran at about "
        f"{true_hz:.0f} Hz, and the file was filled up to {markers.rate_hz:.0f} Hz: velocities in it come and go from "
        "frame to frame; export the frames that were measured, at their own rate"
    )


def rounded_trouble(markers: Markers) -> str:
    """Coordinates that come in coarse steps; empty where they do not."""
    step = _step_m(markers.positions)
    if not step > _COARSE_M:
        return ""
    return (
        f"all coordinates of the markers are multiples of {1e3 * step:.3g} mm: they were rounded (metres with two "
        "decimals, centimetres with none); markers seem to stand still and to jump by that; export them with more "
        "decimals"
    )


def noisy_doubts(markers: Markers) -> list[str]:
    """Noise of most markers from frame to frame that is no camera's."""
    if len(markers.time) < _FEWEST_FRAMES:
        return []
    noise = marker_noise_m(markers)
    if not noise > _NOISY_M * max(1.0, _USUAL_HZ / markers.rate_hz) ** 3:
        return []
    return [
        f"the markers jitter by {1e3 * noise:.1f} mm (standard deviation from frame to frame, median over the markers; "
        "cameras that are calibrated well have 0.1 to 1 mm): calibrate the cameras, see how many of them see each "
        "marker, or whether a video's estimate was exported without a filter; joint moments are as vague"
    ]


def marker_noise_m(markers: Markers) -> float:
    """Deviation of single coordinates from frame to frame, median over the markers; NaN where none are seen."""
    jerk = np.abs(np.diff(markers.positions, n=3, axis=0))
    seen = np.isfinite(jerk).all(axis=2).sum(axis=0) >= _FEWEST_FRAMES - 3
    if not seen.any():
        return np.nan
    return float(np.median(np.nanmedian(jerk[:, seen], axis=(0, 2)))) * _GAUSSIAN / _THIRD_DIFFERENCE


def _for_moments(mask: BoolArray, rate_hz: float) -> BoolArray:
    """The mask without its long runs."""
    kept = mask.copy()
    for first, last in runs(mask):
        if last - first + 1 > _LONGEST_S * rate_hz:
            kept[first : last + 1] = False
    return kept


def _repeated(place: FloatArray) -> BoolArray:
    """(n - 1,) frames in which nearly all markers stay exactly where they were, of a person who moves."""
    way = np.linalg.norm(np.diff(place, axis=0), axis=2)
    seen = np.isfinite(way)
    count = seen.sum(axis=1)
    same = (seen & (way == 0.0)).sum(axis=1) > _ALIKE * np.maximum(count, 1)
    goes_on = way[~same][seen[~same]]
    if not goes_on.size or np.median(goes_on) < _LEAST_MOTION_M:
        return np.zeros(len(way), dtype=bool)
    return np.asarray(same & (count > 0))


def _amid_motion(place: FloatArray, repeated: BoolArray) -> bool:
    """Whether markers stop in repeated frames (n - 1,) and go on just before and after, those at the ends apart.

    Coordinates that are rounded repeat as well, where a person hardly moves.
    """
    way = np.linalg.norm(np.diff(place, axis=0), axis=2)
    way[~np.isfinite(way).any(axis=1)] = 0.0
    moving = float(np.nanmedian(way[~repeated])) if (~repeated).any() else np.inf
    inner = [run for run in runs(repeated) if run[0] > 0 and run[1] < len(repeated) - 1]
    beside = [np.nanmedian(way[[first - 1, last + 1]], axis=1).min() for first, last in inner]
    return max(beside, default=0.0) > max(_LEAST_MOTION_M, 0.5 * moving)


def _between(place: FloatArray) -> BoolArray:
    """(n - 2,) frames in which most markers are in the middle between their neighbours, if in others they are not."""
    bend = np.linalg.norm(np.diff(place, n=2, axis=0), axis=2)
    shown = np.isfinite(bend).any(axis=1)
    typical = np.full(len(bend), np.nan)
    if not shown.any():
        return np.zeros(len(bend), dtype=bool)
    typical[shown] = np.nanmedian(bend[shown], axis=1)
    quick = float(np.nanquantile(typical, 0.95))
    went = np.linalg.norm(np.diff(place, axis=0), axis=2)
    if not np.nanmedian(went) > _LEAST_MOTION_M:
        return np.zeros(len(bend), dtype=bool)
    return np.asarray(shown & (np.nan_to_num(typical, nan=np.inf) < _BETWEEN * quick))


def _step_m(place: FloatArray) -> float:
    """What all coordinates are multiples of, if that is coarse; 0 where they are not."""
    values = place[np.isfinite(place)]
    steps = np.diff(np.unique(np.round(values, 6)))
    if steps.size < 2:
        return 0.0
    step = float(steps.min())
    if step < _COARSE_M:
        return 0.0
    off = np.abs(values / step - np.round(values / step))
    return step if off.max() < _STEPS else 0.0
