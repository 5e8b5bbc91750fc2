"""What the study behind Table 1 may have done otherwise than `kinertia.studies.table1`: one function per guess.

Its text does not say all that it did, and its tools had defaults. Each function stands in for one step of a draw: how
BSPs are estimated, what of the residuals is minimised, the trial, its noise, its coordinates, the start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq, least_squares

from kinertia.estimation.study_parameters import ParameterVector
from kinertia.estimation.two_level import (
    TwoLevelProblem,
    Window,
    estimate_two_level,
    radius_of_gyration,
    trust_scale,
    vector_bounds,
)
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.one_thread import one_blas_thread
from kinertia.motion.smoothing import SmoothedSpline, smooth
from kinertia.studies.table1 import (
    coordinates,
    random_start,
    study_trial,
)
from kinertia.synthetic.noise import STUDY_RATE_RAD_S, displaced, study_noise
from kinertia.synthetic.walk import SyntheticTrial
from kinertia.trial.data import Markers
from kinertia.trial.rms import rms

LEFT_OUT = tuple(f"{side}.{name}" for side in "RL" for name in ("Temple", "Midfoot.Sup", "Toe.Lat", "Toe.Med", "Bicep"))
LEFT_OUT += ("R.Wrist.Lat", "L.Wrist.Lat")
"""Without these 29 of the package's 41 markers remain."""
_MOST_ITERATIONS = 100


def _as_it_is(problem: TwoLevelProblem) -> TwoLevelProblem:
    return problem


def same_trial(trial: SyntheticTrial) -> SyntheticTrial:
    """The study's trial."""
    return trial


def noise_per_coordinate(trial: SyntheticTrial, rng: np.random.Generator) -> Markers:
    """The study's noise."""
    return study_noise(trial.markers, rng)


