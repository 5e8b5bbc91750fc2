"""Does the subtalar axis of a model point forward, up and inward, as it does in people?

All models that OpenSim users scale have one axis, 37 degrees up from the sole and 9 degrees inward. People had 41 and
23 degrees on average, with deviations of 9 and 11 (Isman and Inman 1969), 12 degrees from it: one that is far off is
more likely a mistake, most often an orientation that was lost.
"""

from __future__ import annotations

import numpy as np

from kinertia.model.neutral_joints import NeutralJoints, angle_deg, neutral_joints
from kinertia.model.skeleton import Skeleton

FARTHEST_DEG = 25.0
"""Models in use: 0.0 degrees. An axis along the foot: 38."""
_USUAL = (0.7872, 0.6047, -0.1209)
"""Forward, up, to the right: of a right foot, as gait2354 and Rajagopal have it."""


def subtalar_axis_doubts(skeleton: Skeleton) -> list[str]:
    """One sentence on subtalar axes far from where people have them, or none."""
    neutral = neutral_joints(skeleton)
    if neutral.sideways is None:
        return []
    odd = []
    for body, turns in neutral.turns.items():
        if not body.lower().startswith("calcn") or not neutral.joints[body].parent.lower().startswith("talus"):
            continue
        if len(turns) == 1 and body.endswith(("_r", "_l")):
            ((coordinate, axis),) = turns.items()
            angle = angle_deg(axis, _usual(neutral, body))
            if angle > FARTHEST_DEG:
                odd.append(f"{coordinate} ({angle:.0f} degrees)")
    if not odd:
        return []
    return [
        f"the subtalar axis is far from where people have it (some 40 degrees up from the sole, 10 to 20 inward): "
        f"{', '.join(odd)}; expected within {FARTHEST_DEG:g} degrees; most likely the orientation of the joint or the "
        f"direction of its axis was lost: compare it with the model that this one was scaled from, unless it was "
        f"measured on this person"
    ]


def _usual(neutral: NeutralJoints, body: str) -> np.ndarray:
    """(3,) the usual axis of this foot, in ground: forward is where up and right say."""
    forward, up, right = _USUAL
    to_right = np.zeros(3)
    across = sum((neutral.centres[one] - neutral.centres[other] for one, other in neutral.pairs), np.zeros(3))
    to_right[neutral.sideways] = np.sign(across[neutral.sideways])
    ahead = np.cross([0.0, 1.0, 0.0], to_right)
    inward = right if body.endswith("_r") else -right
    return np.asarray(forward * ahead + up * np.array([0.0, 1.0, 0.0]) + inward * to_right)
