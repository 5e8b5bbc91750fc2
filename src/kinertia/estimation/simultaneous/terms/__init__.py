"""Defines what is minimised: cost terms, each with its unknowns, its part of the cost and its result.

With the symbols of `simultaneous`, half of the following is added to the cost; ' is the transpose, or a rate of q:

    `Markers`            e' W e,  e = y - x
    `RootLoads`          sum over measured frames of r' D^-1 r
                         r = B(q, q', q'', b) - f, moments about the moving root; B: what moves the body, less gravity
    `BodySegments`       (b - b0)' P^-1 (b - b0) + (m(b) - M)^2 / sd_M^2
    `JointRanges`        sum over knots of (excess of q over its range / sd)^2, rounded off at the limit
    `Start`              (c - c_start)^2 / away^2 + differences of neighbours of it / change^2
    `StaticCoordinates`  (s / sd)^2 of joint centres and tilts of axes, on which x and r depend
    `MarkerPositions`       (l - l0)^2 / sd^2 of positions l in the segments, and d^2 of a trial's displacements sd d
    `Skin`               |C|^2 of coefficients by which skin follows the joints (`skin`)
    `InstrumentErrors`   -2 log of the mixture priors of the errors on which f depends (`mixture_prior`)
    `MissingLoads`       the same of shares of the load that no plate measured
    `TrunkBending`       kappa^2 / sd^2 of one first moment per trial, on which r depends
    `TaskMasses`         nothing: a mass that depends on the task lengthens error bars (`CostTerm.left_out`)

A term of other packages is given to `fit_subject`; `CostTerm.order` states its place among these.
"""
