"""Varies what the study behind Table 1 may have done differently: one function per hypothesis.

Its text does not describe all steps, and its tools had defaults. Each function replaces one step of a `Setup`.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from kinertia.estimation.study_parameters import ParameterVector
from kinertia.estimation.two_level import TwoLevelProblem, Window, radius_of_gyration, trust_scale, vector_bounds
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.smoothing import SmoothedSpline, interpolate, smooth
from kinertia.motion.workload import one_blas_thread
from kinertia.studies.table1 import coordinates, random_start, study_trial
from kinertia.synthetic.noise import STUDY_RATE_RAD_S, displaced
from kinertia.synthetic.walk import SyntheticTrial
from kinertia.trial.data import Markers

LEFT_OUT = tuple(f"{side}.{name}" for side in "RL" for name in ("Temple", "Midfoot.Sup", "Toe.Lat", "Toe.Med", "Bicep"))
LEFT_OUT += ("R.Wrist.Lat", "L.Wrist.Lat")
"""Without these 29 of the package's 41 markers remain."""


@one_blas_thread
def trust_region(
    skeleton: Skeleton,
    start: BodySegmentParameters,
    window: Window,
    correct: bool,
    *,
    length_m: float | None = None,
    about_ground: bool = False,
    every: int = 1,
    tolerance: float = 1e-6,
    most_iterations: int = 100,
    differences: bool = False,
    scaled: bool = True,
    subspace: bool = False,
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Run a trust region method: return every iterate (k, 49), the cost at each, and whether it stopped by itself.

    Args:
        skeleton, start, window, correct: as in `estimate_two_level`.
        length_m: moments are divided by it; by the radius of gyration if None.
        about_ground: moments about the ground origin, instead of the (measured) pelvis.
        every: only every so many frames count; the pelvis is still corrected in all.
        tolerance: relative, of cost and step; below it the method stops.
        most_iterations: the method stops there, too.
        differences: a Jacobian by forward differences instead of the exact one.
        scaled: a parameter's unit is its start value; or else kg, m and kg m2.
        subspace: steps from the plane of the gradient and an iterative Gauss-Newton step, as large problems are solved.
    """
    vector = ParameterVector(start, True)
    length_m = radius_of_gyration(skeleton, start, [window]) if length_m is None else length_m
    problem = TwoLevelProblem(skeleton, vector, [window], correct, length_m)
    residuals, jacobian = error_signal(problem, about_ground, every)
    theta = vector.values(start)
    path, costs = [theta], [0.5 * float(np.square(residuals(theta)).sum())]

    def follow(intermediate_result: OptimizeResult) -> None:
        path.append(intermediate_result.x.copy())
        costs.append(float(intermediate_result.cost))
        if len(path) > most_iterations:
            raise StopIteration

    least_squares(
        residuals,
        theta,
        "2-point" if differences else jacobian,
        bounds=vector_bounds(vector),
        x_scale=trust_scale(theta) if scaled else 1.0,
        ftol=tolerance,
        xtol=tolerance,
        gtol=1e-15,
        tr_solver="lsmr" if subspace else "exact",
        callback=follow,
    )
    return np.array(path), np.array(costs), len(path) <= most_iterations


def error_signal(
    problem: TwoLevelProblem, about_ground: bool, every: int
) -> tuple[Callable[[np.ndarray], np.ndarray], Callable[[np.ndarray], np.ndarray]]:
    """Return the function of a problem's residuals that is minimised, and its Jacobian, as in `trust_region`."""
    place = problem.windows[0].motion.q[:, :3]
    weights = np.tile(np.eye(6), (len(place), 1, 1))
    if about_ground:
        weights[:, 3:, :3] = np.swapaxes(np.cross(place[:, None, :], np.eye(3)), 1, 2) / problem.length

    def weighed(values: np.ndarray) -> np.ndarray:
        chosen: np.ndarray = (weights @ values.reshape(len(weights), 6, -1))[::every]
        return chosen.reshape(-1, *values.shape[1:])

    return lambda theta: weighed(problem.residuals(theta)), lambda theta: weighed(problem.jacobian(theta))


def fewer_markers() -> SyntheticTrial:
    """Return the package's walk without the markers `LEFT_OUT`."""
    trial = study_trial()
    worn = [marker for marker in trial.skeleton.markers if marker.label not in LEFT_OUT]
    return replace(trial, skeleton=trial.skeleton.with_markers(worn))


def noise_per_marker(trial: SyntheticTrial, rng: np.random.Generator) -> Markers:
    """Add one sinusoid per marker, along the diagonal of the ground axes."""
    return displaced(trial.markers, (len(trial.skeleton.markers), 1), rng)


def noise_per_segment(trial: SyntheticTrial, rng: np.random.Generator) -> Markers:
    """Move the markers of a segment together, along each ground axis with a sinusoid of its own."""
    moved, markers = trial.markers.positions.copy(), trial.skeleton.markers
    for segment in trial.skeleton.segments:
        on_it = [i for i, marker in enumerate(markers) if marker.segment == segment]
        moved[:, on_it] = displaced(trial.markers, (1, 3), rng).positions[:, on_it]
    return replace(trial.markers, positions=moved)


def slower_noise(trial: SyntheticTrial, rng: np.random.Generator) -> Markers:
    """Add noise with rates up to half as high."""
    return displaced(trial.markers, trial.markers.positions.shape[1:], rng, STUDY_RATE_RAD_S / 2)


def markers_smoothed_first(trial: SyntheticTrial, markers: Markers) -> SmoothedSpline:
    """Smooth marker coordinates by GCV, then apply inverse kinematics."""
    flat = markers.positions.reshape(len(markers.time), -1)
    smoothed = smooth(markers.time, flat, "gcv")(markers.time).reshape(markers.positions.shape)
    return coordinates(trial, replace(markers, positions=smoothed))


def known_variance(trial: SyntheticTrial, markers: Markers) -> SmoothedSpline:
    """Minimise the predicted mean squared error, RSS - 2 variance (n - trace A), with each coordinate's true variance.

    It is criterion 3 of Woltring's package (Craven and Wahba 1979); like GCV, it assumes independent errors.
    """
    ik = solve_ik(trial.skeleton, markers)
    variance, fitted, risk = np.square(ik.q - trial.motion.q).mean(axis=0), [], []
    for cutoff_hz in np.geomspace(0.1, 0.4 / (ik.time[1] - ik.time[0]), 100):
        spline = smooth(ik.time, ik.q, float(cutoff_hz))
        fitted.append(spline(ik.time))
        rss = np.square(fitted[-1] - ik.q).sum(axis=0)
        risk.append(rss - 2.0 * variance * rss / spline.sigma**2)
    best = np.argmin(risk, axis=0)
    return interpolate(ik.time, np.array(fitted)[best, :, np.arange(len(best))].T)


def mass_of_scale(vector: ParameterVector, rng: np.random.Generator) -> np.ndarray:
    """Return the usual start with all masses multiplied so that their sum is right."""
    theta = random_start(vector, rng)
    theta[::7] *= vector.reference.total_mass_kg / vector.bsp(theta).total_mass_kg
    return theta


def com_by_distance(vector: ParameterVector, rng: np.random.Generator) -> np.ndarray:
    """Return the usual start, but with CoM errors of up to half of the CoM's distance from the segment's origin."""
    theta, com = random_start(vector, rng).reshape(-1, 7), vector.values(vector.reference).reshape(-1, 7)[:, 1:4]
    theta[:, 1:4] = com + (theta[:, 1:4] / com - 1.0) * np.linalg.norm(com, axis=1, keepdims=True)
    return theta.ravel()
