"""The effect of a displaced knee, against loads about it in the axes that it defines."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.markers.marker_errors import ErrorProcess
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observation
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.uncertainty import model_errors as module
from kinertia.estimation.simultaneous.uncertainty.model_errors import (
    AXIS_SD_RAD,
    CENTRE_SD_M,
    END_GROWTH,
    GROWTH,
    LASTS_S,
    block_growth,
    end_growth,
    fixed_axes,
    knee_geometry,
    motion_noise,
    placement,
    with_drawn_ankles,
    with_drawn_knees,
)
from kinertia.model.gait27 import LEG_AXIS_TILTS
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.joint_moments import body_joints, component_signs, joint_axes, joint_moments, joint_wrenches
from kinertia.synthetic.walk import SyntheticTrial, walk, walking_subject
from kinertia.trial.data import Markers
from small_problem import INSTRUMENTS, small_ground

SMALL = 1e-3
"""Of the displacement's standard deviations."""


@pytest.fixture(scope="module")
def standing():
    """Skeleton, joints and their loads: upright, where axes are perpendicular to each other."""
    walked = walk(walking_subject(), 1.0, 100.0)
    n, c = 4, len(walked.skeleton.coordinates)
    still = Motion(*np.zeros((3, n, c)))
    loads = np.random.default_rng(0).normal(0.0, 1.0, (n, 2, 6)) * [100.0, 700.0, 100.0, 50.0, 20.0, 50.0]
    joints = body_joints(walked.skeleton)
    moments = joint_moments(walked.skeleton, walked.bsp, still, loads)
    wrenches = joint_wrenches(walked.skeleton, walked.bsp, still, loads, joints)
    return walked.skeleton, joints, moments, wrenches


def unit(vector):
    return vector / np.linalg.norm(vector)


def frame(up, right):
    """(3, 3) axes forward, up and right in columns, of which `up` is exact."""
    up, right = unit(up), unit(right - (right @ unit(up)) * unit(up))
    return np.column_stack([np.cross(up, right), up, right])


def displaced(skeleton, joints, wrenches, centre_m, axis_rad):
    """(n, j, 2, 3) moments and forces where the knees are displaced to the right and turned about the thigh."""
    pose = skeleton.pose(np.zeros((1, len(skeleton.coordinates))))
    turned = {name: pose.rotation[0, k] for k, name in enumerate(skeleton.segments)}
    centres = {joint.label: joint.centre(skeleton, pose)[0] for joint in joints}
    places, result = dict(centres), []
    for joint in joints:
        if joint.name == "Knee":
            thigh = turned[joint.parent]
            places[joint.label] = centres[joint.label] + centre_m * thigh[:, 2]
    for joint in joints:
        if joint.side:
            hip, knee, ankle = (places[f"{name}_{joint.side}"] for name in ("hip", "knee", "ankle"))
            thigh_name = next(
                candidate.child for candidate in joints if (candidate.name, candidate.side) == ("Hip", joint.side)
            )
            shank_name = next(
                candidate.child for candidate in joints if (candidate.name, candidate.side) == ("Knee", joint.side)
            )
            thigh, shank = turned[thigh_name], turned[shank_name]
            right = np.cos(axis_rad) * thigh[:, 2] + np.sin(axis_rad) * thigh[:, 0]
            segment_axes = turned | {thigh_name: frame(hip - knee, right), shank_name: frame(knee - ankle, shank[:, 2])}
        else:
            segment_axes = turned
        wrench = wrenches[joint]
        moved = wrench[:, 3:] + np.cross(centres[joint.label] - places[joint.label], wrench[:, :3])
        axes = joint_axes(segment_axes[joint.parent][None], segment_axes[joint.child][None], long_axis=joint.long_axis)[
            0
        ]
        moments = component_signs(joint) * (moved @ axes.T)
        result.append(np.stack([moments, wrench[:, :3] @ segment_axes[joint.child]], axis=1))
    return np.stack(result, axis=1)


