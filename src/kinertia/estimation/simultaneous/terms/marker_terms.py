"""Adds the markers to a trial's normal equations, for errors that are correlated over time.

With J the derivative of the markers by the coordinates that move, S the derivative by unknowns that do not (static
coordinates, marker positions, then coefficients of skin motion: `skin`), r = measured - model and W the information on
the errors (`marker_errors`), the terms are J^T W J, J^T W S, J^T W r, S^T W S and S^T W r. Frames are coupled to the
two after them. They are summed over the frames of a knot interval, in which the same six splines are active, and seven
with those after it.
"""

from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import (
    NO_BORDER,
    Gradient,
    Interval,
    NormalEquations,
    longest_run,
    to_border,
    to_splines,
)
from kinertia.estimation.simultaneous.markers.marker_errors import (
    LATER,
    PlacedMarkers,
    SeenMarkers,
    add_gradient,
    place_markers,
    seen_markers,
)
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, InTrial
from kinertia.model.compiled import Float1, Float2, Float4, Int1, StridedFloat2, StridedFloat3, compiled, inlined, part
from kinertia.model.kinematic_tree import hand_down, inner
from kinertia.motion.marker_sums import add_force, add_marker, met_force, swapped


class _Static(NamedTuple):
    """The static terms S^T W S (s, s), S^T W r (s,) and r^T W r (1,)."""

    square: StridedFloat2
    rhs: Float1
    cost: Float1


class Markers(CostTerm):
    """Cost of the markers of all trials against the model; it adds no unknowns, and depends on those of other terms."""

    def add(self, into: Gradient, here: InTrial) -> None:
        """Add the squares of the markers' errors relative to their expected size."""
        given, k, near, static = self.given, here.k, here.time_block.with_neighbours, here.static
        seen = seen_markers(
            self.model.placed(static),
            given.trials[k].markers[near],
            here.near_q,
            given.trials[k].marker_process,
            self.model.skin(k, static, near),
            given.moving,
            given.still,
        )
        add_markers(into, self.layout.in_markers, given.bases[k], here.time_block, seen, len(given.still))


def add_markers(
    into: Gradient, columns: slice, basis: MotionBasis, time_block: TimeBlock, markers: SeenMarkers, still: int
) -> None:
    """Add the terms of the markers in one time block of a trial.

    Args:
        into: zero, or with other terms.
        columns: slice of the static unknowns that markers depend on.
        basis: of the motion.
        time_block: of the trial.
        markers: in the block with its neighbours.
        still: number of coordinates that do not move.
    """
    near = time_block.with_neighbours
    rows = (time_block.frames.start - near.start, time_block.frames.stop - near.start)
    first, values = basis.first[near] - time_block.splines.start, basis.values[0][near]
    if not isinstance(into, NormalEquations):
        into.cost += 0.5 * add_gradient(markers, first, values, rows, still, into.rhs, into.static_rhs[columns])
        return
    static = _Static(into.static[columns, columns], into.static_rhs[columns], np.zeros(1))
    border = into.border[..., columns] if into.bordered else NO_BORDER
    _add(markers, first, values, rows, still, into.band, border, into.rhs, static, into.bordered)
    into.cost += 0.5 * float(static.cost[0])


@compiled
def _add(
    markers: SeenMarkers,
    first: Int1,
    values: Float2,
    rows: tuple[int, int],
    still: int,
    band: Float4,
    border: StridedFloat3,
    rhs: Float2,
    static: _Static,
    bordered: bool,
) -> None:
    """Add frames own[0] to own[1] - 1, interval by interval, each coupled to the two frames after it.

    `first` and `values` are those of the motion basis.
    """
    n, m = markers.same.shape
    start, stop = rows
    c, a, s = band.shape[2], len(markers.column), len(static.rhs)
    reach, pairs = _reach(markers, c, still), _pairs(markers.tree.parent)
    placed = PlacedMarkers(np.empty((5, a, 6)), np.empty((5, m, 3)), np.empty((5, m, 3)), np.empty((5, m, 3, 3)))
    most = longest_run(first)
    interval = Interval(np.empty(((1 + 2 * LATER) * most, c * c)), np.zeros((most + LATER, c, s)), np.empty((most, c)))
    for k in range(max(start - LATER, 0), min(start + LATER, n)):
        place_markers(markers, k, placed)
    while start < stop:
        end = start + 1
        while end < stop and first[end] == first[start]:
            end += 1
        interval.squares[:] = 0.0
        interval.gradient[:] = 0.0
        for k in range(start, end):
            if k + LATER < n:
                place_markers(markers, k + LATER, placed)
            _frame(markers, k, k - start, still, pairs, placed, interval, static, bordered)
            for later in range(1, min(LATER, n - 1 - k) + 1):
                _pair(markers, k, later, k - start, pairs, placed, interval, static)
        to_splines(first, values, start, end, interval, reach, band, border, rhs, bordered)
        start = end
    for row in range(min(LATER, n - stop) if bordered else 0):
        # of the frames after them, only their coupling to the last of these
        to_border(first[stop + row], values[stop + row], interval.across[row], border)


