"""Findings of recordings: a synthetic laboratory's, spoilt in one way at a time, and the measured ones."""

from dataclasses import replace

import ezc3d
import numpy as np
import pytest

from kinertia.findings.finding import Severity
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.io.recording import read_recording
from kinertia.settings import Subject
from kinertia.synthetic.laboratory import LabNoise, record
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import Markers
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.check import check_person, check_recording
from kinertia.workflow.person import Person
from loads_and_feet import on_one_plate
from recordings import here, is_here, marker_set_for


@pytest.fixture(scope="module")
def lab():
    """Static trial and walk of a synthetic person of 72.6 kg, with the noise of a good laboratory."""
    subject = walking_subject()
    trial = walk(subject, 2.7, 1000.0, 0.75)
    return record(subject, trial, LabNoise(skin="none"), np.random.default_rng(3), 10)


@pytest.fixture(scope="module")
def marker_set(lab):
    return choose_marker_set(lab.static.markers.labels)


def codes(check, *severities):
    """Of open findings of these severities; of WARNINGs and ERRORs if none is given."""
    wanted = severities or (Severity.WARNING, Severity.ERROR)
    return [finding.code for finding in check.findings if finding.is_open and finding.severity in wanted]


def errors(check):
    return codes(check, Severity.ERROR)


def of_code(check, code):
    return [finding for finding in check.findings if finding.code == code]


def moved(recording, positions):
    markers = recording.markers
    return replace(recording, markers=Markers(markers.time, markers.labels, positions))


def without(recording, *labels):
    kept = [label for label in recording.markers.labels if label not in labels]
    return replace(recording, markers=recording.markers.select(kept))


def test_a_good_laboratory(lab, marker_set):
    assert marker_set is not None
    static = check_recording(lab.static, marker_set, 72.6, is_static=True)
    walked = check_recording(lab.walk, marker_set, 72.6)
    for check in (static, walked):
        assert codes(check) == []
        assert check.marker_set.fits
    assert static.travel.kind == "stands still"
    assert walked.travel.sentence().startswith("walks along +X")
    assert walked.context.force_mass.mass_kg == pytest.approx(72.6, rel=0.02)
    (start, end), *_ = walked.windows
    assert dict(walked.facts())["complete contact"].startswith(f"{start:.3f} to {end:.3f} s")
    assert [marker.share for marker in walked.markers] == [1.0] * len(walked.markers)


def test_facts_say_what_is_in_it(lab, marker_set):
    facts = dict(check_recording(lab.walk, marker_set, 72.6).facts())
    markers = lab.walk.markers
    assert facts["frames"] == f"{len(markers.time)} at 100 Hz, {markers.time[0]:.3f} to {markers.time[-1]:.3f} s"
    assert facts["in the file"] == "lengths in m, +Y up; read as m, Y up"
    assert "2 plates at 1000 Hz" in facts["forces"]
    standing = dict(check_recording(lab.static, marker_set, is_static=True).facts())
    assert standing["forces"] == "none"
    assert "movement" in facts
    assert "movement" not in standing, "nobody is expected to move in it"


def test_windows_are_shown_in_order_of_time(lab, marker_set):
    check = replace(check_recording(lab.walk, marker_set, 72.6), windows=((2.8, 3.4), (2.4, 2.7)))
    assert dict(check.facts())["complete contact"] == "2.400 to 2.700 s, 2.800 to 3.400 s"


def test_labels_of_nobody(lab):
    markers = lab.walk.markers
    strange = replace(lab.walk, markers=replace(markers, labels=tuple(f"P{k}" for k in range(len(markers.labels)))))
    check = check_recording(strange)
    (found,) = of_code(check, "L101")
    assert (found.is_open, found.severity) == (True, Severity.ERROR)
    assert found.evidence["labels_found"].value == 0
    assert not check.marker_set.fits
    assert {contact.foot for plate in check.plates for contact in plate.contacts} == {None}
    assert check.windows == ()


