"""Joints of one side with the other's frames are named; sound models, and people with legs unlike, are not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import upright_model as upright
from kinertia.diagnostics.model.geometry import mirrored_joints
from kinertia.io.opensim.reader import read_osim
from kinertia.model.joint_centres import subtalar_axis
from kinertia.model.skeleton import Joint, Skeleton
from people import with_model
from recordings import here
from sound_models import MODELS


def found(skeleton: Skeleton) -> list[tuple[str, str, str, float]]:
    """Code, the right and the left joint or axis, and by how much they do not mirror: degrees or mm."""
    return [
        (
            finding.code,
            finding.evidence["right"].value,
            finding.evidence["left"].value,
            round(np.degrees(finding.evidence["angle_rad"].value))
            if finding.code == "O302"
            else round(1e3 * finding.evidence["distance_m"].value),
        )
        for finding in mirrored_joints(with_model(skeleton, upright.bsp()))
    ]


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
    assert found(upright.skeleton(arms)) == []
    assert found(upright.skeleton(arms, lumbar_up_m=0.07)) == []


def test_an_axis_of_the_other_side():
    """(0.79, 0.60, -0.12) mirrored is (-0.79, -0.60, -0.12), or its opposite: copied, they are 14 degrees apart."""
    right = axis_of(upright.skeleton(), "toes_r", (0.79, 0.60, -0.12))
    for mirrored in ((-0.79, -0.60, -0.12), (0.79, 0.60, 0.12)):
        assert found(axis_of(right, "toes_l", mirrored)) == []
    copied = found(axis_of(right, "toes_l", (0.79, 0.60, -0.12)))
    assert copied == [("O302", "talus_r_toes_r", "talus_l_toes_l", 14)]


def test_what_is_above_a_joint_is_not_its_fault():
    """A thigh that is turned by 8 degrees turns all below: the joints below it are still mirrored in their parents."""
    turned = Rotation.from_rotvec([0.0, np.radians(8.0), 0.0]).as_matrix()
    assert found(changed(upright.skeleton(), "femur_r", rotation=turned)) == [("O302", "hip_r", "hip_l", 8)]


def test_a_knee_with_a_body_more_than_the_other_is_not_compared():
    """The right shank hangs on a body of its own, a plateau in the knee; its place there is none of the left's."""
    skeleton = upright.skeleton()
    (knee,) = [joint for joint in skeleton.joints if joint.child == "tibia_r"]
    plateau = replace(knee, child="plateau_r")
    shank = Joint("plateau_r", "tibia_r", np.eye(3), np.zeros(3), ())
    joints = [part for joint in skeleton.joints for part in ((plateau, shank) if joint is knee else (joint,))]
    assert found(replace(skeleton, joints=tuple(joints))) == []


@pytest.mark.parametrize("child", ["tibia_r", "talus_l", "humerus_r"])
def test_a_joint_that_was_moved(child):
    pair = f"{child[:-2]}_r", f"{child[:-2]}_l"
    for forward, expected in ((0.010, []), (0.020, [("O303", *pair, 20)])):
        moved = np.add(place(upright.skeleton(), child), (forward, 0.0, 0.0))
        assert found(changed(upright.skeleton(), child, translation=moved)) == expected


def test_a_hip_that_was_moved_outward():
    moved = np.add(place(upright.skeleton(), "femur_r"), (0.0, 0.0, 0.020))
    assert found(changed(upright.skeleton(), "femur_r", translation=moved)) == [("O303", "femur_r", "femur_l", 20)]


def test_the_middle_of_a_pelvis_need_not_be_its_origin():
    """All joints of the pelvis 30 mm to the right: it is still symmetrical."""
    skeleton = upright.skeleton()
    for child in ("femur_r", "femur_l", "torso"):
        skeleton = changed(skeleton, child, translation=np.add(place(skeleton, child), (0.0, 0.0, 0.030)))
    assert found(skeleton) == []


@pytest.mark.parametrize("child", ["tibia_r", "talus_l"])
def test_one_leg_shorter(child):
    assert found(changed(upright.skeleton(), child, translation=0.9 * place(upright.skeleton(), child))) == []


def test_bodies_with_axes_of_their_own():
    """As in `test_anatomy`: thighs whose frames are askew, the same on both sides."""
    turned = Rotation.from_rotvec([0.3, -0.8, 0.4]).as_matrix()
    assert found(upright.skeleton(turned=turned)) == []


@pytest.mark.parametrize("name", MODELS)
def test_models_in_use(file_of, name):
    assert found(read_osim(file_of(name)).skeleton) == []


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
    axes = tuple(
        replace(left_axis, direction=other.direction) for left_axis, other in zip(left.axes, right.axes, strict=True)
    )
    copied = changed(skeleton, left.child, axes=axes, rotation=right.rotation, child_rotation=right.child_rotation)
    degrees = round(2.0 * np.degrees(np.arcsin(abs(axis[2]))))
    assert found(copied) == [("O302", "subtalar_angle_r", "subtalar_angle_l", degrees)]
