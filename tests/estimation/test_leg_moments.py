from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.result.suitability import suitability
from kinertia.estimation.leg_moments import coverage_by_task, coverage_sentence, moment_coverage


def test_a_walk_over_plates_has_joint_moments_in_all_of_stance(fit):
    (trial,) = fit.trials
    legs = moment_coverage(trial)
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
    own = curves.joints["estimate"].joints.index(f"hip_{side}")
    known = np.isfinite(curves.joints["estimate"].moments[:, own, 0])
    ground = k.trial.on_ground[k.course_frames, foot]
    stance = np.flatnonzero(known & ground)
    late = k.trial.markers.time > curves.time[stance[3 * len(stance) // 4]]
    cut = replace(k, known=k.known & ~late[:, None], windows_s=((-2.0, -1.0),))
    leg = moment_coverage(replace(trial, kinematics=cut))[foot]
    assert leg.missing == ("push-off",)
    assert coverage_sentence([replace(trial, kinematics=cut)]).count("no push-off") >= 1


def test_tasks_are_named_where_there_are_several(fit):
    (walk,) = fit.trials
    k = walk.kinematics
    turn = replace(walk, kinematics=replace(k, trial=replace(k.trial, name="turn", task="turn")))
    assert coverage_sentence([walk, turn]).startswith("walk (right: whole st")
    assert "); turn (right: whole st" in coverage_sentence([walk, turn])


def test_without_strides_there_is_nothing(fit):
    (walk,) = fit.trials
    k = walk.kinematics
    unknown = replace(walk, kinematics=replace(k, trial=replace(k.trial, on_ground=None)))
    assert moment_coverage(unknown) == ()
    assert coverage_sentence([unknown]) == ""
