import numpy as np
import pytest

from generic_static import generic_model, smooth_motion
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.dynamics import (
    Motion,
    consistent_root_acceleration,
    inverse_dynamics,
    joined,
    residual,
    residual_terms,
    root_derivatives,
    root_regressor,
    segment_loads,
)
from kinertia.synthetic.walk import balancing_wrench
from opensim_model import oracle_of
from pinocchio_model import pin, pinocchio_model


@pytest.fixture(scope="module")
def skeleton():
    return generic_model().skeleton


@pytest.fixture(scope="module")
def bsp():
    return literature_bsp(70.0, 1.75, "male", generic_model().geometry)


@pytest.fixture(scope="module")
def motion(skeleton):
    return smooth_motion(skeleton, n=8, rate_hz=20.0)[1]


@pytest.fixture(scope="module")
def wrench():
    return np.random.default_rng(0).normal(0, 300, (8, 6))


def test_standing_still_the_residual_is_the_weight(skeleton, bsp):
    still = np.zeros((1, len(skeleton.coordinates)))
    still[:, 1] = 1.0
    load = residual(skeleton, bsp, Motion(still, 0 * still, 0 * still), np.zeros((1, 6)))
    np.testing.assert_allclose(load[0, :3], [0.0, 70.0 * GRAVITY_M_S2, 0.0], atol=1e-9)


def test_ground_reactions_are_taken_about_the_pelvis_origin(skeleton, bsp, motion):
    nothing = residual(skeleton, bsp, motion, np.zeros((8, 6)))
    force, point = np.array([10.0, 700.0, -20.0]), np.array([0.3, 0.0, -0.1])
    wrench = np.tile(np.concatenate([force, np.cross(point, force)]), (8, 1))
    change = residual(skeleton, bsp, motion, wrench) - nothing
    np.testing.assert_allclose(change[:, :3], np.tile(-force, (8, 1)), atol=1e-9)
    np.testing.assert_allclose(change[:, 3:], -np.cross(point - motion.q[:, :3], force), atol=1e-9)


def test_residual_is_opensims(skeleton, bsp, motion):
    """OpenSim's root forces are generalised; their virtual power must be that of our force and moment."""
    oracle = oracle_of(skeleton, bsp)
    load = residual(skeleton, bsp, motion, np.zeros((8, 6)))
    jacobian = skeleton.pose(motion.q).axes[:, :6]
    for k in range(8):
        oracle.pose(motion.q[k], motion.qd[k])
        tau = oracle.inverse_dynamics(motion.q[k], motion.qd[k], motion.qdd[k])[:6]
        about_ground = np.concatenate([load[k, :3], load[k, 3:] + np.cross(motion.q[k, :3], load[k, :3])])
        np.testing.assert_allclose(jacobian[k] @ about_ground, tau, atol=1e-6 * np.abs(tau).max())


@pytest.mark.parametrize("order", ["q", "qd", "qdd"])
def test_derivatives_of_the_residual_agree_with_finite_differences(skeleton, bsp, motion, wrench, order):
    left, by = residual_terms(skeleton, bsp, motion, wrench)
    derivative, h = getattr(by, order), 1e-5
    np.testing.assert_array_equal(left, residual(skeleton, bsp, motion, wrench))
    np.testing.assert_array_equal(getattr(root_derivatives(skeleton, bsp, motion, wrench), order), derivative[..., :6])
    for c in range(len(skeleton.coordinates)):
        ends = []
        for sign in (1, -1):
            parts = {name: getattr(motion, name).copy() for name in ("q", "qd", "qdd")}
            parts[order][:, c] += sign * h
            ends.append(residual(skeleton, bsp, Motion(**parts), wrench))
        expected = (ends[0] - ends[1]) / (2 * h)
        np.testing.assert_allclose(derivative[:, :, c], expected, atol=1e-6 * max(1.0, np.abs(expected).max()))


def test_regressor_times_parameters_is_the_residual_plus_the_ground_load(skeleton, bsp, motion, wrench):
    shown = root_regressor(skeleton, bsp.segments, motion) @ bsp.dynamic_parameters()
    np.testing.assert_allclose(shown, residual(skeleton, bsp, motion, np.zeros((8, 6))), atol=1e-8)
    moved = wrench[:, 3:] - np.cross(motion.q[:, :3], wrench[:, :3])
    loads = np.hstack([wrench[:, :3], moved])
    np.testing.assert_allclose(shown - loads, residual(skeleton, bsp, motion, wrench), atol=1e-8)


