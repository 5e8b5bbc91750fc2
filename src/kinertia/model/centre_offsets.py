"""How far calibration moved the joint centres of an OpenSim model."""

from __future__ import annotations

import numpy as np

from kinertia.model.skeleton import Skeleton


def centre_offsets(skeleton: Skeleton) -> dict[str, np.ndarray]:
    """By joint, (3,) m by which the skeleton's joint centre offsets move it in its parent, along the parent's axes."""
    names = {name.removesuffix("/offset_x") for name in skeleton.locked if name.endswith("/offset_x")}
    return {name: np.array([skeleton.locked[f"{name}/offset_{axis}"] for axis in "xyz"]) for name in names}
