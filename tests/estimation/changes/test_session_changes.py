"""What changed between two sessions of one person: shared errors of the body cancel, all others do not."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import kinertia
from command_line import run
from kinertia.errors import KinertiaError
from kinertia.estimation.changes import session_changes as module
from kinertia.estimation.changes.condition_changes import Condition
from kinertia.estimation.changes.session_changes import (
    identity_note,
    instrument_doubts,
    session,
    unjudged_changes,
    why_incomparable,
    why_unjudged,
)
from kinertia.estimation.changes.stride_features import _CONTACTS, CONTACT_SD_S, _Strides
from kinertia.estimation.result import drawn_fit
from kinertia.estimation.simultaneous.uncertainty.model_errors import CENTRE_SD_M
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.gait27 import VIRTUAL_TRUNK
from kinertia.model.skeleton import Marker
from kinertia.report.comparison.what_changed import compare
from kinertia.report.exports.saved_fit import write_fit
from kinertia.trial.stances import load_edges
from report_page import Elements

TIMES = ("start_s", "end_s", "toe_off_s", "opposite_toe_off_s", "opposite_strike_s")


def trial_under(trial, condition, shift_m=0.0):
    """A walk under a condition, at another place where it is another recording."""
    markers = trial.kinematics.trial.markers
    moved = replace(markers, positions=markers.positions + shift_m)
    walk = replace(trial.kinematics.trial, name=condition, condition=condition, markers=moved)
    return replace(trial, kinematics=replace(trial.kinematics, trial=walk))


def session_of(fit, condition, shift_m, walks=3):
    """A session in which one walk was measured as often."""
    (trial,), (draws,) = fit.trials, fit.posterior.draws.trials
    posterior = replace(fit.posterior, draws=replace(fit.posterior.draws, trials=(draws,) * walks))
    trials = [trial_under(trial, condition, shift_m) for _ in range(walks)]
    named = [
        replace(
            walked,
            kinematics=replace(walked.kinematics, trial=replace(walked.kinematics.trial, name=f"{condition} {k}")),
        )
        for k, walked in enumerate(trials)
    ]
    return replace(fit, trials=tuple(named), posterior=posterior)


@pytest.fixture(scope="module")
def sessions(fit):
    return session_of(fit, "before", 0.0), session_of(fit, "after", 1e-3)


def compared(*fits, draws=12):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "DRAWS", draws)
        return compare(*fits).outcomes


@pytest.fixture(scope="module")
def found(sessions):
    return compared(*sessions)


def test_a_walk_has_not_changed_from_itself(found):
    assert {change.verdict for change in found} <= {"not shown", "cannot be judged"}
    assert max(abs(change.difference) for change in found) < 1e-9
    assert {"moment", "angle"} == {change.quantity for change in found}


def test_the_body_cancels_and_markers_do_not(found):
    for change in found:
        assert change.sd_by_source["body"] < 1e-6
    moments = [
        change.sd_by_source["markers"] for change in found if change.quantity == "moment" and change.joint == "knee"
    ]
    assert min(moments) > 1e-3


def test_what_the_body_and_the_rest_make_up_for_is_uncertain_between_sessions():
    """Within an estimate both compensate; with one body for two sessions, errors of the rest remain."""
    random = np.random.default_rng(0)
    body, rest, shared = random.normal(0.0, [[0.05], [0.05], [0.001]], (3, 200))
    drawn = {"all": body - 0.9 * body + 0.1 * rest, "rest": rest, "instruments": np.zeros(200), "shared": shared}
    both = [Condition(0.0, 3, {**drawn, "shared": k * shared, "contacts": np.zeros((4,))}, 0.0) for k in (0.0, 1.0)]
    parts = module._apart(False, "moment lumbar_flexion mid-stance r", *both)
    assert sum(parts.values()) == pytest.approx(2.0 * np.var(rest, ddof=1) + np.var(shared, ddof=1))
    assert parts["body"] == pytest.approx(np.var(shared, ddof=1))


def test_ankles_are_displaced_to_the_side_between_sessions(fit, sessions, found, monkeypatch):
    """By CENTRE_SD_M in both, which changes adduction moments by as much times the force along the shank."""
    monkeypatch.setattr(drawn_fit, "with_drawn_ankles", lambda joints, loads, random: loads)
    without = {change.names: change.sd_by_source["markers"] for change in compared(*sessions)}
    more = {change.names: change.sd_by_source["markers"] ** 2 - without[change.names] ** 2 for change in found}
    stance = ("mid-stance", "late stance")
    adduction = [
        np.sqrt(max(variance, 0.0))
        for (_, joint, component, _, event, unit), variance in more.items()
        if (joint, component, unit) == ("ankle", "adduction", "N m/kg") and event in stance
    ]
    shares = np.array(adduction) / (np.sqrt(2.0) * CENTRE_SD_M * 9.81)  # of a few draws
    assert 0.5 < shares.min() <= shares.max() < 2.0
    assert not [names for names, variance in more.items() if names[1] != "ankle" and abs(variance) > 1e-12]


def test_the_deviation_is_that_of_two_independent_sessions(fit, found):
    """Angles do not depend on the body: their variances add up."""
    (trial,) = fit.trials
    change = next(c for c in found if (c.quantity, c.joint, c.side, c.event) == ("angle", "knee", "r", "mid-stance"))
    column = fit.skeleton.coordinates.index("knee_angle_r")
    sd = np.degrees(trial.joint_curves.deviations.coordinates[:, column].mean())
    factor = module._FIXED_AXES if session(fit).fixed_axes else 1.0
    assert change.sd_by_source["markers"] == pytest.approx(factor * np.sqrt(2.0) * sd, rel=0.4)


def test_contacts_that_no_plate_measured_are_uncertain(fit):
    """By as much as a later contact changes each average; those of plates are not."""
    (trial,) = fit.trials
    strides = _Strides.of([trial])
    edges = load_edges(trial.kinematics.trial.loads)
    for side, kind in _CONTACTS:
        measured = [edge.time_s for edge in edges if edge[1:] == (side, kind)]
        for stride, other in zip(strides.strides[0], strides.later([trial], side, kind).strides[0], strict=True):
            times = {name: getattr(other, name) - getattr(stride, name) for name in TIMES}
            moved = {name for name, later in times.items() if later != 0.0 and np.isfinite(later)}
            assert {round(times[name], 9) for name in moved} <= {CONTACT_SD_S}
            assert not [t for name in moved for t in measured if abs(getattr(stride, name) - t) < 0.002]
            strike = stride.opposite_strike_s if stride.side != side else stride.start_s
            if (
                kind == "heel strike"
                and np.isfinite(strike)
                and min(abs(np.array(measured) - strike), default=1) > 0.02
            ):
                assert moved & {"start_s", "opposite_strike_s"}


def test_a_changed_knee_is_found(sessions):
    before, after = sessions
    column = after.skeleton.coordinates.index("knee_angle_r")
    bent = []
    for trial in after.trials:
        trajectory = trial.trajectory.copy()
        trajectory[:, column] -= np.radians(20.0)
        curves = trial.joint_curves
        q = curves.motion.q.copy()
        q[:, column] -= np.radians(20.0)
        motion = replace(curves.motion, q=q)
        bent.append(replace(trial, trajectory=trajectory, joint_curves=replace(curves, motion=motion)))
    found = compared(before, replace(after, trials=tuple(bent)))
    knee = [change for change in found if (change.quantity, change.joint, change.side) == ("angle", "knee", "r")]
    assert {change.verdict for change in knee} == {"changed"}
    assert [change.difference for change in knee] == pytest.approx([-20.0] * len(knee), abs=1.0)
    other = [change for change in found if (change.quantity, change.joint, change.side) == ("angle", "knee", "l")]
    assert {change.verdict for change in other} == {"not shown"}


def test_results_of_one_session_alone_are_pointed_out(sessions):
    draws = sessions[0].posterior.draws
    wide = np.random.default_rng(0).normal(0.0, 0.01, draws.places.shape)
    for places, narrow in ((draws.places, True), (wide, False)):
        fits = [
            replace(fitted, posterior=replace(fitted.posterior, draws=replace(fitted.posterior.draws, places=places)))
            for fitted in sessions
        ]
        assert session(fits[0]).narrow_markers is narrow
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "DRAWS", 2)
            found = compare(*fits)
        assert bool(found.note) is narrow
        assert (found.sentences[-1] == found.note) is narrow
        assert found.summary["note"] == found.note


def test_markers_of_a_trunk_that_has_none_do_not_hide_that_a_result_is_of_one_session_alone(sessions):
    before, _ = sessions
    draws = before.posterior.draws
    labels = [marker.label for marker in VIRTUAL_TRUNK]
    virtual = [Marker(label, "torso", np.zeros(3)) for label in labels]
    skeleton = before.skeleton.with_markers([*before.skeleton.markers, *virtual])
    wide = np.random.default_rng(0).normal(0.0, 0.04, (draws.count, len(virtual), 3))
    for scale, narrow in ((0.0, True), (10.0, False)):
        placed = np.random.default_rng(1).normal(0.0, 0.001 * scale, draws.places.shape)
        posterior = replace(before.posterior, draws=replace(draws, places=np.concatenate([placed, wide], axis=1)))
        assert session(replace(before, skeleton=skeleton, posterior=posterior)).narrow_markers is narrow


def test_both_are_evaluated_with_one_body(sessions):
    """Estimates of the body that differ by chance are no change of moments."""
    before, after = sessions
    table = after.estimate.table().copy()
    table[:, 0] *= np.where(np.char.startswith(np.array(after.estimate.segments), "shank"), 1.3, 1.0)
    other = replace(after, estimate=BodySegmentParameters.from_table(after.estimate.segments, table))
    differences = np.array([change.difference for change in compared(before, other, draws=2)])
    assert np.abs(differences).max() < 1e-9


def test_results_of_different_models_are_shown_but_not_judged(sessions):
    before, after = sessions
    assert not why_unjudged(before, after)
    fewer = replace(after.posterior.draws, segments=after.posterior.draws.segments[:-1])
    found = compare(before, replace(after, posterior=replace(after.posterior, draws=fewer)))
    usual = compared(before, after, draws=2)
    comparable = [change for change in usual if change.quantity == "moment" or change.joint in ("hip", "knee", "ankle")]
    assert {change.names for change in comparable} <= {change.names for change in found.outcomes}
    assert {change.names for change in found.outcomes} <= {change.names for change in usual}
    assert {change.verdict for change in found.outcomes} == {"cannot be judged"}
    assert all("different models" in change.doubt for change in found.outcomes)
    before_of = {change.names: change.before for change in usual}
    apart = [change.before - before_of[change.names] for change in found.outcomes if change.quantity == "angle"]
    assert np.abs(apart).max() < 0.5

    def opposite(name, side):
        return -1 if name == "knee_angle" else 0

    both = (session(before), session(after))
    knees = [change for change in unjudged_changes(*both, "another model", opposite) if change.quantity == "angle"]
    assert {change.joint for change in knees} == {"knee"}
    assert all(np.sign(change.before) == -np.sign(change.after) for change in knees if change.event == "swing")
    assert {outcome["verdict"] for outcome in found.summary["outcomes"]} == {"cannot be judged"}
    assert not found.curves


def test_what_cannot_be_compared_says_why(sessions, two_level):
    before, after = sessions
    assert not why_incomparable(before, after)
    assert "same recording" in why_incomparable(before, before)
    assert "two-level" in why_incomparable(before, two_level)
    heavy = replace(after, subject=after.subject.model_copy(update={"mass_kg": 2.0 * after.mass_kg}))
    assert "one person" in why_incomparable(before, heavy)
    sex = {"male": "female", "female": "male"}[after.subject.sex]
    other = replace(after, subject=after.subject.model_copy(update={"sex": sex}))
    assert "male" in why_incomparable(before, other)
    unknown = replace(after, subject=after.subject.model_copy(update={"sex": None}))
    assert not why_incomparable(before, unknown)
    with pytest.raises(KinertiaError, match="same recording"):
        compare(before, before)


def test_whether_both_are_one_person_is_asked_where_mass_or_legs_differ(sessions):
    before, after = sessions
    assert not identity_note(before, after)
    for share, asked in ((0.92, False), (1.2, True)):
        mass = replace(after, subject=after.subject.model_copy(update={"mass_kg": share * before.mass_kg}))
        assert not why_incomparable(before, mass)
        assert ("kg" in identity_note(before, mass)) is asked
    for share, asked in ((1.03, False), (1.08, True)):
        joints = tuple(replace(joint, translation=share * joint.translation) for joint in after.skeleton.joints)
        longer = replace(after, skeleton=replace(after.skeleton, joints=joints))
        assert ("egs of" in identity_note(before, longer)) is asked


def test_two_people_are_not_judged_and_a_child_who_grew_is(sessions):
    before, after = sessions
    for age in (None, 9.0):
        fits = [
            replace(fit, subject=fit.subject.model_copy(update={"mass_kg": kg, "age_years": age}))
            for fit, kg in ((before, before.mass_kg), (after, 1.2 * before.mass_kg))
        ]
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "DRAWS", 2)
            found = compare(*fits)
        verdicts = {change.verdict for change in (*found.outcomes, *found.steps)}
        assert (verdicts == {"cannot be judged"}) is (age is None)
        assert ("not shown" in verdicts) is (age is not None)
        assert found.sentences[0] == found.person == found.summary["person"]
        assert ("age_years" in found.person) is (age is None)


def test_trials_without_a_step_are_not_compared(sessions):
    """Squats and jumps have no phases between contacts of both feet."""
    standing = []
    for trial in sessions[0].trials:
        vars(still := replace(trial))["strides"] = ()
        vars(still)["phases"] = ()
        standing.append(still)
    with pytest.raises(KinertiaError, match="before 0, before 1, before 2"):
        session(replace(sessions[0], trials=tuple(standing)))


def test_a_session_of_several_conditions_needs_a_choice(sessions):
    before, _ = sessions
    mixed = replace(before, trials=(*before.trials[:2], trial_under(before.trials[2], "with brace")))
    with pytest.raises(KinertiaError, match="several conditions"):
        session(mixed)
    assert len(session(mixed, "before").trials) == 2
    with pytest.raises(KinertiaError, match="no trial"):
        session(mixed, "running")


def test_the_command_compares_sessions_first_of_all_by_joint_moments(sessions, tmp_path):
    folders = []
    for name, fit in zip(("before", "after"), sessions, strict=True):
        (tmp_path / name).mkdir()
        write_fit(fit, None, tmp_path / name / "fit.npz")
        folders.append(tmp_path / name)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "DRAWS", 2)
        outcome = run("compare", *folders, "-o", tmp_path / "c", "--json")
    assert outcome.status == 0, outcome.err
    content = json.loads(outcome.out)
    rows = content["outcomes"]
    assert {row["quantity"] for row in rows} == {"moment", "angle"}
    assert "changed" not in {row["verdict"] for row in rows}
    assert not content["not_compared"]
    steps = [content["walking_speed"], *content["spatiotemporal"]]
    assert [step["component"] for step in steps] == ["speed", "cadence", "length", "share", "share", "width"]
    assert len(pd.read_csv(tmp_path / "c" / "changes.csv")) == len(steps) + len(rows)
    assert len(pd.read_csv(tmp_path / "c" / "change_curves.csv")) % 101 == 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "DRAWS", 2)
        said = run("compare", *folders, "-o", tmp_path / "c").out
    assert said.index("Walking speed") < said.index("knee adduction moment") < said.index("ody segment parameters")
    page = (tmp_path / "c" / "compare.html").read_text(encoding="utf-8")
    assert page.index('id="changes"') < page.index('id="bsp"')
    assert page.count("<td>not shown</td>") == sum(row["verdict"] == "not shown" for row in (*steps, *rows))
    assert page.count('class="plot"') > 8


def test_results_that_are_no_sessions_say_why(demo_run, two_level_run, tmp_path):
    outcome = run("compare", demo_run[1], two_level_run[1], "-o", tmp_path / "c", "--json")
    content = json.loads(outcome.out)
    assert content["outcomes"] == []
    assert "two-level" in content["not_compared"]
    assert not (tmp_path / "c" / "changes.csv").exists()
    assert content["not_compared"] in Elements((tmp_path / "c" / "compare.html").read_text(encoding="utf-8")).text


def test_python_compares_what_the_command_does(sessions):
    with pytest.raises(KinertiaError, match="two sessions, or two conditions"):
        kinertia.compare(sessions[0])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "DRAWS", 2)
        found = kinertia.compare(*sessions, conditions=("before", "after"))
    assert len(found.outcomes) > 50
    assert found.speed.difference == pytest.approx(0.0, abs=1e-9)


def zero(trial):
    where = Where(trial=trial, plate="plate 1", axis="vertical", file_axis="Y")
    return finding("P213", where, level_n=Quantity(-23.1, "N", limit=15.0))


@pytest.fixture(scope="module")
def doubled(fit):
    """A walk that was recorded twice, without findings."""
    (trial,) = fit.trials

    def named(name):
        return replace(trial, kinematics=replace(trial.kinematics, trial=replace(trial.kinematics.trial, name=name)))

    return replace(fit, trials=(named("first"), named("second")), findings=())


def doubt(fit, *findings):
    doubted = replace(fit, findings=findings)
    return instrument_doubts((doubted, doubted.trials[:1]), (doubted, doubted.trials[1:])).get("r", "")


def test_an_error_of_one_condition_is_none_of_both(doubled):
    assert doubt(doubled) == ""
    assert doubt(doubled, zero("first")).startswith("P213")
    assert doubt(doubled, zero("first"), zero("second")) == ""
    assert doubt(doubled, zero("third")) == ""


def test_errors_of_both_that_a_user_waived_remain(doubled):
    both = [replace(zero(trial).at(Severity.ERROR), status="waived") for trial in ("first", "second")]
    assert doubt(doubled, *both).startswith("P213")


def test_what_is_corrected_explained_or_ignored_is_none(doubled):
    assert doubt(doubled, zero("first").at(Severity.CORRECTED)) == ""
    assert doubt(doubled, zero("first").muted("P201")) == ""
    assert doubt(doubled, replace(zero("first"), status="ignored")) == ""


def test_sessions_have_errors_of_their_own(doubled):
    days = [replace(doubled, findings=(zero(name),)) for name in ("first", "second")]
    found = instrument_doubts((days[0], days[0].trials[:1]), (days[1], days[1].trials[1:]))
    assert set(found) == {"r", "l", ""}
    assert found["l"].startswith("P213")


def test_a_foot_beside_its_plate_leaves_the_other_leg(doubled):
    where = Where(trial="first", plate="plate 1")
    beside = finding("P282", where, foot=Quantity("right"), overhang_m=Quantity(0.05, "m"))
    doubted = replace(doubled, findings=(beside,))
    assert set(instrument_doubts((doubted, doubted.trials[:1]), (doubted, doubted.trials[1:]))) == {"r"}
