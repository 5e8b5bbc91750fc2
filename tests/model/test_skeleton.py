import numpy as np
import pytest

from generic_static import generic_model, random_coordinates, smooth_motion
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.bsp import BodySegmentParameters, transformed_parameters
from kinertia.model.gait27 import ARM_ROTATIONS, SHOULDER_OFFSETS
from kinertia.model.kinematic_tree import in_segments
from kinertia.model.skeleton import Axis, Joint, Marker, Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics, root_regressor
from kinertia.motion.marker_sums import marker_jacobian
from kinertia.motion.rigid_body import axis_force_derivatives
from opensim_model import oracle_of
from pinocchio_model import axis_forces, pin, pinocchio_model


@pytest.fixture(scope="module")
def model():
    return generic_model()


@pytest.fixture(scope="module")
def bsp(model):
    return literature_bsp(70.0, 1.75, "male", model.geometry)


def unrolled(skeleton: Skeleton, values: dict[str, float]) -> tuple[Skeleton, Skeleton]:
    return skeleton.lock(values), skeleton.free(values)


def filled(locked: Skeleton, free: Skeleton, q: np.ndarray, values: dict[str, float]) -> np.ndarray:
    """Coordinates of the free skeleton from those of the locked one."""
    columns = dict(zip(locked.coordinates, q.T, strict=True))
    return np.stack([columns.get(name, np.full(len(q), values.get(name))) for name in free.coordinates], axis=1)


def test_marker_positions_by_hand():
    turn = Axis("turn", "rotation", (0.0, 0.0, 1.0))
    slide = Axis("slide", "translation", (1.0, 0.0, 0.0))
    joints = (Joint("ground", "rod", np.eye(3), np.array([0.0, 1.0, 0.0]), (turn, slide)),)
    skeleton = Skeleton("rod", joints, (Marker("tip", "rod", np.array([0.5, 0.0, 0.0])),))
    at = skeleton.marker_positions(skeleton.pose(np.array([[np.pi / 2, 0.25]])))
    np.testing.assert_allclose(at[0, 0], [0.0, 1.75, 0.0], atol=1e-12)
    assert skeleton.rotational.tolist() == [True, False]


def test_markers_at_their_places_are_in_their_segments_as_in_the_model(model):
    skeleton = model.skeleton
    q = np.random.default_rng(1).uniform(-0.5, 0.5, (4, len(skeleton.coordinates)))
    places = skeleton.marker_positions(skeleton.pose(q))
    found = in_segments(skeleton.tree, skeleton.map.axes(q), skeleton.marker_segments, places)
    np.testing.assert_allclose(found, np.broadcast_to(skeleton.marker_locals, found.shape), atol=1e-12)


def test_pose_jacobian_agrees_with_finite_differences(model):
    skeleton = model.skeleton.free(SHOULDER_OFFSETS)
    q = random_coordinates(skeleton, 3)
    pose = skeleton.pose(q)
    jacobian = marker_jacobian(skeleton, pose, skeleton.marker_positions(pose))
    h = 1e-6
    for c in range(q.shape[1]):
        step = h * np.eye(q.shape[1])[c]
        ahead, behind = (skeleton.marker_positions(skeleton.pose(q + s * step)) for s in (1, -1))
        np.testing.assert_allclose(jacobian[..., c], (ahead - behind) / (2 * h), atol=1e-8)


def test_support_is_where_the_jacobian_moves_something(model):
    skeleton = model.skeleton
    assert skeleton.support[:, :6].all()
    knee = skeleton.coordinates.index("knee_angle_r")
    moved = {name for name, moves in zip(skeleton.segments, skeleton.support[:, knee], strict=True) if moves}
    assert moved == {"shank_r", "talus_r", "foot_r"}


LOCKS = [
    {"arm_rot_r": 0.4, "pro_sup_r": -0.7, "shoulder_x_l": 0.03},
    {"subtalar_angle_r": 0.2, "knee_angle_l": 0.9},
    {"hip_rotation_r": 0.3, "lumbar_bending": -0.2},
]


@pytest.mark.parametrize("values", LOCKS)
def test_locked_coordinates_equal_the_free_model_at_that_value(model, values):
    locked, free = unrolled(model.skeleton, values)
    assert len(free.coordinates) == len(locked.coordinates) + len(values)
    q = random_coordinates(locked, 4)
    here, there = locked.pose(q), free.pose(filled(locked, free, q, values))
    np.testing.assert_allclose(here.rotation, there.rotation, atol=1e-12)
    np.testing.assert_allclose(here.translation, there.translation, atol=1e-12)
    np.testing.assert_allclose(locked.marker_positions(here), free.marker_positions(there), atol=1e-12)
    common = [free.coordinates.index(name) for name in locked.coordinates]
    np.testing.assert_allclose(here.axes, there.axes[:, common], atol=1e-12)