def test_labels_misspelt_are_guessed(lab, marker_set):
    markers = lab.walk.markers
    misspelt = tuple(label + "_a" for label in markers.labels)
    check = check_recording(replace(lab.walk, markers=replace(markers, labels=misspelt)))
    assert not check.marker_set.fits
    assert check.marker_set.missing["R.ASIS" if "R.ASIS" in check.marker_set.missing else "RASI"][0] == "R.ASIS_a"
    assert "L101" in errors(check)


def test_labels_in_other_capitals_and_punctuation_are_known(lab, marker_set):
    markers = lab.walk.markers
    folded = tuple(label.replace(".", "_").lower() for label in markers.labels)
    check = check_recording(replace(lab.walk, markers=replace(markers, labels=folded)))
    assert check.marker_set.name == marker_set.name
    read = {finding.evidence["written"].value: finding.evidence["label"].value for finding in of_code(check, "L103")}
    assert read == {written: label for written, label in zip(folded, markers.labels, strict=True) if written != label}
    assert codes(check) == []
    assert check.windows == check_recording(lab.walk).windows


def test_a_trunk_without_markers_is_no_failure_unless_the_static_trial_shows_it(lab, marker_set):
    torso = marker_set.segments["torso"]
    walked, static = without(lab.walk, *torso), without(lab.static, *torso)
    for standing in (None, static):
        assert not errors(check_recording(walked, marker_set, static=standing))
    assert not errors(check_recording(static, marker_set, is_static=True))
    (found,) = of_code(check_recording(walked, marker_set, static=lab.static), "M104")
    assert (found.is_open, found.severity, found.where.part) == (True, Severity.ERROR, "torso")


@pytest.mark.parametrize(("pelvis_only", "code"), [(False, "M104"), (True, "L106")])
def test_markers_that_a_fit_cannot_do_without(lab, marker_set, pelvis_only, code):
    gone = ["R.ASIS"] if pelvis_only else marker_set.segments["foot_r"]
    check = check_recording(without(lab.walk, *gone), marker_set)
    assert errors(check) == [code]
    (found,) = of_code(check, code)
    assert "R.ASIS" in found.where.markers if pelvis_only else found.where.part == "right foot"
    assert bool(check.windows) == pelvis_only


def test_never_seen_and_gaps(lab, marker_set):
    positions = lab.walk.markers.positions.copy()
    column = lab.walk.markers.labels.index
    (start, end), *_ = check_recording(lab.walk, marker_set).windows
    time = lab.walk.markers.time
    positions[:, column("R.Heel")] = np.nan
    positions[(time > start) & (time < start + 0.3 * (end - start)), column("L.Elbow")] = np.nan
    positions[(time > start) & (time < start + 0.9 * (end - start)), column("Sternum")] = np.nan
    check = check_recording(moved(lab.walk, positions), marker_set)
    found = {code: of_code(check, code) for code in ("M101", "M102", "M103")}
    assert {code: [finding.where.markers for finding in findings] for code, findings in found.items()} == {
        "M101": [("R.Heel",)],
        "M102": [("Sternum",)],
        "M103": [("L.Elbow",)],
    }
    assert found["M102"][0].evidence["share"].value == pytest.approx(0.1, abs=0.02)
    assert found["M103"][0].evidence["gap_s"].value == pytest.approx(0.3 * (end - start), abs=0.02)


def test_gap_outside_the_measured_window_does_no_harm(lab, marker_set):
    (start, _), *_ = check_recording(lab.walk, marker_set).windows
    positions = lab.walk.markers.positions.copy()
    positions[lab.walk.markers.time < start - 0.05, lab.walk.markers.labels.index("Sternum")] = np.nan
    check = check_recording(moved(lab.walk, positions), marker_set)
    assert codes(check, Severity.WARNING, Severity.ERROR) == []
    assert not [finding for finding in check.findings if finding.code.startswith("M10")]
    (sternum,) = [marker for marker in check.markers if marker.label == "Sternum"]
    assert sternum.share < 1.0


