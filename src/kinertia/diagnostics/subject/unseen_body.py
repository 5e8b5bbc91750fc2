"""What it costs that markers do not show the upper body: sentences for the user.

The figures are differences of the joint moments (RMS over the window) with and without the markers of arms and head, or
of all of the upper body, in the walks of gait2354 and of Rajagopal's model.
"""

from __future__ import annotations

from kinertia.model.gait27 import ARM_COORDINATES, VIRTUAL_TRUNK
from kinertia.model.skeleton import Skeleton


def unseen_body(skeleton: Skeleton) -> list[str]:
    """Of a 27-DOF model that was adapted to its trials."""
    held = [name for name in ARM_COORDINATES if name in skeleton.locked]
    joined = len(held) == len(ARM_COORDINATES)
    if VIRTUAL_TRUNK[0].label in skeleton.labels:
        upper = "trunk, arms and head are one segment" if joined else "trunk and head are one segment"
        return [
            f"no marker shows the trunk: {upper}, taken to stay upright over the pelvis and to face where it does on "
            f"average, within 10 degrees; in two walks joint moments of the legs changed by 1 to 7 N m against the "
            f"full marker set, those of the lumbar joint by 3 to 11 N m, within their error bars; what is said of "
            f"the upper body's parameters is the literature: add markers at C7, sternum and shoulders"
        ]
    if joined:
        return [
            "no marker shows the arms: trunk, arms and head are one segment, the arms hanging; in two walks joint "
            "moments of the legs changed by 0.1 to 5 N m against the full marker set, those of the lumbar joint by 1 "
            "to 8 N m, within their error bars; what is said of the arms' parameters is the literature"
        ]
    return [f"no marker shows {', '.join(held)}: held at 0 (the arm hangs along the torso)"] if held else []
