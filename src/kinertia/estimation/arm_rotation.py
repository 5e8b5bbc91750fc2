"""Lets upper arms rotate about their own axes where arms move in more than a plane, as in jumps and runs.

The 27-DOF model's shoulders flex and adduct. Arms that also rotate leave the elbow where the model cannot follow: the
forearm's markers are centimetres off, and an arm that swings overhead jumps from one solution to another. The rotation
is visible as long as the elbow is bent.
"""

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.calibration import first_poses
from kinertia.model.gait27 import UPPER_ARM_ROTATIONS
from kinertia.model.skeleton import Skeleton
from kinertia.trial.data import Trial


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
