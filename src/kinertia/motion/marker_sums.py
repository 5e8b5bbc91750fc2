"""Computes sums over the markers of a body, frame by frame in compiled code.

A motion (l, w) at the ground origin moves a marker at x by l + w x x. The normal matrix of a tree of markers is the
mass matrix of the same tree with a mass at every marker, and is built the same way: per axis, sums over all markers
that it moves. For weights that couple two frames, in which a marker is at x and at y, they are

    [0]      sum w                [1:4] sum w x        [4:7] sum w y        [7:16] sum w y x^T, row by row

so that the motion S in the second frame causes, in the first, the generalised force

    (sum w (l + w_ x y),  sum w x x (l + w_ x y)),    with  x x (w_ x y) = w_ (x . y) - y (x . w_).
"""

import numpy as np

from kinertia.model.compiled import Float1, Float2, Float3, Int1, compiled, inlined, part
from kinertia.model.kinematic_tree import KinematicTree, hand_down, inner, place_axes
from kinertia.model.skeleton import Pose, Skeleton


@inlined
def add_marker(weight: float, x: np.ndarray, y: np.ndarray, sums: np.ndarray) -> None:
    """Add a marker at x, and at y in the second frame, to the sums (16,) of the axis that moves it."""
    sums[0] += weight
    sums[1] += weight * x[0]
    sums[4] += weight * y[0]
    sums[2] += weight * x[1]
    sums[5] += weight * y[1]
    sums[3] += weight * x[2]
    sums[6] += weight * y[2]
    sums[7] += weight * y[0] * x[0]
    sums[8] += weight * y[0] * x[1]
    sums[9] += weight * y[0] * x[2]
    sums[10] += weight * y[1] * x[0]
    sums[11] += weight * y[1] * x[1]
    sums[12] += weight * y[1] * x[2]
    sums[13] += weight * y[2] * x[0]
    sums[14] += weight * y[2] * x[1]
    sums[15] += weight * y[2] * x[2]


@inlined
def met_force(sums: np.ndarray, i: int, s: np.ndarray, j: int, out: np.ndarray) -> None:
    """Write the force that the motion s[j] in the second frame causes in the first, with sums[i], to out[i]."""
    w = sums[i, 0]
    lx, ly, lz, wx, wy, wz = s[j, 0], s[j, 1], s[j, 2], s[j, 3], s[j, 4], s[j, 5]
    square = sums[i, 7] + sums[i, 11] + sums[i, 15]
    out[i, 0] = w * lx + wy * sums[i, 6] - wz * sums[i, 5]
    out[i, 1] = w * ly + wz * sums[i, 4] - wx * sums[i, 6]
    out[i, 2] = w * lz + wx * sums[i, 5] - wy * sums[i, 4]
    along_x = sums[i, 7] * wx + sums[i, 8] * wy + sums[i, 9] * wz
    along_y = sums[i, 10] * wx + sums[i, 11] * wy + sums[i, 12] * wz
    along_z = sums[i, 13] * wx + sums[i, 14] * wy + sums[i, 15] * wz
    out[i, 3] = sums[i, 2] * lz - sums[i, 3] * ly + square * wx - along_x
    out[i, 4] = sums[i, 3] * lx - sums[i, 1] * lz + square * wy - along_y
    out[i, 5] = sums[i, 1] * ly - sums[i, 2] * lx + square * wz - along_z


@part
def swapped(sums: np.ndarray) -> np.ndarray:
    """Return the sums (a, 16) with the two frames interchanged."""
    result = sums.copy()
    for j in range(len(sums)):
        for r in range(3):
            result[j, 1 + r], result[j, 4 + r] = sums[j, 4 + r], sums[j, 1 + r]
            for c in range(3):
                result[j, 7 + 3 * r + c] = sums[j, 7 + 3 * c + r]
    return result


@inlined
def place_marker(rotation: np.ndarray, translation: np.ndarray, local: np.ndarray, out: np.ndarray) -> None:
    """Write the marker's position (3,) m in ground to `out`."""
    out[0] = translation[0] + rotation[0, 0] * local[0] + rotation[0, 1] * local[1] + rotation[0, 2] * local[2]
    out[1] = translation[1] + rotation[1, 0] * local[0] + rotation[1, 1] * local[1] + rotation[1, 2] * local[2]
    out[2] = translation[2] + rotation[2, 0] * local[0] + rotation[2, 1] * local[1] + rotation[2, 2] * local[2]


