"""Estimates motion, body segment parameters and calibration together, maximum a posteriori.

Symbols, the same in all packages here; subscripts of the trial are left out:

    q(t) = sum_j B_j(t) c_j    coordinates that move: quintic B-splines B_j of time, coefficients c_j (`motion_basis`)
    s                          static unknowns: of calibration, instruments and body (`Layout`)
    theta, b(theta)            log-Cholesky parameters of the segments, a part of s, and their table, ten per segment
    y_m, x_m(q, s)             measured and modelled position of marker m
    e = y - x                  errors of the markers; W their information, banded in time (`marker_errors`)
    f(t, s)                    ground reactions, corrected for errors of plates and synchronisation (`GroundLoads`)
    r(q, q', q'', s)           load (6) at the root that f leaves unexplained, and D its variances
    b0, P; M, sd_M             mean and covariance of the prior of b; mass by the scale and its SD

The estimate is the minimum over all c and s of half of

    sum over trials [ e' W e + sum over measured frames r' D^-1 r + ranges and start ]
        + (b - b0)' P^-1 (b - b0) + (m(b) - M)^2 / sd_M^2 + priors of the other s

`terms` holds the summands, `instruments` what f depends on, `markers` what x and W depend on; `linear_algebra` solves
the normal equations, `search` finds the minimum, `uncertainty` derives error bars from the curvature there.
"""