def mass_finding(recording, marker_set, mass_kg):
    """What is found of a stated mass: it is the person's, not the recording's."""
    person = Person(Subject(name="A", mass_kg=mass_kg), [TrialInput(recording)], marker_set=marker_set)
    return [finding for finding in check_person(person).findings if finding.code.startswith("S11")]


def test_no_forces_and_no_measured_frame(lab, marker_set):
    bare = check_recording(replace(lab.walk, plates=None), marker_set)
    assert errors(bare) == ["P271"]
    assert codes(bare, Severity.WARNING) == []
    plates = lab.walk.plates
    quiet = replace(plates, force=np.zeros_like(plates.force), moment=np.zeros_like(plates.moment))
    check = check_recording(replace(lab.walk, plates=quiet), marker_set)
    assert errors(check) == ["P278"]
    assert check.context.force_mass is None


def test_loads_that_are_nowhere_near_the_feet_are_not_said_to_be_on_the_wrong_feet(lab, marker_set):
    plates = lab.walk.plates
    spoilt = replace(lab.walk, plates=replace(plates, moment=1000.0 * plates.moment, corners=None))
    check = check_recording(spoilt, marker_set)
    assert errors(check) == ["P203", "P203"]
    assert [finding.where.plate for finding in of_code(check, "P203")] == list(plates.names)


def test_window_of_the_user(lab, marker_set):
    (start, end), *_ = check_recording(lab.walk, marker_set).windows
    middle = (start + end) / 2
    check = check_recording(lab.walk, marker_set, window_s=(middle, middle + 0.2))
    (found,) = of_code(check, "P274")
    assert found.where.span_s == (middle, middle + 0.2)
    assert codes(check) == []
    assert check.context.trial.measured.sum() in (20, 21)
    short = check_recording(lab.walk, marker_set, window_s=(middle, middle + 0.05))
    assert errors(short) == ["P279"]
    assert of_code(short, "P279")[0].evidence["frames"].value in (5, 6)


@pytest.mark.parametrize(
    ("name", "over"),
    [
        (name, over)
        for name, over in (
            ("synthetic/long", "whole strides"),
            ("synthetic/run", "whole strides"),
            ("gait2354/subject01_walk1", "whole strides"),
            ("field/hamner_run/subject02_running", "whole strides"),
        )
        if is_here(f"{name}.trc")
    ],
)
def test_mass_on_one_belt_is_that_of_two_plates(recording_of, name, over):
    """While both feet stand on it, the sum of their loads is known, which is all that weighs."""
    two = recording_of(f"{name}.trc", f"{name}_grf.mot")
    long_plate = on_one_plate(two)
    by_two, by_one = (check_recording(recording).context.force_mass for recording in (two, long_plate))
    assert by_one.over == by_two.over == over
    assert by_one.mass_kg == pytest.approx(by_two.mass_kg, rel=0.005)


WALKS = {
    "synthetic/walk.trc": ("synthetic/walk_grf.mot", 72.6, (1.09, 2.17)),
    "synthetic/long.trc": ("synthetic/long_grf.mot", 72.6, (0.0, 3.7)),
    "synthetic/squats.trc": ("synthetic/squats_grf.mot", 72.6, (0.0, 5.0)),
    "synthetic/walk.c3d": (None, 72.6, (1.09, 2.17)),
    "gait2354/subject01_walk1.trc": ("gait2354/subject01_walk1_grf.mot", 72.6, (0.0, 2.5)),
    "rajagopal_walk/motion_capture_walk.trc": ("rajagopal_walk/grf_walk.mot", 84.0, (0.48, 1.95)),
    "pig_c3d/subject_a_walk.c3d": (None, 41.5, (2.76, 3.58)),
    "pig_c3d/subject_b_walk.c3d": (None, 47.5, (2.64, 3.52)),
    "subject4/squats1.trc": ("subject4/squats1_grf.mot", 60.0, (0.0, 13.45)),
}


