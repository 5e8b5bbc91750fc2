"""How well could anybody do on the study's noise? The Cramér-Rao bound with exact forces and exactly known noise.

Nothing of the estimator's noise model is used: forces count as exact, and the covariance of the marker errors over time
is that of the study's sinusoids, A sin(w t + phi) with uniform A, w and phi: A_max^2 / 6 sinc(w_max (t - t')).
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.inputs import BSP
from kinertia.estimation.simultaneous.observation import Observation
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.model.log_cholesky import table_jacobian
from kinertia.motion.marker_sums import marker_jacobian
from kinertia.studies.sensitivity import held
from kinertia.synthetic.laboratory import STUDY_AMPLITUDE_M, STUDY_RATE_RAD_S
from kinertia.synthetic.walk import SyntheticTrial
from validation.accuracy_study import at_truth
from validation.study_noise import drawn_start, start_prior
from validation.synthetic_walks import observation_of, study_walk

EXACT_N = 0.05
"""SD of exact forces."""
FLOORS_M = (1e-4, 1e-5)
"""White noise of the cameras beside the study's."""
_NOTHING_M = 1e4
"""SD of markers without information."""


def information_on_body(trial: SyntheticTrial, seen: Observation, prior: BspPrior, floor_m: float) -> np.ndarray:
    """Compute the information (10 s, 10 s) of the trial on the true body's table rows, motion unknown, skeleton known.

    Args:
        trial: the true trial.
        seen: frames and loads of the trial.
        prior: prior, used for its segments only.
        floor_m: white noise of the markers besides the study's.
    """
    exact = replace(
        at_truth(seen, trial),
        marker_sd=np.full_like(seen.marker_sd, _NOTHING_M),
        marker_frames=1.0,
        force_sd=EXACT_N,
        moment_sd=0.3 * EXACT_N,
    )
    problem = MapProblem(trial.skeleton, replace(prior, mean=trial.bsp), held(trial.skeleton), [exact])
    normal = problem.normal(0, problem.start[0], problem.layout.start)
    motion = dense_band(normal.band) + _of_markers(problem, exact, floor_m)
    theta = problem.layout[BSP]
    border = normal.border[..., theta].reshape(len(motion), -1)
    information = normal.static[theta, theta] - border.T @ np.linalg.solve(motion, border)
    chain = np.linalg.inv(block_diag(*table_jacobian(problem.layout.start[theta])))
    return chain.T @ information @ chain


def dense_band(band: np.ndarray) -> np.ndarray:
    """Expand the band (size, 7, c, c) of `NormalEquations` to the whole symmetric matrix (size c, size c)."""
    size, reach, c, _ = band.shape
    whole = np.zeros((size, c, size, c))
    for i in range(size):
        for offset in range(min(reach, size - i)):
            whole[i, :, i + offset] = band[i, offset]
            whole[i + offset, :, i] = band[i, offset].T
    return whole.reshape(size * c, -1)


def _of_markers(problem: MapProblem, seen: Observation, floor_m: float) -> np.ndarray:
    """Compute the information of the markers on all spline coefficients."""
    basis, skeleton = problem.bases[0], problem.skeleton
    q = basis.evaluate(problem.start[0])[0]
    pose = skeleton.pose(q)
    positions = skeleton.marker_positions(pose)
    moved = marker_jacobian(skeleton, pose, positions)
    apart = seen.time[:, None] - seen.time
    covariance = STUDY_AMPLITUDE_M**2 / 6.0 * np.sinc(STUDY_RATE_RAD_S * apart / np.pi)
    whiten = np.linalg.inv(np.linalg.cholesky(covariance + floor_m**2 * np.eye(len(apart))))
    splines = np.zeros((len(q), basis.size))
    np.put_along_axis(splines, basis.active, basis.values[0], axis=1)
    size, c = problem.start[0].shape
    total = np.zeros((size * c, size * c))
    for m in range(positions.shape[1]):
        for axis in range(3):
            rows = whiten @ (splines[:, :, None] * moved[:, m, axis, None]).reshape(len(q), -1)
            total += rows.T @ rows
    return total


def bound(information: np.ndarray, prior: BspPrior) -> tuple[float, float, float]:
    """Return the RMS over segments of the SDs of mass (kg), CoM (m) and moments of inertia (kg m2), prior included."""
    scale = np.zeros(len(information))
    scale[::10] = 1.0 / prior.mass_sd_kg
    covariance = np.linalg.inv(information + np.linalg.inv(prior.covariance) + np.outer(scale, scale))
    chosen = [k for k, segment in enumerate(prior.mean.segments) if not segment.endswith("_l")]
    variance = np.diag(covariance).reshape(-1, 10)[chosen]
    mass, com, inertia = (float(np.sqrt(part.mean())) for part in (variance[:, 0], variance[:, 1:4], variance[:, 4:7]))
    return mass, com, inertia


def bound_rows(draws: int) -> list[list[str]]:
    """Return rows for the table of `study_noise.study_section`: mean bounds over the priors of its draws."""
    trial = study_walk()
    seen = observation_of(trial, trial.markers)
    priors = [start_prior(drawn_start(trial, number)[0], trial.bsp.total_mass_kg) for number in range(draws)]
    rows = []
    for floor_m in FLOORS_M:
        information = information_on_body(trial, seen, priors[0], floor_m)
        mass, com, inertia = np.mean([bound(information, prior) for prior in priors], axis=0)
        name = f"at best (bound), cameras {1e3 * floor_m:g} mm"
        rows.append([name, f"{mass:.2f}", f"{1e3 * com:.1f}", f"{inertia:.3f}"])
    return rows
