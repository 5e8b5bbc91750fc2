"""Computes the contributions of bodies and loads to the forces along joint axes, frame by frame in compiled code.

A load f on a segment reduces the force of every axis S that moves the segment by S . f.
"""

import numpy as np

from kinertia.model.array_types import Bool2, Float2, Float3, Float4, Int1
from kinertia.model.compiled import compiled


@compiled
def add_bodies(
    axes: Float3,
    slopes: Float2,
    rows: Int1,
    moved: Bool2,
    by_parameter: Float4,
    segments: Int1,
    chain: Float3,
    out: Float3,
) -> None:
    """Add the derivatives of generalised forces by the bodies' unknowns to the first columns of `out` (n, c, s).

    Args:
        axes: (n, a, 6) motion axes, in ground axes at the ground origin.
        slopes: (n, a) derivative of every axis value by its coordinate.
        rows: (a,) row of `out` of each axis' coordinate; -1 for none.
        moved: (b, a) whether the axis moves the body.
        by_parameter: (n, 6, s, 10) derivatives of the segments' loads at the ground origin by dynamic parameters.
        segments: (b,) indices of the bodies.
        chain: (b, 10, 10) derivatives of each body's dynamic parameters by its ten unknowns.
        out: written.
    """
    load = np.empty((6, 10 * len(segments)))
    for i in range(axes.shape[0]):
        for b in range(len(segments)):
            for r in range(6):
                own = by_parameter[i, r, segments[b]]
                for k in range(10):
                    total = 0.0
                    for p in range(10):
                        total += own[p] * chain[b, p, k]
                    load[r, 10 * b + k] = total
        for j in range(axes.shape[1]):
            if rows[j] < 0:
                continue
            row, slope, b = out[i, rows[j]], slopes[i, j], 0
            x, y, z = slope * axes[i, j, 0], slope * axes[i, j, 1], slope * axes[i, j, 2]
            u, v, w = slope * axes[i, j, 3], slope * axes[i, j, 4], slope * axes[i, j, 5]
            while b < len(segments):
                first = b
                while b < len(segments) and moved[b, j]:
                    b += 1
                for k in range(10 * first, 10 * b):
                    force = x * load[0, k] + y * load[1, k] + z * load[2, k]
                    row[k] += force + u * load[3, k] + v * load[4, k] + w * load[5, k]
                b += 1


@compiled
def take_load(
    axes: Float3,
    slopes: Float2,
    rows: Int1,
    moved: Int1,
    loads: Float2,
    by_load: Float3,
    first: int,
    tau: Float2,
    by_place: Float3,
    out: Float3,
) -> None:
    """Subtract a load on a segment from the forces of the axes that move the segment.

    Args:
        axes, slopes, rows: as in `add_bodies`.
        moved: (k,) the axes, in order; each rotates those after it.
        loads: (n, 6) at the ground origin.
        by_load: (n, 6, s) derivatives of the load by the static unknowns, from the column `first` on; zero before.
        first: the column.
        tau: (n, a) forces of the axes, written.
        by_place: (n, a, a) their derivatives by the axis positions (columns), written.
        out: (n, c, s) derivatives of generalised forces by the static unknowns, written.
    """
    carried = np.empty(6)
    for i in range(axes.shape[0]):
        by, fx, fy, fz = by_load[i], loads[i, 0], loads[i, 1], loads[i, 2]
        mx, my, mz = loads[i, 3], loads[i, 4], loads[i, 5]
        for at in range(len(moved)):
            j = moved[at]
            x, y, z, u, v, w = axes[i, j, 0], axes[i, j, 1], axes[i, j, 2], axes[i, j, 3], axes[i, j, 4], axes[i, j, 5]
            tau[i, j] -= x * fx + y * fy + z * fz + u * mx + v * my + w * mz
            # (S_j x S_l) . f = S_l . (f moved along with j)
            carried[0], carried[1], carried[2] = fy * w - fz * v, fz * u - fx * w, fx * v - fy * u
            carried[3] = my * w - mz * v + fy * z - fz * y
            carried[4] = mz * u - mx * w + fz * x - fx * z
            carried[5] = mx * v - my * u + fx * y - fy * x
            for after in range(at + 1, len(moved)):
                later = moved[after]
                change = 0.0
                for r in range(6):
                    change += axes[i, later, r] * carried[r]
                by_place[i, later, j] -= change
            if rows[j] < 0:
                continue
            row, slope = out[i, rows[j]], slopes[i, j]
            for k in range(first, out.shape[2]):
                force = x * by[0, k] + y * by[1, k] + z * by[2, k] + u * by[3, k] + v * by[4, k] + w * by[5, k]
                row[k] -= slope * force
