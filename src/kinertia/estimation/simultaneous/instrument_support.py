"""Tests what supports an accusation: the error moves joint moments, and no trial contradicts it.

The estimate puts every instrument right by what it finds. Much of what it finds may be the model's own error: soft
tissue that lags looks like late forces, a trunk that bends like a plate elsewhere. Whoever is told to check a plate
should find something there. So an error must matter, by the joint moments that it moves, and hold in every trial.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from kinertia.estimation.simultaneous.calibration_entry import INTERVAL_SD
from kinertia.estimation.simultaneous.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.linearised import Point
from kinertia.estimation.simultaneous.moment_derivatives import moment_derivatives
from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.estimation.simultaneous.sound_or_faulty import GaussianPrior
from kinertia.estimation.simultaneous.static_information import StaticInformation

_MOST_FRAMES = 100
"""Of each trial, evenly spaced, at which moments are looked at."""
_ROOT = 6
"""Coordinates of the pelvis come first: what moves them are residuals, not joint moments."""


@dataclass(frozen=True, eq=False)
class InstrumentSupport:
    """Of the k instrument unknowns, in the order of `Layout.errors`.

    Attributes:
        moved: (k,) by how many halves of its own 95 % interval a unit of the error, put back, moves the joint moment
            that it moves most.
        contradicted: (k,) whether a trial alone and the others do not agree; never of what is a single trial's.
    """

    moved: np.ndarray
    contradicted: np.ndarray


def instrument_support(
    model: GaussNewton, point: Point, gaussian: GaussianPrior, curves: tuple[CurveDeviations, ...]
) -> InstrumentSupport:
    """Support of all instruments' errors.

    Args:
        model: the quadratic at the end of the search, under the Gaussian.
        point: the estimate.
        gaussian: in place of the priors of the instruments.
        curves: deviations of the trials' curves.
    """
    root, late = model.static.root_of_covariance(), model.problem.loads.late
    late_sd_s = [float(np.linalg.norm(root[late(k)].sum(axis=0))) for k in range(len(curves))]
    each_trial = enumerate(zip(curves, late_sd_s, strict=True))
    moved = [moved_moments(model.problem, k, point, *each) for k, each in each_trial]
    return InstrumentSupport(np.max(moved, axis=0), trials_apart(model, gaussian))


def moved_moments(
    problem: MapProblem, k: int, point: Point, curves: CurveDeviations, late_sd_s: float = 0.0
) -> np.ndarray:
    """(k,) `InstrumentSupport.moved` in one trial, by the derivatives of its joint moments while the motion stays;
    those by the delay are averaged over its deviation.
    """
    dynamic, instruments = np.flatnonzero(problem.trials[k].dynamic), problem.layout.errors
    if not len(dynamic):
        return np.zeros(instruments.stop - instruments.start)
    some = np.unique(np.linspace(0, len(dynamic) - 1, min(_MOST_FRAMES, len(dynamic))).astype(int))
    frames, static = dynamic[some], problem.in_trial(k, point)
    motion = problem.model.full(problem.bases[k].evaluate(point.coefficients[k], frames), static)
    by = moment_derivatives(problem, k, motion, static, problem.loads.reactions(k, static), frames, late_sd_s)
    change = np.abs(by.static[:, _ROOT:, instruments])
    result: np.ndarray = (change / (INTERVAL_SD * curves.moments[some][:, _ROOT:, None])).max(axis=(0, 1))
    return result


def trials_apart(model: GaussNewton, gaussian: GaussianPrior) -> np.ndarray:
    """(k,) of which of the laboratory's instruments a trial alone and all the others, each with the priors, say
    different things: beyond 95 % for any of the trials.
    """
    problem, here = model.problem, model.here
    layout, count = problem.layout, len(here.trials)
    result = np.zeros(len(gaussian.pull), dtype=bool)
    if count < 2:
        return result
    rights = _rights(model)
    prior_right = here.point.like(here.slope.under(gaussian)[1]).static
    prior_right = prior_right - sum(trial.gradient.static_right for trial in here.trials)
    prior = here.information.copy()
    prior[layout.errors, layout.errors] += gaussian.precision
    every = sum(each.information for each in model.displaced)
    shared = slice(0, layout.laboratory.stop - layout.laboratory.start)
    # by chance one of twenty instruments, however many trials there are; of two, one contradicts the other
    apart_sd = -ndtri(0.025 / (count if count > 2 else 1))
    for k, own in enumerate(model.displaced):
        alone = _posterior(prior + own.information, prior_right + rights[k], layout.in_root.stop, layout.errors)
        rest = prior_right + sum(rights) - rights[k]
        others = _posterior(prior + every - own.information, rest, layout.in_root.stop, layout.errors)
        apart = np.abs(alone[0] - others[0]) > apart_sd * np.hypot(alone[1], others[1])
        result[shared] |= apart[shared]
    return result


def _rights(model: GaussNewton) -> list[np.ndarray]:
    """Per trial the right-hand side (S,) on the static unknowns, motion and displacements eliminated."""
    pull, places = model.here.point.like(model.here.slope.right), model.problem.layout.displaced
    result = []
    for k, (trial, displaced) in enumerate(zip(model.here.trials, model.displaced, strict=True)):
        _, lost = trial.forward(pull.coefficients[k])
        own = pull.displaced[k] - model.problem.displaced_sd[k] * lost[places]
        result.append(trial.gradient.static_right - lost - own @ displaced.gain)
    return result


def _posterior(information: np.ndarray, right: np.ndarray, first: int, places: slice) -> tuple[np.ndarray, np.ndarray]:
    """(k,), (k,) steps of the unknowns at these places, and their deviations."""
    found = StaticInformation.of(information, first)
    covariance = np.linalg.inv(found.first)
    variance = np.maximum(np.diag(covariance)[places], 0.0)
    return found.solution(right)[places], np.sqrt(variance)
