"""Spatial vectors in ground axes, at the ground origin: linear part first, then angular (Featherstone 2008, ch. 2).

A motion (velocity of the body's point at the origin, angular velocity) and a force (force, moment about the origin) of
all bodies can be added up as they are, since all are taken at one place.
"""

from __future__ import annotations

import numpy as np

from kinertia.model.compiled import compiled


@compiled
def motion_cross(v: np.ndarray, m: np.ndarray, out: np.ndarray) -> None:
    """out = v x m: how the motion m changes when what it belongs to moves by v."""
    out[0] = v[4] * m[2] - v[5] * m[1] + v[1] * m[5] - v[2] * m[4]
    out[1] = v[5] * m[0] - v[3] * m[2] + v[2] * m[3] - v[0] * m[5]
    out[2] = v[3] * m[1] - v[4] * m[0] + v[0] * m[4] - v[1] * m[3]
    out[3] = v[4] * m[5] - v[5] * m[4]
    out[4] = v[5] * m[3] - v[3] * m[5]
    out[5] = v[3] * m[4] - v[4] * m[3]


@compiled
def force_cross(v: np.ndarray, f: np.ndarray, out: np.ndarray) -> None:
    """out = v x* f: how the force f changes when what it belongs to moves by v."""
    out[0] = v[4] * f[2] - v[5] * f[1]
    out[1] = v[5] * f[0] - v[3] * f[2]
    out[2] = v[3] * f[1] - v[4] * f[0]
    out[3] = v[4] * f[5] - v[5] * f[4] + v[1] * f[2] - v[2] * f[1]
    out[4] = v[5] * f[3] - v[3] * f[5] + v[2] * f[0] - v[0] * f[2]
    out[5] = v[3] * f[4] - v[4] * f[3] + v[0] * f[1] - v[1] * f[0]


@compiled
def times(matrix: np.ndarray, vector: np.ndarray, out: np.ndarray) -> None:
    """out = matrix @ vector, (6, 6) and (6,)."""
    for i in range(6):
        total = 0.0
        for k in range(6):
            total += matrix[i, k] * vector[k]
        out[i] = total


@compiled
def transposed_times(matrix: np.ndarray, vector: np.ndarray, out: np.ndarray) -> None:
    """out = matrix^T @ vector, (6, 6) and (6,)."""
    for i in range(6):
        out[i] = 0.0
    for k in range(6):
        for i in range(6):
            out[i] += matrix[k, i] * vector[k]


@compiled
def inner(a: np.ndarray, b: np.ndarray) -> float:
    """a . b of two (6,)."""
    result: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
    return result
