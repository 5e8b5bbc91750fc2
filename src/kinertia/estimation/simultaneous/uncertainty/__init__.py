"""Computes error bars of the estimate: covariances, curves, posterior draws, and evidence for errors.

With the symbols of `simultaneous`, the curvature at the estimate as in `linear_algebra`, and S = (C - B' A^-1 B)^-1 the
covariance of s, a curve h(c, s), such as a joint moment, has the variance

    G S G' + n h_c A^-1 h_c',     G = h_s - h_c A^-1 B',   subscripts: derivatives

n is the observed power of the markers' errors where joint moments are sensitive, over that of W (`motion_noise`). The
first part has more: what is left out of s, the spread over positions of the knots (`marginal_posterior`), geometry of
the knee and skin that moves as a block (`model_errors`). Draws are made of the same parts (`posterior_draws`). The
evidence for an interpretation of a recording is the integral of exp(-F) by the same curvature (`evidence`).
"""
