"""Reports how far calibration moved the joint centres of a model."""

import re

import numpy as np

from kinertia.model.skeleton import Skeleton


def centre_offsets(skeleton: Skeleton) -> dict[str, np.ndarray]:
    """Return by joint how far (3,) m its centre offsets move it in its parent, along the parent's axes."""
    names = {name.removesuffix("/offset_x") for name in skeleton.locked if name.endswith("/offset_x")}
    return {name: np.array([skeleton.locked[f"{name}/offset_{axis}"] for axis in "xyz"]) for name in names}


def joint_and_axis(coordinate: str) -> tuple[str, str]:
    """Return joint and axis that a static coordinate moves or tilts, from its name.

    >>> [joint_and_axis(name) for name in ("hip_x_r", "lumbar_y", "knee_tilt_1_l", "hip_l/offset_z")]
    [('hip_r', 'x'), ('lumbar', 'y'), ('knee_l', '1'), ('hip_l', 'z')]
    """
    joint, axis, side = re.fullmatch(r"(.+?)(?:/offset|_tilt)?_([xyz12])(_[rl])?", coordinate).groups("")  # type: ignore[union-attr]
    return f"{joint}{side}", axis