@compiled
def normal_equations(
    tree: KinematicTree,
    owner: Int1,
    slopes: Float2,
    at: Float2,
    last_axis: Int1,
    local: Float2,
    measured: Float3,
    count: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute J^T J (n, c, c), J^T r (n, c) and r^T r (n,) of the visible markers; r = measured - model.

    Args:
        tree: the skeleton.
        owner: (a,) the coordinate of each axis.
        slopes: (n, a) derivatives of the axes by their coordinates.
        at: (n, a) values of the axes, rad or m.
        last_axis: (m,) the last axis that moves each marker.
        local: (m, 3) m, the markers in the frames of these axes.
        measured: (n, m, 3) m; NaN where not seen.
        count: number of coordinates, c.
    """
    n, a = at.shape
    normal, gradient, cost = np.zeros((n, count, count)), np.zeros((n, count)), np.zeros(n)
    rotation, translation, axes = np.empty((a, 3, 3)), np.empty((a, 3)), np.empty((a, 6))
    sums, forces, x, r, met = np.empty((a, 16)), np.empty((a, 6)), np.empty(3), np.empty(3), np.empty((a, 6))
    for k in range(n):
        place_axes(tree, at[k], rotation, translation, axes)
        sums[:] = 0.0
        forces[:] = 0.0
        for m in range(len(last_axis)):
            j = last_axis[m]
            place_marker(rotation[j], translation[j], local[m], x)
            for i in range(3):
                r[i] = measured[k, m, i] - x[i]
            square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
            if np.isnan(square):
                continue
            cost[k] += square
            add_marker(1.0, x, x, sums[j])
            add_force(r, x, forces[j])
        hand_down(tree.parent, sums)
        hand_down(tree.parent, forces)
        for j in range(a):
            met_force(sums, j, axes, j, met)
            here, coordinate = slopes[k, j], owner[j]
            gradient[k, coordinate] += here * inner(axes, j, forces, j)
            normal[k, coordinate, coordinate] += here * here * inner(axes, j, met, j)
            i = tree.parent[j]
            while i >= 0:
                value = here * slopes[k, i] * inner(axes, i, met, j)
                normal[k, coordinate, owner[i]] += value
                normal[k, owner[i], coordinate] += value
                i = tree.parent[i]
    return normal, gradient, cost


@inlined
def add_force(force: np.ndarray, at: np.ndarray, total: np.ndarray) -> None:
    """Add a force (3,) that acts at a point (3,) m to a total (6,) at the ground origin."""
    total[0] += force[0]
    total[1] += force[1]
    total[2] += force[2]
    total[3] += at[1] * force[2] - at[2] * force[1]
    total[4] += at[2] * force[0] - at[0] * force[2]
    total[5] += at[0] * force[1] - at[1] * force[0]


@part
def _factors(matrix: np.ndarray, added: float, least: float, upper: np.ndarray, diagonal: np.ndarray) -> None:
    """Factorise matrix + added 1 = U^T D U: unit upper U, and diagonal D of at least `least` despite rounding."""
    for j in range(len(matrix)):
        for i in range(j, len(matrix)):
            upper[j, i] = matrix[j, i]
    for j in range(len(matrix)):
        diagonal[j] = max(upper[j, j] + added, least)
        for i in range(j + 1, len(matrix)):
            factor = upper[j, i] / diagonal[j]
            for m in range(i, len(matrix)):
                upper[i, m] -= factor * upper[j, m]
        for i in range(j + 1, len(matrix)):
            upper[j, i] /= diagonal[j]


@compiled
def damped_steps(normal: Float3, gradient: Float2, damping: Float1) -> np.ndarray:
    """Solve (normal + damping mean(diag) 1) step = gradient for steps (n, c), frame by frame."""
    n, c = gradient.shape
    step, upper, diagonal = gradient.copy(), np.empty((c, c)), np.empty(c)
    for k in range(n):
        scale = 0.0
        for i in range(c):
            scale += normal[k, i, i] / c
        _factors(normal[k], damping[k] * scale, 1e-16 * scale, upper, diagonal)
        for m in range(c):
            for i in range(m + 1, c):
                step[k, i] -= upper[m, i] * step[k, m]
        for i in range(c - 1, -1, -1):
            step[k, i] /= diagonal[i]
            for m in range(i + 1, c):
                step[k, i] -= upper[i, m] * step[k, m]
    return step


@compiled
def variances(normal: Float3, added: float) -> np.ndarray:
    """Return the diagonals (n, c) of the inverses of normal + added 1, frame by frame."""
    n, c = normal.shape[:2]
    result, upper, diagonal, column = np.zeros((n, c)), np.empty((c, c)), np.empty(c), np.empty(c)
    for k in range(n):
        _factors(normal[k], added, added, upper, diagonal)
        for j in range(c):  # column j of the inverse of U^T
            column[:] = 0.0
            column[j] = 1.0
            for m in range(j, c):
                result[k, j] += column[m] * column[m] / diagonal[m]
                for i in range(m + 1, c):
                    column[i] -= upper[m, i] * column[m]
    return result


def marker_jacobian(skeleton: Skeleton, pose: Pose, positions: np.ndarray) -> np.ndarray:
    """Compute the velocity (n, m, 3, c) of every marker, at positions (n, m, 3) m, for each coordinate at unit rate."""
    columns = pose.axes.transpose(0, 2, 1)
    x, y, z = positions[..., None].transpose(2, 0, 1, 3)
    turn_x, turn_y, turn_z = columns[:, None, 3:].transpose(2, 0, 1, 3)
    turning = np.stack([turn_y * z - turn_z * y, turn_z * x - turn_x * z, turn_x * y - turn_y * x], axis=2)
    by_axes = (columns[:, None, :3] + turning) * skeleton.support[skeleton.marker_segments][:, None, :]
    return skeleton.map.to_coordinates(by_axes, pose.slopes)
