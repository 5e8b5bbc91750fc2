import numpy as np
import pytest

from generic_static import generic_model, smooth_motion
from kinertia.errors import TrialError
from kinertia.estimation import calibration
from kinertia.estimation.calibration import AdaptationInputs, first_poses, sampled, turn_about
from kinertia.estimation.model_adaptation import elbow_rotations, with_elbows_that_bend_forwards
from kinertia.model.gait27 import ARM_COORDINATES, ARM_ROTATIONS, SHOULDER_OFFSETS
from kinertia.model.skeleton import Marker
from kinertia.trial.data import FootLoads, Markers, Trial

UPPER = ("torso", "upper_arm_r", "upper_arm_l", "forearm_r", "forearm_l")
HELD = dict.fromkeys(ARM_COORDINATES, 0.0)
ARM = ("R.Bicep", "R.Elbow", "R.Wrist.Lat", "R.Wrist.Med")


@pytest.fixture(scope="module")
def skeleton():
    return generic_model().skeleton


def walk(skeleton, n=300, seed=0) -> Markers:
    time, motion = smooth_motion(skeleton, n, 100.0, seed)
    return Markers(time, skeleton.labels, skeleton.marker_positions(skeleton.pose(motion.q)))


def trial(markers: Markers, name="walk") -> Trial:
    zero = np.zeros((len(markers.time), 2, 3))
    return Trial(name, markers, FootLoads(markers.time, zero, zero), np.ones(len(markers.time), bool))


def dropped(markers: Markers, labels) -> Markers:
    return markers.select([label for label in markers.labels if label not in labels])


def deviations(skeleton) -> dict[str, float]:
    return {segment: 0.04 if segment in UPPER else 0.01 for segment in skeleton.segments}


def adapt(skeleton, recordings, *deviations):
    trials = [trial(markers) for markers in recordings]
    return calibration.adapt(skeleton, AdaptationInputs(trials, first_poses(skeleton, trials), *deviations))


def lock_undetermined(skeleton, trials, may_lock):
    return calibration.lock_undetermined(skeleton, trials, first_poses(skeleton, trials), may_lock)


def test_moved_markers_come_back(skeleton):
    moved = {"R.Acromium": np.array([0.0, -0.08, 0.02]), "L.Thigh.Front": np.array([0.01, 0.02, -0.01])}
    truth = skeleton.with_markers(
        [Marker(m.label, m.segment, m.position + moved.get(m.label, 0.0)) for m in skeleton.markers]
    )
    adapted = adapt(skeleton, [walk(truth)], deviations(skeleton), {})
    expected = {marker.label: marker.position for marker in truth.markers}
    error = {m.label: np.linalg.norm(m.position - expected[m.label]) for m in adapted.skeleton.markers}
    assert adapted.moved_m["R.Acromium"] == pytest.approx(np.hypot(0.08, 0.02), rel=0.1)
    assert error["R.Acromium"] < 0.006
    assert error["L.Thigh.Front"] < 0.006
    # what could also be told by moving a whole segment under its markers stays with the prior
    assert max(error.values()) < 0.012


def test_trials_that_repeat_a_misfit_move_markers_no_farther_than_one(skeleton):
    moved = {"R.Acromium": np.array([0.0, -0.08, 0.02]), "L.Thigh.Front": np.array([0.01, 0.02, -0.01])}
    markers = [Marker(m.label, m.segment, m.position + moved.get(m.label, 0.0)) for m in skeleton.markers]
    recording = walk(skeleton.with_markers(markers))
    once, thrice = (adapt(skeleton, count * [recording], deviations(skeleton), {}) for count in (1, 3))
    np.testing.assert_allclose(thrice.skeleton.marker_locals, once.skeleton.marker_locals, atol=1e-5)


def test_shoulder_offsets_and_arm_rotations_are_found(skeleton):
    values = {"shoulder_x_r": 0.02, "shoulder_y_l": -0.03, "arm_rot_r": 0.6, "pro_sup_l": -0.5}
    truth = skeleton.lock(values)
    sd = dict.fromkeys(SHOULDER_OFFSETS, 0.04) | dict.fromkeys(ARM_ROTATIONS, 1.0)
    adapted = adapt(skeleton, [walk(truth)], dict.fromkeys(skeleton.segments, 0.001), sd)
    for name in sd:
        expected = values.get(name, skeleton.locked[name])
        assert adapted.coordinates[name] == pytest.approx(expected, abs=0.005 if name in SHOULDER_OFFSETS else 0.05)
    assert adapted.skeleton.locked == {**skeleton.locked, **adapted.coordinates}


def test_perfect_markers_leave_the_model_as_it_is(skeleton):
    sd = dict.fromkeys(SHOULDER_OFFSETS, 0.04)
    adapted = adapt(skeleton, [walk(skeleton)], deviations(skeleton), sd)
    assert max(adapted.moved_m.values()) < 1e-5
    assert max(map(abs, adapted.coordinates.values())) < 1e-5


