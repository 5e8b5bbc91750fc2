from dataclasses import replace

import numpy as np
import opensim as osim
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from generic_static import generic_model, random_coordinates, smooth_motion
from kinertia.errors import MarkerSetError, TrialError
from kinertia.estimation.calibration import sampled
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.io.opensim.reader import read_osim
from kinertia.io.recording import read_recording
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.coordinate_range import Range
from kinertia.model.gait27 import build_gait27
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.marker_sums import marker_jacobian, variances
from kinertia.motion.pose_fit import _STEP_TOLERANCE, normal_equations
from kinertia.trial.data import Markers
from opensim_model import build_opensim
from random_chain import motion_within, random_chain
from recordings import named_here

JUMPER = "field/laiarnold5_jump/LaiArnoldModified2017_poly_withArms_weldHand_scaled.osim"
FAST = {
    "run": ("synthetic/run.trc", "synthetic/scaled.osim"),
    "another run": ("field/hamner_run/subject02_running.trc", "field/hamner_run/subject02_registered.osim"),
    "jump": ("field/laiarnold5_jump/DJ1.trc", JUMPER),
}
PLUG_IN_GAIT = {
    "synthetic": ("synthetic/static.c3d", "synthetic/walk.c3d"),
    "a": ("pig_c3d/subject_a_static.c3d", "pig_c3d/subject_a_walk.c3d"),
    "b": ("pig_c3d/subject_b_static.c3d", "pig_c3d/subject_b_walk.c3d"),
}


@pytest.fixture(scope="module")
def model():
    return generic_model()


@pytest.fixture(scope="module")
def skeleton(model):
    return model.skeleton


def markers_of(skeleton, q, rate_hz=100.0) -> Markers:
    positions = skeleton.marker_positions(skeleton.pose(q))
    return Markers(np.arange(len(q)) / rate_hz, skeleton.labels, positions)


def noisy(markers: Markers, size_m=0.005, seed=0) -> Markers:
    noise = np.random.default_rng(seed).normal(0, size_m, markers.positions.shape)
    return Markers(markers.time, markers.labels, markers.positions + noise)


def without(markers: Markers, labels, frames=slice(None)) -> Markers:
    positions = markers.positions.copy()
    positions[frames, [markers.labels.index(label) for label in labels]] = np.nan
    return Markers(markers.time, markers.labels, positions)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), heading=st.floats(-3.0, 3.0))
@example(seed=8912, heading=-1.40625)
@example(seed=156, heading=0.25)
@example(seed=878, heading=0.5)
def test_perfect_markers_give_back_the_coordinates(seed, heading):
    skeleton = generic_model().skeleton
    q = random_coordinates(skeleton, 4, seed, spread=0.6)
    # beyond a right angle the middle one of three angles has an equal twin on the other side
    q[:, skeleton.rotational] = np.clip(q[:, skeleton.rotational], -1.3, 1.3)
    q[:, 5] += heading
    ik = solve_ik(skeleton, markers_of(skeleton, q), consecutive=False)
    turns = np.where(skeleton.rotational, (ik.q - q + np.pi) % (2 * np.pi) - np.pi, ik.q - q)
    np.testing.assert_allclose(turns, 0.0, atol=1e-6)
    assert ik.converged.all()
    assert ik.marker_rms_m < 1e-7


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), clamped=st.booleans())
@example(seed=28, clamped=True)
def test_perfect_markers_give_back_any_motion_within_its_ranges_in_one_branch(seed, clamped):
    rng = np.random.default_rng(seed)
    skeleton = random_chain(rng, clamped)
    q = motion_within(rng, skeleton, np.arange(60) / 100.0)
    ik = solve_ik(skeleton, markers_of(skeleton, q))
    np.testing.assert_allclose(ik.q, q, atol=1e-6)
    assert ik.converged.all()


@pytest.mark.parametrize(
    ("coordinate", "clamped"), [("elbow_flex_r", True), ("arm_flex_r", True), ("arm_flex_r", False)]
)
def test_a_clamped_range_holds_and_another_one_does_not(skeleton, coordinate, clamped):
    q = np.zeros((40, len(skeleton.coordinates)))
    column = skeleton.coordinates.index(coordinate)
    q[:, column] = np.linspace(-0.3, 0.8, 40)
    ranges = {**skeleton.ranges, coordinate: Range(0.0, 2.6, clamped)}
    ik = solve_ik(replace(skeleton, ranges=ranges), markers_of(skeleton, q))
    expected = np.maximum(q[:, column], 0.0) if clamped else q[:, column]
    np.testing.assert_allclose(ik.q[:, column], expected, atol=1e-6)
    assert ik.converged.all()


