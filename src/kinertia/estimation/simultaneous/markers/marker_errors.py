"""Holds the visible markers of a trial, and the information of errors that are correlated over time.

The errors of a marker coordinate are a second-order autoregressive process with the poles r and s,

    e[t] = (r + s) e[t-1] - r s e[t-2] + white noise,

with the same standard deviation in every frame. The inverse of its covariance, the information, is banded: a frame is
coupled to itself and the two on either side, so the normal matrix stays banded, too. The process starts again after a
gap.

Skin motion is slow. With s = 0, a first-order process, the spectrum falls only with the square of the frequency: marker
errors would affect the accelerations, and with them joint moments, more than they do. With s = r it falls with the
fourth power. But every frame has camera noise, and for long-lasting errors, as in a slow movement or a posture, such a
spectrum would fall below it: the estimate would follow the noise. So s is as close to r as the observed innovation of
the errors allows, the part of a frame's error that the two previous frames do not predict.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from kinertia.estimation.simultaneous.markers.skin import SkinPatterns
from kinertia.model.compiled import Float1, Float2, Float3, Int1, compiled, part
from kinertia.model.kinematic_tree import KinematicTree, hand_down, inner, place_axes
from kinertia.model.skeleton import Skeleton
from kinertia.motion.marker_sums import add_force, place_marker

LATER = 2
"""Number of later frames to which a frame is coupled in the information."""
_STEPS = 32
"""Number of processes tried between a double pole and white noise."""


class ErrorProcess(NamedTuple):
    """Poles of the process, the larger first; white noise has none.

    >>> process = ErrorProcess.double_over(9.0)
    >>> round(process.larger, 3), process.larger == process.smaller, round(process.frames, 6)
    (0.571, True, 9.0)
    """

    larger: float = 0.0
    smaller: float = 0.0

    @classmethod
    def double_over(cls, frames: float) -> Self:
        """Return the process with a double pole that is correlated over so many neighbouring frames.

        The number of frames is the sum of its correlations over all lags: (1 + r)^3 / ((1 + r^2) (1 - r)).
        """
        if frames <= 1.0:
            return cls()
        roots = np.roots([1.0 + frames, 3.0 - frames, 3.0 + frames, 1.0 - frames])
        real = roots[np.abs(roots.imag) < 1e-9].real
        r = float(real[(real >= 0.0) & (real < 1.0)][0])
        return cls(r, r)

    @classmethod
    def with_smaller(cls, smaller: float, frames: float) -> Self:
        """Return the process with this smaller pole s that is correlated over so many neighbouring frames.

        The number of frames is (1 - r s) (1 + r) (1 + s) / ((1 + r s) (1 - r) (1 - s)).
        """
        more = frames * (1.0 - smaller) / (1.0 + smaller)
        half = (1.0 - smaller) * (1.0 + more)
        larger = 2.0 * (more - 1.0) / (half + np.sqrt(half**2 + 4.0 * smaller * (more - 1.0) ** 2))
        return cls(float(larger), smaller)

    @property
    def of_before(self) -> tuple[float, float]:
        """Coefficients of a frame's error on those of the frame before it and of the second before it."""
        return self.larger + self.smaller, -self.larger * self.smaller

    @property
    def new(self) -> float:
        """Innovation variance of a process of unit variance: what the two frames before do not predict."""
        lag1, lag2 = self.of_before
        return (1.0 + lag2) * ((1.0 - lag2) ** 2 - lag1**2) / (1.0 - lag2)

    @property
    def frames(self) -> float:
        """Number of neighbouring frames over which its errors are correlated."""
        lag1, lag2 = self.of_before
        return self.new / (1.0 - lag1 - lag2) ** 2

    @classmethod
    def read(cls, frames: float, products: np.ndarray) -> tuple[Self, float]:
        """Fit the slowest process with as much innovation per frame as the errors have; return it with its variance.

        The errors have unit variance and are correlated over so many frames. If even a first-order process has too
        little innovation, a shorter one is used with proportionally larger variance: the information on what does not
        vary stays equal.

        Args:
            frames: number of frames over which the errors are correlated.
            products: (k, 3, 3) mean products of the errors of a frame and of the two before it, for several kinds of
                errors; the largest innovation counts.
        """
        double = cls.double_over(frames)
        slow = [cls.with_smaller(float(s), frames) for s in np.linspace(double.smaller, 0.0, _STEPS)[1:]]
        short = [cls.with_smaller(0.0, float(f)) for f in np.geomspace(max(frames, 1.0), 1.0, _STEPS)[1:]]
        for process in (double, *slow, *short):
            variance = frames / process.frames
            beyond = np.array([1.0, *(-coefficient for coefficient in process.of_before)])
            if np.max(beyond @ products @ beyond) <= variance * process.new:
                break
        return process, max(variance, 1.0)


