"""Three-dimensional moments against generalised forces, and virtual axes against the whole load of a joint."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.joint_moments import (
    VirtualAxes,
    body_joints,
    component_names,
    joint_axes,
    joint_moments,
    joint_wrenches,
    lumbar_joint,
)
from kinertia.synthetic.walk import walk, walking_subject

SIDES = ("r", "l")


@pytest.fixture(scope="module")
def walked():
    return walk(walking_subject(), 1.0, 100.0)


@pytest.fixture(scope="module")
def found(walked):
    return joint_moments(walked.skeleton, walked.bsp, walked.motion, walked.foot_loads)


def component(found, name):
    return found.moments.reshape(len(found.moments), -1)[:, found.names.index(name)]


def test_joints_and_names(found):
    assert found.joints == ("hip_r", "knee_r", "ankle_r", "hip_l", "knee_l", "ankle_l", "lumbar")
    assert found.names[3:6] == ("knee_r_flexion", "knee_r_adduction", "knee_r_rotation")
    assert component_names("lumbar") == ("lumbar_flexion", "lumbar_bending", "lumbar_rotation")
    assert found.force_names[-3:] == ("lumbar_force_forward", "lumbar_force_up", "lumbar_force_right")


def test_of_joints_with_three_rotations_they_are_the_generalised_forces(walked, found):
    forces = inverse_dynamics(walked.skeleton, walked.bsp, walked.motion, walked.foot_loads)
    names = {f"hip_{s}_{a}": (f"hip_{a}_{s}", 1.0) for s in SIDES for a in ("flexion", "adduction", "rotation")}
    names |= {"lumbar_flexion": ("lumbar_extension", -1.0)}
    names |= {f"lumbar_{a}": (f"lumbar_{a}", 1.0) for a in ("bending", "rotation")}
    for name, (coordinate, sign) in names.items():
        expected = sign * forces[:, walked.skeleton.coordinates.index(coordinate)]
        np.testing.assert_allclose(component(found, name), expected, atol=1e-9, err_msg=name)


def test_a_hinge_transmits_adduction_and_rotation(found):
    assert {name for name, fixed in zip(found.names, found.constraint.ravel(), strict=True) if fixed} == {
        f"knee_{side}_{axis}" for side in SIDES for axis in ("adduction", "rotation")
    }


def test_signs_of_a_force_beside_the_knee(walked):
    """The ground pushes up through a point medial to a knee at rest: muscles and ligaments must abduct the shank."""
    skeleton, n = walked.skeleton, 3
    still = Motion(np.zeros((n, len(skeleton.coordinates))), *np.zeros((2, n, len(skeleton.coordinates))))
    pose = skeleton.pose(still.q)
    weightless = replace(walked.bsp, mass_kg=1e-9 * walked.bsp.mass_kg)
    for foot, (side, medial) in enumerate((("r", -1.0), ("l", 1.0))):
        joint = next(body_joint for body_joint in body_joints(skeleton) if body_joint.label == f"knee_{side}")
        force = np.array([0.0, 100.0, 0.0])
        ahead = np.add(joint.centre(skeleton, pose), [0.02, 0.0, 0.03 * medial])
        loads = np.zeros((n, 2, 6))
        loads[:, foot] = np.concatenate([np.tile(force, (n, 1)), np.cross(ahead, force)], axis=1)
        result = joint_moments(skeleton, weightless, still, loads)
        # externally the load adducts the knee by 3 N m, and extends it by 2
        assert component(result, f"knee_{side}_adduction") == pytest.approx(np.full(n, -3.0), abs=0.15)
        assert component(result, f"knee_{side}_flexion") == pytest.approx(np.full(n, 2.0), abs=0.15)
        row = result.joints.index(f"knee_{side}")
        assert result.forces[:, row, 1] == pytest.approx(np.full(n, -100.0), abs=0.5)


def test_the_same_moment_in_other_axes(walked, found):
    """Distal and proximal axes are perpendicular: they leave the moment's size."""
    joints = body_joints(walked.skeleton)
    wrenches = joint_wrenches(walked.skeleton, walked.bsp, walked.motion, walked.foot_loads, joints)
    sizes = np.stack([np.linalg.norm(wrenches[joint][:, 3:], axis=1) for joint in joints], axis=1)
    state = walked.skeleton, walked.bsp, walked.motion, walked.foot_loads
    distal, proximal = (joint_moments(*state, frame=frame) for frame in ("distal", "proximal"))
    for other in (distal, proximal):
        np.testing.assert_allclose(np.linalg.norm(other.moments, axis=2), sizes, rtol=1e-9)
    for k, joint in enumerate(joints):
        about_long_axis = 1 if joint.name == "Ankle" else 2
        np.testing.assert_allclose(
            distal.moments[:, k, about_long_axis], found.moments[:, k, about_long_axis], atol=1e-9, err_msg=joint.label
        )
    np.testing.assert_allclose(proximal.moments[..., 0], found.moments[..., 0], atol=1e-9)