def test_moments_about_axes_change_as_those_of_tilted_axes():
    """Of the whole foot's and leg's loads; their weight turns with the axis, which is little beside these."""
    person = walking_subject()
    skeleton = walk(person, 1.0, 100.0).skeleton
    still = Motion(*np.zeros((3, 4, len(skeleton.coordinates))))
    loads = np.random.default_rng(0).normal(0.0, 1.0, (4, 2, 6)) * [100.0, 700.0, 100.0, 50.0, 20.0, 50.0]
    joints, sd = body_joints(skeleton), {name: SMALL for name in LEG_AXIS_TILTS}
    wrenches = joint_wrenches(skeleton, person.bsp, still, loads, joints)
    by_joint = np.concatenate([np.hstack([wrenches[joint][:, 3:], wrenches[joint][:, :3]]) for joint in joints], axis=1)
    moments = inverse_dynamics(skeleton, person.bsp, still, loads)
    variance = fixed_axes(skeleton, joints, by_joint, moments, sd)
    squares = np.zeros(moments.shape)
    for name in sd:
        two = [inverse_dynamics(skeleton.lock({name: sign * SMALL}), person.bsp, still, loads) for sign in (1.0, -1.0)]
        squares += np.square((two[0] - two[1]) / 2.0)
    columns = [k for k, name in enumerate(skeleton.coordinates) if name.startswith(("knee_angle", "ankle_angle"))]
    np.testing.assert_allclose(np.sqrt(variance[:, columns]), np.sqrt(squares[:, columns]), rtol=0.03)
    others = [k for k, name in enumerate(skeleton.coordinates) if not name.startswith(("knee", "ankle", "subtalar"))]
    assert not variance[:, others].any()
    for side in "rl":
        ankle, subtalar = (skeleton.coordinates.index(f"{name}_angle_{side}") for name in ("ankle", "subtalar"))
        both = variance[:, [ankle, subtalar]] / SMALL**2 + np.square(moments[:, [ankle, subtalar]])
        np.testing.assert_allclose(both[:, 0], both[:, 1])
    assert not fixed_axes(skeleton, joints, by_joint, moments, {}).any()


class Drawn:
    """Displacements in place of random ones, the same for both knees."""

    def __init__(self, centre, axis):
        self.scale = np.array([centre, axis])

    def normal(self, mean, sd):
        return mean + self.scale * np.asarray(sd)


@pytest.mark.parametrize("scale", [(SMALL, 0.0), (0.0, SMALL)])
def test_moments_change_as_those_about_the_displaced_knee(standing, scale):
    skeleton, joints, moments, wrenches = standing
    before, after = (
        displaced(skeleton, joints, wrenches, s[0] * CENTRE_SD_M, s[1] * AXIS_SD_RAD) for s in ((0.0, 0.0), scale)
    )
    drawn = with_drawn_knees(skeleton, joints, moments, Drawn(*scale))
    found = np.stack([drawn.moments - moments.moments, drawn.forces - moments.forces], axis=2)
    expected = after - before
    size = np.abs(expected).max(axis=(0, 1, 3))
    assert size.min() > 0.0
    for k, joint in enumerate(joints):
        near = 0.15 if joint.name == "Ankle" else 0.02  # a foot points outward and down
        for part in range(2):
            np.testing.assert_allclose(found[:, k, part], expected[:, k, part], atol=near * size[part])


def test_variances_are_those_of_the_displacements(standing):
    skeleton, joints, known_moments, _ = standing
    signs = np.array([component_signs(joint) for joint in joints])
    both = np.stack([signs * known_moments.moments, known_moments.forces], axis=2)
    found = knee_geometry(skeleton, joints, both.reshape(len(both), -1)).reshape(both.shape)
    changes = [with_drawn_knees(skeleton, joints, known_moments, Drawn(*scale)) for scale in np.eye(2)]
    moments = sum(np.square(change.moments - known_moments.moments) for change in changes)
    forces = sum(np.square(change.forces - known_moments.forces) for change in changes)
    np.testing.assert_allclose(found, np.stack([moments, forces], axis=2), rtol=1e-9, atol=1e-12)
    hip, knee = (next(k for k, joint in enumerate(joints) if joint.label == name) for name in ("hip_r", "knee_r"))
    assert found[:, hip, 0, 2].min() > 0.0
    np.testing.assert_allclose(
        found[:, knee, 0, 1],
        np.square(CENTRE_SD_M * known_moments.forces[:, knee, 1])
        + np.square(AXIS_SD_RAD * known_moments.moments[:, knee, 0]),
    )


def test_back_is_as_certain_as_before(standing):
    skeleton, joints, moments, _ = standing
    lumbar = [k for k, joint in enumerate(joints) if joint.name == "Lumbar"]
    random = np.random.default_rng(1)
    drawn = with_drawn_knees(skeleton, joints, moments, random)
    np.testing.assert_array_equal(drawn.moments[:, lumbar], moments.moments[:, lumbar])
    assert np.abs(drawn.moments - moments.moments).max() > 0.1


def test_moments_change_as_those_about_the_displaced_ankle(standing):
    skeleton, joints, moments, wrenches = standing
    drawn = with_drawn_ankles(joints, moments, SimpleNamespace(normal=lambda mean, sd: mean + sd))
    pose = skeleton.pose(np.zeros((1, len(skeleton.coordinates))))
    for k, joint in enumerate(joints):
        found = drawn.moments[:, k] - moments.moments[:, k]
        if joint.name != "Ankle":
            assert not found.any()
            continue
        forward, _, right = pose.rotation[0, skeleton.segments.index(joint.child)].T
        moved = np.cross(-CENTRE_SD_M * right, wrenches[joint][:, :3])
        adduction = component_signs(joint)[1] * (moved @ forward)
        np.testing.assert_allclose(found[:, 1], adduction, rtol=1e-9)
        assert np.abs(adduction).max() > 0.5
        assert not found[:, 0].any()


