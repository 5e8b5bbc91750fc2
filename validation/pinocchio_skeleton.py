"""A skeleton as a Pinocchio model: the peer of the rigid-body core, built from the joints and not from our tree."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Axis, Skeleton


def pinocchio_model(skeleton: Skeleton, *parts: BodySegmentParameters | None) -> pin.Model:
    """Build the model with these parameters and those of the skeleton; locked axes are part of the placements."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, -skeleton.gravity_m_s2, 0.0])
    last_axis, offset = {"ground": 0}, {"ground": pin.SE3.Identity()}
    for joint in skeleton.joints:
        parent = last_axis[joint.parent]
        place = offset[joint.parent] * pin.SE3(np.asarray(joint.rotation), np.asarray(joint.translation))
        for axis in joint.axes:
            if axis.coordinate in skeleton.locked:
                place = place * _placed_by(axis, skeleton.locked[axis.coordinate])
                continue
            kind = pin.JointModelRevoluteUnaligned if axis.kind == "rotation" else pin.JointModelPrismaticUnaligned
            parent = model.addJoint(parent, kind(*axis.direction), place, f"{axis.coordinate}:{model.njoints}")
            place = pin.SE3.Identity()
        far = pin.SE3(np.asarray(joint.child_rotation), np.asarray(joint.child_translation))
        last_axis[joint.child], offset[joint.child] = parent, place * far.inverse()
    for part in (*parts, skeleton.carried):
        for segment, *body in (
            () if part is None else zip(part.segments, part.mass_kg, part.com_m, part.inertia_kgm2, strict=True)
        ):
            model.appendBodyToJoint(last_axis[segment], pin.Inertia(*body), offset[segment])
    return model


def axis_forces(model: pin.Model, motion: Sequence[np.ndarray]) -> np.ndarray:
    """Compute forces (n, a) of the axes for positions, rates and accelerations, each (n, a)."""
    data = model.createData()
    return np.array([pin.rnea(model, data, *rows) for rows in zip(*motion, strict=True)])


def _placed_by(axis: Axis, value: float) -> pin.SE3:
    direction = np.array(axis.direction)
    if axis.function is not None:
        value = float(axis.function(np.array([value]))[0])
    if axis.kind == "translation":
        return pin.SE3(np.eye(3), direction * value)
    return pin.SE3(pin.exp3(direction * value), np.zeros(3))
