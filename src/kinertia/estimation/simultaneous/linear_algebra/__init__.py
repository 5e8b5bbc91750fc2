"""Solves the normal equations: bands over time, with a border of what does not move.

The coefficients c of a trial are coupled to neighbours in time only, and all of them to s:

    [ A   B ] [dc]   [g]        A block tridiagonal (`block_tridiagonal`), B the border, C of the static unknowns
    [ B'  C ] [ds] = [h]

Eliminating dc leaves (C - B' A^-1 B) ds = h - B' A^-1 g (`elimination`): trials of a person add these, and the inverse
of the sum is the covariance of s. Unknowns on which markers alone depend are eliminated in the same way
(`StaticInformation`). `normal_equations` accumulates A, B, C, g, h over knot intervals, `frame_blocks` in blocks of
time.
"""