def test_a_joint_is_drawn_back_into_the_range_that_anatomy_knows(skeleton):
    """As far as its markers allow, and not where the user states another range."""
    q = np.zeros((9, len(skeleton.coordinates)))
    subtalar = skeleton.coordinates.index("subtalar_angle_l")
    q[:, subtalar] = np.radians(np.linspace(-60.0, 0.0, 9))
    markers = markers_of(skeleton, q)
    angles = solve_ik(skeleton, markers).q[:, subtalar]
    outside = q[:, subtalar] < skeleton.bounds.low[subtalar]
    assert (angles - q[:, subtalar])[outside].min() > 0.01
    assert (angles[outside] < skeleton.bounds.low[subtalar]).all()
    np.testing.assert_allclose(angles[~outside], q[~outside, subtalar], atol=1e-6)
    stated = Range(np.radians(-70.0), 0.5, clamped=False, stated=True)
    loose = replace(skeleton, ranges={**skeleton.ranges, "subtalar_angle_l": stated})
    np.testing.assert_allclose(solve_ik(loose, markers).q[:, subtalar], q[:, subtalar], atol=1e-6)


def test_an_arm_that_swings_through_more_than_half_a_turn_stays_on_its_branch(skeleton):
    """A throw: each frame by itself fits the markers nearly as well with the elbow bent backwards."""
    time = np.arange(100) / 100.0
    q = np.zeros((100, len(skeleton.coordinates)))
    columns = [skeleton.coordinates.index(name) for name in ("arm_flex_r", "arm_add_r", "elbow_flex_r")]
    q[:, columns] = np.column_stack(
        [2.8 * np.sin(5.0 * time) ** 2, -0.5 * np.sin(4.0 * time), 1.2 + 0.9 * np.sin(7.0 * time)]
    )
    markers = noisy(markers_of(skeleton, q), 0.005)
    solved = solve_ik(skeleton, markers).q
    assert np.abs(solved - q)[:, columns].max() < 0.15


@pytest.mark.parametrize("name", named_here(FAST))
def test_no_coordinate_of_a_run_or_a_jump_jumps(file_of, name):
    """Not by more than half a turn in 0.1 s, as a leg does in a sprint at most; an arm may turn round overhead."""
    markers, model = map(file_of, FAST[name])
    skeleton, walk = read_osim(model).skeleton, read_recording(markers).markers
    ik = solve_ik(skeleton, walk.cut(*walk.time[[0, min(300, len(walk.time) - 1)]]))
    fastest = np.nanmax(np.abs(np.diff(ik.q[:, skeleton.rotational], axis=0))) * walk.rate_hz
    assert fastest < 10 * np.pi * (2.0 if name == "jump" else 1.0)
    elbows = ik.q[:, [skeleton.coordinates.index(f"elbow_flex_{side}") for side in "rl"]]
    assert np.nanmin(elbows) >= 0.0
    assert np.nanmax(elbows) <= np.radians(150.01)


def test_normal_equations_are_those_of_the_explicit_jacobian(skeleton):
    q = random_coordinates(skeleton, 3)
    measured = without(noisy(markers_of(skeleton, q), 0.02), ["R.Heel", "Top.Head"], slice(1, 2)).positions
    pose = skeleton.pose(q + 0.05)
    normal, gradient, cost = normal_equations(skeleton, measured, q + 0.05)
    jacobian = marker_jacobian(skeleton, pose, skeleton.marker_positions(pose))
    difference = measured - skeleton.marker_positions(pose)
    for k in range(3):
        seen = np.isfinite(difference[k]).all(axis=-1)
        j, r = jacobian[k, seen].reshape(-1, q.shape[1]), difference[k, seen].ravel()
        np.testing.assert_allclose(normal[k], j.T @ j, atol=1e-10)
        np.testing.assert_allclose(gradient[k], j.T @ r, atol=1e-10)
        assert cost[k] == pytest.approx(r @ r)


def test_variances_are_the_diagonals_of_the_inverses():
    jacobian = np.random.default_rng(2).standard_normal((4, 60, 27))
    jacobian[1, :, 5] = 0.0  # a coordinate that no marker shows
    normal = jacobian.transpose(0, 2, 1) @ jacobian
    inverse = np.linalg.inv(normal + 1e-9 * np.eye(27))
    np.testing.assert_allclose(variances(normal, 1e-9), np.einsum("ncc->nc", inverse), rtol=1e-9)


