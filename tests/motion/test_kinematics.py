from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from generic_static import generic_model, smooth_motion
from kinertia.errors import MarkerSetError, TrialError
from kinertia.io.marker_set_file import read_marker_set
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.kinematics import AROUND_CONTACT_S, _bridged, facing, known_forces, solve_kinematics
from kinertia.motion.smoothing import interpolate
from kinertia.trial.data import FootLoads, Markers, Trial

CLEVELAND = read_marker_set("cleveland-clinic")
RATE = 100.0


@pytest.fixture(scope="module")
def skeleton():
    return generic_model().skeleton


@pytest.fixture(scope="module")
def motion(skeleton):
    return smooth_motion(skeleton, 201, RATE)[1]


@pytest.fixture(scope="module")
def trial(skeleton, motion) -> Trial:
    time = np.arange(201) / RATE
    exact = skeleton.marker_positions(skeleton.pose(motion.q))
    markers = Markers(time, skeleton.labels, exact + np.random.default_rng(0).normal(0, 0.001, exact.shape))
    fast = np.arange(2001) / 1000.0
    force = np.zeros((2001, 2, 3))
    force[:, :, 1] = 350.0 + 100.0 * np.sin(6.0 * fast)[:, None] * [1, -1]
    loads = FootLoads(fast, force, np.zeros((2001, 2, 3)))
    return Trial("walk", markers, loads, np.ones(201, dtype=bool), ("read from nowhere",))


def hidden(trial: Trial, segments, start: float, end: float) -> Trial:
    """The trial without the markers of these segments from start to end (s), both inclusive."""
    columns = [
        i for i, label in enumerate(trial.markers.labels) if any(label in CLEVELAND.segments[s] for s in segments)
    ]
    positions = trial.markers.positions.copy()
    time = trial.markers.time
    frames = np.flatnonzero((time >= start - 1e-9) & (time <= end + 1e-9))
    positions[np.ix_(frames, columns)] = np.nan
    return replace(trial, markers=replace(trial.markers, positions=positions))


@pytest.mark.parametrize("heading", [0, 90, 180, -90])
@pytest.mark.parametrize("askew", [-30, 0, 40])
def test_facing_turns_every_heading_to_plus_x(trial, heading, askew):
    """`heading`: the person's, about the vertical (Y) from +X."""
    turn = Rotation.from_euler("y", heading + askew, degrees=True).as_matrix()
    upright = replace(trial.markers, positions=np.tile(standing(trial), (3, 1, 1)), time=np.arange(3) / RATE)
    rotation, angle = facing(upright.rotated(turn), CLEVELAND)
    assert (angle + heading) % 360 == 0
    back = Rotation.from_matrix(rotation @ turn).as_euler("yxz", degrees=True)
    np.testing.assert_allclose(back, [askew, 0.0, 0.0], atol=1e-9)


def standing(trial: Trial) -> np.ndarray:
    skeleton = generic_model().skeleton
    assert trial.markers.labels == skeleton.labels
    return skeleton.marker_positions(skeleton.pose(np.zeros((1, 27))))


def test_facing_needs_both_asis(trial):
    markers = hidden(trial, ["pelvis"], 0.0, 3.0).markers
    with pytest.raises(MarkerSetError, match=r"R\.ASIS and L\.ASIS together"):
        facing(markers, CLEVELAND)


def test_smoothed_coordinates_and_derivatives_are_near_the_truth(skeleton, trial, motion):
    kinematics = solve_kinematics(skeleton, trial, 0.0, "gcv")
    here = kinematics.frames
    for name, share in (("q", 0.01), ("qd", 0.05), ("qdd", 0.15)):
        truth = getattr(motion, name)[here]
        error = getattr(kinematics.motion, name) - truth
        assert np.sqrt(np.mean(error**2)) < share * np.sqrt(np.mean(truth**2))
    assert kinematics.notes[0] == "read from nowhere"
    assert "smoothed at 6.0 Hz, the upper limit of the automatic search" in kinematics.notes[1]
    assert len(kinematics.notes) == 2
    assert kinematics.ik.converged.all()