def test_loads_of_segments_are_the_regressor_times_their_parameters(skeleton, bsp, motion):
    carried = literature_bsp(20.0, 1.6, "female", generic_model().geometry)
    every = root_regressor(skeleton, bsp.segments, motion).reshape(len(motion.q), 6, -1, 10)
    sums = (bsp.dynamic_parameters() + carried.dynamic_parameters()).reshape(-1, 10)
    rows = [skeleton.segments.index(name) for name in bsp.segments]
    found = segment_loads(skeleton.carrying(carried), bsp, motion)
    np.testing.assert_allclose(found[rows], np.einsum("nisk,sk->sni", every, sums), rtol=1e-10, atol=1e-9)


def test_consistent_acceleration_leaves_no_residual(skeleton, bsp, motion, wrench):
    acceleration, mass = consistent_root_acceleration(skeleton, bsp, motion, wrench)
    balanced = motion.with_root(motion.q[:, :6], motion.qd[:, :6], acceleration)
    assert np.abs(residual(skeleton, bsp, motion, wrench)).max() > 10.0
    np.testing.assert_allclose(residual(skeleton, bsp, balanced, wrench), 0.0, atol=1e-7)
    np.testing.assert_array_equal(mass, root_derivatives(skeleton, bsp, motion, wrench).qdd)
    np.testing.assert_allclose(mass[:, :3, :3], np.tile(70.0 * np.eye(3), (8, 1, 1)), atol=1e-9)


def test_inverse_dynamics_root_rows_are_the_residual(skeleton, bsp, motion):
    loads = np.random.default_rng(1).normal(0, 300, (8, 2, 6))
    tau = inverse_dynamics(skeleton, bsp, motion, loads)
    load = residual(skeleton, bsp, motion, loads.sum(axis=1))
    about_ground = np.hstack([load[:, :3], load[:, 3:] + np.cross(motion.q[:, :3], load[:, :3])])
    jacobian = skeleton.pose(motion.q).axes[:, :6]
    np.testing.assert_allclose(tau[:, :6], np.einsum("nji,ni->nj", jacobian, about_ground), atol=1e-8)


def test_a_load_on_one_foot_leaves_the_other_leg_and_the_arms_alone(skeleton, bsp, motion):
    loads = np.zeros((8, 2, 6))
    loads[:, 0, :3] = [50.0, 700.0, 20.0]
    change = inverse_dynamics(skeleton, bsp, motion, loads) - inverse_dynamics(skeleton, bsp, motion, 0 * loads)
    names = np.array(skeleton.coordinates)
    moved = names[np.abs(change).max(axis=0) > 1e-9]
    assert {"knee_angle_r", "ankle_angle_r"} <= set(moved)
    assert not [name for name in moved if name.endswith("_l") or name.startswith(("lumbar", "arm", "elbow"))]


def test_power_of_the_generalised_forces_is_the_change_of_energy(skeleton, bsp):
    time, motion = smooth_motion(skeleton, n=401, rate_hz=2000.0)
    model = pinocchio_model(skeleton, bsp)
    data = model.createData()
    rows = zip(motion.q, motion.qd, strict=True)
    energy = np.array([pin.computeMechanicalEnergy(model, data, q, v) for q, v in rows])
    tau = inverse_dynamics(skeleton, bsp, motion, np.zeros((len(time), 2, 6)))
    power = (tau * motion.qd).sum(axis=1)
    rate = np.gradient(energy, time)[2:-2]
    np.testing.assert_allclose(power[2:-2], rate, atol=1e-4 * np.abs(power).max())


def test_cut_parts_join_to_the_whole(motion):
    whole = joined([motion.cut(slice(0, 3)), motion.cut(slice(3, 8))])
    for name in ("q", "qd", "qdd"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(motion, name))


def test_balancing_wrench_balances(skeleton, bsp, motion):
    wrench = balancing_wrench(skeleton, bsp, motion)
    np.testing.assert_allclose(residual(skeleton, bsp, motion, wrench), 0.0, atol=1e-9)