TIME = np.arange(200) / 100.0


NAMES = ("pelvis_tilt", "hip_flexion_r", "knee_angle_r", "hip_flexion_l")


def problem(loaded: np.ndarray, ground: np.ndarray | None = None) -> SimpleNamespace:
    """As far as `block_growth` looks at it, with feet (n, 2) that are loaded, and on the ground beside plates."""
    reactions = SimpleNamespace(loaded_at=lambda time: loaded[np.searchsorted(TIME, time - 1e-9)])
    return SimpleNamespace(
        trials=[SimpleNamespace(time=TIME, on_ground=ground)],
        skeleton=SimpleNamespace(coordinates=NAMES),
        loads=SimpleNamespace(reactions=lambda k, static: reactions),
    )


def test_of_the_leg_that_has_landed_and_for_a_while():
    loaded = np.ones((200, 2))
    loaded[50:100, 0] = 0.0
    between = TIME + 0.005
    growth = block_growth(problem(loaded), 0, np.zeros(0), between)
    landed = (between > 1.0) & (between < 1.0 + LASTS_S)
    np.testing.assert_array_equal(growth[:, 1], np.where(landed, GROWTH, 1.0))
    assert (growth[:, [0, 2, 3]] == 1.0).all()


def test_also_beside_the_plates_and_in_the_joint_of_the_hip():
    ground = np.ones((200, 2), dtype=bool)
    ground[50:100, 1] = False
    hips = [SimpleNamespace(label=f"hip_{side}") for side in "rl"]
    growth = block_growth(problem(np.zeros((200, 2)), ground), 0, np.zeros(0), TIME, hips)
    landed = (TIME > 0.995) & (TIME < 1.0 + LASTS_S)
    for column in (3, 10):  # the coordinate, and the first of six components of the left hip
        np.testing.assert_array_equal(growth[:, column], np.where(landed, GROWTH, 1.0))
    assert growth.shape == (200, 16)
    assert (np.delete(growth, [3, 10], axis=1) == 1.0).all()


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_nobody_lands_who_stands_or_flies(weight):
    assert (block_growth(problem(np.full((200, 2), weight)), 0, np.zeros(0), TIME) == 1.0).all()


@pytest.fixture(scope="module")
def walked():
    """A walk, its markers and its coordinates."""
    result = walk(walking_subject(), 0.6, 50.0)
    return result.skeleton, result.motion.q


def followed(skeleton, q, displaced):
    """Coordinates that inverse kinematics finds with `skeleton` for markers of the body `displaced`."""
    markers = displaced.marker_positions(displaced.pose(q))
    solved = solve_ik(skeleton, Markers(0.02 * np.arange(len(q)), skeleton.labels, markers), "walk")
    return solved.q[:, [solved.coordinates.index(name) for name in skeleton.coordinates]]


def test_variance_of_a_misplaced_marker_is_what_inverse_kinematics_makes_of_it(walked):
    skeleton, q = walked
    at, sd = (
        skeleton.labels.index(next(m.label for m in skeleton.markers if m.segment == "shank_r")),
        np.zeros(len(skeleton.labels)),
    )
    sd[at] = 1e-3
    variance = placement(skeleton, q, np.ones((len(q), len(sd)), bool), sd, {})
    found = np.zeros_like(q)
    for axis in range(3):
        places = skeleton.marker_locals.copy()
        places[at, axis] -= sd[at]
        found += np.square(followed(skeleton, q, skeleton.with_positions(places)) - followed(skeleton, q, skeleton))
    turns = skeleton.rotational
    assert variance[:, turns].max() > 1e-6
    np.testing.assert_allclose(np.sqrt(variance[:, turns]), np.sqrt(found[:, turns]), atol=2e-5, rtol=0.02)
    assert (variance[:, ~turns] == 0.0).all()


def test_variance_of_a_tilted_axis_is_what_inverse_kinematics_makes_of_it(walked):
    skeleton, q = walked
    name, sd = LEG_AXIS_TILTS[0], 0.01
    seen = np.ones((len(q), len(skeleton.labels)), bool)
    variance = placement(skeleton, q, seen, np.zeros(len(skeleton.labels)), {name: sd})
    tilted = skeleton.lock({name: skeleton.locked[name] + sd})
    found = np.square(followed(skeleton, q, tilted) - followed(skeleton, q, skeleton))
    turns = skeleton.rotational
    assert variance[:, turns].max() > 1e-6
    np.testing.assert_allclose(np.sqrt(variance[:, turns]), np.sqrt(found[:, turns]), atol=2e-5, rtol=0.05)


