"""What makes the published pattern of Table 1? Its noisy half again, one thing changed at a time.

The study does not say all that it did, and its tools had defaults. A `Variant` is one guess at what differed. All
variants share their draws: the same seed and number give the same starts and, where it is not the noise that changes,
the same noise. The conditions with noise are run; those without only once, since a guess that does not find the
parameters there cannot be what the study did.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import brentq, least_squares

from kinertia.estimation.study_parameters import ParameterVector
from kinertia.estimation.two_level import (
    TwoLevelProblem,
    Window,
    correct_pelvis,
    estimate_two_level,
    radius_of_gyration,
    trust_scale,
    vector_bounds,
)
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import residual
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.one_thread import one_blas_thread
from kinertia.motion.smoothing import SmoothedSpline, smooth
from kinertia.studies.parallel import in_parallel
from kinertia.studies.table1 import (
    MARGIN_S,
    PUBLISHED,
    Errors,
    coordinates,
    errors_by_class,
    inner_frames,
    random_start,
    smoothed_window,
    study_trial,
)
from kinertia.synthetic.noise import STUDY_RATE_RAD_S, displaced, study_noise
from kinertia.synthetic.walk import HEIGHT_M, SyntheticTrial
from kinertia.trial.data import Markers
from kinertia.trial.rms import rms

NOISY = ("no_correction_noise", "correction_noise")
CLASSES = {"inertia": "inertia_rms_kgm2", "mass": "mass_rms_kg", "CoM": "com_rms_m"}
"""Class of parameters and its error in `Errors`."""
LEFT_OUT = tuple(f"{side}.{name}" for side in "RL" for name in ("Temple", "Midfoot.Sup", "Toe.Lat", "Toe.Med", "Bicep"))
"""Without these and the lateral wrist markers 29 of the package's 41 remain, at least three to a chain of joints."""
LEFT_OUT += ("R.Wrist.Lat", "L.Wrist.Lat")
_MOST_ITERATIONS = 100


def _as_it_is(problem: TwoLevelProblem) -> TwoLevelProblem:
    return problem


def _same_trial(trial: SyntheticTrial) -> SyntheticTrial:
    return trial


def _noise(trial: SyntheticTrial, rng: np.random.Generator) -> Markers:
    return study_noise(trial.markers, rng)