def test_frames_at_the_limit_of_steps_are_counted(skeleton, trial, monkeypatch):
    monkeypatch.setattr("kinertia.motion.kinematics.solve_ik", partial(solve_ik, most_steps=1))
    kinematics = solve_kinematics(skeleton, trial, 0.0, 10.0)
    (found,) = [finding for finding in kinematics.findings if finding.code == "R105"]
    assert found.evidence["frames"].value == (~kinematics.ik.converged).sum() > 0


def test_the_window_keeps_off_the_ends_by_half_a_period(skeleton, trial):
    kinematics = solve_kinematics(skeleton, trial, 0.0, 10.0)
    assert kinematics.window_s == pytest.approx((0.05, 1.95))
    np.testing.assert_allclose(kinematics.time, trial.markers.time[5:196])
    assert kinematics.cutoff_hz == 10.0


def test_loads_are_smoothed_at_the_cutoff_and_sampled_at_the_frames(skeleton, trial):
    kinematics = solve_kinematics(skeleton, trial, 0.0, 10.0)
    expected = 350.0 + 100.0 * np.sin(6.0 * kinematics.time)[:, None] * [1, -1]
    np.testing.assert_allclose(kinematics.foot_loads[:, :, 1], expected, atol=1.0)
    assert kinematics.foot_loads.shape == (len(kinematics.time), 2, 6)


def test_a_short_gap_is_bridged(skeleton, trial, motion):
    gapped = hidden(trial, ["shank_r", "foot_r"], 1.0, 1.05)
    kinematics = solve_kinematics(skeleton, gapped, 0.0, 10.0)
    knee = skeleton.coordinates.index("knee_angle_r")
    assert np.isnan(kinematics.ik.q[100:106, knee]).all()
    assert kinematics.window_s == pytest.approx((0.05, 1.95))
    assert np.abs(kinematics.motion.q[:, knee] - motion.q[kinematics.frames, knee]).max() < np.radians(1.0)


@pytest.mark.parametrize(
    ("start", "windows"), [(0.6, [(0.05, 0.59), (0.91, 1.95)]), (1.2, [(0.05, 1.19), (1.51, 1.95)])]
)
def test_a_long_gap_ends_an_interval(skeleton, trial, motion, start, windows):
    gapped = hidden(trial, ["shank_r", "foot_r"], start, start + 0.3)
    kinematics = solve_kinematics(skeleton, gapped, 0.0, 10.0)
    np.testing.assert_allclose(kinematics.windows_s, windows, atol=1e-9)
    assert kinematics.window_s == pytest.approx((0.05, 1.95))
    of_intervals = [kinematics.time[part][[0, -1]] for part in kinematics.intervals]
    np.testing.assert_allclose(of_intervals, windows, atol=1e-9)
    assert not kinematics.inside(np.array([start + 0.1])).any()
    assert np.abs(kinematics.motion.q - motion.q[kinematics.frames])[:, 3:].max() < np.radians(2.0)
    (found,) = kinematics.findings
    assert (found.code, found.evidence["count"].value, found.evidence["left_out"].value) == ("P270", 2, 0)


def test_an_interval_that_is_too_short_is_left_out(skeleton, trial):
    measured = np.ones(201, dtype=bool)
    measured[80:90] = measured[100:105] = False
    kinematics = solve_kinematics(skeleton, replace(trial, measured=measured), 0.0, 10.0)
    np.testing.assert_allclose(kinematics.windows_s, [(0.05, 0.79), (1.05, 1.95)], atol=1e-9)
    (found,) = kinematics.findings
    assert [found.evidence[name].value for name in ("frames", "count", "left_out")] == [166, 2, 10]


def test_the_foot_alone_tells_where_the_shank_is(skeleton, trial):
    gapped = hidden(trial, ["shank_r"], 0.6, 0.9)
    assert np.isfinite(solve_kinematics(skeleton, gapped, 0.0, 10.0).ik.q).all()