@pytest.mark.parametrize("values", LOCKS)
def test_locked_coordinates_carry_their_inertia_and_regressor(model, bsp, values):
    locked, free = unrolled(model.skeleton, values)
    q = random_coordinates(locked, 3)
    rng = np.random.default_rng(2)
    qd, qdd = rng.normal(0, 1, q.shape), rng.normal(0, 5, q.shape)
    still = dict.fromkeys(values, 0.0)
    full = [filled(locked, free, part, fill) for part, fill in ((q, values), (qd, still), (qdd, still))]
    common = [free.coordinates.index(name) for name in locked.coordinates]
    tau = axis_forces(pinocchio_model(locked, bsp), (q, qd, qdd))
    expected = axis_forces(pinocchio_model(free, bsp), full)[:, common]
    np.testing.assert_allclose(tau, expected, atol=1e-9)
    ours = inverse_dynamics(locked, bsp, Motion(q, qd, qdd), np.zeros((len(q), 0, 6)), ())
    np.testing.assert_allclose(ours, expected, atol=1e-9)
    here = root_regressor(locked, bsp.segments, Motion(q, qd, qdd))
    there = root_regressor(free, bsp.segments, Motion(*full))
    np.testing.assert_allclose(here, there, atol=1e-9)


def test_moved_parameters_are_pinocchios():
    rng = np.random.default_rng(0)
    place = pin.SE3.Random()
    inertia = pin.Inertia(2.0, rng.normal(size=3), np.diag([0.3, 0.4, 0.5]))
    moved = transformed_parameters(np.array([place.homogeneous]))[0] @ inertia.toDynamicParameters()
    np.testing.assert_allclose(moved, place.act(inertia).toDynamicParameters(), atol=1e-12)


def test_two_segments_on_one_joint_add_up(model):
    """With the knee, ankle and subtalar joints locked, thigh, shank and foot ride on one joint."""
    rigid = model.skeleton.lock({"knee_angle_r": 0.3, "ankle_angle_r": 0.1, "subtalar_angle_r": 0.0})
    bsp = literature_bsp(70.0, 1.75, "male", model.geometry)
    assert rigid.bodies(bsp)[:, 0].sum() == pytest.approx(70.0)


def test_unknown_coordinates_are_refused(model):
    with pytest.raises(KeyError, match="knee_angle_x"):
        model.skeleton.lock({"knee_angle_x": 0.0})
    with pytest.raises(KeyError, match="knee_angle_x"):
        model.skeleton.free(["knee_angle_x"])


@pytest.mark.parametrize("freed", [(), (*ARM_ROTATIONS, *SHOULDER_OFFSETS)])
def test_opensim_agrees_on_markers_mass_matrix_and_inverse_dynamics(model, bsp, freed):
    skeleton = model.skeleton.free(freed)
    tilted = BodySegmentParameters.from_table(
        bsp.segments, bsp.table() + 1e-3 * np.random.default_rng(5).uniform(0.1, 1.0, (len(bsp.segments), 10))
    )
    oracle = oracle_of(skeleton, tilted)
    q = random_coordinates(skeleton, 20, seed=3, spread=1.0)
    rng = np.random.default_rng(4)
    qd, qdd = rng.normal(0, 3, q.shape), rng.normal(0, 20, q.shape)
    ours = skeleton.marker_positions(skeleton.pose(q))
    state = (skeleton.tree, skeleton.gravity_m_s2, skeleton.bodies(tilted), q, qd, qdd)
    forces, _, by, _ = axis_force_derivatives(*state, np.zeros((len(q), 3)), np.ones(len(state[0].parent), dtype=bool))
    for k in range(len(q)):
        oracle.pose(q[k], qd[k])
        np.testing.assert_allclose(ours[k], oracle.markers(), atol=1e-6)
        tau = oracle.inverse_dynamics(q[k], qd[k], qdd[k])
        np.testing.assert_allclose(forces[k], tau, atol=1e-6 * np.abs(tau).max())
        theirs = oracle.mass_matrix(q[k])
        np.testing.assert_allclose(by[2, k], theirs, atol=1e-6 * np.abs(theirs).max())


def test_smooth_motion_is_its_own_derivative(model):
    """The motion the other tests rely on."""
    time, motion = smooth_motion(model.skeleton, n=400, rate_hz=2000.0)
    np.testing.assert_allclose(np.gradient(motion.q, time, axis=0)[1:-1], motion.qd[1:-1], atol=1e-3)
    np.testing.assert_allclose(np.gradient(motion.qd, time, axis=0)[1:-1], motion.qdd[1:-1], atol=1e-2)
