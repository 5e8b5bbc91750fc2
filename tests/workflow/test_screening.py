"""`kinertia check` and `kinertia fit` find the same in the same recordings, and no ERROR in fault-free ones."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinertia.errors import BlockedError
from kinertia.findings.finding import Severity
from kinertia.findings.rule import STAGES
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.recording import read_recording
from kinertia.io.subject.reader import read_subject
from kinertia.io.text.sto import read_sto, write_sto
from kinertia.io.text.trc import write_trc
from kinertia.settings import Overrule, Settings, Subject
from kinertia.trial.data import Markers, Recording
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.check import check_person
from kinertia.workflow.from_files import prepare_subject
from kinertia.workflow.person import Person, read_person
from kinertia.workflow.prepare import prepared
from kinertia.workflow.screening import screen, with_widths
from recordings import FITTED, is_here, slow_beside
from refusals import expect_filled
from synthetic_lab import WITH_MODEL, synthetic_arguments
from validation import osim_models
from validation.field_trials import cases
from validation.measured_data import data_folder
from validation.walks import fit_arguments

SCREENED = STAGES[: STAGES.index("person") + 1]


_SUBJECT4 = "subject4/walking1"


PEOPLE = [*FITTED, "synthetic with model", *(["subject4"] if is_here(f"{_SUBJECT4}.trc") else [])]
"""Names of `walks.WALKS`, the synthetic laboratory's, and two with their own OpenSim models."""


FIELD = [case for case in cases(data_folder()) if case.arguments[0] == "fit"] if is_here(f"{_SUBJECT4}.trc") else []


def written(arguments):
    """The subject file of a command."""
    words = [argument for argument in arguments if argument != "--calibrate"]
    given = dict(zip(words[1::2], words[2::2], strict=True))
    trial = {"markers": arguments[0], "forces": given.get("--forces"), "loads": given.get("--loads")}
    tables = {
        "[subject]": {"mass_kg": given.get("--mass"), "height_m": given.get("--height"), "sex": given.get("--sex")},
        "[model]": {
            "static": given.get("--static"),
            "osim": given.get("--model"),
            "calibrate": "true" if "--calibrate" in arguments else None,
        },
        "[[trial]]": trial,
    }
    lines = []
    for head, entries in tables.items():
        stated = {key: value for key, value in entries.items() if value is not None}
        lines += [
            head,
            *(
                f"{key} = {value if key.endswith(('_kg', '_m', 'calibrate')) else repr(value)}"
                for key, value in stated.items()
            ),
        ]
    return "\n".join(lines)


@pytest.fixture(params=slow_beside(("synthetic", "pig_b", "synthetic with model"), PEOPLE))
def subject(request, tmp_path, synthetic_lab):
    """One person's subject file, read."""
    name = request.param
    if name == "synthetic":
        text = written(synthetic_arguments(synthetic_lab))
    elif name == "synthetic with model":
        text = osim_models.subject_file(synthetic_lab, WITH_MODEL, False)
    elif name == "subject4":
        person = osim_models.PEOPLE[name]
        trials = {_SUBJECT4: person.trials[_SUBJECT4]}
        text = osim_models.subject_file(data_folder(), replace(person, trials=trials), False)
    else:
        text = written(fit_arguments(data_folder(), name))
    path = tmp_path / "subject.toml"
    path.write_text(text, encoding="utf-8")
    return read_subject(path)


def screened(findings):
    """Code, severity and place of what is found before inverse kinematics."""
    return [(finding.code, finding.severity, finding.where) for finding in findings if finding.rule.stage in SCREENED]


def test_check_and_fit_find_the_same(subject):
    checked, ready = check_person(read_person(subject)), prepare_subject(subject)
    found = screened(checked.findings)
    assert found
    assert screened(ready.findings) == found
    assert checked.overview.left_out == ready.left_out == ()
    assert ready.rules == checked.overview.rules
    assert not [finding for finding in ready.findings if finding.severity is Severity.ERROR]
    for finding in ready.findings:
        expect_filled(finding)