def test_frames_without_measured_contact_are_left_out(skeleton, trial):
    measured = np.ones(201, dtype=bool)
    measured[80:90] = False
    kinematics = solve_kinematics(skeleton, replace(trial, measured=measured), 0.0, 10.0)
    np.testing.assert_allclose(kinematics.windows_s, [(0.05, 0.79), (0.90, 1.95)], atol=1e-9)
    assert not np.isin(np.arange(80, 90), kinematics.frames).any()


def test_no_usable_frame_names_trial_and_counts(skeleton, trial):
    measured = np.zeros(201, dtype=bool)
    measured[100:110] = True
    gapped = hidden(replace(trial, measured=measured), ["foot_l", "shank_l"], 0.9, 1.2)
    found = refused(skeleton, gapped)
    assert (found.code, found.evidence["frames_with_contact"].value) == ("R104", 10)
    found = refused(skeleton, replace(trial, measured=measured))
    assert (found.code, found.evidence["frames"].value) == ("P279", 10)
    assert found.where.span_s == pytest.approx((1.0, 1.09))


def test_a_trial_without_forces_lacks_no_contact(skeleton, trial):
    alone = replace(trial, loads=replace(trial.loads, plates=()))
    found = refused(skeleton, hidden(alone, ["foot_l", "shank_l"], 0.14, 1.9))
    assert (found.code, found.where.part, found.evidence["frames"].value) == ("R102", "the whole body", 14)


def refused(skeleton, trial):
    """The finding of the error that this trial has no kinematics."""
    with pytest.raises(TrialError) as caught:
        solve_kinematics(skeleton, trial, 0.0, 10.0)
    assert caught.value.finding.where.trial == "walk"
    return caught.value.finding


def test_a_coordinate_seen_too_seldom_is_named(skeleton, trial):
    gapped = hidden(trial, ["forearm_r"], 0.04, 3.0)
    found = refused(skeleton, gapped)
    assert (found.code, found.where.part, found.evidence["frames"].value) == ("R102", "elbow_flex_r", 4)


def test_a_single_frame_is_too_short(skeleton, trial):
    single = replace(
        trial,
        markers=Markers(np.zeros(1), trial.markers.labels, trial.markers.positions[:1]),
        measured=np.ones(1, bool),
    )
    found = refused(skeleton, single)
    assert (found.code, found.evidence["frames"].value) == ("R102", 1)


def test_bridges_are_between_known_frames_and_at_most_a_tenth_of_a_second():
    known = np.ones((40, 1), dtype=bool)
    known[[0, 1, 10, 11, 38, 39]] = False
    known[20:30] = False
    filled = _bridged(known, np.arange(40) / 100.0)[:, 0]
    assert filled[10:12].all()
    assert not filled[[0, 1, 38, 39]].any()
    assert not filled[20:30].any()


def columns(skeleton, *parts):
    """Mask (c,) of the coordinates whose names contain one of these."""
    return np.array([any(part in name for part in parts) for name in skeleton.coordinates])


def test_a_leg_needs_its_own_load_only(skeleton, trial):
    """The left foot is beside the plates in the second half: left leg and pelvis are not known there."""
    legs = np.ones((201, 2), dtype=bool)
    legs[100:, 1] = False
    partly = replace(trial, measured=legs.all(axis=1), leg_known=legs)
    known = known_forces(skeleton, partly, np.ones((201, len(skeleton.coordinates)), dtype=bool))
    left = columns(skeleton, "hip_flexion_l", "hip_adduction_l", "hip_rotation_l", "knee_angle_l", "ankle_angle_l")
    assert not known[:, columns(skeleton, "pelvis")].any()
    assert known[:100, left].all()
    assert not known[100:, left].any()
    rest = ~left & ~columns(skeleton, "pelvis", "subtalar_angle_l")
    assert known[:, rest].all()
    assert rest.sum() > 10
    solved = solve_kinematics(skeleton, partly, 0.0, "gcv")
    assert len(solved.time) < 100 < len(solved.trajectory_time) == np.ptp(np.flatnonzero(solved.known_frames)) + 1
    pelvis = columns(skeleton, "pelvis")
    np.testing.assert_array_equal(solved.trajectory_known[:, pelvis].all(axis=1), solved.inside(solved.trajectory_time))


