"""Defines `KinematicTree`, a skeleton as plain arrays, axis by axis, and spatial vectors, for compiled functions.

Every moving axis has a frame of its own, at a fixed position in the frame of the axis before it (its parent), and
rotates about, or slides along, a fixed direction. Parents come first. A segment is at a fixed position in the frame of
the last axis that moves it. Everything is computed in ground axes.

The linear part comes first, then the angular one (Featherstone 2008, ch. 2). A motion (velocity of the body's point at
the origin, angular velocity) and a force (force, moment about the origin) of all bodies can be summed directly, since
all are taken at one point. Vectors are rows of arrays (k, 6), selected by their indices: in inner loops a separate view
for each row takes longer than the computation.
"""

from typing import NamedTuple

import numpy as np

from kinertia.model.compiled import Bool1, Float2, Float3, Int1, compiled, inlined, part


class KinematicTree(NamedTuple):
    """Axes and segments as arrays.

    Attributes:
        parent: (a,) index of the axis before; -1 for the ground.
        slides: (a,) True for a translation.
        direction: (a, 3) unit, in the axis' frame.
        rotation, translation: (a, 3, 3) and (a, 3) m, the axis' frame in its parent's, at zero.
        last_axis: (s,) index of the last axis that moves each segment; -1 for none.
        segment_rotation, segment_translation: (s, 3, 3) and (s, 3) m, the segment's frame in its last axis'.
    """

    parent: Int1
    slides: Bool1
    direction: Float2
    rotation: Float3
    translation: Float2
    last_axis: Int1
    segment_rotation: Float3
    segment_translation: Float2


@part
def place_axes(
    tree: KinematicTree, at: np.ndarray, rotation: np.ndarray, translation: np.ndarray, axes: np.ndarray
) -> None:
    """Compute the frames of all axes, and their motion at unit rate, in one frame of a trial.

    Args:
        tree: the skeleton.
        at: (a,) values of the axes, rad or m.
        rotation, translation: (a, 3, 3) and (a, 3) m, written: the axes' frames in ground.
        axes: (a, 6), written: motion in ground axes at the ground origin, linear first.
    """
    base, turn, unit, here = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    for j in range(len(at)):
        parent = tree.parent[j]
        for r in range(3):
            if parent < 0:
                here[r] = tree.translation[j, r]
            else:
                here[r] = translation[parent, r]
                for c in range(3):
                    here[r] += rotation[parent, r, c] * tree.translation[j, c]
            for c in range(3):
                if parent < 0:
                    base[r, c] = tree.rotation[j, r, c]
                else:
                    base[r, c] = 0.0
                    for k in range(3):
                        base[r, c] += rotation[parent, r, k] * tree.rotation[j, k, c]
        x, y, z = tree.direction[j, 0], tree.direction[j, 1], tree.direction[j, 2]
        for r in range(3):
            unit[r] = base[r, 0] * x + base[r, 1] * y + base[r, 2] * z
        if tree.slides[j]:
            for r in range(3):
                translation[j, r] = here[r] + unit[r] * at[j]
                axes[j, r], axes[j, 3 + r] = unit[r], 0.0
                for c in range(3):
                    rotation[j, r, c] = base[r, c]
            continue
        # Rodrigues' formula
        sine, cosine = np.sin(at[j]), np.cos(at[j])
        o = 1.0 - cosine
        turn[0, 0], turn[0, 1], turn[0, 2] = cosine + o * x * x, o * x * y - sine * z, o * x * z + sine * y
        turn[1, 0], turn[1, 1], turn[1, 2] = o * x * y + sine * z, cosine + o * y * y, o * y * z - sine * x
        turn[2, 0], turn[2, 1], turn[2, 2] = o * x * z - sine * y, o * y * z + sine * x, cosine + o * z * z
        for r in range(3):
            translation[j, r], axes[j, 3 + r] = here[r], unit[r]
            for c in range(3):
                rotation[j, r, c] = base[r, 0] * turn[0, c] + base[r, 1] * turn[1, c] + base[r, 2] * turn[2, c]
        axes[j, 0] = here[1] * unit[2] - here[2] * unit[1]
        axes[j, 1] = here[2] * unit[0] - here[0] * unit[2]
        axes[j, 2] = here[0] * unit[1] - here[1] * unit[0]


@inlined
def hand_down(parent: np.ndarray, sums: np.ndarray) -> None:
    """Add to the sums (a, k) of every axis those of the axes beyond it."""
    for j in range(len(parent) - 1, -1, -1):
        before = parent[j]
        if before >= 0:
            for k in range(sums.shape[1]):
                sums[before, k] += sums[j, k]


