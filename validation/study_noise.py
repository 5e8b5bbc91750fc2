"""The study's noise, from starts 50 % off: draws of every method, and their section of docs/validation/accuracy.md."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinertia.estimation.identifiability import ParameterVector
from kinertia.estimation.prior import BspPrior, with_symmetry
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.observation import Observation
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.estimation.two_level import Window, estimate_two_level
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.dynamics import Motion
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.smoothing import smooth
from kinertia.studies.sensitivity import held
from kinertia.studies.table1 import MARGIN_S, START_SHARE
from kinertia.synthetic.laboratory import camera_noise, study_noise
from kinertia.synthetic.walk import SyntheticTrial
from kinertia.trial.data import Markers
from validation.bsp_errors import errors
from validation.measured_trials import table
from validation.synthetic_walks import FIRST_SEED, observation_of, study_walk

UNIFORM_SD = 0.29
"""SD of a uniform error of +/-50 %, as a share."""
CAMERA_SD_M = 0.0001


def start_prior(start: BodySegmentParameters, mass_kg: float) -> BspPrior:
    """Return what the study's estimator may know: start, uniform +/-50 %; symmetry; principal along segment axes."""
    values = start.table()
    sd = UNIFORM_SD * np.abs(values)
    sd[:, 1:4] = np.maximum(sd[:, 1:4], 0.005)
    sd[:, 7:] = 0.02 * values[:, 4:7].mean(axis=1, keepdims=True)
    covariance = with_symmetry(np.diag(np.square(sd.ravel())), start.segments, 0.99)
    return BspPrior(start, covariance, mass_kg, 0.005 * mass_kg)


def moved_prior(prior: BspPrior) -> BspPrior:
    """Return the prior of truth given start = truth (1 + u), u uniform +/-50 %, any size as likely: start / (1 + u).

    Its mean is log 3 times the start, its SD sqrt(4 / 3 - (log 3)^2) times.
    """
    mean, share = np.log(3.0), np.sqrt(4.0 / 3.0 - np.log(3.0) ** 2)
    start = BodySegmentParameters.from_table(prior.mean.segments, mean * prior.mean.table())
    return replace(prior, mean=start, covariance=prior.covariance * (share / UNIFORM_SD) ** 2)


def drawn_start(trial: SyntheticTrial, number: int) -> tuple[BodySegmentParameters, np.random.Generator]:
    """Return the start of this draw (of `kinertia study table1`, seed 1), and the generator that makes its noise."""
    rng = np.random.default_rng([FIRST_SEED, number])
    vector = ParameterVector(trial.bsp, symmetric=True)
    truth = vector.values(trial.bsp)
    return vector.bsp(truth * (1.0 + rng.uniform(-START_SHARE, START_SHARE, len(truth)))), rng


def study_draw(number: int, two_level: bool = True) -> dict[str, tuple[float, float, float]]:
    """Return errors of every method on one draw of start and noise (the draws of `kinertia study table1`, seed 1)."""
    trial = study_walk()
    start, rng = drawn_start(trial, number)
    noisy = study_noise(trial.markers, rng)
    prior, calibration = start_prior(start, trial.bsp.total_mass_kg), held(trial.skeleton)
    estimates = {"start": start}
    if two_level:
        estimates["two-level"] = estimate_two_level(trial.skeleton, start, [_window(trial, noisy)]).bsp

    def simultaneous(observation: Observation, prior: BspPrior = prior) -> BodySegmentParameters:
        return estimate_simultaneous(trial.skeleton, prior, calibration, [observation], with_draws=False).bsp

    seen = observation_of(trial, noisy)
    estimates["simultaneous"] = simultaneous(seen)
    white = np.full_like(seen.marker_sd, np.std(noisy.positions - trial.markers.positions))
    estimates["noise taken as white"] = simultaneous(replace(seen, marker_sd=white, marker_frames=1.0))
    estimates["deviation of the noise doubled"] = simultaneous(replace(seen, marker_sd=2.0 * seen.marker_sd))
    sure = replace(seen, force_sd=0.3 * seen.force_sd, moment_sd=0.3 * seen.moment_sd)
    estimates["forces three times as sure"] = simultaneous(sure)
    estimates["20 Hz instead of 10 Hz"] = simultaneous(observation_of(trial, noisy, bandwidth=Bandwidth(20.0)))
    estimates["prior widened and moved to where such starts come from"] = simultaneous(seen, moved_prior(prior))
    sharp = observation_of(trial, camera_noise(trial.markers, CAMERA_SD_M, rng))
    sharp = replace(sharp, marker_sd=np.full_like(white, CAMERA_SD_M), marker_frames=1.0)
    estimates["**0.1 mm of white noise instead of the study's**"] = simultaneous(sharp)
    return {name: errors(bsp, trial.bsp) for name, bsp in estimates.items()}


def _window(trial: SyntheticTrial, noisy: Markers) -> Window:
    ik = solve_ik(trial.skeleton, noisy)
    spline = smooth(ik.time, ik.q, "gcv")
    margin = round(MARGIN_S / (trial.time[1] - trial.time[0]))
    inner = slice(margin, len(trial.time) - margin)
    motion = Motion(*(spline(trial.time[inner], order) for order in range(3)))
    return Window(trial.time[inner], motion, trial.window.wrench[inner])


def study_section(draws: Sequence[dict[str, tuple[float, float, float]]], bounds: Sequence[list[str]]) -> str:
    """Return errors on the study's noise, mean over draws, and the rows of `study_bound.bound_rows`."""
    rows = []
    for name in draws[0]:
        mass, com, inertia = np.mean([draw[name] for draw in draws], axis=0)
        rows.append([name, f"{mass:.2f}", f"{1e3 * com:.1f}", f"{inertia:.3f}"])
    rows += bounds
    rows.append(["published: Table 1, two-level", "1.71", "180", "0.382"])
    rows.append(["published: IEEE TBME 54:782 (2007), splines and prior", "1.33", "21.6", "0.0745"])
    rows.append(["**aim**", "0.90", "15.0", "0.030"])
    return table(["estimate", "mass (kg)", "CoM (mm)", "inertia (kg m2)"], rows)
