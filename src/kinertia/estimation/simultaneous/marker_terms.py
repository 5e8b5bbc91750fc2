"""Terms of the markers in a trial's normal equations, for errors that are alike from frame to frame.

The errors of a marker coordinate are a first-order autoregressive process: e[t] = a e[t-1] + white noise, with the same
deviation in every frame. The inverse of its covariance, the information, is tridiagonal in time: a
frame sees itself and its two neighbours, so the normal matrix stays banded. A gap starts the process anew.

Slow skin motion (a near one) counts for few independent frames where the motion is slow, and hardly disturbs what is
fast: accelerations, which the forces answer to.

With J the derivative of the markers by the coordinates that move, S that by what does not (static coordinates, then
marker positions), r = measured - model and W the information, the terms are J^T W J, J^T W S, J^T W r, S^T W S and
S^T W r. They are summed over the frames of a knot interval, in which the same six splines are active, and seven with the
frame after it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK, NormalEquations
from kinertia.model.compiled import compiled
from kinertia.model.kinematic_tree import KinematicTree, place_axes
from kinertia.model.skeleton import Skeleton
from kinertia.model.spatial import inner
from kinertia.motion.marker_sums import add_force, add_marker, hand_down, met_force, place_marker, swapped

_TOGETHER = SPLINES_PER_BLOCK + 1


@dataclass(frozen=True)
class ErrorInformation:
    """Inverse covariance of the errors of m markers over n frames; the three axes are alike and independent.

    Attributes:
        own: (n, m) of each frame with itself, 1 / m^2; zero where the marker is not seen.
        next: (n - 1, m) of each frame with the one after it.
    """

    own: np.ndarray
    next: np.ndarray

    @classmethod
    def of(cls, seen: np.ndarray, sd_m: np.ndarray, autocorrelation: float) -> ErrorInformation:
        """Of markers seen (n, m), with deviations sd_m (m,) and this correlation between neighbouring frames."""
        both = seen[:-1] & seen[1:]
        a = autocorrelation
        own = seen.astype(float)
        own[1:] += a**2 / (1.0 - a**2) * both
        own[:-1] += a**2 / (1.0 - a**2) * both
        weight = 1.0 / np.square(sd_m)
        return cls(own * weight, -a / (1.0 - a**2) * both * weight)


class _Markers(NamedTuple):
    """Markers of a trial and the axes that move them.

    Attributes:
        tree: the skeleton.
        column: (a,) place of each axis' coordinate among those that move, then those that do not.
        at, slopes: (n, a) places of the axes, rad or m, and their derivatives by the coordinates.
        carrier: (m,) the axis that carries each marker.
        local: (m, 3) m, the markers in the frames of these axes.
        turned: (m, 3, 3) the segments' axes in these frames.
        measured: (n, m, 3) m; NaN where not seen.
        own, next: as `ErrorInformation` has them.
    """

    tree: KinematicTree
    column: np.ndarray
    at: np.ndarray
    slopes: np.ndarray
    carrier: np.ndarray
    local: np.ndarray
    turned: np.ndarray
    measured: np.ndarray
    own: np.ndarray
    next: np.ndarray


class _Placed(NamedTuple):
    """Three neighbouring frames, in turn: axes (3, a, 6), and of the markers the places (3, m, 3) m, the errors
    (3, m, 3) m (zero where not seen) and the axes of their segments (3, m, 3, 3)."""

    axes: np.ndarray
    places: np.ndarray
    errors: np.ndarray
    turned: np.ndarray


class _Interval(NamedTuple):
    """Terms of the frames of a knot interval, and of the one after them.

    Attributes:
        squares: (3, f, c c) J^T W J of each frame with itself, with the next, and the latter transposed.
        across: (f + 1, c, k + 3 m) J^T W S.
        gradient: (f, c) J^T W r.
    """

    squares: np.ndarray
    across: np.ndarray
    gradient: np.ndarray


class _Static(NamedTuple):
    """S^T W S (k + 3 m, k + 3 m), S^T W r (k + 3 m,) and r^T W r (1,)."""

    square: np.ndarray
    right: np.ndarray
    cost: np.ndarray


def add_markers(
    normal: NormalEquations,
    columns: slice,
    basis: MotionBasis,
    skeleton: Skeleton,
    measured: np.ndarray,
    q: np.ndarray,
    deviation: tuple[np.ndarray, float],
    moving: np.ndarray,
    still: np.ndarray,
) -> None:
    """Add the terms of the markers of one trial, at the coordinates q, to its normal equations.

    Args:
        normal: zero, or with other terms.
        columns: of the static unknowns, those that markers depend on.
        basis: of the motion.
        skeleton: with static coordinates free.
        measured: (n, m, 3) m; NaN where not seen.
        q: (n, c) rad and m.
        deviation: (m,) of each marker's errors, m, and their correlation between neighbouring frames.
        moving, still: columns of q that move in time, and that do not.
    """
    information = ErrorInformation.of(np.isfinite(measured).all(axis=-1), *deviation)
    place = np.empty(q.shape[1], dtype=np.int64)
    place[np.concatenate([moving, still])] = np.arange(q.shape[1])
    at, slopes = skeleton.map.axes(q), skeleton.map.slopes(q)
    carrier, local = skeleton.carried_markers
    markers = _Markers(
        skeleton.tree,
        place[skeleton.map.owner],
        np.ascontiguousarray(at),
        np.ones_like(at) if slopes is None else np.ascontiguousarray(slopes),
        carrier,
        local,
        np.ascontiguousarray(skeleton.tree.segment_rotation[skeleton.marker_segments]),
        np.ascontiguousarray(measured),
        information.own,
        information.next,
    )
    border = normal.border[..., columns]
    static = _Static(normal.static[columns, columns], normal.static_right[columns], np.zeros(1))
    _add(markers, basis.first, basis.values[0], len(still), normal.band, border, normal.right, static)
    normal.cost += 0.5 * float(static.cost[0])


@compiled
def _add(
    markers: _Markers,
    first: np.ndarray,
    values: np.ndarray,
    still: int,
    band: np.ndarray,
    border: np.ndarray,
    right: np.ndarray,
    static: _Static,
) -> None:
    """All frames, interval by interval; `first` and `values` are the motion basis'."""
    n, m = markers.own.shape
    c, a, s = band.shape[2], len(markers.column), border.shape[2]
    placed = _Placed(np.empty((3, a, 6)), np.empty((3, m, 3)), np.empty((3, m, 3)), np.empty((3, m, 3, 3)))
    most = _longest_run(first)
    interval = _Interval(np.empty((3, most, c * c)), np.zeros((most + 1, c, s)), np.empty((most, c)))
    _place(markers, 0, placed)
    start = 0
    while start < n:
        end = start + 1
        while end < n and first[end] == first[start]:
            end += 1
        interval.squares[:] = 0.0
        interval.gradient[:] = 0.0
        interval.across[1:] = 0.0
        for k in range(start, end):
            if k + 1 < n:
                _place(markers, k + 1, placed)
            _frame(markers, k, k - start, still, placed, interval, static)
            if k + 1 < n:
                _pair(markers, k, k - start, still, placed, interval, static)
        _to_splines(first, values, start, end, interval, band, border, right)
        interval.across[0] = interval.across[end - start]
        start = end


