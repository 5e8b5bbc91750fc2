"""Which way an elbow bends: what trials say where the static trial misleads.

With one marker at an elbow, the static trial's plane of upper arm and forearm tells where the elbow's axis points. Of a
nearly straight arm, as in a T-pose, that plane is chance, and the axis may be turned by more than a quarter turn about
the arm: the elbow then bends backwards in all that follows. Trials in which it does are read again with upper arm and
forearm free to turn about their own axes, where markers and the elbow's range tell the turn.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.calibration import first_poses
from kinertia.model.gait27 import ARM_ROTATIONS
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import InverseKinematics
from kinertia.trial.data import Trial

_BACKWARDS_RAD = 0.5
"""Beyond the end of the elbow's range, median over the frames."""


def with_elbows_that_bend_forwards(
    skeleton: Skeleton, trials: Sequence[Trial], poses: Sequence[InverseKinematics]
) -> tuple[Skeleton, list[InverseKinematics]]:
    """The skeleton, its arms turned as the trials show them where an elbow bends backwards, and the poses with it.

    Args:
        skeleton: of the 27-DOF model, from the static trial; the arms' turns about their own axes are locked.
        trials: that it will be used for.
        poses: their `first_poses`.
    """
    sides = [side for side in "rl" if _bends_backwards(skeleton, poses, f"elbow_flex_{side}")]
    if not sides:
        return skeleton, list(poses)
    free = first_poses(skeleton.free(ARM_ROTATIONS), trials)
    turns = {name: _mean_angle(free, name) for name in ARM_ROTATIONS if name[-1] in sides}
    turned = skeleton.lock({name: turn for name, turn in turns.items() if np.isfinite(turn)})
    return turned, first_poses(turned, trials)


def elbow_rotations(before: Skeleton, after: Skeleton) -> dict[str, float]:
    """By how much `with_elbows_that_bend_forwards` has turned elbow axes about the upper arm: side -> rad.

    Sides that it has left alone are not in it.
    """
    names = {side: f"arm_rot_{side}" for side in "rl"}
    rotations = {side: after.locked.get(name, 0.0) - before.locked.get(name, 0.0) for side, name in names.items()}
    return {side: float(np.angle(np.exp(1j * each))) for side, each in rotations.items() if each != 0.0}


def _bends_backwards(skeleton: Skeleton, poses: Sequence[InverseKinematics], elbow: str) -> bool:
    angles = _angles(poses, elbow)
    return len(angles) > 0 and bool(np.median(angles) < skeleton.ranges[elbow].low - _BACKWARDS_RAD)


def _mean_angle(poses: Sequence[InverseKinematics], name: str) -> float:
    """Rad, on the circle; NaN where no frame shows it."""
    angles = _angles(poses, name)
    return float(np.angle(np.exp(1j * angles).mean())) if len(angles) else np.nan


def _angles(poses: Sequence[InverseKinematics], name: str) -> np.ndarray:
    """Rad, of all frames that show it."""
    columns = [ik.q[:, ik.coordinates.index(name)] for ik in poses if name in ik.coordinates]
    found = np.concatenate([np.empty(0), *columns])
    result: np.ndarray = found[np.isfinite(found)]
    return result