def test_the_roll_of_a_foot_does_not_change_the_rotation_moment_of_the_ankle():
    """Markers on heel and toes show a foot's long axis, and hardly its roll about it."""
    rng = np.random.default_rng(0)
    shank, foot = Rotation.random(2, rng=rng).as_matrix()
    rolled = foot @ Rotation.from_euler("X", 25.0, degrees=True).as_matrix()
    axes = [joint_axes(shank[None], foot_axes[None], long_axis=0) for foot_axes in (foot, rolled)]
    np.testing.assert_allclose(axes[0], axes[1], atol=1e-12)
    flexion, inversion, rotation = axes[0][0]
    np.testing.assert_allclose(np.cross(flexion, inversion) @ rotation, np.linalg.norm(np.cross(flexion, inversion)))
    np.testing.assert_allclose([inversion @ foot[:, 0], flexion @ shank[:, 2]], 1.0)


def test_virtual_axes_give_the_whole_load_and_change_nothing_else(walked):
    skeleton, joints = walked.skeleton, body_joints(walked.skeleton)
    virtual = VirtualAxes.of(skeleton, joints)
    motion = Motion(*map(virtual.embedded, (walked.motion.q, walked.motion.qd, walked.motion.qdd)))
    forces = inverse_dynamics(virtual.skeleton, walked.bsp, motion, walked.foot_loads)
    expected = inverse_dynamics(skeleton, walked.bsp, walked.motion, walked.foot_loads)
    np.testing.assert_allclose(forces[:, virtual.former], expected, atol=1e-9)
    pose = skeleton.pose(walked.motion.q)
    wrenches = joint_wrenches(skeleton, walked.bsp, walked.motion, walked.foot_loads, joints)
    for virtual_axes, base, joint in zip(virtual.added, virtual.bases, joints, strict=True):
        axes = pose.rotation[:, base]
        for part, rows in ((slice(0, 3), virtual_axes[:3]), (slice(3, 6), virtual_axes[3:])):
            expected = np.einsum("nka,nk->na", axes, wrenches[joint][:, part])
            np.testing.assert_allclose(forces[:, rows], expected, atol=1e-8, err_msg=joint.label)


def test_no_moments_of_legs_that_are_none(walked):
    """A chain that is no leg has no hip, knee and ankle; a trunk on the pelvis still has its joint."""
    skeleton = walked.skeleton
    shank = next(joint for joint in skeleton.joints if joint.child == "shank_r")
    turned = replace(shank, child_rotation=np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    other = replace(skeleton, joints=tuple(turned if joint is shank else joint for joint in skeleton.joints))
    assert [joint.label for joint in body_joints(other)] == ["lumbar"]
    lumbar = lumbar_joint(skeleton)
    assert lumbar is not None
    assert lumbar.parent == "pelvis"
