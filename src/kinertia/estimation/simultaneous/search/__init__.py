"""Finds the estimate: the problem, its linearisation, Gauss-Newton and quasi-Newton steps.

With cost F, slope g and the quadratic H that Gauss-Newton makes of the residuals' first derivatives (`problem`), a step
minimises

    F + g' d + d' (H + lambda diag H) d / 2

shortened to where terms hold (`CostTerm.shorten`). Steps d_k and changes of slope y_k = g(k+1) - g(k) then correct H
along them, as L-BFGS does (`gauss_newton`). Priors of errors that are no Gaussians are replaced by the Gaussian that
gives the posterior the same mean and covariance, again and again (`mixture_prior`). A delay's posterior is taken from
the profile min F over all else, at three delays (`marginal_posterior`).
"""
