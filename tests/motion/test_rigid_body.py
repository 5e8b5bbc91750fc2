"""The compiled rigid-body core against Pinocchio, and its derivatives against finite differences."""

import numpy as np
import pytest

from generic_static import generic_model, smooth_motion
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.gait27 import HIP_OFFSETS, SHOULDER_OFFSETS
from kinertia.model.skeleton import Axis, Joint, Skeleton
from kinertia.motion.dynamics import Motion, axis_motion, regressor
from kinertia.motion.rigid_body import axis_force_derivatives, axis_forces
from pinocchio_model import axis_forces as oracle_forces
from pinocchio_model import pin, pinocchio_model

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@pytest.fixture(scope="module", params=["as it is", "with joint centres free", "with joints locked"])
def skeleton(request):
    skeleton = generic_model().skeleton
    if request.param == "with joint centres free":
        return skeleton.free([*HIP_OFFSETS, *SHOULDER_OFFSETS])
    return skeleton if request.param == "as it is" else skeleton.lock({"knee_angle_r": 0.4, "lumbar_bending": -0.2})


def every(skeleton) -> np.ndarray:
    """All of its axes."""
    return np.ones(len(skeleton.tree.parent), dtype=bool)


@pytest.fixture(scope="module")
def bsp():
    return literature_bsp(70.0, 1.75, "male", generic_model().geometry)


@pytest.fixture(scope="module")
def motion(skeleton):
    rng = np.random.default_rng(0)
    shape = (6, len(skeleton.coordinates))
    return Motion(rng.uniform(-1.0, 1.0, shape), rng.normal(0.0, 3.0, shape), rng.normal(0.0, 30.0, shape))


@pytest.fixture(scope="module")
def state(skeleton, bsp, motion):
    return skeleton.tree, skeleton.gravity_m_s2, skeleton.bodies(bsp), *axis_motion(skeleton, motion)


def origin(state) -> np.ndarray:
    """The ground origin in every frame."""
    return np.zeros((len(state[3]), 3))


def close(ours, theirs):
    np.testing.assert_allclose(ours, theirs, atol=1e-11 * np.abs(theirs).max())


def test_forces_and_all_their_derivatives_are_pinocchios(skeleton, bsp, state):
    model = pinocchio_model(skeleton, bsp)
    data = model.createData()
    tau, _, (by_x, by_v, by_a), _ = axis_force_derivatives(*state, origin(state), every(skeleton))
    np.testing.assert_array_equal(axis_forces(*state, origin(state))[0], tau)
    close(tau, oracle_forces(model, state[3:]))
    for k, rows in enumerate(zip(*state[3:], strict=True)):
        pin.computeRNEADerivatives(model, data, *rows)
        close(by_x[k], data.dtau_dq)
        close(by_v[k], data.dtau_dv)
        close(by_a[k], np.triu(data.M) + np.triu(data.M, 1).T)


def test_axes_are_the_columns_of_pinocchios_jacobian(skeleton, motion):
    model, pose = pinocchio_model(skeleton), skeleton.pose(motion.q)
    data = model.createData()
    for k, q in enumerate(motion.q):
        close(pose.axes[k].T, pin.computeJointJacobians(model, data, q))


def moved_to(load, about):
    return np.hstack([load[:, :3], load[:, 3:] - np.cross(about, load[:, :3])])


def test_load_of_the_body_does_the_work_of_the_root_forces(skeleton, motion, state):
    tau, load, _ = axis_forces(*state, origin(state))
    _, same, none, _ = axis_force_derivatives(*state, origin(state), ~every(skeleton))
    np.testing.assert_array_equal(load, same)
    assert none.shape == (3, len(load), 0, 0)
    close((skeleton.pose(motion.q).axes[:, :6] @ load[..., None])[..., 0], tau[:, :6])


@pytest.mark.parametrize("order", [0, 1, 2])
def test_derivatives_of_the_load_are_its_differences(skeleton, state, order):
    about = np.random.default_rng(1).normal(size=(len(state[3]), 3))
    *_, by = axis_force_derivatives(*state, about, ~every(skeleton))
    if order == 2:
        close(axis_forces(*state, about)[2], by[2, :, :, :6])
    h = (1e-6, 1e-3, 1e-1)[order]  # quadratic in the rates, linear in the accelerations
    for j in range(state[3].shape[1]):
        ends = []
        for sign in (1.0, -1.0):
            moved = [part.copy() for part in state[3:]]
            moved[order][:, j] += sign * h
            ends.append(moved_to(axis_forces(*state[:3], *moved, about)[1], about))
        expected = (ends[0] - ends[1]) / (2 * h)
        np.testing.assert_allclose(by[order, :, :, j], expected, atol=1e-7 * max(1.0, np.abs(expected).max()))


