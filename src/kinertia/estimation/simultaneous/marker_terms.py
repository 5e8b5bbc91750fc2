"""Terms of the markers in a trial's normal equations, for errors that are alike from frame to frame.

With J the derivative of the markers by the coordinates that move, S that by what does not (static coordinates, marker
positions, then coefficients of skin motion: `skin`), r = measured - model and W the information on the errors
(`marker_errors`), the terms are J^T W J, J^T W S, J^T W r, S^T W S and S^T W r. Frames meet the two after them. They
are summed over the frames of a knot interval, in which the same six splines are active, and seven with those after it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.knot_interval import Interval, longest_run, to_border, to_splines
from kinertia.estimation.simultaneous.marker_errors import LATER, ErrorInformation, ErrorProcess
from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.normal_equations import NormalEquations
from kinertia.estimation.simultaneous.skin import SkinPatterns
from kinertia.estimation.simultaneous.stretches import Stretch
from kinertia.model.compiled import compiled, part
from kinertia.model.kinematic_tree import KinematicTree, hand_down, place_axes
from kinertia.model.skeleton import Skeleton
from kinertia.model.spatial import inner
from kinertia.motion.marker_sums import add_force, add_marker, met_force, place_marker, swapped


class _Markers(NamedTuple):
    """Markers of a trial and the axes that move them.

    Attributes:
        tree: the skeleton.
        column: (a,) place of each axis' coordinate among those that move, then those that do not.
        at, slopes: (n, a) places of the axes, rad or m, and their derivatives by the coordinates.
        carrier: (m,) the axis that carries each marker.
        local: (n, m, 3) m, the markers in the frames of these axes, displaced with the skin.
        turned: (m, 3, 3) the segments' axes in these frames.
        measured: (n, m, 3) m; NaN where not seen.
        own, next, second: as `ErrorInformation` has them.
        patterns, first, last: as `SkinPatterns` has them.
        columns: (m,) where the coefficients of each marker begin among the columns of S.
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
    second: np.ndarray
    patterns: np.ndarray
    first: np.ndarray
    last: np.ndarray
    columns: np.ndarray


class _Placed(NamedTuple):
    """Five neighbouring frames, in turn: axes (5, a, 6), and of the markers the places (5, m, 3) m, the errors
    (5, m, 3) m (zero where not seen) and the axes of their segments (5, m, 3, 3)."""

    axes: np.ndarray
    places: np.ndarray
    errors: np.ndarray
    turned: np.ndarray


