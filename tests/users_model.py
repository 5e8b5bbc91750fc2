"""A person's model as users of OpenSim have them: more bodies and other names than the built-in model's.

It moves exactly as that does. Feet have toes, which no marker shows; the patella is held fast on the tibia, the hand on
the radius; forearms and upper arms turn about their long axes; frames of hips and shoulders are turned in their
parents; one marker of the trials is missing.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Axis, Joint, Marker, Skeleton

NAMES = {"thigh": "femur", "shank": "tibia", "foot": "calcn", "upper_arm": "humerus", "forearm": "ulna"}
SHARES = (
    # of the mass of the first body, the second one's
    ("calcn", "talus", 0.1),
    ("calcn", "toes", 0.2),
    ("tibia", "patella", 0.02),
    ("ulna", "radius", 0.66),
    ("radius", "hand", 0.45),
)
WITHOUT = "R.Midfoot.Lat"
_TURN = Rotation.from_rotvec([0.2, -0.3, 0.1]).as_matrix()


def users_model(skeleton: Skeleton, bsp: BodySegmentParameters) -> tuple[Skeleton, BodySegmentParameters]:
    """The built-in model of a person in this form."""
    joints = []
    for joint in skeleton.joints:
        joint = replace(joint, parent=renamed(joint.parent), child=renamed(joint.child))
        side = joint.child[-1]
        if joint.child.startswith(("femur", "humerus")):
            joint = _turned(joint)
        if joint.child.startswith("ulna"):
            *bending, turning = joint.axes
            joints += [replace(joint, axes=tuple(bending)), _joint(joint.child, f"radius_{side}", (turning,))]
            joints.append(_joint(f"radius_{side}", f"hand_{side}"))
            continue
        joints.append(joint)
        if joint.child.startswith("tibia"):
            joints.append(_joint(joint.child, f"patella_{side}"))
        if joint.child.startswith("calcn"):
            toes = (Axis(f"mtp_angle_{side}", "rotation", (0.0, 0.0, 1.0)),)
            joints.append(_joint(joint.child, f"toes_{side}", toes, _place(skeleton, f"{side.upper()}.Toe.Med")))
    markers = [replace(marker, segment=_worn_by(marker)) for marker in skeleton.markers if marker.label != WITHOUT]
    moving = ("arm_rot", "pro_sup")
    locked = {name: value for name, value in skeleton.locked.items() if not name.startswith(moving)}
    whole = replace(skeleton, name="user", joints=tuple(joints), markers=tuple(markers), locked=locked)
    whole = replace(whole, feet=("calcn_r", "calcn_l"))
    return whole, _shared(whole, bsp)


def renamed(segment: str) -> str:
    """A body's name for a segment of the built-in model."""
    kind, _, side = segment.rpartition("_")
    return f"{NAMES[kind]}_{side}" if kind in NAMES else segment


def _place(skeleton: Skeleton, label: str) -> np.ndarray:
    return next(marker.position for marker in skeleton.markers if marker.label == label) * [1.0, 1.0, 0.0]


def _worn_by(marker: Marker) -> str:
    return f"radius_{marker.segment[-1]}" if "Wrist" in marker.label else renamed(marker.segment)


def _joint(parent: str, child: str, axes: tuple[Axis, ...] = (), place: np.ndarray | None = None) -> Joint:
    return Joint(parent, child, np.eye(3), np.zeros(3) if place is None else place, axes)


def _turned(joint: Joint) -> Joint:
    """With both frames turned, and the axes in them: the child moves as before."""
    axes = tuple(replace(axis, direction=tuple((_TURN.T @ axis.direction).tolist())) for axis in joint.axes)
    return replace(joint, rotation=joint.rotation @ _TURN, axes=axes, child_rotation=joint.child_rotation @ _TURN)


def _shared(skeleton: Skeleton, bsp: BodySegmentParameters) -> BodySegmentParameters:
    """Bodies that stood for two give a share to the other, about the same place: together they are as before."""
    mass, com, inertia = (
        dict(zip(map(renamed, bsp.segments), values, strict=True))
        for values in (bsp.mass_kg, bsp.com_m, bsp.inertia_kgm2)
    )
    places = skeleton.pose(np.zeros((1, len(skeleton.coordinates)))).translation[0]
    for side in "rl":
        for kind, other, share in SHARES:
            segment, two = f"{kind}_{side}", f"{other}_{side}"
            apart = np.subtract(*(places[skeleton.segments.index(name)] for name in (two, segment)))
            mass[two], inertia[two], com[two] = share * mass[segment], share * inertia[segment], com[segment] - apart
            mass[segment], inertia[segment] = (1.0 - share) * mass[segment], (1.0 - share) * inertia[segment]
    order = [name for name in skeleton.segments if name in mass]
    return BodySegmentParameters(
        tuple(order), *(np.array([values[name] for name in order]) for values in (mass, com, inertia))
    )