@pytest.mark.slow
@pytest.mark.parametrize("case", FIELD, ids=lambda case: case.title)
def test_check_and_fit_find_the_same_in_recordings_of_other_laboratories(case, tmp_path):
    path = tmp_path / "subject.toml"
    if case.arguments[1].endswith(".toml"):
        path = Path(case.arguments[1])
    else:
        path.write_text(written(case.arguments[1:]), encoding="utf-8")
    wanted = read_subject(path)
    checked = check_person(read_person(wanted))
    try:
        found = prepare_subject(wanted).findings
    except BlockedError as blocked:
        found = blocked.findings
    assert screened(found) == screened(checked.findings)
    for finding in (*found, *checked.findings):
        expect_filled(finding)


def laboratory(folder, lab, trials, static="static"):
    """A subject file for trials of the synthetic laboratory."""
    lines = ["[subject]", "mass_kg = 72.6", "height_m = 1.803", "sex = 'male'", "[model]", f"static = '{static}.trc'"]
    for trial in trials:
        lines += ["[[trial]]", f"markers = '{trial}.trc'", f"forces = '{trial}_grf.mot'"]
        for name in (f"{trial}.trc", f"{trial}_grf.mot"):
            if (lab / name).exists() and not (folder / name).exists():
                shutil.copyfile(lab / name, folder / name)
    shutil.copyfile(lab / "static.trc", folder / "static.trc")
    (folder / "subject.toml").write_text("\n".join(lines), encoding="utf-8")
    return read_subject(folder / "subject.toml")


def spoil_forces(path):
    """Forces in kN."""
    table = read_sto(path)
    forces = [name for name in table.columns if "_force_v" in name or "torque" in name]
    table[forces] /= 1000.0
    write_sto(path, table, False, path.stem)


def test_what_the_readers_refuse_stands_though_it_is_waived(tmp_path, synthetic_lab):
    """Z up in the markers and Y up in the forces: the trial was left out, and its ERROR shown as waived."""
    wanted = laboratory(tmp_path, synthetic_lab, ["walk", "other"])
    markers = read_recording(tmp_path / "other.trc").markers
    turned = markers.positions[..., [0, 2, 1]] * [1.0, -1.0, 1.0]
    write_trc(tmp_path / "other.trc", replace(markers, positions=turned))
    screened = screen(replace(read_person(wanted), overrule=Overrule(waive=("P201",))))
    assert screened.left_out == ("other",)
    assert [(finding.code, finding.status) for finding in screened.findings if finding.where.trial == "other"] == [
        ("P201", "open")
    ]


def test_a_trial_that_is_left_out_is_so_by_both(tmp_path, synthetic_lab):
    wanted = laboratory(tmp_path, synthetic_lab, ["walk", "other", "alike"])
    spoil_forces(tmp_path / "other_grf.mot")
    (tmp_path / "alike.trc").write_text("PathFileType 4\n", encoding="utf-8")
    checked, ready = check_person(read_person(wanted)), prepare_subject(wanted)
    assert checked.overview.left_out == ready.left_out == ("alike", "other")
    assert screened(ready.findings) == screened(checked.findings)
    errors = [
        (finding.code, finding.where.trial)
        for finding in ready.findings
        if finding.severity is Severity.ERROR and finding.is_open
    ]
    assert errors[1:] == [("P202", "other")]
    assert errors[0][0].startswith("F")
    assert errors[0][1] == "alike"
    assert [k.trial.name for k in ready.kinematics] == ["walk"]


def test_what_blocks_a_fit_is_what_check_found(tmp_path, synthetic_lab):
    wanted = laboratory(tmp_path, synthetic_lab, ["walk", "other"])
    for name in ("walk", "other"):
        spoil_forces(tmp_path / f"{name}_grf.mot")
    checked = check_person(read_person(wanted))
    with pytest.raises(BlockedError) as blocked:
        prepare_subject(wanted)
    assert screened(blocked.value.findings) == screened(checked.findings)
    assert [(finding.code, finding.where.trial) for finding in blocked.value.blocking] == [
        ("P202", "walk"),
        ("P202", "other"),
    ]