def test_markers_that_are_not_seen_misplace_nothing(walked):
    skeleton, q = walked
    sd = np.full(len(skeleton.labels), 0.01)
    hidden = np.array([marker.segment == "torso" for marker in skeleton.markers])
    seen = np.tile(~hidden, (len(q), 1))
    without = placement(skeleton, q, seen, np.where(hidden, 0.0, sd), {})
    np.testing.assert_array_equal(placement(skeleton, q, seen, sd, {}), without)
    # nor are there any in a frame that no camera saw
    seen[1] = False
    unseen = placement(skeleton, q, seen, sd, {})
    np.testing.assert_array_equal(unseen[1], 0.0)
    np.testing.assert_array_equal(np.delete(unseen, 1, axis=0), np.delete(without, 1, axis=0))


FRAMES_ALIKE, SD_M, SPACING_S = 9.0, 0.004, 0.05


@pytest.fixture(scope="module")
def trial() -> SyntheticTrial:
    return walk(walking_subject(), 6.0, trapezoid=False)


@pytest.fixture(scope="module")
def expected(trial) -> np.ndarray:
    """Errors as the estimate expects them, m."""
    process, (n, m, _) = ErrorProcess.double_over(FRAMES_ALIKE), trial.markers.positions.shape
    fresh = np.random.default_rng(0).normal(0.0, np.sqrt(process.new), (500 + n, m, 3))
    return SD_M * lfilter([1.0], [1.0, *(-coefficient for coefficient in process.of_before)], fresh, axis=0)[500:]


def found(trial: SyntheticTrial, errors: np.ndarray) -> np.ndarray:
    """At the true motion and body, which have taken up none of the errors."""
    markers = trial.markers.positions + errors
    seen = Observation(
        trial.time,
        markers,
        np.full(markers.shape[1], SD_M),
        FRAMES_ALIKE,
        trial.motion.q,
        SPACING_S,
        np.arange(len(trial.time)) > 30,
        small_ground(trial, np.random.default_rng(1)),
        6.0,
        2.0,
    )
    calibration = CalibrationPrior({}, np.full(markers.shape[1], 0.005), INSTRUMENTS)
    prior = literature_prior(walking_subject().literature)
    problem = MapProblem(trial.skeleton, prior, calibration, [seen])
    return motion_noise(problem, 0, problem.beginning.coefficients[0], problem.layout.start)


def taken_up(trial: SyntheticTrial) -> float:
    """By 27 coordinates of three times the markers."""
    return 27.0 / trial.markers.positions[0].size


@pytest.mark.parametrize("size", [0.3, 0.45, 0.6, 1.5])
def test_errors_as_expected_but_for_their_size(trial, expected, size):
    power = size**2 / (1.0 - taken_up(trial))
    shares = found(trial, size * expected)
    np.testing.assert_allclose(shares, min(3.0 * power, 1.0), rtol=0.1)


def test_slow_errors_hardly_accelerate(trial):
    """As skin that follows the gait: 8 mm to and fro at the strides' rate."""
    slow = 0.004 * np.sin(2.0 * np.pi * 0.8 * trial.time + np.arange(trial.markers.positions[0].size)[:, None]).T
    place, rate, acceleration = found(trial, slow.reshape(trial.markers.positions.shape))
    assert place > 0.9
    assert acceleration < 0.01 < rate < 0.2


def test_gaps_and_parts_change_little(trial, expected, monkeypatch):
    whole = found(trial, 0.3 * expected)
    monkeypatch.setattr(module, "_MOST_FRAMES", 320)
    np.testing.assert_allclose(found(trial, 0.3 * expected), whole, rtol=0.15)
    gaps = 0.3 * expected
    gaps[100:300, :5] = np.nan
    gaps[:, 7] = np.nan
    gaps[::40, 9] = np.nan
    gaps[50:, 11] = np.nan
    np.testing.assert_allclose(found(trial, gaps), whole, rtol=0.15)


def test_nothing_seen_is_as_expected(trial, expected):
    assert found(trial, np.nan * expected).tolist() == [1.0, 1.0, 1.0]


def test_moments_are_less_certain_at_the_ends_of_the_motion():
    time = 3.0 + np.arange(101) / 100.0
    growth = end_growth(MotionBasis(time, 0.1), time, time)
    np.testing.assert_allclose(growth[[0, 1, 4, 5, 50]], 1.0 + END_GROWTH * np.array([1.0, 0.8, 0.2, 0.0, 0.0]))
    np.testing.assert_allclose(growth, growth[::-1])
    assert (growth[6:-6] == 1.0).all()