def test_regressor_times_parameters_is_the_load(skeleton, bsp, state):
    about = np.random.default_rng(2).normal(size=(len(state[3]), 3))
    rows = [skeleton.segments.index(segment) for segment in bsp.segments]
    shown = regressor(*state[:2], *state[3:], about)[:, :, rows].reshape(len(about), 6, -1)
    close(shown @ bsp.dynamic_parameters(), moved_to(axis_forces(*state, about)[1], about))


def test_regressor_through_the_axes_is_pinocchios(skeleton, state):
    """Column by column, on a skeleton in which every segment has an axis of its own."""
    model = pinocchio_model(skeleton)
    data, tree = model.createData(), skeleton.tree
    about = np.zeros((len(state[3]), 3))
    shown = regressor(*state[:2], *state[3:], about)
    for k, rows in enumerate(zip(*state[3:], strict=True)):
        expected = pin.computeJointTorqueRegressor(model, data, *rows)
        axes = pin.computeJointJacobians(model, data, rows[0]).T
        for s, last_axis in enumerate(tree.last_axis):
            if not np.array_equal(tree.segment_rotation[s], np.eye(3)) or tree.segment_translation[s].any():
                continue
            ours = np.where(skeleton.support[s][:, None], axes @ shown[k, :, s], 0.0)
            np.testing.assert_allclose(ours, expected[:, 10 * last_axis : 10 * last_axis + 10], atol=1e-9)


def test_axes_that_do_not_move_are_left_out(skeleton, state):
    moving = np.arange(len(skeleton.tree.parent)) % 3 != 1
    tau, _, (by_x, by_v, by_a), _ = axis_force_derivatives(*state, origin(state), every(skeleton))
    some, _, (some_x, some_v, some_a), _ = axis_force_derivatives(*state, origin(state), moving)
    np.testing.assert_array_equal(some, tau)
    np.testing.assert_array_equal(some_x, by_x * moving[:, None])
    for ours, whole in ((some_v, by_v), (some_a, by_a)):
        np.testing.assert_array_equal(ours, whole * moving[:, None] * moving)


def test_no_frame_knows_of_another(skeleton, bsp):
    """An interval of a motion gives what the whole motion gives there."""
    _, motion = smooth_motion(skeleton, n=12, rate_hz=50.0)
    body = (skeleton.tree, 9.81, skeleton.bodies(bsp))
    about = np.random.default_rng(3).normal(size=(12, 3))
    whole = axis_force_derivatives(*body, *axis_motion(skeleton, motion), about, every(skeleton))
    part = motion.cut(slice(5, 9))
    cut = axis_force_derivatives(*body, *axis_motion(skeleton, part), about[5:9], every(skeleton))
    for before, after in zip(whole[:2], cut[:2], strict=True):
        np.testing.assert_array_equal(before[5:9], after)
    for before, after in zip(whole[2:], cut[2:], strict=True):
        np.testing.assert_array_equal(before[:, 5:9], after)


def test_branches_may_come_in_any_order():
    """Two fingers on a hand, listed joint by joint: what a finger carries does not follow it at once."""
    turn = [Axis(name, "rotation", direction) for name, direction in (("a", X), ("b", Y), ("c", Z), ("d", X), ("e", Y))]
    at = np.array([0.1, 0.3, -0.2])
    pairs = (("ground", "hand"), ("hand", "left"), ("hand", "right"), ("left", "left tip"), ("right", "right tip"))
    joints = tuple(Joint(*pair, np.eye(3), at, (axis,)) for pair, axis in zip(pairs, turn, strict=True))
    skeleton = Skeleton("hand", joints, ())
    rng = np.random.default_rng(0)
    bsp = BodySegmentParameters(
        skeleton.segments,
        np.arange(1.0, 6.0),
        rng.normal(0.0, 0.1, (5, 3)),
        np.tile(np.diag([1.0, 2.0, 2.5]), (5, 1, 1)),
    )
    state = [rng.normal(size=(3, 5)) for _ in range(3)]
    tree = (skeleton.tree, 9.81, skeleton.bodies(bsp))
    about = np.zeros((3, 3))
    _, _, by, _ = axis_force_derivatives(*tree, *state, about, every(skeleton))
    for order, j in np.ndindex(3, 5):
        ends = []
        for sign in (1.0, -1.0):
            moved = [part.copy() for part in state]
            moved[order][:, j] += sign * 1e-5
            ends.append(axis_forces(*tree, *moved, about)[0])
        np.testing.assert_allclose(by[order, :, :, j], (ends[0] - ends[1]) / 2e-5, atol=1e-6)
