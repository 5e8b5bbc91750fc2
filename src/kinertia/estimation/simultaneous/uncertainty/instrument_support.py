"""Tests whether an instrument error is credible: it affects joint moments, and no trial contradicts it.

The estimate corrects every instrument error that it finds. Many of them may be errors of the model: soft tissue that
lags looks like delayed forces, a bending trunk like a displaced plate. Users who are asked to check a plate should find
an error there. So an error must matter, by its effect on joint moments, and be present in every trial.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from kinertia.estimation.simultaneous.calibration_entry import INTERVAL_SD
from kinertia.estimation.simultaneous.linear_algebra.static_information import StaticInformation
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.linearised import Point
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.uncertainty.moment_derivatives import MomentsOfTrial

_MOST_FRAMES = 100
"""Number of frames of each trial, evenly spaced, at which moments are compared."""
_ROOT = 6
"""Coordinates of the pelvis come first: their generalised forces are residuals, not joint moments."""


@dataclass(frozen=True, eq=False)
class InstrumentSupport:
    """Support of the k instrument unknowns, in the order of `Layout.errors`.

    Attributes:
        moved: (k,) effect of a unit of the uncorrected error on the most affected joint moment, in half-widths of the
            moment's own 95 % interval.
        contradicted: (k,) whether a single trial and the others disagree; False for errors that belong to one trial.
    """

    moved: np.ndarray
    contradicted: np.ndarray


def instrument_support(
    model: GaussNewton, point: Point, gaussian: GaussianPrior, curves: tuple[CurveDeviations, ...]
) -> InstrumentSupport:
    """Compute the support of all instruments' errors.

    Args:
        model: the quadratic at the end of the search, under the Gaussian.
        point: the estimate.
        gaussian: replaces the priors of the instruments.
        curves: standard deviations of the trials' curves.
    """
    root, late = model.static.root_of_covariance(), model.problem.loads.delay_unknowns
    delay_sd_s = [float(np.linalg.norm(root[late(k)].sum(axis=0))) for k in range(len(curves))]
    each_trial = enumerate(zip(curves, delay_sd_s, strict=True))
    moved = [moved_moments(model.problem, k, point, *each) for k, each in each_trial]
    return InstrumentSupport(np.max(moved, axis=0), contradicted_errors(model, gaussian))


def moved_moments(
    problem: MapProblem, k: int, point: Point, curves: CurveDeviations, delay_sd_s: float = 0.0
) -> np.ndarray:
    """Compute `InstrumentSupport.moved` (k,) in one trial, from derivatives of its joint moments at fixed motion.

    The derivatives by the delay are averaged over its standard deviation.
    """
    dynamic, instruments = np.flatnonzero(problem.trials[k].dynamic), problem.layout.errors
    if not len(dynamic):
        return np.zeros(instruments.stop - instruments.start)
    some = np.unique(np.linspace(0, len(dynamic) - 1, min(_MOST_FRAMES, len(dynamic))).astype(int))
    frames, static = dynamic[some], problem.in_trial(k, point)
    motion = problem.model.full(problem.bases[k].evaluate(point.coefficients[k], frames), static)
    every = MomentsOfTrial(problem, k, static, problem.loads.reactions(k, static), delay_sd_s)
    by = every.derivatives(motion, frames)
    change = np.abs(by.static[:, _ROOT : len(problem.moving), instruments])
    rows = np.searchsorted(problem.trials[k].curve_frames, frames)
    result: np.ndarray = (change / (INTERVAL_SD * curves.moments[rows][:, _ROOT:, None])).max(axis=(0, 1))
    return result


def contradicted_errors(model: GaussNewton, gaussian: GaussianPrior) -> np.ndarray:
    """Return the mask (k,) of the laboratory's instruments for which one trial and all the others disagree.

    Each estimate includes the priors; they disagree beyond 95 % for any of the trials.
    """
    problem, here = model.problem, model.here
    layout, count = problem.layout, len(here.trials)
    result = np.zeros(len(gaussian.pull), dtype=bool)
    if count < 2:
        return result
    right_hand_sides = _right_hand_sides(model)
    prior_rhs = here.point.like(here.slope.under(gaussian)[1]).static
    prior_rhs = prior_rhs - sum(trial.gradient.static_rhs for trial in here.trials)
    prior = here.information.copy()
    prior[layout.errors, layout.errors] += gaussian.precision
    every = sum(each.information for each in model.displaced)
    shared = slice(0, layout.laboratory.stop - layout.laboratory.start)
    # by chance one of twenty instruments, however many trials there are; with two, each contradicts the other
    apart_sd = -ndtri(0.025 / (count if count > 2 else 1))
    for k, own in enumerate(model.displaced):
        alone = _posterior(prior + own.information, prior_rhs + right_hand_sides[k], layout.in_root.stop, layout.errors)
        rest = prior_rhs + sum(right_hand_sides) - right_hand_sides[k]
        others = _posterior(prior + every - own.information, rest, layout.in_root.stop, layout.errors)
        apart = np.abs(alone[0] - others[0]) > apart_sd * np.hypot(alone[1], others[1])
        result[shared] |= apart[shared]
    return result


def _right_hand_sides(model: GaussNewton) -> list[np.ndarray]:
    """Return, per trial, the right-hand side (S,) on the static unknowns, motion and displacements eliminated."""
    pull, places = model.here.point.like(model.here.slope.rhs), model.problem.layout.displaced
    result = []
    for k, (trial, displaced) in enumerate(zip(model.here.trials, model.displaced, strict=True)):
        _, lost = trial.forward(pull.coefficients[k])
        own = pull.displaced[k] - model.problem.displaced_sd[k] * lost[places]
        result.append(trial.gradient.static_rhs - lost - own @ displaced.gain)
    return result


def _posterior(information: np.ndarray, rhs: np.ndarray, first: int, places: slice) -> tuple[np.ndarray, np.ndarray]:
    """Return steps (k,) of the unknowns at these indices, and their standard deviations (k,)."""
    found = StaticInformation.of(information, first)
    covariance = np.linalg.inv(found.first)
    variance = np.maximum(np.diag(covariance)[places], 0.0)
    return found.solution(rhs)[places], np.sqrt(variance)
