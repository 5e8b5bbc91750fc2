"""A simultaneous estimate small enough for a dense Jacobian by finite differences."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from generic_static import smooth_motion
from kinertia.estimation.prior import BspPrior, literature_prior
from kinertia.estimation.simultaneous.inputs import PLACES, SKIN, STILL
from kinertia.estimation.simultaneous.instruments.instrument_errors import BENDING
from kinertia.estimation.simultaneous.instruments.plates import PLATE_UNKNOWNS, FootPlates, plate_middles
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.markers.marker_errors import ErrorProcess
from kinertia.estimation.simultaneous.markers.skin import SkinPatterns
from kinertia.estimation.simultaneous.mixture_prior import FaultMixture
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observation
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.terms.instrument_term import GAINS, ZEROS
from kinertia.estimation.simultaneous.terms.instrument_term import PLATES as PLATE_ERRORS
from kinertia.estimation.simultaneous.terms.motion_terms import AWAY_SD, CHANGE_SD
from kinertia.io.opensim.reader import read_osim
from kinertia.model.anatomy import segment_of
from kinertia.model.gait27 import HIP_OFFSETS
from kinertia.model.skeleton import Skeleton
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.smoothing import SmoothedSpline, smooth
from kinertia.synthetic.walk import SyntheticTrial, walk, walking_subject
from kinertia.trial.data import FootLoads
from osim_text import CUSTOM_ROOT, FREE, LINEAR, ZERO, joint, model, transform
from pinocchio_model import axis_forces, pin, pinocchio_model

KEPT = ("R.ASIS", "V.Sacral", "L.Shank.Front", "L.Heel", "R.Toe.Tip", "L.Elbow", "Sternum")
"""A marker or two per segment: the Jacobian does not ask whether they determine every coordinate."""
PLATES = {
    name: FaultMixture.certain(sd) for name, sd in zip(PLATE_UNKNOWNS, (0.02, 0.03, 0.02, 0.01, 0.02), strict=True)
}
FLOOR = {"x": FaultMixture.certain(0.015), "z": FaultMixture(0.005, 0.02, 0.3), "turn": FaultMixture.certain(0.03)}
CLOCK = FaultMixture.certain(0.01)
ZERO_N = FaultMixture(2.0, 9.0, 0.2)
INSTRUMENTS = InstrumentPrior(PLATES, FLOOR, CLOCK, zero_offset_n=ZERO_N)
SWITCH_S = 0.1
"""When the right foot steps from one plate to another, without a flight."""
NOISE_N = 0.7
"""Of the plates, in the forces for joint moments."""
LOCKED = (*HIP_OFFSETS[:3], "knee_tilt_1_l", "knee_tilt_2_l")


def one_plate_per_foot(loads: SmoothedSpline, n_frames: int) -> FootPlates:
    """A plate under each foot, recorded in the trial's axes; nothing is faster than the smoothed loads."""
    wrench = loads(loads.time).reshape(-1, 2, 6)
    on = [np.tile([0, 1], (count, 1)) for count in (len(wrench), n_frames)]
    reactions = GroundReactions(loads.time, wrench, on[0], np.zeros_like(wrench), None)
    middles = plate_middles(FootLoads(loads.time, wrench[..., :3], wrench[..., 3:]), np.arange(2))
    loaded = smooth(loads.time, reactions.loaded, float(np.median(loads.cutoff_hz)))
    return FootPlates(loads, loaded, reactions, ("right foot", "left foot"), on[1], np.eye(3), middles)


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
        marker_frames=9.0,
        q=trial.motion.q,
        spacing_s=0.1,
        dynamic=dynamic,
        ground=small_ground(trial, rng),
        force_sd=6.0,
        moment_sd=2.0,
        skin=small_skin(trial.skeleton, len(trial.time)),
    )


def small_skin(skeleton: Skeleton, frames: int) -> SkinPatterns:
    """Two segments follow two patterns each, one of them with two markers; the others none."""
    values = np.random.default_rng(3).normal(0.0, 0.3, (frames, 4))
    segments = skeleton.marker_segments
    first_segment, other = segments[0], segments[-1]
    first = np.select([segments == first_segment, segments == other], [0, 2])
    return SkinPatterns(values, first, first + 2 * np.isin(segments, [first_segment, other]))


