"""Does the subtalar axis of a model point forward, up and inward, as it does in people?

All models that OpenSim users scale have the same axis, 37 degrees up from the sole and 9 degrees inward. People had 41
and 23 degrees on average (SD 9 and 11; Isman and Inman 1969), 12 degrees from it. A very different axis is more likely
a mistake, most often a lost orientation.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.model.mirrored_joints import without_side
from kinertia.diagnostics.person_context import PersonContext
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.neutral_joints import NeutralJoints, angle_deg, neutral_joints

_FARTHEST_RAD = float(np.radians(25.0))
"""Models in use: 0.0 degrees. An axis along the foot: 38."""
_USUAL = (0.7872, 0.6047, -0.1209)
"""Forward, up, to the right: of a right foot, as gait2354 and Rajagopal have it."""


def subtalar_axis(context: PersonContext) -> Iterator[Finding]:
    """Report O304: a subtalar axis far from where people have it (some 40 degrees up from the sole, 10 to 20
    inward)."""
    neutral = None if context.model is None else neutral_joints(context.model.skeleton)
    if neutral is None or neutral.sideways is None:
        return
    far = {}
    for body, axes in neutral.turns.items():
        if not body.lower().startswith("calcn") or not neutral.joints[body].parent.lower().startswith("talus"):
            continue
        if len(axes) == 1 and body.endswith(("_r", "_l")):
            ((coordinate, axis),) = axes.items()
            angle = float(np.radians(angle_deg(axis, _usual(neutral, body))))
            if angle > _FARTHEST_RAD:
                far[coordinate] = angle
    if far:
        # both sides in one: what is said of their asymmetry has the name that they share, too
        worst = max(far, key=far.__getitem__)
        angle_rad = Quantity(far[worst], "rad", limit=_FARTHEST_RAD, usual=(0.0, 0.21))
        yield finding("O304", Where(part=without_side(worst)), angle_rad=angle_rad, joints=Quantity(", ".join(far)))


def _usual(neutral: NeutralJoints, body: str) -> np.ndarray:
    """Return the usual axis (3,) of this foot, in ground, where forward follows from up and right."""
    forward, up, right = _USUAL
    to_right = np.zeros(3)
    across = sum((neutral.centres[one] - neutral.centres[other] for one, other in neutral.pairs), np.zeros(3))
    to_right[neutral.sideways] = np.sign(across[neutral.sideways])
    ahead = np.cross([0.0, 1.0, 0.0], to_right)
    inward = right if body.endswith("_r") else -right
    return np.asarray(forward * ahead + up * np.array([0.0, 1.0, 0.0]) + inward * to_right)