def usual_start(vector: ParameterVector, truth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Every parameter off by uniform +/-50 %."""
    return random_start(truth, rng)


@one_blas_thread
def as_today(
    skeleton: Skeleton, start: BodySegmentParameters, window: Window, correct: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Start and estimate of `estimate_two_level`, (2, 49), and its cost at both."""
    result, vector = estimate_two_level(skeleton, start, [window], correct=correct), ParameterVector(start, True)
    return np.array([vector.values(start), vector.values(result.bsp)]), np.array(result.cost)


@one_blas_thread
def trust_region(
    skeleton: Skeleton,
    start: BodySegmentParameters,
    window: Window,
    correct: bool,
    *,
    signal: Callable[[TwoLevelProblem], TwoLevelProblem | _Signal] = _as_it_is,
    tolerance: float = 1e-6,
    most_iterations: int = _MOST_ITERATIONS,
    differences: bool = False,
    scaled: bool = True,
    subspace: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Every iterate of a trust region method, (k, 49), and the cost at each; the start comes first.

    Args:
        skeleton, start, window, correct: as of `estimate_two_level`.
        signal: what of the problem's residuals is minimised.
        tolerance: relative, of cost and step; below it the method stops.
        most_iterations: the method stops there, too.
        differences: a Jacobian by forward differences instead of the exact one.
        scaled: a parameter's unit is its start value; or else kg, m and kg m2.
        subspace: steps from the plane of the gradient and an iterative Gauss-Newton step, as large problems are solved.
    """
    vector = ParameterVector(start, True)
    problem = signal(
        TwoLevelProblem(skeleton, vector, [window], correct, radius_of_gyration(skeleton, start, [window]))
    )
    theta = vector.values(start)
    path, costs = [theta], [0.5 * float(np.square(problem.residuals(theta)).sum())]

    def follow(intermediate_result: object) -> None:
        path.append(intermediate_result.x.copy())  # type: ignore[attr-defined]
        costs.append(float(intermediate_result.cost))  # type: ignore[attr-defined]
        if len(path) > most_iterations:
            raise StopIteration

    least_squares(
        problem.residuals,
        theta,
        "2-point" if differences else problem.jacobian,
        bounds=vector_bounds(vector),
        x_scale=trust_scale(theta) if scaled else 1.0,
        ftol=tolerance,
        xtol=tolerance,
        gtol=1e-15,
        tr_solver="lsmr" if subspace else "exact",
        callback=follow,
    )
    return np.array(path), np.array(costs)


@dataclass(frozen=True)
class _Signal:
    """Residuals of some frames of a problem, each multiplied by a matrix of its own (n, 6, 6)."""

    problem: TwoLevelProblem
    weights: np.ndarray
    frames: slice

    def residuals(self, theta: np.ndarray) -> np.ndarray:
        return self._weighed(self.problem.residuals(theta).reshape(-1, 6, 1)).ravel()

    def jacobian(self, theta: np.ndarray) -> np.ndarray:
        return self._weighed(self.problem.jacobian(theta).reshape(-1, 6, len(theta))).reshape(-1, len(theta))

    def _weighed(self, values: np.ndarray) -> np.ndarray:
        weighed: np.ndarray = self.weights @ values
        return weighed[self.frames]


def with_length(length_m: float, problem: TwoLevelProblem) -> TwoLevelProblem:
    """Moments divided by this length."""
    return replace(problem, length=length_m)


def about_ground(problem: TwoLevelProblem, length_m: float | None = None) -> _Signal:
    """Moments about the ground origin, instead of the (measured) pelvis, divided by this or the usual length."""
    problem = problem if length_m is None else with_length(length_m, problem)
    place = problem.windows[0].motion.q[:, :3]
    weights = np.tile(np.eye(6), (len(place), 1, 1))
    weights[:, 3:, :3] = np.swapaxes(np.cross(place[:, None, :], np.eye(3)), 1, 2) / problem.length
    return _Signal(problem, weights, slice(None))


def every_fifth(problem: TwoLevelProblem) -> _Signal:
    """Residuals of every fifth frame; the pelvis is still corrected at all."""
    return _Signal(problem, np.eye(6)[None], slice(None, None, 5))


def fewer_markers(trial: SyntheticTrial) -> SyntheticTrial:
    """The package's walk without the markers `LEFT_OUT`, whatever the trial, which may have markers of other names."""
    trial = study_trial()
    worn = [marker for marker in trial.skeleton.markers if marker.label not in LEFT_OUT]
    return replace(trial, skeleton=trial.skeleton.with_markers(worn))


def slow_walk(trial: SyntheticTrial) -> SyntheticTrial:
    """The package's walk at 1 m/s, whatever the trial."""
    return study_trial(pace=1.0 / 1.14)


def noise_per_marker(trial: SyntheticTrial, rng: np.random.Generator) -> Markers:
    """One sinusoid per marker, along the diagonal of the ground axes."""
    return displaced(trial.markers, (len(trial.skeleton.markers), 1), rng)


def noise_per_segment(trial: SyntheticTrial, rng: np.random.Generator) -> Markers:
    """The markers of a segment move together, along each ground axis with a sinusoid of its own."""
    moved, markers = trial.markers.positions.copy(), trial.skeleton.markers
    for segment in trial.skeleton.segments:
        on_it = [i for i, marker in enumerate(markers) if marker.segment == segment]
        moved[:, on_it] = displaced(trial.markers, (1, 3), rng).positions[:, on_it]
    return replace(trial.markers, positions=moved)


def slower_noise(trial: SyntheticTrial, rng: np.random.Generator) -> Markers:
    """Rates up to half as high."""
    return displaced(trial.markers, trial.markers.positions.shape[1:], rng, STUDY_RATE_RAD_S / 2)


def markers_smoothed_first(trial: SyntheticTrial, markers: Markers) -> SmoothedSpline:
    """GCV of marker coordinates, then inverse kinematics."""
    flat = markers.positions.reshape(len(markers.time), -1)
    smoothed = smooth(markers.time, flat, "gcv")(markers.time).reshape(markers.positions.shape)
    return coordinates(trial, replace(markers, positions=smoothed))


def known_variance(trial: SyntheticTrial, markers: Markers) -> SmoothedSpline:
    """Each coordinate smoothed until it has moved by as much as it was wrong (RMS), which only the truth can tell."""
    ik = solve_ik(trial.skeleton, markers)
    columns = []
    for q, wrong in zip(ik.q.T, np.sqrt(np.square(ik.q - trial.motion.q).mean(axis=0)), strict=True):

        def excess(log_cutoff: float, q: np.ndarray = q, wrong: float = wrong) -> float:
            return rms(smooth(ik.time, q, float(np.exp(log_cutoff)))(ik.time) - q) - wrong

        low, high = np.log([0.1, 40.0])
        cutoff = np.exp(brentq(excess, low, high, xtol=0.01)) if excess(low) > 0.0 else np.exp(low)
        columns.append(smooth(ik.time, q, float(cutoff))(ik.time))
    return smooth(ik.time, np.column_stack(columns), "gcv")


def mass_of_scale(vector: ParameterVector, truth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The usual start with all masses multiplied so that their sum is right."""
    theta = random_start(truth, rng)
    theta[::7] *= vector.bsp(truth).total_mass_kg / vector.bsp(theta).total_mass_kg
    return theta


def com_by_distance(vector: ParameterVector, truth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The usual start, but every CoM coordinate off by up to half of the CoM's distance from the segment's origin."""
    theta, by_segment = random_start(truth, rng).reshape(-1, 7), truth.reshape(-1, 7)
    share = theta[:, 1:4] / by_segment[:, 1:4] - 1.0
    theta[:, 1:4] = by_segment[:, 1:4] + share * np.linalg.norm(by_segment[:, 1:4], axis=1, keepdims=True)
    return theta.ravel()