def test_joint_loads_are_known_to_the_ends_of_the_recording(skeleton, trial):
    solved = solve_kinematics(skeleton, trial, 0.0, 5.0)
    assert solved.window_s == pytest.approx((0.10, 1.90))
    np.testing.assert_array_equal(solved.trajectory_time, trial.markers.time)
    known = solved.trajectory_known
    assert known[:, ~columns(skeleton, "pelvis")].all()
    np.testing.assert_array_equal(known[:, columns(skeleton, "pelvis")].all(axis=1), solved.inside(trial.markers.time))


def test_the_end_of_a_motion_is_smoothed_and_windows_stay(skeleton, trial, motion):
    """Errors of markers at the ends of a motion make no accelerations there."""
    solved = solve_kinematics(skeleton, trial, 0.0, 5.0)
    noise = np.random.default_rng(1).normal(0.0, 0.001, motion.q.shape)
    smoothed = solved.with_smooth_ends(motion.q + noise, 10.0)
    np.testing.assert_array_equal(smoothed[solved.frames], (motion.q + noise)[solved.frames])
    outer = [0, 1, 2, 198, 199, 200]
    before, after = (
        np.sqrt(np.square((interpolate(solved.trajectory_time, q)(trial.markers.time, 2) - motion.qdd)[outer]).mean())
        for q in (motion.q + noise, smoothed)
    )
    assert after < before / 3.0


def test_a_joint_needs_markers_of_what_is_distal_and_of_what_carries_it(skeleton, trial):
    seen = np.ones((201, len(skeleton.coordinates)), dtype=bool)
    seen[:50, columns(skeleton, "ankle_angle_r")] = False
    seen[50:90, columns(skeleton, "elbow_flex_l")] = False
    seen[90:100, columns(skeleton, "pelvis_tilt")] = False
    known = known_forces(skeleton, trial, seen)
    right = columns(skeleton, "hip_flexion_r", "knee_angle_r", "ankle_angle_r")
    assert not known[:50, right].any()
    assert known[50:90, right].all()
    assert known[:50, columns(skeleton, "knee_angle_l")].all()
    assert not known[50:90, columns(skeleton, "lumbar")].any()
    assert known[:50, columns(skeleton, "lumbar")].all()
    assert not known[90:100].any()


def test_nothing_is_known_long_before_a_contact(skeleton, trial):
    late = trial.loads.time >= 1.2
    loads = replace(trial.loads, force=trial.loads.force * late[:, None, None])
    known = known_forces(skeleton, replace(trial, loads=loads), np.ones((201, len(skeleton.coordinates)), dtype=bool))
    frames = np.flatnonzero(known.any(axis=1))
    assert trial.markers.time[frames[0]] == pytest.approx(1.2 - AROUND_CONTACT_S, abs=0.011)
    assert frames[-1] == 200


def test_windows_of_a_single_leg_where_contact_is_never_complete(skeleton, trial):
    """The left foot is on the ground beside the plates throughout: nothing is measured, the right leg is known."""
    legs = np.zeros((201, 2), dtype=bool)
    legs[40:160, 0] = True
    force = trial.loads.force.copy()
    force[:, 1] = 0.0
    alone = replace(trial, measured=np.zeros(201, dtype=bool), leg_known=legs, loads=replace(trial.loads, force=force))
    solved = solve_kinematics(skeleton, alone, 0.0, "gcv")
    assert not solved.complete
    assert solved.time[[0, -1]] == pytest.approx([0.40, 1.59])
    known = solved.trajectory_known
    assert not known[:, columns(skeleton, "pelvis")].any()
    assert not known[:, columns(skeleton, "knee_angle_l")].any()
    inside = solved.inside(solved.trajectory_time)
    np.testing.assert_array_equal(known[:, columns(skeleton, "knee_angle_r")][:, 0], inside)
    assert solve_kinematics(skeleton, trial, 0.0, "gcv").complete