@part
def _frame(
    markers: SeenMarkers,
    k: int,
    row: int,
    still: int,
    pairs: np.ndarray,
    placed: PlacedMarkers,
    interval: Interval,
    static: _Static,
    bordered: bool,
) -> None:
    """Add J^T W J of frame k with itself, J^T W S of positions and skin if `bordered`, and J^T W r.

    W r covers five frames.
    """
    a, m, here = len(markers.column), len(markers.last_axis), k % 5
    most = 1
    for i in range(m):
        most = max(most, 1 + markers.last[i] - markers.first[i])
    pull, directions = np.zeros((m, 3)), np.zeros((m, 3, 3 * most))
    for offset in range(-LATER, LATER + 1):
        _informed(markers, k, offset, placed, pull, directions)
    sums, forces, met = np.zeros((a, 16)), np.zeros((a, 6)), np.empty((a, 6))
    for i in range(m):
        at = placed.places[here, i]
        add_marker(markers.same[k, i], at, at, sums[markers.last_axis[i]])
        add_force(pull[i], at, forces[markers.last_axis[i]])
        for r in range(3):
            static.cost[0] += placed.errors[here, i, r] * pull[i, r]
    if bordered:
        _by_place(markers, k, row, still, placed, pull, directions, interval, static)
    hand_down(markers.tree.parent, sums)
    hand_down(markers.tree.parent, forces)
    parent, column, slopes, axes = markers.tree.parent, markers.column, markers.slopes, placed.axes[here]
    c, gradient = interval.gradient.shape[1], interval.gradient[row]
    product = np.empty((a, a))
    for j in range(a):
        force = slopes[k, j] * inner(axes, j, forces, j)
        if column[j] < c:
            gradient[column[j]] += force
        else:
            static.rhs[column[j] - c] += force
        met_force(sums, j, axes, j, met)
        i = j
        while i >= 0:
            value = slopes[k, j] * slopes[k, i] * inner(axes, i, met, j)
            product[i, j] = value
            product[j, i] = value
            i = parent[i]
    _sort(column, pairs, product, interval.squares[row], interval.across[row], static.square)


