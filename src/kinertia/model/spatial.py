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
    out[k, 0] = v[i, 4] * m[j, 2] - v[i, 5] * m[j, 1] + v[i, 1] * m[j, 5] - v[i, 2] * m[j, 4]
    out[k, 1] = v[i, 5] * m[j, 0] - v[i, 3] * m[j, 2] + v[i, 2] * m[j, 3] - v[i, 0] * m[j, 5]
    out[k, 2] = v[i, 3] * m[j, 1] - v[i, 4] * m[j, 0] + v[i, 0] * m[j, 4] - v[i, 1] * m[j, 3]
    out[k, 3] = v[i, 4] * m[j, 5] - v[i, 5] * m[j, 4]
    out[k, 4] = v[i, 5] * m[j, 3] - v[i, 3] * m[j, 5]
    out[k, 5] = v[i, 3] * m[j, 4] - v[i, 4] * m[j, 3]


@inlined
def force_cross(v: np.ndarray, i: int, f: np.ndarray, j: int, out: np.ndarray, k: int) -> None:
    """Write v[i] x* f[j] to out[k]: the change of the force f when its body moves by v."""
    out[k, 0] = v[i, 4] * f[j, 2] - v[i, 5] * f[j, 1]
    out[k, 1] = v[i, 5] * f[j, 0] - v[i, 3] * f[j, 2]
    out[k, 2] = v[i, 3] * f[j, 1] - v[i, 4] * f[j, 0]
    out[k, 3] = v[i, 4] * f[j, 5] - v[i, 5] * f[j, 4] + v[i, 1] * f[j, 2] - v[i, 2] * f[j, 1]
    out[k, 4] = v[i, 5] * f[j, 3] - v[i, 3] * f[j, 5] + v[i, 2] * f[j, 0] - v[i, 0] * f[j, 2]
    out[k, 5] = v[i, 3] * f[j, 4] - v[i, 4] * f[j, 3] + v[i, 0] * f[j, 1] - v[i, 1] * f[j, 0]


@inlined
def inner(a: np.ndarray, i: int, b: np.ndarray, j: int) -> float:
    """Return a[i] . b[j]."""
    result: float = a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2]
    result += a[i, 3] * b[j, 3] + a[i, 4] * b[j, 4] + a[i, 5] * b[j, 5]
    return result