@compiled
def _longest_run(first: np.ndarray) -> int:
    """The most frames of an interval."""
    longest, run = 1, 1
    for k in range(1, len(first)):
        run = run + 1 if first[k] == first[k - 1] else 1
        longest = max(longest, run)
    return longest


@compiled
def _place(markers: _Markers, k: int, placed: _Placed) -> None:
    """Axes and markers of frame k."""
    a, here = len(markers.column), k % 3
    rotation, translation = np.empty((a, 3, 3)), np.empty((a, 3))
    place_axes(markers.tree, markers.at[k], rotation, translation, placed.axes[here])
    for m in range(len(markers.carrier)):
        j = markers.carrier[m]
        place_marker(rotation[j], translation[j], markers.local[m], placed.places[here, m])
        seen = markers.own[k, m] > 0.0
        for r in range(3):
            placed.errors[here, m, r] = markers.measured[k, m, r] - placed.places[here, m, r] if seen else 0.0
            for i in range(3):
                total = 0.0
                for h in range(3):
                    total += rotation[j, r, h] * markers.turned[m, h, i]
                placed.turned[here, m, r, i] = total


@compiled
def _frame(
    markers: _Markers, k: int, row: int, still: int, placed: _Placed, interval: _Interval, static: _Static
) -> None:
    """J^T W J of frame k with itself; J^T W S of marker positions and J^T W r, W r being of three frames."""
    a, here = len(markers.column), k % 3
    c = interval.gradient.shape[1]
    sums, forces, met = np.zeros((a, 16)), np.zeros((a, 6)), np.empty(6)
    pull, directions = np.empty(3), np.empty((3, 3))
    for m in range(len(markers.carrier)):
        weight = markers.own[k, m]
        if weight == 0.0:
            continue
        _informed(markers, k, m, placed, pull, directions)
        at = placed.places[here, m]
        add_marker(weight, at, at, sums[markers.carrier[m]])
        add_force(pull, at, forces[markers.carrier[m]])
        _by_place(markers, k, m, row, still, placed, directions, interval, static)
        for i in range(3):
            static.cost[0] += placed.errors[here, m, i] * pull[i]
            for r in range(3):
                static.right[still + 3 * m + i] += placed.turned[here, m, r, i] * pull[r]
    hand_down(markers.tree.parent, sums)
    hand_down(markers.tree.parent, forces)
    for j in range(a):
        axis, slope, column = placed.axes[here, j], markers.slopes[k, j], markers.column[j]
        force = slope * inner(axis, forces[j])
        if column < c:
            interval.gradient[row, column] += force
        else:
            static.right[column - c] += force
        met_force(sums[j], axis, met)
        _sort(slope * slope * inner(axis, met), column, column, row, row, c, 0, interval, static)
        i = markers.tree.parent[j]
        while i >= 0:
            value = slope * markers.slopes[k, i] * inner(placed.axes[here, i], met)
            _sort(value, column, markers.column[i], row, row, c, 0, interval, static)
            if (column < c and markers.column[i] < c) or (column >= c and markers.column[i] >= c):
                _sort(value, markers.column[i], column, row, row, c, 0, interval, static)
            i = markers.tree.parent[i]


