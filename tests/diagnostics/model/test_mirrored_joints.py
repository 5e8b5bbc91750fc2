"""Joints of one side with the other's frames are named; sound models, and people with legs unlike, are not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import upright_model as upright
from kinertia.diagnostics.model.mirrored_joints import mirrored_joints_doubts
from kinertia.io.osim.reader import read_osim
from kinertia.model.joint_centres import subtalar_axis
from kinertia.model.skeleton import Skeleton
from recordings import here
from sound_models import MODELS


def changed(skeleton: Skeleton, child: str, **values) -> Skeleton:
    """The model with some properties of the joint that carries one body replaced."""
    return replace(skeleton, joints=tuple(replace(j, **values) if j.child == child else j for j in skeleton.joints))


def place(skeleton: Skeleton, child: str) -> np.ndarray:
    return next(np.asarray(joint.translation) for joint in skeleton.joints if joint.child == child)


def axis_of(skeleton: Skeleton, child: str, direction) -> Skeleton:
    (joint,) = [joint for joint in skeleton.joints if joint.child == child]
    unit = tuple(np.asarray(direction) / np.linalg.norm(direction))
    return changed(skeleton, child, axes=tuple(replace(axis, direction=unit) for axis in joint.axes))


@pytest.mark.parametrize("arms", [True, False])
def test_a_sound_model(arms):
    assert mirrored_joints_doubts(upright.skeleton(arms)) == []
    assert mirrored_joints_doubts(upright.skeleton(arms, lumbar_up_m=0.07)) == []


def test_an_axis_of_the_other_side():
    """(0.79, 0.60, -0.12) mirrored is (-0.79, -0.60, -0.12), or its opposite: copied, they are 14 degrees apart."""
    right = axis_of(upright.skeleton(), "toes_r", (0.79, 0.60, -0.12))
    for mirrored in ((-0.79, -0.60, -0.12), (0.79, 0.60, 0.12)):
        assert mirrored_joints_doubts(axis_of(right, "toes_l", mirrored)) == []
    (sentence,) = mirrored_joints_doubts(axis_of(right, "toes_l", (0.79, 0.60, -0.12)))
    assert "do not mirror each other in the axes of talus_r_toes_r and talus_l_toes_l (14 degrees)" in sentence


def test_what_is_above_a_joint_is_not_its_fault():
    """A thigh that is turned by 8 degrees turns all below: the joints below it are still mirrored in their parents."""
    turned = Rotation.from_rotvec([0.0, np.radians(8.0), 0.0]).as_matrix()
    (sentence,) = mirrored_joints_doubts(changed(upright.skeleton(), "femur_r", rotation=turned))
    assert "in the axes of hip_r and hip_l (8 degrees);" in sentence


@pytest.mark.parametrize("child", ["tibia_r", "talus_l", "humerus_r"])
def test_a_joint_that_was_moved(child):
    for forward, said in ((0.010, False), (0.020, True)):
        moved = np.add(place(upright.skeleton(), child), (forward, 0.0, 0.0))
        told = mirrored_joints_doubts(changed(upright.skeleton(), child, translation=moved))
        assert bool(told) == said
    assert f"{child[:-2]}_r and {child[:-2]}_l (20 mm)" in told[0]


def test_a_hip_that_was_moved_outward():
    moved = np.add(place(upright.skeleton(), "femur_r"), (0.0, 0.0, 0.020))
    (sentence,) = mirrored_joints_doubts(changed(upright.skeleton(), "femur_r", translation=moved))
    assert "femur_r and femur_l (20 mm)" in sentence


def test_the_middle_of_a_pelvis_need_not_be_its_origin():
    """All joints of the pelvis 30 mm to the right: it is still symmetrical."""
    skeleton = upright.skeleton()
    for child in ("femur_r", "femur_l", "torso"):
        skeleton = changed(skeleton, child, translation=np.add(place(skeleton, child), (0.0, 0.0, 0.030)))
    assert mirrored_joints_doubts(skeleton) == []


@pytest.mark.parametrize("child", ["tibia_r", "talus_l"])
def test_one_leg_shorter(child):
    assert (
        mirrored_joints_doubts(changed(upright.skeleton(), child, translation=0.9 * place(upright.skeleton(), child)))
        == []
    )


def test_bodies_with_axes_of_their_own():
    """As in `test_anatomy`: thighs whose frames are askew, the same on both sides."""
    turned = Rotation.from_rotvec([0.3, -0.8, 0.4]).as_matrix()
    assert mirrored_joints_doubts(upright.skeleton(turned=turned)) == []


@pytest.mark.parametrize("name", MODELS)
def test_models_in_use(file_of, name):
    assert mirrored_joints_doubts(read_osim(file_of(name)).skeleton) == []


SUBTALAR_AXES = {
    "synthetic/scaled.osim": ("foot", subtalar_axis("r")),
    "gait2354/subject01_scaled.osim": ("calcn", np.array([0.7872, 0.6047, -0.1209])),
}
"""Of models: what carries the right heel, and the axis there."""


@pytest.mark.parametrize("name", here(SUBTALAR_AXES))
def test_a_subtalar_joint_with_the_frames_of_the_right(file_of, name):
    """Nothing else said so; in gait2354 the moments were up to 33 N m off."""
    heel, axis = SUBTALAR_AXES[name]
    skeleton = read_osim(file_of(name)).skeleton
    (right,) = [joint for joint in skeleton.joints if joint.child == f"{heel}_r"]
    (left,) = [joint for joint in skeleton.joints if joint.child == f"{heel}_l"]
    axes = tuple(replace(own, direction=other.direction) for own, other in zip(left.axes, right.axes, strict=True))
    copied = changed(skeleton, left.child, axes=axes, rotation=right.rotation, child_rotation=right.child_rotation)
    (sentence,) = mirrored_joints_doubts(copied)
    degrees = 2.0 * np.degrees(np.arcsin(abs(axis[2])))
    assert f"subtalar_angle_r and subtalar_angle_l ({degrees:.0f} degrees)" in sentence
