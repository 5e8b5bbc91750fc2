"""Errors of calibration put into synthetic walks, what becomes of them, and their section of the accuracy page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.observation import CalibrationPrior
from kinertia.estimation.simultaneous.outcome import SimultaneousResult
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.model.gait27 import HIP_OFFSETS
from kinertia.motion.smoothing import smooth
from kinertia.studies.sensitivity import held
from kinertia.synthetic.laboratory import camera_noise
from kinertia.synthetic.walk import unlike_literature, walk, walking_subject
from validation.bsp_errors import errors
from validation.measured_trials import table
from validation.synthetic_walks import FIRST_SEED, observation_of


@dataclass(frozen=True)
class Disturbance:
    """Errors of instruments and model injected into a synthetic trial.

    Attributes:
        plate_m: displacement of the recorded right foot's plate along the walk.
        delay_s: delay of the recorded forces.
        hips_m: forward displacement of both hips of the model from the person's.
    """

    plate_m: float = 0.0
    delay_s: float = 0.0
    hips_m: float = 0.0


LARGEST = Disturbance(0.020, 0.010, 0.010)
"""All injected errors; the hips' is also their prior SD."""
DISTURBANCES = {
    "nothing wrong": Disturbance(),
    "right plate 20 mm off": Disturbance(plate_m=0.020),
    "forces 10 ms late": Disturbance(delay_s=0.010),
    "hips 10 mm off": Disturbance(hips_m=0.010),
    "all three": LARGEST,
}


@dataclass(frozen=True)
class Calibrated:
    """Outcome of one disturbed trial.

    Attributes:
        deviations: per injected quantity: (error of the estimate, its posterior SD), m and s.
        errors: RMS of mass (kg), CoM (m) and inertia (kg m2) with calibration free.
        errors_held: the same with calibration fixed at its (wrong) values.
        errors_literature: the same of the prior's mean.
    """

    deviations: dict[str, tuple[float, float]]
    errors: tuple[float, float, float]
    errors_held: tuple[float, float, float]
    errors_literature: tuple[float, float, float]


def calibrated(disturbance: Disturbance, seed: int, duration_s: float = 2.5, compare: bool = True) -> Calibrated:
    """Estimate a person who differs from the literature from a disturbed trial with 1 mm of camera noise."""
    rng = np.random.default_rng([FIRST_SEED, seed])
    person = unlike_literature(walking_subject(), rng)
    trial = walk(person, duration_s, trapezoid=False)
    noisy = camera_noise(trial.markers, 0.001, rng)
    late = smooth(trial.time, trial.foot_loads.reshape(len(trial.time), 12), 40.0)(trial.time - disturbance.delay_s)
    loads = late.reshape(-1, 2, 6)
    loads[:, 0, 3:] += np.cross([disturbance.plate_m, 0.0, 0.0], loads[:, 0, :3])
    wrong = {name: disturbance.hips_m if "_x_" in name else 0.0 for name in HIP_OFFSETS}
    off = replace(trial, skeleton=trial.skeleton.lock(wrong))
    seen = observation_of(off, noisy, loads)
    prior = literature_prior(person.literature)

    def estimate(calibration: CalibrationPrior) -> SimultaneousResult:
        return estimate_simultaneous(off.skeleton, prior, calibration, [seen], with_draws=False)

    marker_sd = np.full(len(off.skeleton.markers), 0.005)
    centres = dict.fromkeys(HIP_OFFSETS, LARGEST.hips_m)
    free = CalibrationPrior(centres, marker_sd, InstrumentPrior())
    result = estimate(free)
    entries = {(entry.plate, entry.quantity, entry.axis): entry for entry in result.calibration if entry.trial is None}
    plate, delay = entries["right foot", "position", "x"], entries[None, "delay", None]
    deviations = {
        "right plate, x": (disturbance.plate_m - plate.value, plate.sd),
        "delay": (delay.value - disturbance.delay_s, delay.sd),
        "right hip, x": result.coordinates["hip_x_r"],
        "left hip, x": result.coordinates["hip_x_l"],
    }
    held_errors = (np.nan, np.nan, np.nan)
    if compare:
        held_errors = errors(estimate(replace(held(off.skeleton), marker_sd_m=marker_sd)).bsp, trial.bsp)
    return Calibrated(deviations, errors(result.bsp, trial.bsp), held_errors, errors(person.literature, trial.bsp))


def calibration_section(runs: Mapping[str, Sequence[Calibrated]]) -> str:
    """Return per disturbance the errors of the injected quantities, in posterior SDs, and of the BSPs."""
    rows = []
    for name, outcomes in runs.items():
        cells = [name]
        for quantity in outcomes[0].deviations:
            error, sd = np.array([o.deviations[quantity] for o in outcomes]).T
            cells.append(
                f"{1e3 * np.sqrt(np.mean(error**2)):.1f} / {1e3 * sd.mean():.1f} ({np.abs(error / sd).max():.1f})"
            )
        for kind in ("errors", "errors_held", "errors_literature"):
            mass, com, inertia = np.mean([getattr(o, kind) for o in outcomes], axis=0)
            cells.append(f"{mass:.2f}, {1e3 * com:.1f}, {inertia:.3f}")
        rows.append(cells)
    quantities = [f"{q} ({'ms' if q == 'delay' else 'mm'})" for q in next(iter(runs.values()))[0].deviations]
    return table(["put in", *quantities, "calibration free", "calibration held", "literature"], rows)