def _start(vector: ParameterVector, truth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
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


def about_ground(problem: TwoLevelProblem) -> _Signal:
    """Moments about the ground origin, instead of the (measured) pelvis."""
    place = problem.windows[0].motion.q[:, :3]
    weights = np.tile(np.eye(6), (len(place), 1, 1))
    weights[:, 3:, :3] = np.swapaxes(np.cross(place[:, None, :], np.eye(3)), 1, 2) / problem.length
    return _Signal(problem, weights, slice(None))


def every_fifth(problem: TwoLevelProblem) -> _Signal:
    """Residuals of every fifth frame; the pelvis is still corrected at all."""
    return _Signal(problem, np.eye(6)[None], slice(None, None, 5))


def fewer_markers(trial: SyntheticTrial) -> SyntheticTrial:
    """Without the markers `LEFT_OUT`."""
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


@dataclass(frozen=True)
class Variant:
    """One guess at what the study did otherwise: today's set-up, but for what is given.

    Attributes:
        title: what is changed, for the tables.
        estimate: start to iterates and their costs; most variants stop the trust region method where the study's would.
        trial: from the study's trial.
        noise: noisy markers of the trial.
        spline: smooth coordinates of noisy markers.
        margin_s: frames this near the ends are not used.
        start: from true parameters.
        share: of the draws; what takes long has fewer.
    """

    title: str
    estimate: Callable[..., tuple[np.ndarray, np.ndarray]] = trust_region
    trial: Callable[[SyntheticTrial], SyntheticTrial] = _same_trial
    noise: Callable[[SyntheticTrial, np.random.Generator], Markers] = _noise
    spline: Callable[[SyntheticTrial, Markers], SmoothedSpline] = coordinates
    margin_s: float = MARGIN_S
    start: Callable[[ParameterVector, np.ndarray, np.random.Generator], np.ndarray] = _start
    share: float = 1.0


TODAY = Variant("today's set-up", as_today)
BASE = Variant("trust region, tolerances 1e-6, at most 100 iterations: base of all below")
GROUND = Variant("moments about the ground", partial(trust_region, signal=about_ground))
NEAREST = Variant(
    "moments about the ground, tolerances 1e-4", partial(trust_region, signal=about_ground, tolerance=1e-4), share=5.0
)
VARIANTS = (
    TODAY,
    BASE,
    Variant("400 iterations, no tolerance", partial(trust_region, tolerance=1e-12, most_iterations=400), share=0.3),
    Variant("tolerances 1e-4", partial(trust_region, tolerance=1e-4)),
    Variant("10 iterations", partial(trust_region, most_iterations=10)),
    Variant("forward differences", partial(trust_region, differences=True), share=0.1),
    Variant("parameters in kg, m, kg m2", partial(trust_region, scaled=False)),
    Variant("steps in a plane", partial(trust_region, subspace=True)),
    Variant("N and N m as they are", partial(trust_region, signal=partial(with_length, 1.0))),
    Variant("moments divided by height", partial(trust_region, signal=partial(with_length, HEIGHT_M))),
    GROUND,
    Variant("every fifth frame", partial(trust_region, signal=every_fifth)),
    Variant("ends of the record too", margin_s=0.0),
    Variant("29 markers", trial=fewer_markers),
    Variant("the package's walk at 1 m/s", trial=slow_walk),
    Variant("one sinusoid per marker", noise=noise_per_marker),
    Variant("noise per segment", noise=noise_per_segment),
    Variant("noise half as fast", noise=slower_noise),
    Variant("markers smoothed first", spline=markers_smoothed_first),
    Variant("error variance known", spline=known_variance),
    Variant("starts with the scale's mass", start=mass_of_scale),
    Variant("CoM starts off by distance", start=com_by_distance),
    Variant(
        "moments about the ground, 400 iterations",
        partial(trust_region, signal=about_ground, most_iterations=400),
        share=0.3,
    ),
    NEAREST,
)
"""In the order of the table."""


@dataclass(frozen=True)
class Course:
    """One estimate of one draw.

    Attributes:
        errors: at its end.
        along: (k, 3) RMS error of inertia, mass and CoM at every iterate.
        costs: (k,) at every iterate.
    """

    errors: Errors
    along: np.ndarray
    costs: np.ndarray

    def stopped_by(self, tolerance: float) -> int:
        """The first iterate that lowers the cost by a smaller share than this; the last, if none does."""
        gains = -np.diff(self.costs) / self.costs[:-1]
        return int(np.argmax(gains < tolerance)) + 1 if (gains < tolerance).any() else len(gains)


@dataclass(frozen=True)
class VariantResult:
    """All draws of a variant, each without and with correction; `clean` is the first of them without noise."""

    variant: Variant
    clean: tuple[Course, Course]
    draws: tuple[tuple[Course, Course], ...]

    def mean(self, corrected: bool) -> Errors:
        """Mean of the errors over the draws."""
        values = [list(asdict(draw[corrected].errors).values()) for draw in self.draws]
        return Errors(*np.mean(values, axis=0).tolist())

    @property
    def helped(self) -> dict[str, float]:
        """Share of the draws in which correction makes the error of each class smaller."""
        errors = [[asdict(course.errors) for course in draw] for draw in self.draws]
        return {n: float(np.mean([b[field] < a[field] for a, b in errors])) for n, field in CLASSES.items()}

    @property
    def distance(self) -> float:
        """From the published table: a typical factor between means and its ten noisy RMS errors (1: the same)."""
        logs = [
            np.log(value / asdict(PUBLISHED[condition])[name])
            for corrected, condition in enumerate(NOISY)
            for name, value in asdict(self.mean(bool(corrected))).items()
            if "_rms_" in name
        ]
        return float(np.exp(rms(np.array(logs))))


def run_variants(
    trial: SyntheticTrial,
    variants: tuple[Variant, ...] = VARIANTS,
    repeats: int = 10,
    seed: int = 1,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[VariantResult]:
    """The variants with this number of draws times their share (one at least), in parallel processes."""
    counts = [max(1, round(repeats * variant.share)) for variant in variants]
    cases = [
        (variant, number, noisy)
        for variant, count in zip(variants, counts, strict=True)
        for number, noisy in [(0, False), *((number, True) for number in range(count))]
    ]
    found = iter(in_parallel(partial(run_variant_draw, trial, seed), cases, workers, progress))
    return [
        VariantResult(variant, next(found), tuple(next(found) for _ in range(count)))
        for variant, count in zip(variants, counts, strict=True)
    ]


def run_variant_draw(trial: SyntheticTrial, seed: int, case: tuple[Variant, int, bool]) -> tuple[Course, Course]:
    """One draw of one variant, with noise or without: uncorrected and corrected."""
    variant, number, noisy = case
    trial, rng = variant.trial(trial), np.random.default_rng([seed, number])
    vector = ParameterVector(trial.bsp, symmetric=True)
    truth = vector.values(trial.bsp)
    start = vector.bsp(variant.start(vector, truth, rng))
    inner = inner_frames(trial.time, variant.margin_s)
    if noisy:
        window = smoothed_window(trial, inner, variant.spline(trial, variant.noise(trial, rng)))
    else:
        window = Window(trial.time[inner], trial.motion.cut(inner), trial.window.wrench[inner])
    raw, corrected = (_course(trial, vector, truth, window, variant, start, correct) for correct in (False, True))
    return raw, corrected


def _course(
    trial: SyntheticTrial,
    vector: ParameterVector,
    truth: np.ndarray,
    window: Window,
    variant: Variant,
    start: BodySegmentParameters,
    correct: bool,
) -> Course:
    path, costs = variant.estimate(trial.skeleton, start, window, correct)
    bsp = vector.bsp(path[-1])
    motion = correct_pelvis(trial.skeleton, bsp, window) if correct else window.motion
    errors = errors_by_class(path[-1] - truth, residual(trial.skeleton, bsp, motion, window.wrench))
    wrong = (path - truth).reshape(len(path), -1, 7)
    along = [[rms(each[:, part]) for part in (slice(4, 7), slice(0, 1), slice(1, 4))] for each in wrong]
    return Course(errors, np.array(along), costs)