def test_the_fit_is_a_minimum(skeleton):
    """No small step in any coordinate lowers the squared distances."""
    markers = noisy(markers_of(skeleton, random_coordinates(skeleton, 2)))
    q = solve_ik(skeleton, markers, consecutive=False).q

    def cost(at):
        return np.square(markers.positions - skeleton.marker_positions(skeleton.pose(at))).sum(axis=(1, 2))

    best = cost(q)
    for step in 1e-3 * np.eye(q.shape[1]):
        assert (cost(q + step) > best).all()
        assert (cost(q - step) > best).all()


def test_a_missing_marker_changes_little_and_is_not_counted(skeleton):
    _, motion = smooth_motion(skeleton, n=30)
    markers = markers_of(skeleton, motion.q)
    ik = solve_ik(skeleton, without(markers, ["R.Knee.Lat", "V.Sacral"], slice(10, 20)))
    # the pelvis shows two markers only: its coordinates are unknown, and so are all others there
    assert np.isnan(ik.q[10:20]).all()
    np.testing.assert_allclose(
        np.delete(ik.q, np.s_[10:20], axis=0), np.delete(motion.q, np.s_[10:20], axis=0), atol=1e-6
    )
    ik = solve_ik(skeleton, without(markers, ["R.Knee.Lat"], slice(10, 20)))
    np.testing.assert_allclose(ik.q, motion.q, atol=1e-6)
    assert np.isnan(ik.errors_m[10:20, ik.labels.index("R.Knee.Lat")]).all()


@pytest.mark.parametrize("gap", [slice(30, 31), slice(20, 60), slice(0, 15)])
def test_a_marker_that_is_off_its_place_and_vanishes_leaves_no_jump(skeleton, gap):
    """Without care the knee of this walk jumps by several degrees at either end of the gap."""
    _, motion = smooth_motion(skeleton, n=90)
    places = skeleton.marker_locals.copy()
    places[skeleton.labels.index("R.Shank.Front")] += 0.03
    off = markers_of(skeleton.with_positions(places), motion.q)
    whole = solve_ik(skeleton, off).q
    gapped = solve_ik(skeleton, without(off, ["R.Shank.Front"], gap)).q
    alone = solve_ik(skeleton, without(off, ["R.Shank.Front"])).q
    assert np.degrees(np.abs(alone - whole)).max() > 2.0
    jumps = np.abs(np.diff(gapped - whole, axis=0)).max(axis=0)
    assert np.degrees(jumps).max() < 0.1


def test_coordinates_without_enough_markers_are_nan_and_the_others_exact(skeleton):
    _, motion = smooth_motion(skeleton, n=30)
    arm = [m.label for m in skeleton.markers if m.segment == "forearm_r"]
    ik = solve_ik(skeleton, without(markers_of(skeleton, motion.q), arm, slice(5, 9)))
    elbow = skeleton.coordinates.index("elbow_flex_r")
    assert np.isnan(ik.q[5:9, elbow]).all()
    others = np.delete(np.arange(27), elbow)
    np.testing.assert_allclose(ik.q[:, others], motion.q[:, others], atol=1e-6)
    known = np.delete(np.arange(30), np.s_[5:9])
    np.testing.assert_allclose(ik.q[known, elbow], motion.q[known, elbow], atol=1e-6)


def test_each_frame_is_its_own_problem(skeleton):
    """The warm start decides nothing: frames alone, together and backwards agree."""
    _, motion = smooth_motion(skeleton, n=25)
    markers = noisy(markers_of(skeleton, motion.q))
    together = solve_ik(skeleton, markers).q
    backwards = solve_ik(skeleton, Markers(markers.time, markers.labels, markers.positions[::-1])).q[::-1]
    alone = np.vstack(
        [solve_ik(skeleton, Markers(np.zeros(1), markers.labels, markers.positions[[k]])).q for k in range(25)]
    )
    np.testing.assert_allclose(together, backwards, atol=_STEP_TOLERANCE)
    np.testing.assert_allclose(together, alone, atol=_STEP_TOLERANCE)


def test_the_order_of_the_markers_does_not_matter(skeleton):
    markers = noisy(markers_of(skeleton, smooth_motion(skeleton, n=5)[1].q))
    order = np.random.default_rng(1).permutation(len(markers.labels))
    shuffled = Markers(markers.time, tuple(markers.labels[i] for i in order), markers.positions[:, order])
    np.testing.assert_allclose(solve_ik(skeleton, shuffled).q, solve_ik(skeleton, markers).q, atol=1e-9)


