"""Terms of the markers in a trial's normal equations, for errors that are alike from frame to frame.

The errors of a marker coordinate are a first-order autoregressive process: e[t] = a e[t-1] + white noise, with the same
deviation in every frame. The inverse of its covariance, the information, is tridiagonal in time: a
frame sees itself and its two neighbours, so the normal matrix stays banded. A gap starts the process anew.

Slow skin motion (a near one) counts for few independent frames where the motion is slow, and hardly disturbs what is
fast: accelerations, which the forces answer to.

With J the derivative of the markers by the coordinates that move, S that by what does not (static coordinates, then
marker positions), r = measured - model and W the information, the terms are J^T W J, J^T W S, J^T W r, S^T W S and
S^T W r. They are summed over the frames of a knot interval, in which the same six splines are active, and seven with
the frame after it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.knot_interval import Interval, longest_run, to_border, to_splines
from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.normal_equations import NormalEquations
from kinertia.estimation.simultaneous.stretches import Stretch
from kinertia.model.compiled import compiled
from kinertia.model.kinematic_tree import KinematicTree, hand_down, place_axes
from kinertia.model.skeleton import Skeleton
from kinertia.model.spatial import inner
from kinertia.motion.marker_sums import add_force, add_marker, met_force, place_marker, swapped


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


class _Static(NamedTuple):
    """S^T W S (k + 3 m, k + 3 m), S^T W r (k + 3 m,) and r^T W r (1,)."""

    square: np.ndarray
    right: np.ndarray
    cost: np.ndarray


def add_markers(
    normal: NormalEquations,
    columns: slice,
    basis: MotionBasis,
    stretch: Stretch,
    skeleton: Skeleton,
    measured: np.ndarray,
    q: np.ndarray,
    deviation: tuple[np.ndarray, float],
    moving: np.ndarray,
    still: np.ndarray,
) -> None:
    """Add the terms of the markers in one stretch of a trial, at the coordinates q, to its normal equations.

    Args:
        normal: zero, or with other terms.
        columns: of the static unknowns, those that markers depend on.
        basis: of the motion.
        stretch: of the trial.
        skeleton: with static coordinates free.
        measured: (n, m, 3) m, in the stretch with its neighbours; NaN where not seen.
        q: (n, c) rad and m, in the same frames.
        deviation: (m,) of each marker's errors, m, and their correlation between neighbouring frames.
        moving, still: columns of q that move in time, and that do not.
    """
    information = ErrorInformation.of(np.isfinite(measured).all(axis=-1), *deviation)
    place = np.empty(q.shape[1], dtype=np.int64)
    place[np.concatenate([moving, still])] = np.arange(q.shape[1])
    at, slopes = skeleton.map.places_and_slopes(q)
    carrier, local = skeleton.carried_markers
    markers = _Markers(
        skeleton.tree,
        place[skeleton.map.owner],
        at,
        slopes,
        carrier,
        local,
        np.ascontiguousarray(skeleton.tree.segment_rotation[skeleton.marker_segments]),
        np.ascontiguousarray(measured),
        np.ascontiguousarray(information.own),
        np.ascontiguousarray(information.next),
    )
    border = normal.border[..., columns]
    static = _Static(normal.static[columns, columns], normal.static_right[columns], np.zeros(1))
    near = stretch.with_neighbours
    own = (stretch.frames.start - near.start, stretch.frames.stop - near.start)
    first, values = basis.first[near] - stretch.splines.start, basis.values[0][near]
    _add(markers, first, values, own, len(still), normal.band, border, normal.right, static)
    normal.cost += 0.5 * float(static.cost[0])


@compiled
def _add(
    markers: _Markers,
    first: np.ndarray,
    values: np.ndarray,
    own: tuple[int, int],
    still: int,
    band: np.ndarray,
    border: np.ndarray,
    right: np.ndarray,
    static: _Static,
) -> None:
    """Frames own[0] to own[1] - 1, interval by interval, and each with the next; `first` and `values` are the motion
    basis'.
    """
    n, m = markers.own.shape
    start, stop = own
    c, a, s = band.shape[2], len(markers.column), border.shape[2]
    placed = _Placed(np.empty((3, a, 6)), np.empty((3, m, 3)), np.empty((3, m, 3)), np.empty((3, m, 3, 3)))
    most = longest_run(first)
    interval = Interval(np.empty((3, most, c * c)), np.zeros((most + 1, c, s)), np.empty((most, c)))
    if start > 0:
        _place(markers, start - 1, placed)
    _place(markers, start, placed)
    while start < stop:
        end = start + 1
        while end < stop and first[end] == first[start]:
            end += 1
        interval.squares[:] = 0.0
        interval.gradient[:] = 0.0
        interval.across[1:] = 0.0
        for k in range(start, end):
            if k + 1 < n:
                _place(markers, k + 1, placed)
            _frame(markers, k, k - start, still, placed, interval, static)
            if k + 1 < n:
                _pair(markers, k, k - start, placed, interval, static)
        to_splines(first, values, start, end, interval, band, border, right)
        interval.across[0] = interval.across[end - start]
        start = end
    if stop < n:
        # of the frame after them, only what it has in common with the last
        to_border(first[stop], values[stop], interval.across[0], border)


@compiled
def _place(markers: _Markers, k: int, placed: _Placed) -> None:
    """Axes and markers of frame k."""
    a, here = len(markers.column), k % 3
    rotation, translation = np.empty((a, 3, 3)), np.empty((a, 3))
    place_axes(markers.tree, markers.at[k], rotation, translation, placed.axes[here])
    places, errors, turned = placed.places[here], placed.errors[here], placed.turned[here]
    for m in range(len(markers.carrier)):
        j = markers.carrier[m]
        place_marker(rotation[j], translation[j], markers.local[m], places[m])
        for r in range(3):
            errors[m, r] = markers.measured[k, m, r] - places[m, r] if markers.own[k, m] > 0.0 else 0.0
            for i in range(3):
                turned[m, r, i] = 0.0
                for h in range(3):
                    turned[m, r, i] += rotation[j, r, h] * markers.turned[m, h, i]


@compiled
def _frame(
    markers: _Markers, k: int, row: int, still: int, placed: _Placed, interval: Interval, static: _Static
) -> None:
    """J^T W J of frame k with itself; J^T W S of marker positions and J^T W r, W r being of three frames."""
    a, m, here = len(markers.column), len(markers.carrier), k % 3
    pull, directions = np.zeros((m, 3)), np.zeros((m, 3, 3))
    for offset in range(-1, 2):
        _informed(markers, k, offset, placed, pull, directions)
    sums, forces, met = np.zeros((a, 16)), np.zeros((a, 6)), np.empty((1, 6))
    for i in range(m):
        at = placed.places[here, i]
        add_marker(markers.own[k, i], at, at, sums[markers.carrier[i]])
        add_force(pull[i], at, forces[markers.carrier[i]])
    _by_place(markers, k, row, still, placed, pull, directions, interval, static)
    hand_down(markers.tree.parent, sums)
    hand_down(markers.tree.parent, forces)
    parent, column, slopes, axes = markers.tree.parent, markers.column, markers.slopes, placed.axes[here]
    c, gradient = interval.gradient.shape[1], interval.gradient[row]
    product = np.zeros((a, a))
    for j in range(a):
        force = slopes[k, j] * inner(axes, j, forces, j)
        if column[j] < c:
            gradient[column[j]] += force
        else:
            static.right[column[j] - c] += force
        met_force(sums, j, axes, j, met)
        i = j
        while i >= 0:
            value = slopes[k, j] * slopes[k, i] * inner(axes, i, met, 0)
            product[i, j] = value
            product[j, i] = value
            i = parent[i]
    _sort(column, product, interval.squares[0, row], interval.across[row], static.square)


@compiled
def _informed(
    markers: _Markers, k: int, offset: int, placed: _Placed, pull: np.ndarray, directions: np.ndarray
) -> None:
    """Add what the frame at this offset from k gives of W r (m, 3) and W times the segments' axes (m, 3, 3)."""
    if k + offset < 0 or k + offset >= len(markers.own):
        return
    weights = markers.own[k] if offset == 0 else markers.next[min(k, k + offset)]
    errors, turned = placed.errors[(k + offset) % 3], placed.turned[(k + offset) % 3]
    for m in range(len(weights)):
        for r in range(3):
            pull[m, r] += weights[m] * errors[m, r]
            for i in range(3):
                directions[m, r, i] += weights[m] * turned[m, r, i]


