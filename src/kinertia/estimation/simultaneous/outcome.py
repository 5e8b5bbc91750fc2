"""Defines the result of the simultaneous estimate, in physical units and names."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from kinertia.estimation.simultaneous.instruments.instrument_errors import CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.search.problem import Linearised, MapProblem, Point
from kinertia.estimation.simultaneous.terms.cost_term import Solution
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.uncertainty.evidence import Evidence, InstrumentSupport, MissingLoad
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import PosteriorDraws
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.ground_reactions import GroundReactions


@dataclass(frozen=True, kw_only=True)
class SimultaneousResult:
    """Result of `estimate_simultaneous`.

    Attributes:
        bsp: the estimate, physically consistent.
        bsp_covariance: (10 s, 10 s) posterior covariance of its table rows, segment after segment.
        skeleton: with the estimated marker positions and static coordinates.
        coordinates: static coordinate -> (value, posterior standard deviation), rad or m.
        foot_loads: per trial (n, 2, 6) loads on the feet, corrected for instrument errors, at the motion's bandwidth.
        reactions: per trial the loads for the joint moments, corrected for instrument errors.
        motions: per trial q, qd, qdd at its frames.
        marker_offsets_m: per trial (m, 3) displacements of its markers from their positions in the segments.
        curve_deviations: per trial the posterior standard deviations of its curves at its reported frames.
        calibration: entries of all quantities that terms calibrate.
        instruments: information of these trials on plates and synchronisation, which can be added to that of others.
        converged: whether the last step was short: CONVERGED_SD, CONVERGED.
        iterations: Gauss-Newton steps taken.
        cost: half the sum of squares, at the start and at the end.
        support: whether each instrument error is credible.
        evidence: of the trials, and of the same trials interpreted differently.
        draws: from the posterior, or None.
        missing_loads: loads of which a part is missing, which seem to be errors of plates.
    """

    bsp: BodySegmentParameters
    bsp_covariance: np.ndarray
    skeleton: Skeleton
    coordinates: dict[str, tuple[float, float]]
    foot_loads: tuple[np.ndarray, ...]
    reactions: tuple[GroundReactions, ...]
    motions: tuple[Motion, ...]
    marker_offsets_m: tuple[np.ndarray, ...]
    curve_deviations: tuple[CurveDeviations, ...]
    calibration: tuple[CalibrationEntry, ...]
    instruments: InstrumentInformation
    converged: bool
    iterations: int
    cost: tuple[float, float]
    support: InstrumentSupport
    evidence: Evidence
    draws: PosteriorDraws | None
    missing_loads: tuple[MissingLoad, ...] = ()

    def of_first(self, count: int) -> Self:
        """Return the result with the first `count` trials only."""
        names = ("foot_loads", "reactions", "motions", "marker_offsets_m", "curve_deviations")
        first = {name: getattr(self, name)[:count] for name in names}
        return replace(self, **first, draws=None if self.draws is None else self.draws.of_first(count))


class Ended(NamedTuple):
    """State at the end of the search.

    The point, the quadratic there and the instruments' last Gaussian; whether it ended before its limit; the number of
    quadratics; the cost at the start and at the end.
    """

    point: Point
    here: Linearised
    instruments: GaussianPrior
    converged: bool
    iterations: int
    cost: tuple[float, float]


def result_of(
    problem: MapProblem,
    ended: Ended,
    motions: Sequence[np.ndarray],
    covariance: np.ndarray,
    of_curves: tuple[CurveDeviations, ...],
    support: InstrumentSupport,
    evidence: Evidence,
    draws: PosteriorDraws | None,
) -> SimultaneousResult:
    """Convert the end of the search to a result in physical units, from the terms' readings of the solution.

    `motions` are per trial, `covariance` (S, S) is of all unknowns that do not move, `of_curves` are the curves'
    standard deviations.
    """
    values = ended.point.static
    solution = Solution(
        static=values,
        covariance=covariance,
        there=ended.here.point.static,
        displaced=tuple(sd * offsets for sd, offsets in zip(problem.displaced_sd, ended.point.displaced, strict=True)),
        gaussian=ended.instruments,
        moved=support.moved,
        contradicted=support.contradicted,
    )
    read = problem.read(solution)
    entries = tuple(entry for values_of_term in read for entry in values_of_term.pop("calibration", ()))
    trials = range(len(problem.trials))
    return SimultaneousResult(
        **{name: value for values_of_term in read for name, value in values_of_term.items()},
        calibration=entries,
        skeleton=problem.model.locked(values),
        foot_loads=tuple(problem.loads.on_feet(k, values) for k in trials),
        reactions=tuple(problem.loads.reactions(k, values) for k in trials),
        motions=tuple(Motion(*basis.evaluate(part)) for basis, part in zip(problem.bases, motions, strict=True)),
        curve_deviations=of_curves,
        converged=ended.converged,
        iterations=ended.iterations,
        cost=ended.cost,
        support=support,
        evidence=evidence,
        draws=draws,
    )