@compiled
def _informed(markers: _Markers, k: int, m: int, placed: _Placed, pull: np.ndarray, directions: np.ndarray) -> None:
    """pull = (3,) W r and directions = (3, 3) W times the segment's axes, of marker m in frame k."""
    for offset in range(-1, 2):
        other = k + offset
        if other < 0 or other >= len(markers.own):
            weight = 0.0
        else:
            weight = markers.own[k, m] if offset == 0 else markers.next[min(k, other), m]
        there = other % 3
        for r in range(3):
            if offset == -1:
                pull[r] = 0.0
                directions[r] = 0.0
            if weight != 0.0:
                pull[r] += weight * placed.errors[there, m, r]
                for i in range(3):
                    directions[r, i] += weight * placed.turned[there, m, r, i]


@compiled
def _by_place(
    markers: _Markers,
    k: int,
    m: int,
    row: int,
    still: int,
    placed: _Placed,
    directions: np.ndarray,
    interval: _Interval,
    static: _Static,
) -> None:
    """Terms of marker m's position in its segment: across the coordinates, and with itself."""
    c, here, first = interval.gradient.shape[1], k % 3, still + 3 * m
    force = np.empty(6)
    for i in range(3):
        force[:] = 0.0
        add_force(directions[:, i], placed.places[here, m], force)
        j = markers.carrier[m]
        while j >= 0:
            value = markers.slopes[k, j] * inner(placed.axes[here, j], force)
            if markers.column[j] < c:
                interval.across[row, markers.column[j], first + i] += value
            else:
                static.square[markers.column[j] - c, first + i] += value
                static.square[first + i, markers.column[j] - c] += value
            j = markers.tree.parent[j]
        for h in range(3):
            for r in range(3):
                static.square[first + h, first + i] += placed.turned[here, m, r, h] * directions[r, i]