def small_ground(trial: SyntheticTrial, rng: np.random.Generator) -> FootPlates:
    """Three plates, of ten samples to a frame; loads for joint moments differ from those of the root."""
    loads = smooth(trial.time, trial.foot_loads.reshape(len(trial.time), 12), 15.0)
    fine = np.linspace(trial.time[0], trial.time[-1], 10 * len(trial.time))
    wrench = 1.1 * loads(fine).reshape(-1, 2, 6) + [1.0, 2.0, 3.0, 1.0, 2.0, 3.0]
    plate_indices = (np.stack([np.where(t < SWITCH_S, 0, 2), np.full(len(t), 1)], axis=1) for t in (fine, trial.time))
    at_samples, at_frames = plate_indices
    impact = rng.normal(0.0, 5.0, wrench.shape)
    turn = Rotation.from_euler("y", 90, degrees=True).as_matrix()
    reactions = GroundReactions(
        fine, wrench, at_samples, impact, None, NOISE_N, blurred=rng.normal(0.0, 3.0, wrench.shape)
    )
    middles = np.array([[0.2, 0.0, 0.1], [0.9, 0.0, -0.2], [1.5, 0.0, 0.3]])
    loaded = smooth(trial.time, np.stack([trial.time > 0.1, trial.time < SWITCH_S], axis=1), 15.0)
    return FootPlates(loads, loaded, reactions, ("first", "second", "third"), at_frames, turn, middles)


def small_problem(n_trials: int = 1) -> MapProblem:
    trial = small_trial()
    calibration = CalibrationPrior(dict.fromkeys(LOCKED, 0.01), np.full(len(KEPT), 0.005), INSTRUMENTS)
    observations = [small_observation(trial, seed) for seed in range(n_trials)]
    return MapProblem(trial.skeleton, literature_prior(walking_subject().literature), calibration, observations)


def curved_problem(path: Path) -> MapProblem:
    """Two segments from an OpenSim file: a knee that bends, turns and slides by one coordinate, and a turned root."""
    curve = '<SimmSpline name="function"><x>-2 -1 0 0.7 1.6 3</x><y>0.1 -0.3 0.05 0.2 0.6 0.4</y></SimmSpline>'
    fixed = '<Constant name="function"><value>0.02</value></Constant>'
    functions = [LINEAR, curve, LINEAR, curve, fixed, ZERO]
    axes = zip(("a", "a", "b", "a", "", ""), ("0 0 1", "1 0 0", "0 1 0") * 2, functions, strict=True)
    places = (("0.1 -0.05 0.02", "0.3 -0.4 0.2"), ("0.01 0.02 0.03", "0.1 0.2 -0.3"))
    root = joint("CustomJoint", "root", "/ground", "pelvis", FREE[1], CUSTOM_ROOT, places=places)
    knee = joint("CustomJoint", "knee", "/bodyset/pelvis", "leg", "ab", transform(list(axes)))
    path.write_text(model(root + knee), encoding="utf-8")
    ours = read_osim(path)
    skeleton = replace(ours.skeleton, feet=("leg", "pelvis"))
    time, motion = smooth_motion(skeleton, 13, 50.0)
    rng = np.random.default_rng(0)
    markers = skeleton.marker_positions(skeleton.pose(motion.q))
    upward = 400.0 * np.isin(np.arange(12), [1, 7])
    observation = Observation(
        time=time,
        markers=markers + rng.normal(0.0, 0.01, markers.shape),
        marker_sd=np.linspace(0.01, 0.03, 5),
        marker_frames=9.0,
        q=motion.q,
        spacing_s=0.1,
        dynamic=np.arange(13) > 1,
        ground=one_plate_per_foot(smooth(time, rng.normal(upward, 50.0, (13, 12)), 15.0), 13),
        force_sd=6.0,
        moment_sd=2.0,
        skin=small_skin(skeleton, 13),
    )
    prior = BspPrior(ours.bsp, np.diag(np.square(np.full(20, 0.01))), 13.0, 0.1)
    calibration = CalibrationPrior({"knee/translation2": 0.01}, np.full(5, 0.005), INSTRUMENTS)
    return MapProblem(skeleton, prior, calibration, [observation])


