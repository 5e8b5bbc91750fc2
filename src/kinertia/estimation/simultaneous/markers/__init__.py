"""Describes errors of markers: noise, skin motion, offsets, and which markers are visible.

A marker m of a segment with position p and rotation R is at

    x_m = p(q) + R(q) [l_m + C_m phi(t)]

with its position l_m in the segment and skin that follows neighbouring joints, patterns phi and coefficients C_m
(`skin`). What remains, e = y - x, is a second-order autoregressive process per marker coordinate (`marker_errors`),

    e[t] = (r + s) e[t-1] - r s e[t-2] + white noise,

whose SD and correlation are estimated beforehand (`marker_noise`). W, the inverse of its covariance, is banded in time.
"""
