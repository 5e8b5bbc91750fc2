"""A synthetic walk as a C3D file of poses, laid out as Theia does."""

from pathlib import Path

import ezc3d
import numpy as np

from kinertia.synthetic.walk import SyntheticTrial
from kinertia.trial.data import PlateLoads

NAMES = {
    "pelvis": "pelvis",
    "torso": "torso",
    **{f"{s}_{theirs}": f"{ours}_{s}" for s in "rl" for theirs, ours in [
        ("thigh", "thigh"), ("shank", "shank"), ("foot", "foot"), ("uarm", "upper_arm"), ("larm", "forearm")]},
}  # fmt: skip
"""Theia's segment -> ours."""
AXES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Columns: right, forwards and up in axes that point forwards, up and to the right."""


def poses(trial: SyntheticTrial) -> dict[str, np.ndarray]:
    """Theia's segment -> (n, 4, 4), m, in axes that point right, forwards and up."""
    skeleton, pose = trial.skeleton, trial.skeleton.pose(trial.motion.q)
    result = {}

    def put(name: str, ours: str, place: np.ndarray) -> None:
        i = skeleton.segments.index(ours)
        frames = np.tile(np.eye(4), (len(trial.time), 1, 1))
        frames[:, :3, :3] = AXES.T @ pose.rotation[:, i] @ AXES
        frames[:, :3, 3] = (pose.translation[:, i] + pose.rotation[:, i] @ place) @ AXES
        result[name] = frames

    joints = {joint.child: joint for joint in skeleton.joints}
    hips = [np.asarray(joints[f"thigh_{s}"].translation) for s in "rl"]
    put("pelvis", "pelvis", (hips[0] + hips[1]) / 2)
    put("torso", "torso", np.array([0.0, 0.48, 0.0]))
    for theirs, ours in NAMES.items():
        if theirs not in result:
            put(theirs, ours, np.zeros(3))
    for side in "rl":
        put(f"{side}_toes", f"foot_{side}", np.array([0.13, -0.05, 0.0]))
        put(f"{side}_hand", f"forearm_{side}", np.array([0.0, -0.26, 0.0]))
    return result


def write_theia(
    path: Path, trial: SyntheticTrial, noise_m: float = 0.0, rng: np.random.Generator | None = None
) -> Path:
    """The file, in mm; noise on each segment's place and, over a lever of 0.2 m, on its direction."""
    frames = poses(trial)
    rotations = np.stack(list(frames.values()), axis=1)
    if rng is not None:
        rotations[:, :, :3, 3] += noise_m * rng.standard_normal((*rotations.shape[:2], 3))
    rotations[:, :, :3, 3] *= 1000.0
    file = ezc3d.c3d()
    rate = 1.0 / (trial.time[1] - trial.time[0])
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["data"]["points"] = np.zeros((4, 0, len(trial.time)))
    world = np.tile(np.eye(4), (len(trial.time), 1, 1, 1))
    file["data"]["rotations"] = np.moveaxis(np.concatenate([world, rotations], axis=1), (0, 1), (3, 2))
    labels = ["worldbody_4X4", *(f"{name}_4X4" for name in frames)]
    for name, value in {"LABELS": labels, "RATE": [rate], "RATIO": [1], "USED": [len(labels)]}.items():
        file.add_parameter("ROTATION", name, value)
    file.write(str(path))
    return path


def plates(trial: SyntheticTrial) -> PlateLoads:
    """A plate under each foot, in ground axes that are turned as the file's are."""
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    force, moment = trial.foot_loads[..., :3] @ turn.T, trial.foot_loads[..., 3:] @ turn.T
    return PlateLoads(trial.time, ("right", "left"), force, moment, (None, None))