def test_noise_does_not_carry_the_pelvis_markers_beyond_their_prior(skeleton):
    """All pelvis markers together may shift in the segment (the gauge): only the prior holds them."""
    markers = walk(skeleton)
    noise = np.random.default_rng(0).normal(0, 0.01, markers.positions.shape)
    noisy = Markers(markers.time, markers.labels, markers.positions + noise)
    adapted = adapt(skeleton, [noisy], deviations(skeleton), {})
    pelvis = [m.label for m in skeleton.markers if m.segment == "pelvis"]
    assert max(adapted.moved_m[label] for label in pelvis) < 0.01


def test_markers_may_be_absent_in_one_of_several_trials_or_in_all(skeleton):
    shift = np.array([0.0, 0.0, 0.02])
    truth = skeleton.with_markers(
        [Marker(m.label, m.segment, m.position + shift * (m.label == "L.Bicep")) for m in skeleton.markers]
    )
    first, second = (
        dropped(walk(truth, seed=1), ["L.Bicep", "R.Knee.Med"]),
        dropped(walk(truth, seed=2), ["R.Knee.Med"]),
    )
    adapted = adapt(skeleton, [first, second], deviations(skeleton), {})
    assert set(adapted.skeleton.labels) == set(skeleton.labels)
    assert "R.Knee.Med" not in adapted.moved_m
    assert adapted.moved_m["L.Bicep"] == pytest.approx(0.02, abs=0.005)


def test_feet_that_are_never_seen_together_are_an_error(skeleton):
    markers = walk(skeleton)
    half = len(markers.time) // 2
    positions = markers.positions.copy()
    for frames, foot in ((slice(None, half), "foot_r"), (slice(half, None), "foot_l")):
        positions[frames, skeleton.marker_segments == skeleton.segments.index(foot)] = np.nan
    with pytest.raises(TrialError) as caught:
        adapt(skeleton, [Markers(markers.time, markers.labels, positions)], deviations(skeleton), {})
    assert (caught.value.finding.code, caught.value.finding.where.part) == ("R102", "the whole body")


def test_sampling_takes_at_most_sixty_frames_a_tenth_of_a_second_apart():
    def frames(n, rate_hz):
        return Markers(np.arange(n) / rate_hz, ("a",), np.zeros((n, 1, 3)))

    assert len(sampled(frames(1, 100.0)).time) == 1
    assert len(sampled(frames(2, 100.0)).time) == 1
    np.testing.assert_allclose(np.diff(sampled(frames(101, 100.0)).time), 0.1)
    long = sampled(frames(100_000, 100.0))
    assert 50 <= len(long.time) <= 60
    assert long.time[-1] > 900.0


def test_arms_without_markers_are_held_and_named(skeleton):
    markers = dropped(walk(skeleton), ARM)
    held_skeleton, held = lock_undetermined(skeleton, [trial(markers)], HELD)
    assert held == ("arm_flex_r", "arm_add_r", "elbow_flex_r")
    assert {name: held_skeleton.locked[name] for name in held} == dict.fromkeys(held, 0.0)
    assert len(held_skeleton.coordinates) == 24


def test_a_forearm_without_markers_holds_the_elbow_alone(skeleton):
    markers = dropped(walk(skeleton), ["L.Wrist.Lat", "L.Wrist.Med"])
    assert lock_undetermined(skeleton, [trial(markers)], HELD)[1] == ("elbow_flex_l",)
    assert lock_undetermined(skeleton, [trial(walk(skeleton))], HELD) == (skeleton, ())


def test_a_leg_without_markers_is_an_error(skeleton):
    foot = [m.label for m in skeleton.markers if m.segment == "foot_l"]
    with pytest.raises(TrialError) as caught:
        lock_undetermined(skeleton, [trial(dropped(walk(skeleton), foot))], HELD)
    found = caught.value.finding
    assert (found.code, found.where.trial, "L.Heel" in found.where.markers) == ("R103", "walk", True)
    assert "ankle_angle_l" in found.where.part


def test_arm_markers_in_one_trial_only_are_an_error_that_names_the_other(skeleton):
    trials = [trial(walk(skeleton), "with"), trial(dropped(walk(skeleton), ARM), "bare")]
    with pytest.raises(TrialError) as caught:
        lock_undetermined(skeleton, trials, HELD)
    found = caught.value.finding
    assert (found.code, found.where.trial, "arm_flex_r" in found.where.part) == ("R103", "bare", True)


