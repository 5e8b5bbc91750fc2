from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.prior import literature_prior
from kinertia.synthetic.motions import CAMERA_SD_M, Faults, measured, tilted
from kinertia.synthetic.walk import walk, walking_subject
from one_process import in_one_process
from validation.accuracy_study import (
    CLASSES,
    JOINTS,
    PROOF,
    SCENARIOS,
    Draw,
    attainable,
    run_accuracy,
    run_draw,
    summarised,
)
from validation.accuracy_tables import accuracy_markdown, moments_markdown
from validation.joint_accuracy import JointErrors

ELSEWHERE = ("session", "faulty_walks", "study", "artefact")
"""Laboratories that are not tested in PROOF's order: the session comes first, since it takes longest. The others are
only on the page on accuracy: `faulty_walks` takes as long as all the rest, and the noise of `study` and `artefact` is
tested with calibration errors."""
SHORT_S = 1.3
"""About a stride."""


@pytest.fixture(scope="module")
def trial():
    return walk(walking_subject(), SHORT_S, trapezoid=False)


def made_up(scale: float, seed: int = 0) -> Draw:
    """Errors that are normal with `scale` times the deviation told."""
    rng = np.random.default_rng(seed)
    prior = np.full((12, 10), 2.0)
    sd = np.tile([0.5, 1.2, 1.9, 1.0, 1.0, 1.0, 1.0, 1.9, 1.9, 1.9], (12, 1))
    shares = dict.fromkeys(CLASSES, 0.8)
    joints = dict.fromkeys(
        JOINTS, JointErrors(4.0, 9.0, 0.9, 0.8, (25.0, 16.0, 36.0), 0.01, 0.0225, 0.7, 0.04, 0.0025, 0.09)
    )
    return Draw(scale * rng.normal(0.0, sd), rng.normal(0.0, prior), prior, sd, sd, shares, joints, True)


def test_summary_knows_error_bars_that_hold_from_those_that_do_not():
    good, small = (summarised("made up", [made_up(scale, seed) for seed in range(200)]) for scale in (1.0, 2.0))
    for name in (*CLASSES, "measured", "informed", "assumed"):
        assert good.classes[name].coverage == pytest.approx(0.95, abs=0.015)
        assert good.classes[name].ratio == pytest.approx(1.0, abs=0.04)
        assert small.classes[name].coverage == pytest.approx(0.673, abs=0.03)
        assert small.classes[name].ratio == pytest.approx(2.0, abs=0.08)
    assert good.classes["measured"].rms == pytest.approx(0.25, rel=0.1)
    assert good.classes["measured"].rms_literature == pytest.approx(1.0, rel=0.1)
    assert good.classes["mass"].better > 0.99
    knee = good.joints["knee"]
    assert (knee.moment_nm, knee.moment_sd_nm, knee.coverage, knee.usual_nm) == pytest.approx((2.0, 3.0, 0.9, 4.0))
    assert (knee.angle_sd_rad, knee.angle_coverage, knee.power_coverage) == pytest.approx((0.15, 0.7, 0.8))
    angles = (knee.angle_rad, knee.angle_ik_rad, knee.change_rad, knee.change_ik_rad)
    assert angles == pytest.approx((0.1, 0.2, 0.05, 0.3))


def test_what_an_estimate_at_the_bound_can_attain():
    """Known parts: an exact estimate is always better, none at all never, half the variance in between."""
    prior = literature_prior(walking_subject().literature)
    root = np.linalg.cholesky(prior.given_scale()[1])
    exact, half, nothing = (attainable(prior, share * root, np.random.default_rng(0)) for share in (1e-6, 0.7, 1.0))
    assert set(exact.values()) == {1.0}
    assert all(nothing[name] + 0.1 < share < 1.0 for name, share in half.items())
    assert max(nothing.values()) < 0.6


@pytest.mark.slow
def test_draws_do_not_depend_on_the_number_of_processes():
    """None of its own, and two."""
    short = replace(PROOF["artefact"], walk_s=0.5)
    alone = [run_draw(4, (short, number)) for number in range(2)]
    assert run_accuracy({"artefact": short}, 2, seed=4, workers=2)["artefact"] == summarised(short.title, alone)


@pytest.mark.slow
def test_people_are_the_same_in_every_scenario():
    draws = [run_draw(1, (SCENARIOS[key], 3)) for key in ("study", "gain")]
    np.testing.assert_array_equal(draws[0].literature_errors, draws[1].literature_errors)
    assert not np.allclose(draws[0].errors, draws[1].errors)