@compiled
def _by_place(
    markers: _Markers,
    k: int,
    row: int,
    still: int,
    placed: _Placed,
    pull: np.ndarray,
    directions: np.ndarray,
    interval: Interval,
    static: _Static,
) -> None:
    """Terms of the markers' positions in their segments: across the coordinates, with themselves, and of r."""
    c, here = interval.gradient.shape[1], k % 3
    parent, column, slopes = markers.tree.parent, markers.column, markers.slopes
    axes, at, turned, errors = placed.axes[here], placed.places[here], placed.turned[here], placed.errors[here]
    across, square, right, d = interval.across[row], static.square, static.right, directions
    moments = np.empty((3, 3))
    for m in range(len(markers.carrier)):
        first = still + 3 * m
        for i in range(3):
            moments[0, i] = at[m, 1] * d[m, 2, i] - at[m, 2] * d[m, 1, i]
            moments[1, i] = at[m, 2] * d[m, 0, i] - at[m, 0] * d[m, 2, i]
            moments[2, i] = at[m, 0] * d[m, 1, i] - at[m, 1] * d[m, 0, i]
            static.cost[0] += errors[m, i] * pull[m, i]
            for r in range(3):
                right[first + i] += turned[m, r, i] * pull[m, r]
                for h in range(3):
                    square[first + h, first + i] += turned[m, r, h] * d[m, r, i]
        j = markers.carrier[m]
        while j >= 0:
            for i in range(3):
                value = 0.0
                for r in range(3):
                    value += axes[j, r] * d[m, r, i] + axes[j, 3 + r] * moments[r, i]
                value *= slopes[k, j]
                if column[j] < c:
                    across[column[j], first + i] += value
                else:
                    square[column[j] - c, first + i] += value
                    square[first + i, column[j] - c] += value
            j = parent[j]


