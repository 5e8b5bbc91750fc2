from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.suitability import suitability
from kinertia.estimation.result.leg_moments import (
    coverage_by_task,
    coverage_sentence,
    forces_before,
    forces_used,
    full_bandwidth,
    gaps_sentence,
)
from kinertia.estimation.result.trial_fit import BESIDE, HIDDEN, PARTLY, SHARED
from kinertia.settings import Settings


def test_a_walk_over_plates_has_joint_moments_in_all_of_stance(fit):
    (trial,) = fit.trials
    legs = trial.coverage
    assert [(leg.word, leg.missing) for leg in legs] == [("right", ()), ("left", ())]
    assert trial.kinematics.trial.task == "walk"
    assert list(coverage_by_task(fit.trials)) == ["walk"]
    assert coverage_sentence(fit.trials).startswith("right: whole st")
    assert coverage_sentence(fit.trials) in suitability(fit, ())[0].reason


@pytest.mark.parametrize(("side", "foot"), [("r", 0), ("l", 1)])
def test_only_known_moments_count(fit, side, foot):
    """From three quarters of the stance on nothing is known."""
    (trial,) = fit.trials
    k, curves = trial.kinematics, trial.joint_curves
    hip = curves.joints["estimate"].joints.index(f"hip_{side}")
    known = np.isfinite(curves.joints["estimate"].moments[:, hip, 0])
    ground = k.trial.on_ground[k.trajectory_frames, foot]
    stance = np.flatnonzero(known & ground)
    late = k.trial.markers.time > curves.time[stance[3 * len(stance) // 4]]
    cut = replace(k, known=k.known & ~late[:, None], windows_s=((-2.0, -1.0),))
    leg = replace(trial, kinematics=cut).coverage[foot]
    assert leg.missing == ("push-off",)
    assert coverage_sentence([replace(trial, kinematics=cut)]).count("no push-off") >= 1


def test_tasks_are_named_where_there_are_several(fit):
    (walk,) = fit.trials
    k = walk.kinematics
    turn = replace(walk, kinematics=replace(k, trial=replace(k.trial, name="turn", task="turn")))
    assert coverage_sentence([walk, turn]).startswith("walk (right: whole st")
    assert "); turn (right: whole st" in coverage_sentence([walk, turn])


def test_a_walk_of_less_than_a_stride_says_what_is_known_of_stance(fit, monkeypatch):
    monkeypatch.setattr("kinertia.estimation.result.trial_fit.strides_of", lambda *_: ())
    walk = replace(fit.trials[0])
    assert walk.strides == ()
    assert [(leg.word, leg.missing) for leg in walk.coverage] == [("right", ()), ("left", ())]
    assert coverage_sentence([walk]) == "right: whole stance; left: whole stance"
    assert [leg.stride for leg in walk.coverage] == [None, None]
    k = walk.kinematics
    for task in ("landing", "squat", "other"):
        assert replace(walk, kinematics=replace(k, trial=replace(k.trial, task=task))).coverage == ()


def test_without_ground_contact_there_is_nothing(fit):
    (walk,) = fit.trials
    k = walk.kinematics
    unknown = replace(walk, kinematics=replace(k, trial=replace(k.trial, on_ground=None)))
    assert unknown.coverage == ()
    assert coverage_sentence([unknown]) == ""


FOOT = 1


@pytest.fixture(scope="module")
def interrupted(fit):
    """The trial, itself without some frames of the left stance, these frames, and their first and last time."""
    (trial,) = fit.trials
    k = trial.kinematics
    time = k.trial.markers.time
    loads = k.trial.loads
    loaded = np.interp(time, loads.time, loads.force[:, FOOT, 1]) > 100.0
    stance = np.flatnonzero(loaded & k.inside(time))
    span = (float(time[stance[5]]), float(time[stance[25]]))
    here = (time >= span[0]) & (time <= span[1])

    def changed(columns=slice(None), **fields):
        known = np.where(here[:, None], False, k.known | k.inside(time)[:, None])
        cut = replace(k, known=known, windows_s=((-2.0, -1.9), (time[0], time[0]), (time[-1], time[-1])), **fields)
        return replace(trial, kinematics=cut)

    return trial, changed, here, span


def lost(trial, here):
    """The trial in which the load of the left leg is unknown there."""
    k = trial.kinematics
    legs = np.where(here[:, None], [True, False], k.trial.known_legs)
    return replace(k.trial, leg_known=legs, measured=k.trial.measured & ~here)


def test_whatever_is_known_is_no_gap(fit):
    (trial,) = fit.trials
    known = trial.joint_curves.known.all(axis=1)
    time = trial.joint_curves.time
    for gap in trial.moment_gaps:
        assert not known[(time >= gap.start_s) & (time <= gap.end_s)].any()
        assert gap.reason == BESIDE


def reasons(trial, span):
    middle = (span[0] + span[1]) / 2
    return {gap.reason for gap in trial.moment_gaps if gap.side == "l" and gap.start_s <= middle <= gap.end_s}


def test_a_foot_that_is_partly_on_its_plate(interrupted):
    trial, changed, here, span = interrupted
    assert reasons(changed(trial=lost(trial, here)), span) == {PARTLY}


def test_a_plate_under_both_feet(interrupted):
    trial, changed, here, span = interrupted
    measured = lost(trial, here)
    shared = replace(
        measured, loads=replace(measured.loads, on_shared_plate=np.ones(len(measured.loads.time), dtype=bool))
    )
    assert reasons(changed(trial=shared), span) == {SHARED}


def test_a_foot_beside_the_plates(interrupted):
    trial, changed, here, span = interrupted
    measured = lost(trial, here)
    force = measured.loads.force.copy()
    force[:, FOOT] = 0.0
    beside = changed(trial=replace(measured, loads=replace(measured.loads, force=force)))
    assert reasons(beside, span) == {BESIDE}
    assert f"{BESIDE} (" in gaps_sentence([beside])


def test_hidden_markers(interrupted):
    trial, changed, here, span = interrupted
    ik = trial.kinematics.ik
    hidden = replace(ik, q=np.where(here[:, None], np.nan, ik.q))
    assert reasons(changed(trial=trial.kinematics.trial, ik=hidden), span) == {HIDDEN}


RMS = "of 21.3 N (RMS over the trial)"


CASES = [
    ({}, None, 0.4, "as measured", "as measured"),
    ({}, None, 21.3, f"as measured, less impacts {RMS}", "as measured"),
    ({"force_cutoff_hz": "none"}, None, 21.3, f"as measured, impacts {RMS} included", "as measured"),
    ({}, 31.25, 0.0, "low-passed at 31.2 Hz", "low-passed at 31.2 Hz"),
    ({"force_cutoff_hz": 8.0}, 8.0, 0.0, "low-passed at 8 Hz", "as measured"),
    ({"method": "two-level"}, 7.5, 0.0, "low-passed at 7.5 Hz", "low-passed at 7.5 Hz"),
]


def reactions(cutoff_hz, impact_n):
    return SimpleNamespace(cutoff_hz=cutoff_hz, impact_n=impact_n)


@pytest.mark.parametrize(("given", "cutoff_hz", "impact_n", "which", "before"), CASES)
def test_which_forces(given, cutoff_hz, impact_n, which, before):
    settings = Settings(**given)
    used = forces_used(reactions(cutoff_hz, impact_n), settings, 12.0)
    assert used.which == which
    assert "=" not in used.which
    assert forces_before(reactions(cutoff_hz, impact_n), settings) == before
    assert ("Bisseling" in used.why) == (impact_n > 0.5)
    assert ('force_cutoff_hz = "none"' in used.why) == ("less" in which)


@pytest.mark.parametrize(
    ("given", "reason"),
    [({}, "noisy when unloaded"), ({"force_cutoff_hz": 9.0}, "force_cutoff_hz"), ({"method": "two-level"}, "motion")],
)
def test_why_they_are_low_passed(given, reason):
    assert reason in forces_used(reactions(9.0, 0.0), Settings(**given), 12.0).why


def test_full_bandwidth_is_what_the_forces_have():
    assert full_bandwidth(reactions(None, 0.0)) == "forces at full bandwidth"
    assert full_bandwidth(reactions(31.25, 0.0)) == "forces up to 31.2 Hz"