class _Static(NamedTuple):
    """S^T W S (s, s), S^T W r (s,) and r^T W r (1,)."""

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
    deviation: tuple[np.ndarray, ErrorProcess],
    skin: tuple[SkinPatterns, np.ndarray],
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
        deviation: (m,) of each marker's errors, m, and how they go from frame to frame.
        skin: its patterns in the same frames, and the coefficients (k,).
        moving, still: columns of q that move in time, and that do not.
    """
    information = ErrorInformation.of(np.isfinite(measured).all(axis=-1), *deviation)
    place = np.empty(q.shape[1], dtype=np.int64)
    place[np.concatenate([moving, still])] = np.arange(q.shape[1])
    at, slopes = skeleton.map.places_and_slopes(q)
    carrier, local = skeleton.carried_markers
    turned = skeleton.tree.segment_rotation[skeleton.marker_segments]
    patterns, coefficients = skin
    markers = _Markers(
        skeleton.tree,
        place[skeleton.map.owner],
        at,
        slopes,
        carrier,
        local + (turned @ patterns.displaced(coefficients)[..., None])[..., 0],
        np.ascontiguousarray(turned),
        np.ascontiguousarray(measured),
        information.own,
        information.next,
        information.second,
        np.ascontiguousarray(patterns.values),
        patterns.first,
        patterns.last,
        len(still) + 3 * len(carrier) + patterns.begin[:-1],
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
    """Frames own[0] to own[1] - 1, interval by interval, and each with the two after it; `first` and `values` are the
    motion basis'.
    """
    n, m = markers.own.shape
    start, stop = own
    c, a, s = band.shape[2], len(markers.column), border.shape[2]
    placed = _Placed(np.empty((5, a, 6)), np.empty((5, m, 3)), np.empty((5, m, 3)), np.empty((5, m, 3, 3)))
    most = longest_run(first)
    interval = Interval(np.empty(((1 + 2 * LATER) * most, c * c)), np.zeros((most + LATER, c, s)), np.empty((most, c)))
    for k in range(max(start - LATER, 0), min(start + LATER, n)):
        _place(markers, k, placed)
    while start < stop:
        end = start + 1
        while end < stop and first[end] == first[start]:
            end += 1
        interval.squares[:] = 0.0
        interval.gradient[:] = 0.0
        interval.across[LATER:] = 0.0
        for k in range(start, end):
            if k + LATER < n:
                _place(markers, k + LATER, placed)
            _frame(markers, k, k - start, still, placed, interval, static)
            for later in range(1, min(LATER, n - 1 - k) + 1):
                _pair(markers, k, later, k - start, placed, interval, static)
        to_splines(first, values, start, end, interval, band, border, right)
        for row in range(LATER):
            for j in range(c):
                for i in range(s):
                    interval.across[row, j, i] = interval.across[end - start + row, j, i]
        start = end
    for row in range(min(LATER, n - stop)):
        # of the frames after them, only what these have in common with the last
        to_border(first[stop + row], values[stop + row], interval.across[row], border)


@part
def _place(markers: _Markers, k: int, placed: _Placed) -> None:
    """Axes and markers of frame k."""
    a, here = len(markers.column), k % 5
    rotation, translation = np.empty((a, 3, 3)), np.empty((a, 3))
    place_axes(markers.tree, markers.at[k], rotation, translation, placed.axes[here])
    places, errors, turned = placed.places[here], placed.errors[here], placed.turned[here]
    for m in range(len(markers.carrier)):
        j = markers.carrier[m]
        place_marker(rotation[j], translation[j], markers.local[k, m], places[m])
        for r in range(3):
            errors[m, r] = markers.measured[k, m, r] - places[m, r] if markers.own[k, m] > 0.0 else 0.0
            for i in range(3):
                turned[m, r, i] = 0.0
                for h in range(3):
                    turned[m, r, i] += rotation[j, r, h] * markers.turned[m, h, i]


@part
def _frame(
    markers: _Markers, k: int, row: int, still: int, placed: _Placed, interval: Interval, static: _Static
) -> None:
    """J^T W J of frame k with itself; J^T W S of places and skin and J^T W r, W r being of five frames."""
    a, m, here = len(markers.column), len(markers.carrier), k % 5
    most = 1
    for i in range(m):
        most = max(most, 1 + markers.last[i] - markers.first[i])
    pull, directions = np.zeros((m, 3)), np.zeros((m, 3, 3 * most))
    for offset in range(-LATER, LATER + 1):
        _informed(markers, k, offset, placed, pull, directions)
    sums, forces, met = np.zeros((a, 16)), np.zeros((a, 6)), np.empty((a, 6))
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
            value = slopes[k, j] * slopes[k, i] * inner(axes, i, met, j)
            product[i, j] = value
            product[j, i] = value
            i = parent[i]
    _sort(column, product, interval.squares[row], interval.across[row], static.square)


@part
def _informed(
    markers: _Markers, k: int, offset: int, placed: _Placed, pull: np.ndarray, directions: np.ndarray
) -> None:
    """Add what the frame at this offset from k gives of W r (m, 3), and of W times the segments' axes (m, 3, 3 g): as
    they are, then times each pattern of the skin.
    """
    there = k + offset
    if there < 0 or there >= len(markers.own):
        return
    weights = markers.own[k]
    if abs(offset) == 1:
        weights = markers.next[min(k, there)]
    elif offset != 0:
        weights = markers.second[min(k, there)]
    errors, turned, patterns = placed.errors[there % 5], placed.turned[there % 5], markers.patterns[there]
    for m in range(len(weights)):
        count = markers.last[m] - markers.first[m]
        for r in range(3):
            pull[m, r] += weights[m] * errors[m, r]
            for i in range(3):
                value = weights[m] * turned[m, r, i]
                directions[m, r, i] += value
                for g in range(count):
                    directions[m, r, 3 + 3 * g + i] += value * patterns[markers.first[m] + g]


@part
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
    """Terms of the markers' positions in their segments and of the skin's coefficients: across the coordinates, with
    themselves, and of r.
    """
    c, here = interval.gradient.shape[1], k % 5
    parent, column, slopes = markers.tree.parent, markers.column, markers.slopes
    axes, at, turned, errors = placed.axes[here], placed.places[here], placed.turned[here], placed.errors[here]
    across, square, right = interval.across[row], static.square, static.right
    most = directions.shape[2]
    own, values, velocity = np.empty((3, most)), np.empty(most), np.empty(3)
    for m in range(len(markers.carrier)):
        d, place, first = directions[m], still + 3 * m, markers.first[m]
        # so many before the columns of the skin
        skin = markers.columns[m] - 3
        count = 3 + 3 * (markers.last[m] - first)
        for i in range(3):
            static.cost[0] += errors[m, i] * pull[m, i]
            along = turned[m, 0, i] * pull[m, 0] + turned[m, 1, i] * pull[m, 1] + turned[m, 2, i] * pull[m, 2]
            for j in range(count):
                own[i, j] = turned[m, 0, i] * d[0, j] + turned[m, 1, i] * d[1, j] + turned[m, 2, i] * d[2, j]
            for g in range(count // 3):
                pattern = 1.0 if g == 0 else markers.patterns[k, first + g - 1]
                one = i + (place if g == 0 else skin + 3 * g)
                right[one] += pattern * along
                for j in range(3):
                    square[one, place + j] += pattern * own[i, j]
                for j in range(3, count):
                    square[one, skin + j] += pattern * own[i, j]
        j = markers.carrier[m]
        while j >= 0:
            velocity[0] = axes[j, 0] + axes[j, 4] * at[m, 2] - axes[j, 5] * at[m, 1]
            velocity[1] = axes[j, 1] + axes[j, 5] * at[m, 0] - axes[j, 3] * at[m, 2]
            velocity[2] = axes[j, 2] + axes[j, 3] * at[m, 1] - axes[j, 4] * at[m, 0]
            for i in range(count):
                values[i] = slopes[k, j] * (velocity[0] * d[0, i] + velocity[1] * d[1, i] + velocity[2] * d[2, i])
            if column[j] < c:
                for i in range(3):
                    across[column[j], place + i] += values[i]
                for i in range(3, count):
                    across[column[j], skin + i] += values[i]
            else:
                for i in range(count):
                    one = i + (place if i < 3 else skin)
                    square[column[j] - c, one] += values[i]
                    square[one, column[j] - c] += values[i]
            j = parent[j]


@part
def _pair(
    markers: _Markers, k: int, later: int, row: int, placed: _Placed, interval: Interval, static: _Static
) -> None:
    """J^T W J of frame k with the one so many frames later."""
    a, here, there = len(markers.column), k % 5, (k + later) % 5
    sums, met = np.zeros((a, 16)), np.empty((a, 6))
    weights = markers.next[k] if later == 1 else markers.second[k]
    for m in range(len(markers.carrier)):
        add_marker(weights[m], placed.places[here, m], placed.places[there, m], sums[markers.carrier[m]])
    hand_down(markers.tree.parent, sums)
    back = swapped(sums)
    parent, column, slopes = markers.tree.parent, markers.column, markers.slopes
    axes, after = placed.axes[here], placed.axes[there]
    product = np.zeros((a, a))
    for j in range(a):
        # what axis j carries meets it, and all axes before it, in the other frame
        met_force(sums, j, after, j, met)
        i = j
        while i >= 0:
            product[i, j] = slopes[k + later, j] * slopes[k, i] * inner(axes, i, met, j)
            i = parent[i]
        met_force(back, j, axes, j, met)
        i = parent[j]
        while i >= 0:
            product[j, i] = slopes[k, j] * slopes[k + later, i] * inner(after, i, met, j)
            i = parent[i]
    squares, across, most = interval.squares, interval.across, len(interval.gradient)
    _sort(column, product, squares[(2 * later - 1) * most + row], across[row], static.square)
    _sort(column, product.T, squares[2 * later * most + row], across[row + later], static.square)


@part
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