@compiled
def _pair(markers: _Markers, k: int, row: int, placed: _Placed, interval: Interval, static: _Static) -> None:
    """J^T W J of frame k with the next."""
    a, here, there = len(markers.column), k % 3, (k + 1) % 3
    sums, met = np.zeros((a, 16)), np.empty((1, 6))
    for m in range(len(markers.carrier)):
        add_marker(markers.next[k, m], placed.places[here, m], placed.places[there, m], sums[markers.carrier[m]])
    hand_down(markers.tree.parent, sums)
    back = swapped(sums)
    parent, column, slopes = markers.tree.parent, markers.column, markers.slopes
    axes, later = placed.axes[here], placed.axes[there]
    product = np.zeros((a, a))
    for j in range(a):
        # what axis j carries meets it, and all axes before it, in the other frame
        met_force(sums, j, later, j, met)
        i = j
        while i >= 0:
            product[i, j] = slopes[k + 1, j] * slopes[k, i] * inner(axes, i, met, 0)
            i = parent[i]
        met_force(back, j, axes, j, met)
        i = parent[j]
        while i >= 0:
            product[j, i] = slopes[k, j] * slopes[k + 1, i] * inner(later, i, met, 0)
            i = parent[i]
    _sort(column, product, interval.squares[1, row], interval.across[row], static.square)
    _sort(column, product.T, interval.squares[2, row], interval.across[row + 1], static.square)


@compiled
def _sort(column: np.ndarray, product: np.ndarray, squares: np.ndarray, across: np.ndarray, square: np.ndarray) -> None:
    """Add products (a, a) of axes to where their coordinates belong: the first in a frame, the second in any.

    Args:
        column: (a,) as `_Markers` has it.
        product: of the first's axes (rows) with the second's.
        squares: (c c,) where both coordinates move.
        across: (c, s) of the first's frame, where the second does not move.
        square: (s, s) where neither does.
    """
    a, c = len(column), len(across)
    for i in range(a):
        for j in range(a):
            value = product[i, j]
            if value != 0.0:
                if column[i] < c:
                    if column[j] < c:
                        squares[column[i] * c + column[j]] += value
                    else:
                        across[column[i], column[j] - c] += value
                elif column[j] >= c:
                    square[column[i] - c, column[j] - c] += value