def point(problem: MapProblem, seed: int = 1) -> tuple[list[np.ndarray], np.ndarray]:
    """Coefficients and static unknowns away from the start, so that nothing vanishes."""
    rng = np.random.default_rng(seed)
    coefficients = [basis.fit(trial.q) for basis, trial in zip(problem.bases, problem.trials, strict=True)]
    coefficients = [part + rng.normal(0.0, 0.01, part.shape) for part in coefficients]
    return coefficients, problem.layout.start + rng.normal(0.0, 0.01, problem.layout.size)


def _turned_back(vectors: np.ndarray, angle_rad: np.ndarray) -> np.ndarray:
    """Rotate vectors (n, 2, 3) about the vertical by minus these angles (n, 2)."""
    cosine, sine, (x, y, z) = np.cos(angle_rad), np.sin(angle_rad), np.moveaxis(vectors, -1, 0)
    return np.stack([cosine * x - sine * z, y, sine * x + cosine * z], axis=-1)


def residuals(problem: MapProblem, k: int, coefficients: np.ndarray, static: np.ndarray) -> np.ndarray:
    """All residuals of trial k, each over its deviation, from first principles: no cost term is used."""
    trial, layout = problem.trials[k], problem.layout
    skeleton, rigid = _body(problem, tuple(static))
    q, qd, qdd = problem.bases[k].evaluate(coefficients)
    pose = skeleton.pose(q)
    positions = skeleton.marker_positions(pose)
    skin, coefficient = trial.skin, iter(static[layout[SKIN]])
    for m, segment in enumerate(skeleton.marker_segments):
        for pattern in range(skin.first[m], skin.last[m]):
            along = [next(coefficient) for _ in range(3)]
            positions[:, m] += skin.values[:, pattern, None] * (pose.rotation[:, segment] @ along)
    errors = whitened(trial.markers - positions, *trial.marker_process)
    loads = trial.ground.loads(trial.time + problem.loads.delay_s(k, static)).reshape(len(trial.time), 2, 6)
    *floor, angle = static[layout[PLATE_ERRORS]][-3:]
    of_plates = np.add(static[layout[PLATE_ERRORS]][:-3].reshape(-1, 5), [*floor, 0.0, 0.0, angle])
    values = dict(zip(problem.given.plates, of_plates, strict=True))
    here = np.array([values[name] for name in trial.ground.plates])[trial.ground.plate_index]
    x, z, gain, free_moment, angle = np.moveaxis(here, -1, 0)
    gains = iter(static[layout[GAINS]])
    own_gains = [np.array([next(gains) for _ in of_trial.ground.plates]) for of_trial in problem.trials][k]
    gain = gain + own_gains[trial.ground.plate_index]
    zeros = iter(static[layout[ZEROS]].reshape(-1, 2))
    own_zeros = [np.array([next(zeros) for _ in of_trial.ground.plates]) for of_trial in problem.trials][k]
    zero_x, zero_z = np.moveaxis(own_zeros[trial.ground.plate_index], -1, 0)
    middle = trial.ground.middles[trial.ground.plate_index]
    zero = np.stack([zero_x, np.zeros_like(x), zero_z], axis=-1) @ trial.ground.turn.T
    zero *= trial.ground.loaded(trial.time + problem.loads.delay_s(k, static))[..., None]
    loads -= np.concatenate([zero, np.cross(middle, zero)], axis=-1)
    about = _turned_back(loads[..., 3:] - np.cross(middle, loads[..., :3]), angle)
    loads[..., :3] = _turned_back(loads[..., :3], angle)
    loads[..., 3:] = about + np.cross(middle, loads[..., :3])
    offset = np.stack([x, np.zeros_like(x), z], axis=-1) @ trial.ground.turn.T
    loads[..., 3:] += np.cross(offset, loads[..., :3])
    loads[..., 4] += free_moment * loads[..., 1]
    loads *= 1.0 + gain[..., None]
    forces = axis_forces(rigid, skeleton.map.motion(q, qd, qdd))
    load = np.linalg.solve(pose.axes[:, :6], forces[:, :6, None])[..., 0] - loads.sum(axis=1)
    for kappa in static[layout[BENDING]][k : k + 1]:
        load += kappa * bending(problem, skeleton, (q, qd, qdd), loads[..., :3].sum(axis=1))
    left = np.hstack([load[:, :3], load[:, 3:] - np.cross(skeleton.root.centre(q), load[:, :3])])
    left /= np.repeat([trial.force_sd, trial.moment_sd], 3)
    moved = coefficients - _start(problem, k)
    tied = (moved / AWAY_SD).ravel(), (np.diff(moved, axis=0) / CHANGE_SD).ravel()
    return np.concatenate([errors, left[trial.dynamic].ravel(), *tied])


