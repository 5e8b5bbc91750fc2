"""Holds the visible markers of a trial for compiled functions, and the gradient of their cost."""

from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.markers.marker_errors import LATER, ErrorInformation, ErrorProcess
from kinertia.estimation.simultaneous.markers.skin import SkinPatterns
from kinertia.model.compiled import Float1, Float2, Float3, Int1, compiled, part
from kinertia.model.kinematic_tree import KinematicTree, hand_down, inner, place_axes
from kinertia.model.skeleton import Skeleton
from kinertia.motion.marker_sums import add_force, place_marker


class SeenMarkers(NamedTuple):
    """Markers of a trial and the axes that move them.

    Attributes:
        tree: the skeleton.
        column: (a,) index of each axis' coordinate among those that move, then those that do not.
        at, slopes: (n, a) values of the axes, rad or m, and their derivatives by the coordinates.
        carrier: (m,) the last axis that moves each marker.
        local: (n, m, 3) m, the markers in the frames of these axes, displaced with the skin.
        turned: (m, 3, 3) the segments' axes in these frames.
        measured: (n, m, 3) m; NaN where not seen.
        own, next, second: as in `ErrorInformation`.
        patterns, first, last: as in `SkinPatterns`.
        columns: (m,) index at which the coefficients of each marker begin among the columns of S.
    """

    tree: KinematicTree
    column: Int1
    at: Float2
    slopes: Float2
    carrier: Int1
    local: Float3
    turned: Float3
    measured: Float3
    own: Float2
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
    carrier, local = skeleton.carried_markers
    turned = skeleton.tree.segment_rotation[skeleton.marker_segments]
    patterns, coefficients = skin
    along_axes = np.repeat(turned, patterns.last - patterns.first, axis=0) @ coefficients.reshape(-1, 3, 1)
    return SeenMarkers(
        skeleton.tree,
        place[skeleton.map.owner],
        at,
        slopes,
        carrier,
        local + patterns.displaced(along_axes.ravel()),
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


@part
def place_markers(markers: SeenMarkers, k: int, placed: PlacedMarkers) -> None:
    """Compute axes and markers of frame k."""
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


@compiled
def add_gradient(
    markers: SeenMarkers,
    first: Int1,
    values: Float2,
    own: tuple[int, int],
    still: int,
    rhs: Float2,
    static_rhs: Float1,
) -> float:
    """Add J^T W r (size, c) and S^T W r (s,) of frames own[0] to own[1] - 1, and return r^T W r.

    Arguments are as in `marker_terms`.
    """
    n, m = markers.own.shape
    start, stop = own
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
            add_force(pull[i], placed.places[k % 5, i], forces[markers.carrier[i]])
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
    n, m = markers.own.shape
    cost, here = 0.0, placed.errors[k % 5]
    for i in range(m):
        for r in range(3):
            value = markers.own[k, i] * here[i, r]
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