@pytest.mark.parametrize("side", ["r", "l"])
def test_an_elbow_that_the_static_trial_has_backwards_bends_forwards(skeleton, side):
    """As after a T-pose, in which nothing tells where a straight arm's elbow points."""
    time, motion = smooth_motion(skeleton, 300, 100.0, 0)
    q = motion.q.copy()
    elbow = skeleton.coordinates.index(f"elbow_flex_{side}")
    q[:, elbow] = 1.3 + 0.3 * np.sin(5 * time)
    walk = trial(Markers(time, skeleton.labels, skeleton.marker_positions(skeleton.pose(q))))
    turn = f"arm_rot_{side}"
    spoilt = skeleton.lock({turn: skeleton.locked[turn] + 0.8 * np.pi})
    mended, poses = with_elbows_that_bend_forwards(spoilt, [walk])
    assert np.angle(np.exp(1j * (mended.locked[turn] - skeleton.locked[turn]))) == pytest.approx(0.0, abs=0.05)
    np.testing.assert_allclose(np.median(poses[0].q[:, elbow]), 1.3, atol=0.1)
    other = f"arm_rot_{'l' if side == 'r' else 'r'}"
    assert mended.locked[other] == skeleton.locked[other]
    assert elbow_rotations(spoilt, mended) == {side: pytest.approx(-0.8 * np.pi, abs=0.05)}
    assert elbow_rotations(skeleton, with_elbows_that_bend_forwards(skeleton, [walk])[0]) == {}


def straight_arms(skeleton, hyperextended=-0.05) -> Markers:
    """A walk in which neither elbow bends by more than three degrees."""
    time, motion = smooth_motion(skeleton, 300, 100.0, 0)
    q = motion.q.copy()
    q[:, [skeleton.coordinates.index(f"elbow_flex_{side}") for side in "rl"]] = -hyperextended
    return Markers(time, skeleton.labels, skeleton.marker_positions(skeleton.pose(q)))


def test_straight_elbows_keep_the_arms_as_the_static_trial_has_them(skeleton):
    walk = trial(straight_arms(skeleton))
    same, poses = with_elbows_that_bend_forwards(skeleton, [walk])
    assert same.locked == skeleton.locked
    adapted = calibration.adapt(
        same, AdaptationInputs([walk], poses, deviations(same), dict.fromkeys(ARM_ROTATIONS, 1.0))
    )
    assert adapted.coordinates == pytest.approx({name: skeleton.locked[name] for name in ARM_ROTATIONS}, abs=1e-3)


def test_no_calibration_bends_an_elbow_backwards(skeleton):
    """Markers and arms are adapted so that the elbows stay within their range."""
    walk = trial(straight_arms(skeleton, hyperextended=0.4))
    turned, poses = with_elbows_that_bend_forwards(skeleton, [walk])
    sd = dict.fromkeys(ARM_ROTATIONS, 1.0)
    adapted = calibration.adapt(turned, AdaptationInputs([walk], poses, deviations(turned), sd)).skeleton
    (ik,) = first_poses(adapted, [walk])
    elbows = ik.q[:, [ik.coordinates.index(f"elbow_flex_{side}") for side in "rl"]]
    assert elbows.min() >= np.radians(-5.0) - 1e-9
    assert ik.marker_rms_m < 0.01


def test_a_turn_of_all_markers_of_a_segment_is_told_from_the_move_of_one(skeleton):
    about = np.array([[np.cos(0.5), 0.0, np.sin(0.5)], [0.0, 1.0, 0.0], [-np.sin(0.5), 0.0, np.cos(0.5)]])
    torso = np.mean([m.position for m in skeleton.markers if m.segment == "torso"], axis=0)
    turned = [
        Marker(m.label, m.segment, torso + about @ (m.position - torso)) if m.segment == "torso" else m
        for m in skeleton.markers
    ]
    assert turn_about("torso", skeleton.markers, turned) == pytest.approx(np.sin(0.5), rel=0.1)
    assert turn_about("torso", skeleton.markers, skeleton.markers) == 0.0


def test_an_arm_that_one_trial_does_not_show_is_held_in_all(skeleton):
    """Its markers are not used in the others either: nothing pulls at what is held."""
    whole = walk(skeleton)
    trials = [trial(whole, "one"), trial(dropped(whole, ARM), "two")]
    poses = first_poses(skeleton, trials)
    left = calibration.without_partly_shown(skeleton, poses, ARM_COORDINATES)
    assert set(skeleton.labels) - set(left.labels) == set(ARM)
    held, names = lock_undetermined(left, trials, HELD)
    assert set(names) == {"arm_flex_r", "arm_add_r", "elbow_flex_r"}
    assert "elbow_flex_l" in held.coordinates
    again = calibration.without_partly_shown(skeleton, poses[:1], ARM_COORDINATES)
    assert again.markers == skeleton.markers


def test_a_forearm_that_one_trial_does_not_show_leaves_the_upper_arm(skeleton):
    whole = walk(skeleton)
    trials = [trial(whole, "one"), trial(dropped(whole, ARM[2:]), "two")]
    left = calibration.without_partly_shown(skeleton, first_poses(skeleton, trials), ARM_COORDINATES)
    assert set(skeleton.labels) - set(left.labels) == set(ARM[2:])