@dataclass(frozen=True)
class ErrorInformation:
    """Inverse covariance of the errors of m markers over n frames; the three axes are independent and alike.

    Attributes:
        same: (n, m) of each frame with itself, 1 / m^2; zero where the marker is not seen.
        next: (n - 1, m) of each frame with the one after it.
        second: (n - 2, m) of each frame with the second after it.
    """

    same: np.ndarray
    next: np.ndarray
    second: np.ndarray

    @classmethod
    def of(cls, seen: np.ndarray, sd_m: np.ndarray, process: ErrorProcess) -> Self:
        """Compute the information for markers seen (n, m), with standard deviations sd_m (m,)."""
        lag1, lag2 = process.of_before
        n, m = seen.shape
        diagonal, after, second = np.zeros((n, m)), np.zeros((max(n - 1, 0), m)), np.zeros((max(n - 2, 0), m))
        three = (seen[2:] & seen[1:-1] & seen[:-2]) / process.new
        # correlation of neighbours
        alike = lag1 / (1.0 - lag2)
        diagonal[2:] += three
        diagonal[1:-1] += lag1 * lag1 * three
        diagonal[:-2] += lag2 * lag2 * three
        after[1:] -= lag1 * three
        after[:-1] += lag1 * lag2 * three
        second -= lag2 * three
        before = np.vstack([np.zeros((1, m), dtype=bool), seen[:-1]])
        # the first two frames after a gap
        pair = (seen[1:] & seen[:-1] & ~before[:-1]) / (1.0 - alike * alike)
        diagonal[:-1] += pair
        diagonal[1:] += pair
        after -= alike * pair
        diagonal += seen & ~before & ~np.vstack([seen[1:], np.zeros((1, m), dtype=bool)])
        weight = 1.0 / np.square(sd_m)
        return cls(diagonal * weight, after * weight, second * weight)


class SeenMarkers(NamedTuple):
    """Markers of a trial and the axes that move them.

    Attributes:
        tree: the skeleton.
        column: (a,) index of each axis' coordinate among those that move, then those that do not.
        at, slopes: (n, a) values of the axes, rad or m, and their derivatives by the coordinates.
        last_axis: (m,) the last axis that moves each marker.
        local: (n, m, 3) m, the markers in the frames of these axes, displaced with the skin.
        turned: (m, 3, 3) the segments' axes in these frames.
        measured: (n, m, 3) m; NaN where not seen.
        same, next, second: as in `ErrorInformation`.
        patterns, first, last: as in `SkinPatterns`.
        columns: (m,) index at which the coefficients of each marker begin among the columns of S.
    """

    tree: KinematicTree
    column: Int1
    at: Float2
    slopes: Float2
    last_axis: Int1
    local: Float3
    turned: Float3
    measured: Float3
    same: Float2
    next: Float2
    second: Float2
    patterns: Float2
    first: Int1
    last: Int1
    columns: Int1


class PlacedMarkers(NamedTuple):
    """Axes and markers in five neighbouring frames, overwritten in turn.

    Axes (5, a, 6); positions (5, m, 3) m, errors (5, m, 3) m (zero where not seen) and segment axes (5, m, 3, 3) of the
    markers.
    """

    axes: np.ndarray
    places: np.ndarray
    errors: np.ndarray
    turned: np.ndarray


def seen_markers(
    skeleton: Skeleton,
    measured: np.ndarray,
    q: np.ndarray,
    deviation: tuple[np.ndarray, ErrorProcess],
    skin: tuple[SkinPatterns, np.ndarray],
    moving: np.ndarray,
    still: np.ndarray,
) -> SeenMarkers:
    """Collect the markers at the coordinates q, with the information on their errors.

    Args:
        skeleton: with static coordinates free.
        measured: (n, m, 3) m; NaN where not seen.
        q: (n, c) rad and m.
        deviation: (m,) standard deviation of each marker's errors, m, and their process from frame to frame.
        skin: its patterns in the same frames, and the coefficients (k,).
        moving, still: columns of q that move in time, and that do not.
    """
    information = ErrorInformation.of(np.isfinite(measured).all(axis=-1), *deviation)
    place = np.empty(q.shape[1], dtype=np.int64)
    place[np.concatenate([moving, still])] = np.arange(q.shape[1])
    at, slopes = skeleton.map.places_and_slopes(q)
    last_axis, local = skeleton.carried_markers
    turned = skeleton.tree.segment_rotation[skeleton.marker_segments]
    patterns, coefficients = skin
    along_axes = np.repeat(turned, patterns.last - patterns.first, axis=0) @ coefficients.reshape(-1, 3, 1)
    return SeenMarkers(
        skeleton.tree,
        place[skeleton.map.owner],
        at,
        slopes,
        last_axis,
        local + patterns.displaced(along_axes.ravel()),
        np.ascontiguousarray(turned),
        np.ascontiguousarray(measured),
        information.same,
        information.next,
        information.second,
        np.ascontiguousarray(patterns.values),
        patterns.first,
        patterns.last,
        len(still) + 3 * len(last_axis) + patterns.begin[:-1],
    )


