"""A simultaneous estimate small enough for a dense Jacobian by finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from kinertia.bsp_prior import literature_prior
from kinertia.gait27 import HIP_OFFSETS
from kinertia.instruments import FootPlates
from kinertia.map_terms import COEFFICIENT_SD, CalibrationPrior, MapProblem, Observation
from kinertia.splines import smooth
from kinertia.synthetic import SyntheticTrial, walk, walking_subject

KEPT = ("R.ASIS", "V.Sacral", "L.Shank.Front", "L.Heel", "R.Toe.Tip", "L.Elbow", "Sternum")
"""A marker or two per segment: the Jacobian does not ask whether they determine every coordinate."""
LOCKED = HIP_OFFSETS[:3]


def small_trial() -> SyntheticTrial:
    trial = walk(walking_subject(), 0.24, 50.0, trapezoid=False)
    return replace(trial, skeleton=trial.skeleton.with_markers([m for m in trial.skeleton.markers if m.label in KEPT]))


def small_observation(trial: SyntheticTrial, seed: int = 0) -> Observation:
    """Noisy markers with gaps, three plates, first and last frames not dynamic."""
    rng = np.random.default_rng(seed)
    markers = trial.markers.positions + rng.normal(0.0, 0.01, trial.markers.positions.shape)
    markers[2, 1] = markers[5:7, 3] = np.nan
    dynamic = np.ones(len(trial.time), dtype=bool)
    dynamic[:2] = dynamic[-1] = False
    return Observation(
        time=trial.time,
        markers=markers,
        marker_sd=np.linspace(0.01, 0.03, len(KEPT)),
        q=trial.motion.q,
        dynamic=dynamic,
        ground=FootPlates(
            smooth(trial.time, trial.foot_loads.reshape(len(trial.time), 12), 15.0),
            ("first", "second", "third"),
            np.stack([np.where(trial.time < 0.1, 0, 2), np.full(len(trial.time), 1)], axis=1),
            Rotation.from_euler("y", 90, degrees=True).as_matrix(),
        ),
        force_sd=6.0,
        moment_sd=2.0,
    )


def small_problem(n_trials: int = 1) -> MapProblem:
    trial = small_trial()
    calibration = CalibrationPrior(dict.fromkeys(LOCKED, 0.01), np.full(len(KEPT), 0.005), 0.02, 0.02, 0.01)
    observations = [small_observation(trial, seed) for seed in range(n_trials)]
    return MapProblem(trial.skeleton, literature_prior(walking_subject().literature), calibration, observations, 0.1)


def point(problem: MapProblem, seed: int = 1) -> tuple[list[np.ndarray], np.ndarray]:
    """Coefficients and static unknowns away from the start, so that nothing vanishes."""
    rng = np.random.default_rng(seed)
    coefficients = [basis.fit(trial.q) for basis, trial in zip(problem.bases, problem.trials, strict=True)]
    coefficients = [part + rng.normal(0.0, 0.01, part.shape) for part in coefficients]
    return coefficients, problem.start_static + rng.normal(0.0, 0.01, problem.layout.size)


def residuals(problem: MapProblem, k: int, coefficients: np.ndarray, static: np.ndarray) -> np.ndarray:
    """All residuals of trial k, each over its deviation, from first principles: no term of `map_terms` is used."""
    trial, layout = problem.trials[k], problem.layout
    values = dict(zip(problem.calibration.coordinates, static[layout.coordinates], strict=True))
    positions = static[layout.locals].reshape(-1, 3)
    placed = [replace(marker, position=p) for marker, p in zip(problem.skeleton.markers, positions, strict=True)]
    skeleton = problem.skeleton.with_markers(placed).lock(values)
    q, qd, qdd = problem.bases[k].evaluate(coefficients)
    pose = skeleton.pose(q)
    errors = ((trial.markers - skeleton.marker_positions(pose)) / trial.marker_sd[:, None]).ravel()
    loads = trial.ground.loads(trial.time + static[layout.clock]).reshape(len(trial.time), 2, 6)
    values = dict(zip(problem.plates, static[layout.plates].reshape(-1, 3), strict=True))
    for i, foot in np.ndindex(len(loads), 2):
        x, z, gain = values[trial.ground.plates[trial.ground.carrier[i, foot]]]
        loads[i, foot, 3:] += np.cross(trial.ground.turn @ [x, 0.0, z], loads[i, foot, :3])
        loads[i, foot] *= 1.0 + gain
    reaction = np.einsum("nij,ni->nj", pose.jacobian[:, :, :6], loads.sum(axis=1))
    model = skeleton.model_with(problem.bsp(static))
    data = model.createData()
    left = np.array([pin.rnea(model, data, *rows)[:6] for rows in zip(q, qd, qdd, strict=True)]) - reaction
    left /= np.repeat([trial.force_sd, trial.moment_sd], 3)
    moved = (coefficients - problem.bases[k].fit(trial.q)) / COEFFICIENT_SD
    return np.concatenate([errors[np.isfinite(errors)], left[trial.dynamic].ravel(), moved.ravel()])