def test_markers_unknown_to_the_skeleton_are_ignored(skeleton):
    markers = markers_of(skeleton, random_coordinates(skeleton, 2))
    extra = np.concatenate([markers.positions, np.zeros((2, 1, 3))], axis=1)
    ik = solve_ik(skeleton, Markers(markers.time, (*markers.labels, "Stick"), extra))
    assert ik.labels == skeleton.labels
    assert ik.marker_rms_m < 1e-7


def test_turning_round_twice_gives_a_continuous_angle(skeleton):
    q = np.zeros((60, len(skeleton.coordinates)))
    q[:, 5] = np.linspace(0.0, 4 * np.pi, 60)
    angle = solve_ik(skeleton, markers_of(skeleton, q)).q[:, 5]
    np.testing.assert_allclose(np.diff(angle), 4 * np.pi / 59, atol=1e-6)


def test_too_few_pelvis_markers_name_the_trial(skeleton):
    markers = markers_of(skeleton, random_coordinates(skeleton, 3))
    with pytest.raises(TrialError, match=r"trial 'walk3'") as caught:
        solve_ik(skeleton, without(markers, ["R.ASIS"]), "walk3")
    assert caught.value.finding.code == "R101"
    keep = [label for label in markers.labels if label != "R.ASIS"]
    with pytest.raises(MarkerSetError, match=r"trial 'walk3' has 2 of the markers on the pelvis"):
        solve_ik(skeleton, markers.select(keep), "walk3")


def test_opensim_finds_the_same_coordinates(model):
    skeleton = model.skeleton
    q = smooth_motion(skeleton, n=6, rate_hz=30.0)[1].q
    markers = noisy(markers_of(skeleton, q, 30.0), 0.01)
    ours = solve_ik(skeleton, markers)
    theirs, rms = opensim_ik(model, markers)
    assert ours.marker_rms_m <= rms * (1 + 1e-9)
    np.testing.assert_allclose(ours.q, theirs, atol=2e-4)


@pytest.mark.parametrize("person", named_here(PLUG_IN_GAIT))
def test_a_few_frames_are_solved_as_in_the_whole_trial(recording_of, person):
    """Frames a second apart are no start for one another: a foot would end upside down."""
    static, walk = map(recording_of, PLUG_IN_GAIT[person])
    skeleton = build_gait27(static, choose_marker_set(static.markers.labels), 1.6, "female").skeleton
    every = round(walk.markers.rate_hz / 10)
    few = solve_ik(skeleton, sampled(walk.markers)).q
    np.testing.assert_allclose(few, solve_ik(skeleton, walk.markers).q[::every], atol=1e-3)


def opensim_ik(model, markers: Markers) -> tuple[np.ndarray, float]:
    """Coordinates (n, c) and marker RMS (m) by OpenSim's InverseKinematicsSolver, equal weights."""
    skeleton = model.skeleton
    oracle = build_opensim(skeleton, literature_bsp(70.0, 1.75, "male", model.geometry))
    state = oracle.initSystem()
    table = osim.TimeSeriesTableVec3()
    table.setColumnLabels(list(markers.labels))
    for time, row in zip(markers.time, markers.positions, strict=True):
        table.appendRow(float(time), osim.RowVectorVec3([osim.Vec3(*map(float, at)) for at in row]))
    weights = osim.SetMarkerWeights()
    for label in markers.labels:
        weights.cloneAndAppend(osim.MarkerWeight(label, 1.0))
    solver = osim.InverseKinematicsSolver(
        oracle, osim.MarkersReference(table, weights), osim.SimTKArrayCoordinateReference(), np.inf
    )
    solver.setAccuracy(1e-9)
    coordinates = [oracle.getCoordinateSet().get(name) for name in skeleton.coordinates]
    for coordinate, value in zip(coordinates, [0, 1] + [0] * 25, strict=True):
        coordinate.setValue(state, float(value))
    rows = []
    for k, time in enumerate(markers.time):
        state.setTime(float(time))
        solver.assemble(state) if k == 0 else solver.track(state)
        rows.append([coordinate.getValue(state) for coordinate in coordinates])
    q = np.array(rows)
    distance = np.linalg.norm(markers.positions - skeleton.marker_positions(skeleton.pose(q)), axis=-1)
    return q, float(np.sqrt(np.mean(distance**2)))