@part
def place_markers(markers: SeenMarkers, k: int, placed: PlacedMarkers) -> None:
    """Compute axes and markers of frame k."""
    a, here = len(markers.column), k % 5
    rotation, translation = np.empty((a, 3, 3)), np.empty((a, 3))
    place_axes(markers.tree, markers.at[k], rotation, translation, placed.axes[here])
    places, errors, turned = placed.places[here], placed.errors[here], placed.turned[here]
    for m in range(len(markers.last_axis)):
        j = markers.last_axis[m]
        place_marker(rotation[j], translation[j], markers.local[k, m], places[m])
        for r in range(3):
            errors[m, r] = markers.measured[k, m, r] - places[m, r] if markers.same[k, m] > 0.0 else 0.0
            for i in range(3):
                turned[m, r, i] = 0.0
                for h in range(3):
                    turned[m, r, i] += rotation[j, r, h] * markers.turned[m, h, i]


@compiled
def add_gradient(
    markers: SeenMarkers,
    first: Int1,
    values: Float2,
    rows: tuple[int, int],
    still: int,
    rhs: Float2,
    static_rhs: Float1,
) -> float:
    """Add J^T W r (size, c) and S^T W r (s,) of frames own[0] to own[1] - 1, and return r^T W r.

    Arguments are as in `marker_terms`.
    """
    n, m = markers.same.shape
    start, stop = rows
    c, a = rhs.shape[1], len(markers.column)
    placed = PlacedMarkers(np.empty((5, a, 6)), np.empty((5, m, 3)), np.empty((5, m, 3)), np.empty((5, m, 3, 3)))
    pull, forces, cost = np.empty((m, 3)), np.empty((a, 6)), 0.0
    for k in range(max(start - LATER, 0), min(start + LATER, n)):
        place_markers(markers, k, placed)
    for k in range(start, stop):
        if k + LATER < n:
            place_markers(markers, k + LATER, placed)
        cost += _pulls(markers, k, placed, pull)
        axes, turned = placed.axes[k % 5], placed.turned[k % 5]
        forces[:] = 0.0
        for i in range(m):
            add_force(pull[i], placed.places[k % 5, i], forces[markers.last_axis[i]])
            skin = markers.columns[i] - 3 * markers.first[i]
            for r in range(3):
                along = turned[i, 0, r] * pull[i, 0] + turned[i, 1, r] * pull[i, 1] + turned[i, 2, r] * pull[i, 2]
                static_rhs[still + 3 * i + r] += along
                for g in range(markers.first[i], markers.last[i]):
                    static_rhs[skin + 3 * g + r] += markers.patterns[k, g] * along
        hand_down(markers.tree.parent, forces)
        for j in range(a):
            force = markers.slopes[k, j] * inner(axes, j, forces, j)
            if markers.column[j] < c:
                for i in range(6):
                    rhs[first[k] + i, markers.column[j]] += values[k, i] * force
            else:
                static_rhs[markers.column[j] - c] += force
    return cost


@part
def _pulls(markers: SeenMarkers, k: int, placed: PlacedMarkers, pull: np.ndarray) -> float:
    """Write W r (m, 3) of frame k, and return its r^T W r."""
    n, m = markers.same.shape
    cost, here = 0.0, placed.errors[k % 5]
    for i in range(m):
        for r in range(3):
            value = markers.same[k, i] * here[i, r]
            if k >= 1:
                value += markers.next[k - 1, i] * placed.errors[(k - 1) % 5, i, r]
            if k >= 2:
                value += markers.second[k - 2, i] * placed.errors[(k - 2) % 5, i, r]
            if k + 1 < n:
                value += markers.next[k, i] * placed.errors[(k + 1) % 5, i, r]
            if k + 2 < n:
                value += markers.second[k, i] * placed.errors[(k + 2) % 5, i, r]
            pull[i, r] = value
            cost += value * here[i, r]
    return cost