def bending(problem: MapProblem, skeleton: Skeleton, motion: Sequence[np.ndarray], force: np.ndarray) -> np.ndarray:
    """(n, 6) load at the ground origin per kg m that stays upright while the trunk leans, from places at five times."""
    q, qd, qdd = motion
    row = next(k for k, name in enumerate(problem.model.segments) if segment_of(name) == "torso")
    number = skeleton.segments.index(problem.model.segments[row])
    height = 1.5 * problem.prior.mean.com_m[row, 1]
    steps = 2e-3 * np.arange(-2.0, 3.0)
    poses = [skeleton.pose(q + t * qd + 0.5 * t**2 * qdd) for t in steps]
    axes_and_places = np.array([(p.rotation[:, number, :, 1], p.translation[:, number]) for p in poses])
    weights = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0 / (steps[-1] - steps[-2]) ** 2
    (along, place), (turned, moved) = axes_and_places[2], np.tensordot(weights, axes_and_places, 1)
    specific = np.add(moved, [0.0, skeleton.gravity_m_s2, 0.0])
    moment = np.cross(place, -turned) - np.cross(along, specific + 2.0 * height * turned)
    moment += np.cross([0.0, 1.0, 0.0], force / problem.prior.mass_kg)
    return np.hstack([-turned, moment])


@lru_cache(maxsize=1)
def _start(problem: MapProblem, k: int) -> np.ndarray:
    """Coefficients to which the motion is tied."""
    return problem.bases[k].fit(problem.trials[k].q)


@lru_cache(maxsize=1)
def _body(problem: MapProblem, static: tuple[float, ...]) -> tuple[Skeleton, pin.Model]:
    """Skeleton and Pinocchio model with these static unknowns; kept while only the motion changes."""
    values, layout = np.array(static), problem.layout
    locked = dict(zip(problem.calibration.coordinates, values[layout[STILL]], strict=True))
    positions = values[layout[PLACES]].reshape(-1, 3)
    skeleton = problem.skeleton.with_positions(positions).lock(locked)
    return skeleton, pinocchio_model(skeleton, problem.model.bsp(values))


def process_covariance(process: ErrorProcess, lags: np.ndarray) -> np.ndarray:
    """At these lags, of a second-order autoregressive process of unit variance (Yule and Walker)."""
    lag1, two = process.of_before
    values = [1.0, lag1 / (1.0 - two)]
    while len(values) <= np.max(lags):
        values.append(lag1 * values[-1] + two * values[-2])
    return np.array(values)[lags]


def whitened(errors: np.ndarray, sd: np.ndarray, process: ErrorProcess) -> np.ndarray:
    """Errors (n, m, 3) of an autoregressive process as independent ones, by the dense covariance of every run of frames
    without a gap."""
    result = []
    for j in range(errors.shape[1]):
        seen = np.flatnonzero(np.isfinite(errors[:, j, 0]))
        for run in np.split(seen, np.flatnonzero(np.diff(seen) > 1) + 1):
            covariance = sd[j] ** 2 * process_covariance(process, np.abs(run[:, None] - run))
            result.append(np.linalg.solve(np.linalg.cholesky(covariance), errors[run, j]).ravel())
    return np.concatenate(result)
