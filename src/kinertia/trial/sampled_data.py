"""Checks and searches sampled data: impossible times and values, contiguous runs, moving windows, root mean squares.

Rounding errors of the times do not change results.

No file reader lets them through; they come from arrays that a user passes.

They equal those of `scipy.ndimage`, with the same order of additions: importing it takes as long as importing NumPy,
and only these few functions are needed.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where

TIME_TOLERANCE_S = 1e-6
"""Times that differ by less are equal, so that rounding errors change no result."""
_UNEVEN = 0.5
"""Share of a usual step between frames by which other steps may differ: camera clocks jitter."""
_DEVIATIONS = 4.0
"""Standard deviations to either side at which a Gaussian weight ends."""


def nearest_samples(time: npt.NDArray[np.float64], at: npt.NDArray[np.float64]) -> npt.NDArray[np.int_]:
    """Return indices into `time` (ascending) of the samples nearest to `at`; of two equally near, the later one."""
    after = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
    return after - (at - time[after - 1] < time[after] - at - TIME_TOLERANCE_S)


def within(time: npt.NDArray[np.float64], start_s: float, end_s: float) -> npt.NDArray[np.bool_]:
    """Return the mask of times from start_s to end_s, both included, despite rounding errors."""
    return (time >= start_s - TIME_TOLERANCE_S) & (time <= end_s + TIME_TOLERANCE_S)


def span_s(time: npt.NDArray[np.float64], first: int = 0, last: int = -1) -> float:
    """Return the seconds from one sample to another, rounded to a microsecond: exactly 0.04 for 10.17 to 10.21 s."""
    return round(float(time[last] - time[first]), 6)


def runs(mask: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last index of every contiguous run of True, in order."""
    padded = np.concatenate(([False], mask, [False]))
    edges = np.flatnonzero(padded[1:] != padded[:-1])
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))


