"""A model in memory, with OpenSim's names of bodies and Dumas' mass properties for the person it is built for."""

import numpy as np

from kinertia.model.anthropometry import BodyGeometry, literature_bsp, reference_lengths
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters
from kinertia.model.joint_centres import lumbar_in_pelvis
from kinertia.model.skeleton import Axis, Joint, Marker, Skeleton

MASS_KG, HEIGHT_M, SEX = 75.0, 1.77, "male"
WIDTH_M = (0.085 - 0.0073) / 0.33  # of a pelvis with the hips at 0.085 m, by Harrington
MID_HIP = (-0.19 * WIDTH_M, -0.30 * WIDTH_M - 0.0109, 0.0)
LUMBAR = tuple(lumbar_in_pelvis(WIDTH_M, SEX).tolist())
BODIES = {
    **{"pelvis": "pelvis", "torso": "torso"},
    **{f"{part}_{side}": f"{body}_{side}" for side in "rl" for part, body in [
        ("thigh", "femur"), ("shank", "tibia"), ("foot", "talus"), ("upper_arm", "humerus"), ("forearm", "ulna")]},
}  # fmt: skip


def geometry() -> BodyGeometry:
    usual = reference_lengths(HEIGHT_M, SEX)
    lengths = {f"{name}_{side}": length for name, length in usual.items() for side in "rl" if name != "torso"}
    return BodyGeometry(LUMBAR, MID_HIP, {"torso": usual["torso"], **lengths})


def literature(source: str = "dumas") -> BodySegmentParameters:
    return literature_bsp(MASS_KG, HEIGHT_M, SEX, geometry(), source)


def skeleton(arms: bool = True, turned: np.ndarray | None = None, lumbar_up_m: float = 0.0) -> Skeleton:
    """Upright at zero; `turned` (3, 3) sets the femurs' own frames askew, `lumbar_up_m` the joint above L5/S1."""
    lengths = geometry().lengths_m
    joints = [_joint("ground", "pelvis", (0, 0, 0)), _joint("pelvis", "torso", np.add(LUMBAR, (0, lumbar_up_m, 0)))]
    for side, sign in (("r", 1), ("l", -1)):
        foot = lengths[f"foot_{side}"]
        hip = Joint("pelvis", f"femur_{side}", np.eye(3), np.add(MID_HIP, (0, 0, sign * 0.085)),
                    (Axis(f"hip_{side}", "rotation", (0.0, 0.0, 1.0)),),
                    np.eye(3) if turned is None else turned)  # fmt: skip
        knee = np.array([0.0, -lengths[f"thigh_{side}"], 0.0])
        joints += [
            hip,
            _joint(f"femur_{side}", f"tibia_{side}", knee if turned is None else turned @ knee, turned),
            _joint(f"tibia_{side}", f"talus_{side}", (0, -lengths[f"shank_{side}"], 0)),
            _joint(f"talus_{side}", f"toes_{side}", (0.8 * foot, -0.6 * foot, 0)),
        ]
        if arms:
            joints += [
                _joint("torso", f"humerus_{side}", (0, 0.38, sign * 0.17)),
                _joint(f"humerus_{side}", f"ulna_{side}", (0, -lengths[f"upper_arm_{side}"], 0)),
                _joint(f"ulna_{side}", f"hand_{side}", (0, -lengths[f"forearm_{side}"], 0)),
            ]
    return Skeleton("upright", tuple(joints), (Marker("S", "pelvis", np.zeros(3)),))


def _joint(parent: str, child: str, place: object, rotation: np.ndarray | None = None) -> Joint:
    axes = (Axis(f"{parent}_{child}", "rotation", (0.0, 0.0, 1.0)),)
    return Joint(parent, child, np.eye(3) if rotation is None else rotation, np.array(place, dtype=float), axes)


def bsp(arms: bool = True) -> BodySegmentParameters:
    """Dumas' values under OpenSim's names; toes and hands are massless."""
    whole = literature()
    names = [BODIES[segment] for segment in whole.segments]
    kept = [k for k, name in enumerate(names) if arms or not name.startswith(("humerus", "ulna"))]
    bare = [f"{body}_{side}" for body in (["toes", "hand"] if arms else ["toes"]) for side in "rl"]
    table = np.vstack([whole.table()[kept], np.zeros((len(bare), 10))])
    return BodySegmentParameters.from_table(tuple([*(names[k] for k in kept), *bare]), table)


def changed(body: str, **values: float) -> BodySegmentParameters:
    """The upright model with some parameters of one body replaced."""
    usual = bsp()
    table = usual.table()
    for name, value in values.items():
        table[usual.segments.index(body), PARAMETERS.index(name)] = value
    return BodySegmentParameters.from_table(usual.segments, table)


def with_moments(body: str, *moments: float, mass: float | None = None) -> BodySegmentParameters:
    """The upright model with another inertia of one body, and perhaps another mass."""
    values = dict(zip(("ixx", "iyy", "izz"), moments, strict=True)) | {"ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
    return changed(body, **values, **({} if mass is None else {"mass": mass}))
