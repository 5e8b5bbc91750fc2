"""Repeats the noisy half of Table 1 with one thing changed at a time, to explain its pattern.

A `Variant` is one hypothesis (`kinertia.studies.table1_guesses`) on what differed. All variants share their draws: the
same seed and number give the same starts and, unless the noise is what changes, the same noise. The conditions without
noise are run in the first draw: a hypothesis that does not recover the parameters there cannot be what the study did.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from kinertia.estimation.study_parameters import ParameterVector
from kinertia.studies.parallel import in_parallel
from kinertia.studies.table1 import CONDITIONS, PUBLISHED, TODAY, Draw, Setup, Table1, run_draw, study_trial
from kinertia.studies.table1_guesses import (
    com_by_distance,
    fewer_markers,
    known_variance,
    markers_smoothed_first,
    mass_of_scale,
    noise_per_marker,
    noise_per_segment,
    slower_noise,
    trust_region,
)
from kinertia.synthetic.walk import HEIGHT_M, SyntheticTrial
from kinertia.trial.rms import rms

NOISY = ("no_correction_noise", "correction_noise")
CLASSES = {
    "inertia": ("inertia_rms_kgm2", slice(4, 7)),
    "mass": ("mass_rms_kg", slice(0, 1)),
    "CoM": ("com_rms_m", slice(1, 4)),
}
"""Class of parameters: its error in `Errors`, and its index in the seven of a segment."""


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
    courses = in_parallel(_draw, [case for _, case in cases], progress=progress)
    for (title, _), draw in zip(cases, courses, strict=True):
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