@part
def place_segments(
    tree: KinematicTree,
    axis_rotation: np.ndarray,
    axis_translation: np.ndarray,
    rotation: np.ndarray,
    translation: np.ndarray,
) -> None:
    """Compute the frames of all segments, `rotation` (s, 3, 3) and `translation` (s, 3), from those of the axes."""
    for s in range(len(tree.last_axis)):
        j = tree.last_axis[s]
        for r in range(3):
            if j < 0:
                translation[s, r] = tree.segment_translation[s, r]
            else:
                translation[s, r] = axis_translation[j, r]
                for c in range(3):
                    translation[s, r] += axis_rotation[j, r, c] * tree.segment_translation[s, c]
            for c in range(3):
                if j < 0:
                    rotation[s, r, c] = tree.segment_rotation[s, r, c]
                else:
                    rotation[s, r, c] = 0.0
                    for k in range(3):
                        rotation[s, r, c] += axis_rotation[j, r, k] * tree.segment_rotation[s, k, c]


@compiled
def poses(tree: KinematicTree, at: Float2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute segment frames (n, s, 3, 3) and (n, s, 3), and axis motions (n, a, 6), at axis values (n, a)."""
    n, a = at.shape
    s = len(tree.last_axis)
    rotation, translation, axes = np.empty((n, s, 3, 3)), np.empty((n, s, 3)), np.empty((n, a, 6))
    axis_rotation, axis_translation = np.empty((a, 3, 3)), np.empty((a, 3))
    for k in range(n):
        place_axes(tree, at[k], axis_rotation, axis_translation, axes[k])
        place_segments(tree, axis_rotation, axis_translation, rotation[k], translation[k])
    return rotation, translation, axes


@compiled
def in_segments(tree: KinematicTree, at: Float2, segments: Int1, points: Float3) -> np.ndarray:
    """Convert points (n, m, 3) from ground axes to the frames of their segments (m,), at axis values (n, a)."""
    n, a = at.shape
    s, result = len(tree.last_axis), np.empty(points.shape)
    rotation, translation = np.empty((s, 3, 3)), np.empty((s, 3))
    axis_rotation, axis_translation, axes = np.empty((a, 3, 3)), np.empty((a, 3)), np.empty((a, 6))
    for k in range(n):
        place_axes(tree, at[k], axis_rotation, axis_translation, axes)
        place_segments(tree, axis_rotation, axis_translation, rotation, translation)
        for j in range(len(segments)):
            turn, place = rotation[segments[j]], translation[segments[j]]
            x, y, z = points[k, j, 0] - place[0], points[k, j, 1] - place[1], points[k, j, 2] - place[2]
            for c in range(3):
                result[k, j, c] = turn[0, c] * x + turn[1, c] * y + turn[2, c] * z
    return result


@inlined
def motion_cross(v: np.ndarray, i: int, m: np.ndarray, j: int, out: np.ndarray, k: int) -> None:
    """Write v[i] x m[j] to out[k]: the change of the motion m when its body moves by v."""
    vx, vy, vz, x, y, z = v[i, 0], v[i, 1], v[i, 2], v[i, 3], v[i, 4], v[i, 5]
    lx, ly, lz, wx, wy, wz = m[j, 0], m[j, 1], m[j, 2], m[j, 3], m[j, 4], m[j, 5]
    out[k, 0] = y * lz - z * ly + vy * wz - vz * wy
    out[k, 1] = z * lx - x * lz + vz * wx - vx * wz
    out[k, 2] = x * ly - y * lx + vx * wy - vy * wx
    out[k, 3] = y * wz - z * wy
    out[k, 4] = z * wx - x * wz
    out[k, 5] = x * wy - y * wx


@inlined
def force_cross(v: np.ndarray, i: int, f: np.ndarray, j: int, out: np.ndarray, k: int) -> None:
    """Write v[i] x* f[j] to out[k]: the change of the force f when its body moves by v."""
    vx, vy, vz, x, y, z = v[i, 0], v[i, 1], v[i, 2], v[i, 3], v[i, 4], v[i, 5]
    fx, fy, fz, mx, my, mz = f[j, 0], f[j, 1], f[j, 2], f[j, 3], f[j, 4], f[j, 5]
    out[k, 0] = y * fz - z * fy
    out[k, 1] = z * fx - x * fz
    out[k, 2] = x * fy - y * fx
    out[k, 3] = y * mz - z * my + vy * fz - vz * fy
    out[k, 4] = z * mx - x * mz + vz * fx - vx * fz
    out[k, 5] = x * my - y * mx + vx * fy - vy * fx


@inlined
def inner(a: np.ndarray, i: int, b: np.ndarray, j: int) -> float:
    """Return a[i] . b[j]."""
    result: float = a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2]
    result += a[i, 3] * b[j, 3] + a[i, 4] * b[j, 4] + a[i, 5] * b[j, 5]
    return result
