"""Interpolates loads between samples by natural cubic splines, with rates, in compiled code."""

import numpy as np

from kinertia.model.array_types import Float1, Float3, Int1
from kinertia.model.compiled import compiled, part

_EACH = 9
"""Columns of a foot: force, centre of pressure, and torque about it."""


@compiled
def loads_and_rates(
    time: Float1, wrench: Float3, point: Float3, at: Float1, interval: Int1
) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate loads (n, 2, 6) between samples, N and N m about the ground origin, with their time derivatives.

    Splines interpolate force, centre of pressure and torque about it; beyond the ends their cubics continue.

    Args:
        time: (k,) s, of at least two samples.
        wrench, point: (k, 2, 6) loads, and (k, 2, 3) m centres of pressure, at the samples.
        at: (n,) s.
        interval: (n,) index of the sample before each of these times, at most k - 2.
    """
    feet, n = wrench.shape[1], len(at)
    columns = _columns(wrench, point)
    bend = _second_derivatives(time, columns)
    loads, rates = np.empty((n, feet, 6)), np.empty((n, feet, 6))
    value, rate = np.empty(_EACH), np.empty(_EACH)
    for i in range(n):
        k = interval[i]
        step, s = time[k + 1] - time[k], at[i] - time[k]
        for foot in range(feet):
            for c in range(_EACH):
                j = _EACH * foot + c
                here, there = bend[k, j], bend[k + 1, j]
                slope = (columns[k + 1, j] - columns[k, j]) / step - step / 6.0 * (2.0 * here + there)
                turn = (there - here) / step
                value[c] = columns[k, j] + s * (slope + s * (here / 2.0 + s * turn / 6.0))
                rate[c] = slope + s * (here + s * turn / 2.0)
            x, y, z, fx, fy, fz = value[3], value[4], value[5], value[0], value[1], value[2]
            vx, vy, vz, gx, gy, gz = rate[3], rate[4], rate[5], rate[0], rate[1], rate[2]
            for c in range(3):
                loads[i, foot, c], rates[i, foot, c] = value[c], rate[c]
            loads[i, foot, 3] = value[6] + y * fz - z * fy
            loads[i, foot, 4] = value[7] + z * fx - x * fz
            loads[i, foot, 5] = value[8] + x * fy - y * fx
            rates[i, foot, 3] = rate[6] + vy * fz - vz * fy + y * gz - z * gy
            rates[i, foot, 4] = rate[7] + vz * fx - vx * fz + z * gx - x * gz
            rates[i, foot, 5] = rate[8] + vx * fy - vy * fx + x * gy - y * gx
    return loads, rates


@part
def _columns(wrench: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the columns (k, 18) that are interpolated: for each foot force, centre of pressure and torque about it."""
    result = np.empty((wrench.shape[0], _EACH * wrench.shape[1]))
    for k in range(wrench.shape[0]):
        for foot in range(wrench.shape[1]):
            load, x, y, z = wrench[k, foot], point[k, foot, 0], point[k, foot, 1], point[k, foot, 2]
            own = result[k, _EACH * foot : _EACH * (foot + 1)]
            for c in range(3):
                own[c], own[3 + c] = load[c], point[k, foot, c]
            own[6] = load[3] - (y * load[2] - z * load[1])
            own[7] = load[4] - (z * load[0] - x * load[2])
            own[8] = load[5] - (x * load[1] - y * load[0])
    return result


@part
def _second_derivatives(time: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Compute second derivatives (k, c) at the samples of the natural cubic splines through columns (k, c)."""
    count, wide = columns.shape
    result, above = np.zeros((count, wide)), np.zeros(count)
    for k in range(1, count - 1):
        before, after = time[k] - time[k - 1], time[k + 1] - time[k]
        pivot = 2.0 * (before + after) - before * above[k - 1]
        above[k] = after / pivot
        for c in range(wide):
            change = (columns[k + 1, c] - columns[k, c]) / after - (columns[k, c] - columns[k - 1, c]) / before
            result[k, c] = (6.0 * change - before * result[k - 1, c]) / pivot
    for k in range(count - 2, 0, -1):
        for c in range(wide):
            result[k, c] -= above[k] * result[k + 1, c]
    return result