def windows(time: npt.NDArray[np.float64], mask: npt.NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return first and last time (s) of every contiguous run of True in `mask` (n,), longest run first."""
    spans = [(float(time[first]), float(time[last])) for first, last in runs(mask)]
    return sorted(spans, key=lambda span: span[0] - span[1])


def rms(values: np.ndarray) -> float:
    """Return the root mean square over everything that is not NaN."""
    return _root_mean(np.square(values))


def rms_length(vectors: np.ndarray) -> float:
    """Return the root mean square length of vectors (..., k) over everything that is not NaN."""
    return _root_mean(np.square(vectors).sum(axis=-1))


def _root_mean(squares: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(squares))) if np.isfinite(squares).any() else float("nan")


def rms_by_marker(errors_m: np.ndarray) -> np.ndarray:
    """Return the RMS (m,) of distances (w, m) over the frames that show the marker; NaN for one never visible."""
    seen = np.isfinite(errors_m)
    total = np.square(np.where(seen, errors_m, 0.0)).sum(axis=0)
    with np.errstate(invalid="ignore"):
        result: np.ndarray = np.sqrt(total / seen.sum(axis=0))
        return result


def impossible_markers(time: np.ndarray, labels: Sequence[str], positions: np.ndarray) -> Finding | None:
    """Return the finding for impossible times (n,) or positions (n, m, 3) m of markers; None if there is none."""
    if wrong := _not_growing(time):
        return wrong
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if len(steps) and (away := np.abs(steps - usual)).max() > _UNEVEN * usual:
        k = int(np.argmax(away))
        return with_evidence("T101", Where(), step_evidence(time[k], time[k + 1], usual))
    infinite = np.argwhere(np.isinf(positions))
    if len(infinite):
        frame, marker, axis = infinite[0]
        return impossible_position(labels[marker], float(positions[frame, marker, axis]), float(time[frame]))
    return None


def impossible_plates(
    time: np.ndarray, names: Sequence[str], feet: Sequence[str | None], wrench: np.ndarray
) -> Finding | None:
    """Return the finding for impossible times (k,), declared feet (p,) or wrenches (k, p, 6) of plates, or None."""
    if wrong := _not_growing(time):
        return wrong
    if len(set(names)) != len(names):
        problem = Quantity("each needs a name of its own")
        return finding("F173", names=Quantity(", ".join(names)), problem=problem)
    if odd := [(name, foot) for name, foot in zip(names, feet, strict=True) if foot not in ("r", "l", None)]:
        name, foot = odd[0]
        return finding(
            "F173",
            Where(plate=name),
            names=Quantity(name),
            problem=Quantity(f"declared_feet has {foot!r} in place of 'r', 'l' or None"),
        )
    lost = np.argwhere(~np.isfinite(wrench))
    if len(lost):
        sample, plate, _ = lost[0]
        return impossible_load(names[plate], "force or moment", float(time[sample]))
    return None


def impossible_position(label: str, position_m: float, time_s: float, limit_m: float | None = None) -> Finding:
    """Make the finding that a marker is outside any laboratory (F171)."""
    where = Where(markers=(label,), span_s=(time_s, time_s))
    position = Quantity(position_m, "m", limit=limit_m)
    return with_evidence("F171", where, {"position_m": position, **_at(time_s)})


def impossible_load(plate: str, what: str, time_s: float, **size: Quantity) -> Finding:
    """Make the finding that a force or moment of a plate is not a number, or larger than any plate measures (F172)."""
    found = Quantity("no number" if not size else "more than any plate measures")
    where = Where(plate=plate, span_s=(time_s, time_s))
    return with_evidence("F172", where, {**size, **_at(time_s), "what": Quantity(what), "found": found})


def _at(time_s: float) -> dict[str, Quantity]:
    """Return a time as evidence: as a number, and as text precise enough to find its row."""
    return {"time_s": Quantity(time_s, "s"), "time": Quantity(f"{time_s:.6g} s")}


def step_evidence(before: float, after: float, usual: float) -> dict[str, Quantity]:
    """Return evidence of T101: a step between two times and the usual one (s), and the times to find their rows by."""
    steps = {"step_s": after - before, "usual_s": usual, "time_s": before}
    known = {name: Quantity(float(value), "s") for name, value in steps.items() if np.isfinite(value)}
    times = {"before": before, "after": after, "usual": usual}
    return known | {
        name: Quantity(f"{value:.6g} s" if np.isfinite(value) else "no number") for name, value in times.items()
    }


def _not_growing(time: np.ndarray) -> Finding | None:
    """Return the finding for the first time that is not a number or not later than the one before, or None."""
    steps = np.diff(time)
    odd = np.flatnonzero(~(steps > 0.0))
    if odd.size:
        known = steps[np.isfinite(steps)]
        usual = float(np.median(known)) if known.size else float("nan")
        return with_evidence("T101", Where(), step_evidence(time[odd[0]], time[odd[0] + 1], usual))
    if not np.isfinite(time).all():
        return with_evidence("T101", Where(), step_evidence(time[0], time[-1], float("nan")))
    return None


def gaussian_mean(values: npt.NDArray[np.float64], deviation: float) -> npt.NDArray[np.float64]:
    """Compute the mean of values (n, ...) weighted by a Gaussian of this SD (samples); the ends are continued.

    Examples:
        >>> gaussian_mean(np.array([0.0, 0.0, 1.0, 0.0, 0.0]), 0.5).round(3).tolist()
        [0.0, 0.106, 0.787, 0.106, 0.0]
    """
    radius = int(_DEVIATIONS * deviation + 0.5)
    weights = np.exp(-0.5 / (deviation * deviation) * np.arange(-radius, radius + 1) ** 2)
    weights /= weights.sum()
    around, count = _with_ends(values, radius), len(values)
    result: npt.NDArray[np.float64] = around[radius : radius + count] * weights[radius]
    for k in range(radius):
        result += (around[k : k + count] + around[2 * radius - k : 2 * radius - k + count]) * weights[k]
    return result


def even_mean(values: npt.NDArray[np.float64], size: int) -> npt.NDArray[np.float64]:
    """Compute the mean of values (n, ...) over an odd number of samples; the ends are continued.

    Examples:
        >>> even_mean(np.array([0.0, 0.0, 3.0, 0.0, 0.0]), 3).tolist()
        [0.0, 1.0, 1.0, 1.0, 0.0]
    """
    around = _with_ends(values, size // 2)
    steps = np.concatenate([np.cumsum(around[:size], axis=0)[-1:], around[size:] - around[:-size]])
    return np.cumsum(steps, axis=0) / size


def greatest(values: npt.NDArray[np.float64], size: int) -> npt.NDArray[np.float64]:
    """Compute the maximum of values (n, ...) over an odd number of samples.

    Examples:
        >>> greatest(np.array([0.0, 0.0, 3.0, 0.0, 1.0]), 3).tolist()
        [0.0, 3.0, 3.0, 3.0, 1.0]
    """
    around = np.lib.stride_tricks.sliding_window_view(_with_ends(values, size // 2), size, axis=0)
    result: npt.NDArray[np.float64] = around.max(axis=-1)
    return result


def all_around(known: npt.NDArray[np.bool_], size: int) -> npt.NDArray[np.bool_]:
    """Return whether (n, ...) all of an odd number of samples are True; beyond the ends all are False.

    Examples:
        >>> all_around(np.array([True, True, True, True, False, True]), 3).tolist()
        [False, True, True, False, False, False]
    """
    beyond = np.ones((size // 2, *known.shape[1:]), dtype=bool)
    none = np.zeros((1, *known.shape[1:]), dtype=bool)
    unknown = np.cumsum(np.concatenate([none, beyond, ~known, beyond]), axis=0)
    result: npt.NDArray[np.bool_] = unknown[size:] == unknown[:-size]
    return result


def _with_ends(values: npt.NDArray[np.float64], count: int) -> npt.NDArray[np.float64]:
    return np.concatenate([np.repeat(values[:1], count, axis=0), values, np.repeat(values[-1:], count, axis=0)])
