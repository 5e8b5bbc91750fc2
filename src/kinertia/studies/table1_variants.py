"""What makes the published pattern of Table 1? Its noisy half again, one thing changed at a time.

A `Variant` is one guess (`kinertia.studies.table1_guesses`) at what differed. All variants share their draws: the same
seed and number give the same starts and, where it is not the noise that changes, the same noise. The conditions
without noise are run once: a guess that does not find the parameters there cannot be what the study did.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np

from kinertia.estimation.study_parameters import ParameterVector
from kinertia.estimation.two_level import (
    Window,
    correct_pelvis,
)
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.dynamics import residual
from kinertia.motion.smoothing import SmoothedSpline
from kinertia.studies.parallel import in_parallel
from kinertia.studies.table1 import (
    MARGIN_S,
    PUBLISHED,
    Errors,
    coordinates,
    errors_by_class,
    inner_frames,
    smoothed_window,
)
from kinertia.studies.table1_guesses import (
    about_ground,
    as_today,
    com_by_distance,
    every_fifth,
    fewer_markers,
    known_variance,
    markers_smoothed_first,
    mass_of_scale,
    noise_per_coordinate,
    noise_per_marker,
    noise_per_segment,
    same_trial,
    slow_walk,
    slower_noise,
    trust_region,
    usual_start,
    with_length,
)
from kinertia.synthetic.walk import HEIGHT_M, SyntheticTrial
from kinertia.trial.data import Markers
from kinertia.trial.rms import rms

NOISY = ("no_correction_noise", "correction_noise")
CLASSES = {"inertia": "inertia_rms_kgm2", "mass": "mass_rms_kg", "CoM": "com_rms_m"}
"""Class of parameters and its error in `Errors`."""


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
    trial: Callable[[SyntheticTrial], SyntheticTrial] = same_trial
    noise: Callable[[SyntheticTrial, np.random.Generator], Markers] = noise_per_coordinate
    spline: Callable[[SyntheticTrial, Markers], SmoothedSpline] = coordinates
    margin_s: float = MARGIN_S
    start: Callable[[ParameterVector, np.ndarray, np.random.Generator], np.ndarray] = usual_start
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
    Variant("moments divided by 1.8 m, a height", partial(trust_region, signal=partial(with_length, HEIGHT_M))),
    GROUND,
    Variant("every fifth frame", partial(trust_region, signal=every_fifth)),
    Variant("ends of the record too", margin_s=0.0),
    Variant("the package's walk with 29 markers", trial=fewer_markers),
    Variant("the package's walk at 1 m/s", trial=slow_walk),
    Variant("one sinusoid per marker", noise=noise_per_marker),
    Variant("noise per segment", noise=noise_per_segment),
    Variant("noise half as fast", noise=slower_noise),
    Variant("markers smoothed first", spline=markers_smoothed_first),
    Variant("error variance known", spline=known_variance),
    Variant("starts with the scale's mass", start=mass_of_scale),
    Variant("CoM starts off by distance", start=com_by_distance),
    Variant(
        "moments about the ground, N and N m as they are",
        partial(trust_region, signal=partial(about_ground, length_m=1.0)),
    ),
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
