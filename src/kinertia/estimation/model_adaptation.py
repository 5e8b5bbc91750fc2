"""Adapts the built-in model to the trials: elbows, arms, knees, and a trunk with too few markers.

With one marker at an elbow, the plane of upper arm and forearm in the static trial defines the direction of the elbow
axis. If the arm is nearly straight, as in a T-pose, that plane is random, and the axis may be rotated by more than a
quarter turn about the arm: the elbow then bends backwards in all trials, if its range allows it. Trials in which it
would are solved again with upper arm and forearm free to rotate about their own axes. The markers then give the
rotation or, with an elbow that bends backwards, half a turn more. The straighter the elbow, the less they determine it:
a frame is weighted by the square of the sine of its flexion.

The 27-DOF model's shoulders flex and adduct. Arms that also rotate leave the elbow where the model cannot follow: the
forearm's markers are centimetres off, and an arm that swings overhead jumps from one solution to another. The rotation
is visible as long as the elbow is bent.

A walking trunk leans by a few degrees and rotates against the pelvis, so this is known within some 10 degrees. The
trunk is represented by three virtual markers with that uncertainty, so that the ground reactions can correct it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinertia.estimation.calibration import first_poses
from kinertia.model.gait27 import ARM_ROTATIONS, ELBOWS, ENOUGH_TRUNK_MARKERS, KNEES, UPPER_ARM_ROTATIONS, VIRTUAL_TRUNK
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import InverseKinematics
from kinertia.trial.data import FloatArray, Markers, Trial
from kinertia.trial.sampled_data import gaussian_mean

BACKWARDS_RAD = 0.05
"""Least angle beyond the end of the elbow's range, median over the frames."""
_STRIDE_RAD = float(np.radians(30.0))
"""Half of what a knee bends in the swing phase of walking."""
_SQUAT_RAD = float(np.radians(80.0))
"""More than a knee bends in walking, less than in a squat."""
_WITHIN = 0.02, 0.98
"""Quantiles of the frames; what single frames have is left out."""
TRUNK_SD_M = 0.08
"""Standard deviation of each coordinate of each marker: 10 degrees."""
_HEADING_S = 0.5


def with_elbows_that_bend_forwards(
    skeleton: Skeleton, trials: Sequence[Trial]
) -> tuple[Skeleton, list[InverseKinematics]]:
    """Rotate the arms of the skeleton where an elbow would bend backwards in the trials; return it with `first_poses`.

    Args:
        skeleton: of the 27-DOF model, from the static trial; the rotations of the arms about their own axes are locked.
        trials: the trials it will be used for.
    """
    loose = skeleton.unbounded(ELBOWS)
    poses = first_poses(loose, trials)
    beyond = {name[-1]: _beyond(skeleton, poses, name) for name in ELBOWS}
    if not any(angles.any() for angles in beyond.values()):
        return skeleton, poses
    sides = [side for side, angles in beyond.items() if angles.size and np.median(angles) < -BACKWARDS_RAD]
    if sides:
        free = first_poses(loose.free(ARM_ROTATIONS), trials)
        turns = {name: _mean_angle(free, name) for name in ARM_ROTATIONS if name[-1] in sides}
        skeleton = skeleton.lock({name: turn for name, turn in turns.items() if np.isfinite(turn)})
    return skeleton, first_poses(skeleton, trials)


def elbow_rotations(before: Skeleton, after: Skeleton) -> dict[str, float]:
    """Return by how much `with_elbows_that_bend_forwards` has rotated elbow axes about the upper arm: side -> rad.

    Unchanged sides are left out.
    """
    names = {side: f"arm_rot_{side}" for side in "rl"}
    rotations = {side: after.locked.get(name, 0.0) - before.locked.get(name, 0.0) for side, name in names.items()}
    return {side: float(np.angle(np.exp(1j * rotation))) for side, rotation in rotations.items() if rotation != 0.0}


def _beyond(skeleton: Skeleton, poses: Sequence[InverseKinematics], elbow: str) -> np.ndarray:
    """Return the angle (rad) by which an elbow exceeds its range, signed, in all frames that show it."""
    angles, ends = _angles(poses, elbow), skeleton.ranges[elbow]
    angles = angles[np.isfinite(angles)]
    result: np.ndarray = angles - np.clip(angles, ends.low, ends.high)
    return result


def _mean_angle(poses: Sequence[InverseKinematics], name: str) -> float:
    """Return the circular mean (rad) of a rotation about an arm's axis, elbow flexed forwards; NaN without frames."""
    angles, flexion = _angles(poses, name), _angles(poses, f"elbow_flex_{name[-1]}")
    known = np.isfinite(angles) & np.isfinite(flexion)
    forwards = np.where(flexion < 0.0, angles + np.pi, angles)
    mean = (np.square(np.sin(flexion[known])) * np.exp(1j * forwards[known])).sum()
    return float(np.angle(mean)) if known.any() else np.nan


def _angles(poses: Sequence[InverseKinematics], name: str) -> np.ndarray:
    """Return the coordinate (rad) in all frames; NaN where it is not determined."""
    columns = [ik.q[:, ik.coordinates.index(name)] for ik in poses if name in ik.coordinates]
    return np.concatenate([np.empty(0), *columns])