@part
def _informed(
    markers: SeenMarkers, k: int, offset: int, placed: PlacedMarkers, pull: np.ndarray, directions: np.ndarray
) -> None:
    """Add what the frame at this offset from k gives to W r (m, 3), and to W times the segments' axes (m, 3, 3 g).

    The axes come first as they are, then multiplied by each pattern of the skin.
    """
    there = k + offset
    if there < 0 or there >= len(markers.same):
        return
    weights = markers.same[k]
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
    markers: SeenMarkers,
    k: int,
    row: int,
    still: int,
    placed: PlacedMarkers,
    pull: np.ndarray,
    directions: np.ndarray,
    interval: Interval,
    static: _Static,
) -> None:
    """Add the terms of marker positions and skin coefficients: with the coordinates, with themselves, and with r."""
    c, here = interval.gradient.shape[1], k % 5
    parent, column, slopes = markers.tree.parent, markers.column, markers.slopes
    axes, at, turned = placed.axes[here], placed.places[here], placed.turned[here]
    across, square, rhs = interval.across[row], static.square, static.rhs
    most = directions.shape[2]
    local, values, velocity = np.empty((3, most)), np.empty(most), np.empty(3)
    for m in range(len(markers.last_axis)):
        d, place, first = directions[m], still + 3 * m, markers.first[m]
        # number of columns before those of the skin
        skin = markers.columns[m] - 3
        count = 3 + 3 * (markers.last[m] - first)
        for i in range(3):
            along = turned[m, 0, i] * pull[m, 0] + turned[m, 1, i] * pull[m, 1] + turned[m, 2, i] * pull[m, 2]
            for j in range(count):
                local[i, j] = turned[m, 0, i] * d[0, j] + turned[m, 1, i] * d[1, j] + turned[m, 2, i] * d[2, j]
            for g in range(count // 3):
                pattern = 1.0 if g == 0 else markers.patterns[k, first + g - 1]
                unknown = i + (place if g == 0 else skin + 3 * g)
                rhs[unknown] += pattern * along
                for j in range(3):
                    square[unknown, place + j] += pattern * local[i, j]
                for j in range(3, count):
                    square[unknown, skin + j] += pattern * local[i, j]
        j = markers.last_axis[m]
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
                    unknown = i + (place if i < 3 else skin)
                    square[column[j] - c, unknown] += values[i]
                    square[unknown, column[j] - c] += values[i]
            j = parent[j]


@part
def _pair(
    markers: SeenMarkers,
    k: int,
    later: int,
    row: int,
    pairs: np.ndarray,
    placed: PlacedMarkers,
    interval: Interval,
    static: _Static,
) -> None:
    """Add J^T W J of frame k with the frame `later` frames after it."""
    a, here, there = len(markers.column), k % 5, (k + later) % 5
    sums, met = np.zeros((a, 16)), np.empty((a, 6))
    weights = markers.next[k] if later == 1 else markers.second[k]
    for m in range(len(markers.last_axis)):
        add_marker(weights[m], placed.places[here, m], placed.places[there, m], sums[markers.last_axis[m]])
    hand_down(markers.tree.parent, sums)
    back = swapped(sums)
    parent, column, slopes = markers.tree.parent, markers.column, markers.slopes
    axes, after = placed.axes[here], placed.axes[there]
    product = np.empty((a, a))
    for j in range(a):
        # what axis j moves is coupled to it, and to all axes before it, in the other frame
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
    _sort(column, pairs, product, squares[(2 * later - 1) * most + row], across[row], static.square)
    _sort(column, pairs, product.T, squares[2 * later * most + row], across[row + later], static.square)


@part
def _sort(
    column: np.ndarray,
    pairs: np.ndarray,
    product: np.ndarray,
    squares: np.ndarray,
    across: np.ndarray,
    square: np.ndarray,
) -> None:
    """Add products (a, a) of axes to the terms of their coordinates: the first in a frame, the second in any.

    Args:
        column: (a,) as in `SeenMarkers`.
        pairs: (p, 2) of axes that may have a product.
        product: of the first's axes (rows) with the second's.
        squares: (c c,) where both coordinates move.
        across: (c, s) of the first's frame, where the second does not move.
        square: (s, s) where neither does.
    """
    c = len(across)
    for n in range(len(pairs)):
        i, j = pairs[n, 0], pairs[n, 1]
        if column[i] < c:
            if column[j] < c:
                squares[column[i] * c + column[j]] += product[i, j]
            else:
                across[column[i], column[j] - c] += product[i, j]
        elif column[j] >= c:
            square[column[i] - c, column[j] - c] += product[i, j]


@part
def _pairs(parent: np.ndarray) -> np.ndarray:
    """Return pairs (p, 2) of axes that are equal or one of which moves the other, in both orders."""
    count = 0
    for j in range(len(parent)):
        i = j
        while i >= 0:
            count += 1 if i == j else 2
            i = parent[i]
    pairs, n = np.empty((count, 2), dtype=np.int64), 0
    for j in range(len(parent)):
        i = j
        while i >= 0:
            pairs[n, 0], pairs[n, 1] = i, j
            n += 1
            if i != j:
                pairs[n, 0], pairs[n, 1] = j, i
                n += 1
            i = parent[i]
    return pairs


@part
def _reach(markers: SeenMarkers, c: int, still: int) -> np.ndarray:
    """Return the runs (c, 3, 2) of columns of S that each coordinate may be coupled to, from and to.

    The runs are static coordinates, and positions and skin of the markers that the coordinate moves.
    """
    reach = np.zeros((c, 3, 2), dtype=np.int64)
    reach[:, 0, 1] = still
    for m in range(len(markers.last_axis)):
        place, skin = still + 3 * m, markers.columns[m]
        wide = 3 * (markers.last[m] - markers.first[m])
        j = markers.last_axis[m]
        while j >= 0:
            if markers.column[j] < c:
                _widen(reach[markers.column[j], 1], place, place + 3)
                _widen(reach[markers.column[j], 2], skin, skin + wide)
            j = markers.tree.parent[j]
    return reach


@inlined
def _widen(run: np.ndarray, begin: int, end: int) -> None:
    """Extend a run of columns, empty or not, to include these."""
    if begin < end:
        run[0] = min(run[0], begin) if run[0] < run[1] else begin
        run[1] = max(run[1], end)
