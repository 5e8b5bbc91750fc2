"""Outcome of the simultaneous estimate: where its search ended, in units and names of measured things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.evidence import Evidence
from kinertia.estimation.simultaneous.instrument_support import InstrumentSupport
from kinertia.estimation.simultaneous.instruments import InstrumentInformation
from kinertia.estimation.simultaneous.linearised import Linearised, Point
from kinertia.estimation.simultaneous.plate_loads import GAIN
from kinertia.estimation.simultaneous.plates import PLATE_ERRORS
from kinertia.estimation.simultaneous.posterior_draws import PosteriorDraws
from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.estimation.simultaneous.sound_or_faulty import GaussianPrior
from kinertia.model.bsp import BodySegmentParameters, block_diagonal
from kinertia.model.log_cholesky import table_jacobian
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.ground_reactions import GroundReactions


@dataclass(frozen=True, kw_only=True)
class SimultaneousResult:
    """Outcome of `estimate_simultaneous`.

    Attributes:
        bsp: the estimate, physically consistent.
        bsp_covariance: (10 s, 10 s) posterior covariance of its table rows, segment after segment.
        skeleton: with the estimated marker positions and static coordinates.
        coordinates: static coordinate -> (value, posterior deviation), rad or m.
        plates: per plate what is wrong with it (5,), in the order of PLATE_ERRORS, and the posterior deviations (5,).
        clock_s: the time offset and its posterior deviation, s.
        delays_s: per trial how much later its forces are than by the clock of all, and the posterior deviation, s; none
            of a single trial whose clock has been checked.
        zeros_n: per trial, per plate what it reads too much (2,), in the order of ZERO_UNKNOWNS, and the posterior
            deviations (2,).
        gains: per trial, per plate its whole gain in it, and the posterior deviation.
        trunks_kg_m: per trial how much the trunk bends (`trunk_bending`), and the posterior deviation; none without a
            trunk.
        foot_loads: per trial (n, 2, 6) loads on the feet, of instruments put right, of the motion's bandwidth.
        reactions: per trial the loads for the joint moments, of instruments put right.
        motions: per trial q, qd, qdd at its frames.
        displacements_m: per trial (m, 3) how far its markers are from their places in the segments.
        curve_deviations: per trial the posterior deviations of its curves at its dynamic frames.
        instruments: what these trials say of plates and clock, to be added to what others say.
        converged: the last step was short: CONVERGED_SD, CONVERGED.
        iterations: Gauss-Newton steps taken.
        cost: half the sum of squares, at the start and at the end.
        support: what supports an accusation of each instrument.
        evidence: how likely the trials are, and the same read otherwise.
        draws: from the posterior.
    """

    bsp: BodySegmentParameters
    bsp_covariance: np.ndarray
    skeleton: Skeleton
    coordinates: dict[str, tuple[float, float]]
    plates: dict[str, tuple[np.ndarray, np.ndarray]]
    clock_s: tuple[float, float]
    delays_s: tuple[tuple[float, float], ...]
    zeros_n: tuple[dict[str, tuple[np.ndarray, np.ndarray]], ...]
    gains: tuple[dict[str, tuple[float, float]], ...]
    trunks_kg_m: tuple[tuple[float, float], ...]
    foot_loads: tuple[np.ndarray, ...]
    reactions: tuple[GroundReactions, ...]
    motions: tuple[Motion, ...]
    displacements_m: tuple[np.ndarray, ...]
    curve_deviations: tuple[CurveDeviations, ...]
    instruments: InstrumentInformation
    converged: bool
    iterations: int
    cost: tuple[float, float]
    support: InstrumentSupport
    evidence: Evidence
    draws: PosteriorDraws

    def of_first(self, count: int) -> SimultaneousResult:
        """The same with the first so many trials."""
        of_trials = ("delays_s", "zeros_n", "gains", "trunks_kg_m", "foot_loads", "reactions", "motions")
        names = (*of_trials, "displacements_m", "curve_deviations")
        return replace(self, **{name: getattr(self, name)[:count] for name in names})


class Ended(NamedTuple):
    """Where the search ended, the quadratic there and the instruments' last Gaussian; whether short of its limit, after
    how many quadratics, from which cost and at which.
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
    draws: PosteriorDraws,
) -> SimultaneousResult:
    """In the user's terms, with these motions, covariance (S, S) of all that does not move, and curves' deviations."""
    point, layout = ended.point, problem.layout
    values = point.static
    bsp = problem.bsp(values)
    # of the point at which the covariance is
    chain = block_diagonal(table_jacobian(ended.here.point.static[layout.theta]))
    sd = np.sqrt(np.diag(covariance))
    names = list(problem.calibration.coordinates)
    coordinates = {
        name: (float(value), float(dev))
        for name, value, dev in zip(names, values[layout.coordinates], sd[layout.coordinates], strict=True)
    }
    markers = problem.placed(values).markers
    skeleton = problem.skeleton.with_markers(markers).lock({name: value for name, (value, _) in coordinates.items()})
    plates = zip(problem.plate_errors(values), problem.plate_sd(covariance), strict=True)
    zeros = [(layout.zeros_of(k), trial.ground.plates) for k, trial in enumerate(problem.trials)]
    trials = range(len(problem.trials))
    shown = layout.instruments
    return SimultaneousResult(
        bsp=bsp,
        bsp_covariance=_at_most(chain @ covariance[layout.theta, layout.theta] @ chain.T, problem.prior.covariance),
        skeleton=skeleton,
        coordinates=coordinates,
        plates=dict(zip(problem.plates, plates, strict=True)),
        clock_s=(float(values[layout.clock]), float(sd[layout.clock])),
        delays_s=tuple(zip(values[layout.delays].tolist(), sd[layout.delays].tolist(), strict=True)),
        zeros_n=tuple(dict(zip(names, zip(values[at], sd[at], strict=True), strict=True)) for at, names in zeros),
        gains=tuple(_gains(problem, k, values, covariance) for k in trials),
        trunks_kg_m=tuple(zip(values[layout.trunks].tolist(), sd[layout.trunks].tolist(), strict=True)),
        foot_loads=tuple(problem.foot_loads(k, values) for k in trials),
        reactions=tuple(problem.reactions(k, values) for k in trials),
        motions=tuple(Motion(*basis.evaluate(part)) for basis, part in zip(problem.bases, motions, strict=True)),
        displacements_m=tuple(
            (d * own).reshape(-1, 3) for d, own in zip(problem.displacement_sd_m, point.displaced, strict=True)
        ),
        curve_deviations=of_curves,
        instruments=_shown(problem, ended.instruments, values[shown], covariance[shown, shown]),
        converged=ended.converged,
        iterations=ended.iterations,
        cost=ended.cost,
        support=support,
        evidence=evidence,
        draws=draws,
    )