def with_rotating_arms(skeleton: Skeleton, trials: Sequence[Trial]) -> Skeleton:
    """Free the rotation of each upper arm that all frames of all trials show.

    A frame with a straight elbow does not show it, and would be left out.

    Args:
        skeleton: of the 27-DOF model, with the rotations of the arms about their own axes locked.
        trials: the trials it will be used for.
    """
    names = [name for name in UPPER_ARM_ROTATIONS if f"elbow_flex_{name[-1]}" in skeleton.coordinates]
    poses = first_poses(skeleton.free(names), trials)

    def shown(name: str) -> bool:
        return all(bool(np.isfinite(ik.q[:, ik.coordinates.index(name)]).all()) for ik in poses)

    return skeleton.free([name for name in names if shown(name)])


def show_knee_axes(poses: Sequence[InverseKinematics]) -> bool:
    """Decide whether the trials show the axes of both knees: two with a stride of both legs, or one with a squat.

    Args:
        poses: inverse kinematics of the trials with the 27-DOF model.
    """
    excursions = [_least_excursion_rad(ik) for ik in poses]
    return sum(excursion > _STRIDE_RAD for excursion in excursions) > 1 or any(
        excursion > _SQUAT_RAD for excursion in excursions
    )


def _least_excursion_rad(ik: InverseKinematics) -> float:
    """Return the range of flexion of the knee that bends less."""
    return min(_range_rad(ik.q[:, ik.coordinates.index(name)]) if name in ik.coordinates else 0.0 for name in KNEES)


def _range_rad(angle: np.ndarray) -> float:
    known = angle[np.isfinite(angle)]
    return float(np.diff(np.quantile(known, _WITHIN))[0]) if known.size else 0.0


def shows_trunk(skeleton: Skeleton, trial: Trial) -> bool:
    """Decide whether any frame has enough torso markers to determine how it leans and rotates."""
    of_trunk = {marker.label for marker in skeleton.markers if marker.segment == "torso"}
    seen = trial.markers.seen[:, [label in of_trunk for label in trial.markers.labels]]
    return bool((seen.sum(axis=1) >= ENOUGH_TRUNK_MARKERS).any())


def with_upright_trunk(skeleton: Skeleton, trial: Trial) -> Trial:
    """Add virtual trunk markers to the trial, in the frames that show three markers of the pelvis.

    Args:
        skeleton: of the 27-DOF model, from a static trial.
        trial: facing any way.
    """
    worn = [m for m in skeleton.markers if m.segment == "pelvis" and m.label in trial.markers.labels]
    rotation, translation = rigid_motion(
        np.array([m.position for m in worn]), trial.markers.select([m.label for m in worn]).positions
    )
    joint = next(joint for joint in skeleton.joints if joint.child == "torso")
    lumbar = translation + rotation @ np.asarray(joint.translation)
    upright = _facing(rotation[:, :, 0], trial.markers.rate_hz)
    places = [lumbar + upright @ marker.position for marker in VIRTUAL_TRUNK]
    markers = with_positions(trial.markers, [marker.label for marker in VIRTUAL_TRUNK], np.stack(places, axis=1))
    trunk_sd_m = {marker.label: TRUNK_SD_M for marker in VIRTUAL_TRUNK}
    return replace(trial, markers=markers, virtual_sd_m={**trial.virtual_sd_m, **trunk_sd_m})


def with_positions(markers: Markers, labels: Sequence[str], positions: FloatArray) -> Markers:
    """Append markers with these positions (n, k, 3) m."""
    return Markers(markers.time, (*markers.labels, *labels), np.concatenate([markers.positions, positions], axis=1))


def rigid_motion(local: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute rotation (n, 3, 3) and translation (n, 3) m that best map points (m, 3) to those measured (n, m, 3).

    NaN where fewer than three are seen (Kabsch 1976).
    """
    seen = np.asarray(np.isfinite(measured).all(axis=2))
    weight = seen[..., None] / np.maximum(seen.sum(axis=1), 1)[:, None, None]
    shown = np.where(seen[..., None], measured, 0.0)
    middle, local_middle = (weight * shown).sum(axis=1), (weight * local).sum(axis=1)
    across = np.einsum("nmi,nmj->nij", weight * (shown - middle[:, None]), local - local_middle[:, None])
    left, _, right = np.linalg.svd(across)
    handed = np.linalg.det(left @ right)
    left[:, :, 2] *= handed[:, None]
    rotation = left @ right
    translation = middle - np.einsum("nij,nj->ni", rotation, local_middle)
    few: np.ndarray = seen.sum(axis=1) < 3
    rotation[few], translation[few] = np.nan, np.nan
    return rotation, translation


def _facing(forward: FloatArray, rate_hz: float) -> FloatArray:
    """Return upright axes (n, 3, 3) that face along directions (n, 3), averaged over about a stride."""
    known = np.asarray(np.isfinite(forward).all(axis=1))
    flat = np.where(known[:, None], forward, 0.0) * [1.0, 0.0, 1.0]
    if len(flat) > 1:
        flat = gaussian_mean(flat, _HEADING_S * rate_hz)
    x = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9)
    up = np.tile([0.0, 1.0, 0.0], (len(x), 1))
    return np.stack([x, up, np.cross(x, up)], axis=2)
