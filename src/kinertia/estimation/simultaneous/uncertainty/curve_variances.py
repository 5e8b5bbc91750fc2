"""Sums the variances of curves over the frames of a knot interval, in compiled code."""

import numpy as np

from kinertia.model.compiled import Float1, Float3, Single2, Single3, StridedFloat2, StridedFloat3, compiled_sums


@compiled_sums
def write_variances(
    moment: Single2,
    carried: Single3,
    shaken: Single2,
    by_errors: Single2,
    covariance: StridedFloat2,
    values: Float3,
    shares: Float1,
    out: StridedFloat3,
) -> None:
    """Write variances of coordinates, rates and moments, and the covariances of moments with rates.

    Args:
        moment: (n c, S) change of the moments with one standard deviation of each independent part of the static
            unknowns, the motion following.
        carried: (6, c, S) the same of the active splines' coefficients.
        shaken: (n c, 6 c) derivatives of the moments by these, for the effect of the markers' errors on the motion.
        by_errors: (n c, 6 c) `shaken` times `covariance`.
        covariance: (6 c, 6 c) of these coefficients given the static unknowns.
        values: (3, n, 6) of the splines and of their first two derivatives.
        shares: (3,) factors on the standard deviations of coordinates, rates and accelerations due to these errors.
        out: (4, n, c), written.
    """
    _, n, c = out.shape
    size = moment.shape[1]
    alone = np.empty((6, 6))
    zero, one = moment.dtype.type(0.0), values.astype(moment.dtype)
    for j in range(c):
        u, v, w, x, y, z = carried[0, j], carried[1, j], carried[2, j], carried[3, j], carried[4, j], carried[5, j]
        for i in range(6):
            for s in range(6):
                alone[i, s] = covariance[i * c + j, s * c + j]
        for k in range(n):
            p0, p1, p2, p3, p4, p5 = one[0, k, 0], one[0, k, 1], one[0, k, 2], one[0, k, 3], one[0, k, 4], one[0, k, 5]
            r0, r1, r2, r3, r4, r5 = one[1, k, 0], one[1, k, 1], one[1, k, 2], one[1, k, 3], one[1, k, 4], one[1, k, 5]
            place, rate, force, both, row = zero, zero, zero, zero, k * c + j
            for s in range(size):
                own = p0 * u[s] + p1 * v[s] + p2 * w[s] + p3 * x[s] + p4 * y[s] + p5 * z[s]
                change = r0 * u[s] + r1 * v[s] + r2 * w[s] + r3 * x[s] + r4 * y[s] + r5 * z[s]
                place += own * own
                rate += change * change
                force += moment[row, s] * moment[row, s]
                both += moment[row, s] * change
            for s in range(6 * c):
                force += by_errors[row, s] * shaken[row, s]
            of_place, of_rate, of_both = 0.0, 0.0, 0.0
            for i in range(6):
                for s in range(6):
                    of_place += alone[i, s] * values[0, k, s] * values[0, k, i]
                    of_rate += alone[i, s] * values[1, k, s] * values[1, k, i]
                of_both += by_errors[row, i * c + j] * values[1, k, i]
            out[0, k, j], out[1, k, j] = place + shares[0] ** 2 * of_place, rate + shares[1] ** 2 * of_rate
            out[2, k, j], out[3, k, j] = force, both + shares[1] * of_both