@pytest.mark.parametrize("name", here(WALKS))
def test_sound_trials(recording_of, name):
    forces, mass_kg, window = WALKS[name]
    recording = recording_of(name, forces)
    marker_set = marker_set_for(recording.markers.labels)
    check = check_recording(recording, marker_set, mass_kg)
    assert not errors(check)
    assert check.windows[0] == pytest.approx(window, abs=0.03)
    assert check.context.force_mass.mass_kg == pytest.approx(mass_kg, rel=0.065)
    severities = [finding.severity for finding in mass_finding(recording, marker_set, mass_kg)]
    assert severities == ([Severity.WARNING] if "subject_b" in name else [])


@pytest.fixture
def of_another_laboratory(tmp_path, synthetic_lab):
    """Writes the synthetic walk with labels that nobody knows, in this unit and with this axis up."""

    def write(unit, vertical):
        file = ezc3d.c3d(str(synthetic_lab / "walk.c3d"))
        points, plates = file["parameters"]["POINT"], file["parameters"]["FORCE_PLATFORM"]
        turn = {"+Z": np.eye(3), "+Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}[vertical]
        turn = turn * {"mm": 1.0, "m": 1e-3}[unit]
        points["UNITS"]["value"], points["Y_SCREEN"]["value"] = [unit], [vertical]
        points["LABELS"]["value"] = [f"M{k}" for k in range(len(points["LABELS"]["value"]))]
        file["data"]["points"][:3] = np.einsum("ij,jmn->imn", turn, file["data"]["points"][:3])
        plates["CORNERS"]["value"] = np.einsum("ij,jcp->icp", turn, plates["CORNERS"]["value"])
        del file["parameters"]["PROCESSING"], file["data"]["meta_points"]
        file.write(str(tmp_path / "other.c3d"))
        return tmp_path / "other.c3d"

    return write


def assert_foreign(recording, unit, vertical):
    check = check_recording(recording)
    assert (recording.length_unit, recording.vertical) == (unit, vertical)
    assert "L101" in errors(check)
    assert all(plate.outside_share in (None, 0.0) for plate in check.plates)
    return check


@pytest.mark.parametrize("unit", ["mm", "m"])
@pytest.mark.parametrize("vertical", ["+Y", "+Z"])
def test_a_file_of_another_laboratory(of_another_laboratory, recording_of, unit, vertical):
    check = assert_foreign(read_recording(of_another_laboratory(unit, vertical)), unit, vertical)
    renamed = check_recording(recording_of("synthetic/walk.c3d", None))
    assert (
        [plate.outside_share for plate in check.plates]
        == [plate.outside_share for plate in renamed.plates]
        == [0.0] * 2
    )
    assert [plate.peak_n for plate in check.plates] == pytest.approx([plate.peak_n for plate in renamed.plates])


@pytest.mark.parametrize(
    ("name", "unit", "vertical"),
    [
        pytest.param("bts", "mm", "+Y", marks=pytest.mark.slow),
        ("ist", "m", "+Z"),
        ("plates_type1", "m", "+Y"),
    ],
)
@pytest.mark.measured
def test_measured_files_of_other_laboratories(file_of, name, unit, vertical):
    assert_foreign(read_recording(file_of(f"c3d_variety/{name}.c3d")), unit, vertical)


@pytest.mark.measured
def test_a_measured_walk_with_helen_hayes_markers_in_four_letters(recording_of):
    """VSAC is on the sacrum, 0.2 m behind the ASIS; joint centres are computed from it."""
    check = check_recording(recording_of("c3d_variety/motion_analysis_walk.c3d"))
    assert (check.marker_set.name, errors(check)) == ("Helen Hayes", [])
    assert {"VPEL", "VRKN", "VLAN"} <= set(check.marker_set.others)