@pytest.mark.slow
@pytest.mark.first
@pytest.mark.parametrize("key", ["session", *(key for key in PROOF if key not in ELSEWHERE)])
@in_one_process()
def test_bars_hold(key):
    """Of fewer people where each walks, squats and sways. Of more where their trunks differ by luck.

    Where skin is of a kind that the estimate does not know, knees are covered less, the more instruments are off.
    """
    accuracy = run_accuracy({key: PROOF[key]}, {"walks": 6, "session": 16, "study_calibration": 24}.get(key, 12))[key]
    for name in CLASSES:
        assert 0.92 < accuracy.classes[name].coverage < 0.98
        assert 0.85 < accuracy.classes[name].ratio < 1.15
        assert accuracy.classes[name].rms < 1.3 * accuracy.classes[name].bound
    for joint in JOINTS:
        assert accuracy.joints[joint].coverage > (0.87 if key == "clusters" else 0.93)


def test_faults_are_what_they_say(trial):
    rng = np.random.default_rng
    plain_skeleton, (plain,) = measured([trial], Faults("artefact"), rng(1))
    assert plain_skeleton is trial.skeleton
    _, (gained,) = measured([trial], Faults("artefact", gain=0.02), rng(1))
    right, left = 0, 1
    np.testing.assert_allclose(gained.trial.loads.force[:, right], 1.02 * plain.trial.loads.force[:, right])
    np.testing.assert_allclose(gained.trial.loads.force[:, left], plain.trial.loads.force[:, left])
    hips, _ = measured([trial], Faults("artefact", hips_m=0.015), rng(1))
    assert hips.locked["hip_x_r"] == hips.locked["hip_x_l"] == 0.015
    tilt = tilted(trial.skeleton, np.radians(5.0), rng(1))
    pairs = [
        (axis, other)
        for a, b in zip(trial.skeleton.joints, tilt.joints, strict=True)
        for axis, other in zip(a.axes, b.axes, strict=True)
        if axis != other
    ]
    assert {axis.coordinate.rsplit("_", 1)[0] for axis, _ in pairs} == {
        "knee_angle",
        "ankle_angle",
        "subtalar_angle",
        "elbow_flex",
    }
    angles = [np.degrees(np.arccos(np.dot(axis.direction, other.direction))) for axis, other in pairs]
    assert angles == pytest.approx([5.0] * 8)


def test_all_trials_of_a_person_have_the_same_skin_skeleton_and_plates(trial):
    """But zeros and gains of their own while somebody stands on the plate, and delays of hundredths of a ms."""
    twice = [trial, trial]
    skeleton, (first, other) = measured(twice, Faults("artefact", calibration=True), np.random.default_rng(4))
    assert skeleton is not trial.skeleton
    apart = first.trial.markers.positions - other.trial.markers.positions
    assert np.std(apart) == pytest.approx(np.sqrt(2.0) * CAMERA_SD_M, rel=0.02)
    change = other.trial.loads.force - first.trial.loads.force
    for foot, vertical in enumerate(first.trial.loads.force[..., 1].T):
        firm = vertical > 200.0
        gain = np.mean(change[firm, foot, 1] / vertical[firm])
        assert np.abs(gain) < 0.1
        change[firm, foot] -= gain * first.trial.loads.force[firm, foot]
        assert np.abs(change[firm, foot, 1]).max() < 2.0
        zeros = change[firm, foot][:, [0, 2]]
        assert (zeros.std(axis=0) < 0.2 * np.abs(zeros.mean(axis=0))).all()
        nobody = vertical == 0.0
        assert np.abs(change[nobody, foot]).max(initial=0.0) < 1.0


def test_wobbling_mass_keeps_impulse_and_weight(trial):
    """Soft tissue on springs neither adds weight nor pushes the person off: its mean force is small beside its peak."""
    _, (plain,) = measured([trial], Faults("artefact"), np.random.default_rng(1))
    _, (wobbled,) = measured([trial], Faults("artefact", wobbling=0.4), np.random.default_rng(1))
    added = (wobbled.trial.loads.force - plain.trial.loads.force).sum(axis=1)
    assert 1.0 < np.abs(added).max() < 200.0
    assert np.abs(added.mean(axis=0)).max() < 0.1 * np.abs(added).max()


def test_calibration_errors_move_everything(trial):
    skeleton, (kinematics,) = measured([trial], Faults("study", calibration=True), np.random.default_rng(2))
    assert np.std(skeleton.marker_locals - trial.skeleton.marker_locals) == pytest.approx(0.005, rel=0.2)
    assert skeleton.locked["hip_z_l"] != trial.skeleton.locked["hip_z_l"]
    share = kinematics.trial.loads.force[:, :, 1].sum() / trial.foot_loads[:, :, 1].sum()
    assert 0.0 < abs(share - 1.0) < 0.08


@pytest.mark.slow
@in_one_process()
def test_tables_have_every_laboratory():
    chosen = {key: replace(SCENARIOS[key], walk_s=0.6) for key in ("study_calibration", "gain")}
    accuracies = run_accuracy(chosen, 2)
    assert accuracies["gain"].classes["mass"].rms > 0
    tables = accuracy_markdown(accuracies)
    assert tables.count("| mass (kg) |") == len(chosen)
    for scenario in chosen.values():
        assert scenario.title[1:] in tables
        assert f"| {scenario.title} |" in moments_markdown(accuracies)