def test_an_error_stops_unless_it_is_waived(tmp_path, synthetic_lab):
    wanted = laboratory(tmp_path, synthetic_lab, ["walk"])
    wanted = wanted.model_copy(update={"subject": wanted.subject.model_copy(update={"mass_kg": 90.0})})
    with pytest.raises(BlockedError) as blocked:
        prepare_subject(wanted)
    (found,) = blocked.value.blocking
    assert (found.code, found.where.trial) == ("S111", "walk")
    ready = prepare_subject(wanted, overrule=Overrule(waive=("S111",)))
    assert [(finding.code, finding.status) for finding in ready.findings if finding.severity is Severity.ERROR] == [
        ("S111", "waived")
    ]


def test_a_static_trial_that_cannot_be_read_stops_everything(tmp_path, synthetic_lab):
    wanted = laboratory(tmp_path, synthetic_lab, ["walk"])
    (tmp_path / "static.trc").write_text("PathFileType 4\n", encoding="utf-8")
    checked = check_person(read_person(wanted))
    with pytest.raises(BlockedError) as blocked:
        prepare_subject(wanted)
    assert screened(blocked.value.findings) == screened(checked.findings)
    (found,) = blocked.value.blocking
    assert (found.code, found.where.file, found.where.line, found.where.trial) == ("F104", "static.trc", 2, None)
    assert checked.overview.left_out == ()


SET = read_marker_set("plug-in-gait")


def recording(name, **measurements):
    return Recording(name, Markers(np.zeros(1), ("A",), np.zeros((1, 1, 3))), measurements=measurements)


def widths(static, trials, **given):
    static_with_widths, marker_set = with_widths(static, trials, SET, Subject(name="A", **given))
    known = {joint: static_with_widths.measurements.get(name) for joint, name in marker_set.widths.items()}
    borrowed = [(finding.code, finding.where.part, finding.where.file) for finding in static_with_widths.findings]
    return {joint: value for joint, value in known.items() if value}, borrowed


def test_the_static_trial_goes_before_others_and_the_subject_file_before_both():
    static = recording("static", RKneeWidth=0.10)
    walk = recording("walk", RKneeWidth=0.2, LKneeWidth=0.11, LAnkleWidth=0.07)
    by_joint, borrowed = widths(static, [recording("empty"), walk])
    assert by_joint == {"knee_r": 0.10, "knee_l": 0.11, "ankle_l": 0.07}
    assert borrowed == [("S105", "left knee", "walk"), ("S105", "left ankle", "walk")]
    by_joint, borrowed = widths(static, [walk], knee_width_mm=95.0)
    assert by_joint == {"knee_r": 0.095, "knee_l": 0.095, "ankle_l": 0.07}
    assert borrowed == [("S105", "left ankle", "walk")]


def test_a_set_that_names_no_widths_takes_those_of_the_subject_file():
    unnamed = replace(SET, widths={})
    static, marker_set = with_widths(recording("static"), [], unnamed, Subject(name="A", ankle_width_mm=70.0))
    assert {joint: static.measurements[name] for joint, name in marker_set.widths.items()} == pytest.approx(
        {"ankle_r": 0.07, "ankle_l": 0.07}
    )


def test_the_model_has_the_widths_of_the_subject_file(measured_folder):
    """The static trial has widths of its own, of 105 mm at the knees."""
    folder = measured_folder / "pig_c3d"
    static, walk = (read_recording(folder / f"subject_b_{name}.c3d") for name in ("static", "walk"))

    def shank_m(**given):
        subject = Subject(name="B", mass_kg=47.5, height_m=1.505, sex="female", **given)
        skeleton = prepared(screen(Person(subject, [TrialInput(walk)], static)), Settings(joint_axes=False)).skeleton
        return {joint.child: np.array(joint.translation) for joint in skeleton.joints}["shank_r"]

    usual, same, wide = shank_m(), shank_m(knee_width_mm=105.0), shank_m(knee_width_mm=140.0)
    assert same == pytest.approx(usual, abs=1e-9)
    assert np.linalg.norm(wide - usual) > 0.002
