"""Computes products of spatial vectors in ground axes at the ground origin.

The linear part comes first, then the angular one (Featherstone 2008, ch. 2). A motion (velocity of the body's point at
the origin, angular velocity) and a force (force, moment about the origin) of all bodies can be summed directly, since
all are taken at one point. Vectors are rows of arrays (k, 6), selected by their indices: in inner loops a separate view
for each row takes longer than the computation.
"""

import numpy as np

from kinertia.model.compiled import inlined


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
