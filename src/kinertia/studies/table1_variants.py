"""Repeats the noisy half of Table 1 with one thing changed at a time, to explain its pattern.

A `Variant` is one hypothesis (`kinertia.studies.table1_variants`) on what differed. All variants share their draws: the
same seed and number give the same starts and, unless the noise is what changes, the same noise. The conditions without
noise are run in the first draw: a hypothesis that does not recover the parameters there cannot be what the study did.

Its text does not describe all steps, and its tools had defaults. Each function replaces one step of a `Setup`.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from kinertia.estimation.identifiability import ParameterVector
from kinertia.estimation.two_level import TwoLevelProblem, Window, radius_of_gyration, trust_scale, vector_bounds
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.smoothing import SmoothedSpline, interpolate, smooth
from kinertia.motion.workload import one_blas_thread
from kinertia.studies.parallel import in_parallel
from kinertia.studies.table1 import (
    CONDITIONS,
    PUBLISHED,
    TODAY,
    Draw,
    Setup,
    Table1,
    coordinates,
    random_start,
    run_draw,
    study_trial,
)
from kinertia.synthetic.laboratory import STUDY_RATE_RAD_S, displaced
from kinertia.synthetic.walk import HEIGHT_M, SyntheticTrial
from kinertia.trial.data import Markers
from kinertia.trial.sampled_data import rms

NOISY = ("no_correction_noise", "correction_noise")
CLASSES = {
    "inertia": ("inertia_rms_kgm2", slice(4, 7)),
    "mass": ("mass_rms_kg", slice(0, 1)),
    "CoM": ("com_rms_m", slice(1, 4)),
}
"""Class of parameters: its error in `Errors`, and its index in the seven of a segment."""
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


@dataclass(frozen=True)
class Variant:
    """One hypothesis on what the study did differently.

    Attributes:
        setup: of its draws.
        trial: its exactly consistent trial.
        times: factor on the number of its draws.
    """

    setup: Setup
    trial: Callable[[], SyntheticTrial] = study_trial
    times: int = 1


def _solved(times: int = 1, **options: Any) -> Variant:
    """Make the variant of the trust region method with these options."""
    return Variant(Setup(estimate=partial(trust_region, **options)), times=times)


_BASE = Setup(estimate=trust_region)
BASE = "trust region, tolerances 1e-6, at most 100 iterations: base of all below"
LONG, LONG_GROUND = "at most 400 iterations", "moments about the ground, at most 400 iterations"
VARIANTS = {
    "today's set-up": Variant(TODAY),
    BASE: Variant(_BASE),
    LONG: _solved(most_iterations=400),
    "10 iterations": _solved(most_iterations=10),
    "tolerances 1e-4": _solved(tolerance=1e-4),
    "forward differences": _solved(differences=True),
    "parameters in kg, m, kg m2": _solved(scaled=False),
    "steps in a plane": _solved(subspace=True),
    "N and N m as they are": _solved(length_m=1.0),
    "moments divided by 1.8 m, a height": _solved(length_m=HEIGHT_M),
    "moments about the ground": _solved(about_ground=True),
    "every fifth frame": _solved(every=5),
    "ends of the record too": Variant(Setup(estimate=trust_region, margin_s=0.0)),
    "29 markers": Variant(_BASE, fewer_markers),
    "the same walk at 1 m/s": Variant(_BASE, partial(study_trial, pace=1.0 / 1.14)),
    "CoMs on the segments' axes": Variant(_BASE, partial(study_trial, on_axes=True)),
    "one sinusoid per marker": Variant(Setup(estimate=trust_region, noise=noise_per_marker)),
    "noise per segment": Variant(Setup(estimate=trust_region, noise=noise_per_segment)),
    "noise half as fast": Variant(Setup(estimate=trust_region, noise=slower_noise)),
    "markers smoothed first": Variant(Setup(estimate=trust_region, spline=markers_smoothed_first)),
    "error variance known": Variant(Setup(estimate=trust_region, spline=known_variance)),
    "starts with the scale's mass": Variant(Setup(estimate=trust_region, start=mass_of_scale)),
    "CoM starts off by distance": Variant(Setup(estimate=trust_region, start=com_by_distance)),
    LONG_GROUND: _solved(about_ground=True, most_iterations=400),
    "moments about the ground, N and N m as they are": _solved(about_ground=True, length_m=1.0),
    "moments about the ground, tolerances 1e-4": _solved(about_ground=True, tolerance=1e-4, times=5),
}
"""Variants by title, in the order of the table; the last is the combination nearest to the published table."""


def run_variants(
    measured: SyntheticTrial | None = None,
    variants: Mapping[str, Variant] = VARIANTS,
    repeats: int = 10,
    seed: int = 1,
    progress: Callable[[float], None] = lambda share: None,
) -> dict[str, Table1]:
    """Run every variant's draws in parallel processes; a measured trial made consistent is a variant, too."""
    if measured is not None:
        walks = {"the measured walk": {}, "the measured walk, moments about the ground": {"about_ground": True}}
        variants = {**variants, **{title: Variant(_solved(**o).setup, lambda: measured) for title, o in walks.items()}}
    trials = {title: variant.trial() for title, variant in variants.items()}
    cases = [
        (title, (trials[title], seed, number, variant.setup, NOISY if number else tuple(CONDITIONS)))
        for title, variant in variants.items()
        for number in range(repeats * variant.times)
    ]
    draws: dict[str, list[Draw]] = {title: [] for title in variants}
    results = in_parallel(_draw, [case for _, case in cases], progress=progress)
    for (title, _), draw in zip(cases, results, strict=True):
        draws[title].append(draw)
    tables = {}
    for title, trial in trials.items():
        vector = ParameterVector(trial.bsp, symmetric=True)
        tables[title] = Table1(vector.names, vector.values(trial.bsp), tuple(draws[title]), seed, title)
    return tables


def _draw(case: tuple[SyntheticTrial, int, int, Setup, tuple[str, ...]]) -> Draw:
    return run_draw(*case)


def helped(table: Table1) -> dict[str, float]:
    """Return the share of the draws in which correction reduces the error of each class."""
    errors = [[asdict(draw.errors[condition]) for condition in NOISY] for draw in table.draws]
    return {name: float(np.mean([b[field] < a[field] for a, b in errors])) for name, (field, _) in CLASSES.items()}


def distance(table: Table1) -> float:
    """Return the typical factor between means and the ten noisy RMS errors of the published table (1: equal)."""
    means = [(asdict(table.mean(condition)), asdict(PUBLISHED[condition])) for condition in NOISY]
    return float(np.exp(rms(np.array([np.log(m[name] / p[name]) for m, p in means for name in m if "_rms_" in name]))))


def stopped_by(costs: np.ndarray, tolerance: float) -> int:
    """Return the first iterate (k) that lowers the cost by a smaller share than this; the last, if none does."""
    small = -np.diff(costs) < tolerance * costs[:-1]
    return int(np.argmax(small)) + 1 if small.any() else len(small)