def _at_most(covariance: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """The same with no combination more uncertain than in the prior's covariance: nobody knows less than before."""
    root = np.linalg.cholesky(prior)
    left = np.linalg.solve(root, np.linalg.solve(root, covariance).T)
    shares, along = np.linalg.eigh(0.5 * (left + left.T))
    along = root @ along
    result: np.ndarray = (along * np.minimum(shares, 1.0)) @ along.T
    return result


def _gains(problem: MapProblem, k: int, values: np.ndarray, covariance: np.ndarray) -> dict[str, tuple[float, float]]:
    """The whole gains of a trial's plates in it, and their deviations."""
    result, layout = {}, problem.layout
    for plate, at in zip(problem.trials[k].ground.plates, layout.gains_of(k), strict=True):
        sums = np.zeros(layout.size)
        sums[layout.plates] = problem.to_plates[len(PLATE_ERRORS) * problem.plates.index(plate) + GAIN]
        sums[at] = 1.0
        result[plate] = float(sums @ values), float(np.sqrt(sums @ covariance @ sums))
    return result


def _shown(
    problem: MapProblem, prior: GaussianPrior, mean: np.ndarray, covariance: np.ndarray
) -> InstrumentInformation:
    """What the trials say of the laboratory's instruments, without what was known before."""
    session, own = problem.session, slice(problem.layout.laboratory.stop - problem.layout.laboratory.start, len(mean))
    more = (0, own.stop - own.start)
    before = ((prior.precision, prior.pull), (np.pad(session.information, more), np.pad(session.right, more)))
    shown = InstrumentInformation.of_posterior(problem.plates, mean, covariance, before)
    return shown.without_own(prior.precision[own, own], prior.pull[own])