@compiled
def _sort(
    value: float,
    i: int,
    j: int,
    row_i: int,
    row_j: int,
    c: int,
    kind: int,
    interval: _Interval,
    static: _Static,
) -> None:
    """Add a term of the coordinates i, in one frame, and j, in the same or the next, to where it belongs."""
    if i < c and j < c:
        interval.squares[kind, row_i, i * c + j] += value
        if kind == 1:
            interval.squares[2, row_i, j * c + i] += value
    elif i < c:
        interval.across[row_i, i, j - c] += value
    elif j < c:
        interval.across[row_j, j, i - c] += value
    else:
        static.square[i - c, j - c] += value
        if kind == 1:
            static.square[j - c, i - c] += value


@compiled
def _pair(
    markers: _Markers, k: int, row: int, still: int, placed: _Placed, interval: _Interval, static: _Static
) -> None:
    """J^T W J of frame k with the next."""
    a, here, there, c = len(markers.column), k % 3, (k + 1) % 3, interval.gradient.shape[1]
    sums, back, met = np.zeros((a, 16)), np.empty(16), np.empty(6)
    for m in range(len(markers.carrier)):
        if markers.next[k, m] != 0.0:
            add_marker(markers.next[k, m], placed.places[here, m], placed.places[there, m], sums[markers.carrier[m]])
    hand_down(markers.tree.parent, sums)
    for j in range(a):
        # what axis j carries meets it, and all axes before it, in the other frame
        now, later, column = markers.slopes[k, j], markers.slopes[k + 1, j], markers.column[j]
        met_force(sums[j], placed.axes[there, j], met)
        i = j
        while i >= 0:
            value = later * markers.slopes[k, i] * inner(placed.axes[here, i], met)
            _sort(value, markers.column[i], column, row, row + 1, c, 1, interval, static)
            i = markers.tree.parent[i]
        swapped(sums[j], back)
        met_force(back, placed.axes[here, j], met)
        i = markers.tree.parent[j]
        while i >= 0:
            value = now * markers.slopes[k + 1, i] * inner(placed.axes[there, i], met)
            _sort(value, column, markers.column[i], row, row + 1, c, 1, interval, static)
            i = markers.tree.parent[i]


@compiled
def _to_splines(
    first: np.ndarray,
    values: np.ndarray,
    start: int,
    end: int,
    interval: _Interval,
    band: np.ndarray,
    border: np.ndarray,
    right: np.ndarray,
) -> None:
    """Weigh the terms of an interval with the splines that are active, two by two."""
    n, count, c, at = len(first), end - start, right.shape[1], first[start]
    weight = np.zeros((_TOGETHER, _TOGETHER, 3, count))
    for k in range(start, end):
        later = np.zeros(_TOGETHER)
        if k + 1 < n:
            later[first[k + 1] - at : first[k + 1] - at + 6] = values[k + 1]
        for i in range(6):
            for j in range(_TOGETHER):
                if j < 6:
                    weight[i, j, 0, k - start] = values[k, i] * values[k, j]
                weight[i, j, 1, k - start] += values[k, i] * later[j]
                weight[j, i, 2, k - start] += values[k, i] * later[j]
    size = len(band)
    for i in range(_TOGETHER):
        reach = min(_TOGETHER - i, size - at - i)
        if reach <= 0:
            break
        pairs = np.ascontiguousarray(weight[i, i : i + reach]).reshape(reach, 3 * count)
        squares = np.ascontiguousarray(interval.squares[:, :count]).reshape(3 * count, c * c)
        band[at + i, :reach] += np.dot(pairs, squares).reshape(reach, c, c)
    for i in range(6):
        for k in range(count):
            for j in range(c):
                right[at + i, j] += values[start + k, i] * interval.gradient[k, j]
                for s in range(border.shape[2]):
                    border[at + i, j, s] += values[start + k, i] * interval.across[k, j, s]
