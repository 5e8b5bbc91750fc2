"""Bad input through the command line, from files and options to the recordings: its code and place; status 2."""

import json
import os
import shutil

import numpy as np
import pytest

from c3d_writer import plate_parameters, write_c3d
from command_line import run
from kinertia.io.c3d.reader import read_c3d
from kinertia.io.text.trc import read_trc, write_trc
from recordings import named_here
from spoilt_lab import (
    COMMAND,
    changed_markers,
    complaint,
    edit_cell,
    expect,
    expect_evidence,
    expect_found,
    refused,
    spoil,
)


def test_missing_file(lab):
    refusal = refused(lab, static="statik.trc")
    expect_found(refusal, "F101", file="statik.trc", folder="lab$", nearest="^static.trc")


def test_folder_without_a_subject_file(lab):
    expect_found(
        refused(lab, "../lab", **COMMAND), "F108", {"file": "lab"}, problem="no subject file", action="kinertia init"
    )


def test_missing_subject_file(lab):
    refusal = complaint(lab, lab / "subject.toml")
    expect_found(refusal, "F101", {"file": "subject.toml"}, hint="expected a subject file")


def test_all_missing_files_of_a_subject_file_are_reported_at_once(lab):
    """With their lines, in the terminal and as JSON: a folder that was moved takes all of its files along."""
    subject = lab / "subject.toml"
    subject.write_text(
        """
[subject]
name = "moved"
sex = "male"
mass_kg = 72.6
height_m = 1.8
[model]
static = "elsewhere/static.trc"
[[trial]]
markers = "elsewhere/walk.trc"
forces = "elsewhere/walk.mot"
""",
        encoding="utf-8",
    )
    for command in ("check", "fit"):
        ended = run(command, subject)
        assert (ended.status, ended.err.count("error: "), ended.err.count(" F101 ")) == (2, 3, 3)
        found = json.loads(run(command, subject, "--json").out)["findings"]
        assert [finding["code"] for finding in found] == ["F101"] * 3
        lines = [finding["where"]["line"] for finding in found]
        assert lines == sorted(lines)


FILES = ["walk.trc", "walk.mot", "walk.xml", "static.trc", "walk.c3d", "static.c3d"]


@pytest.mark.parametrize("name", FILES)
def test_empty_file(lab, name):
    (lab / name).write_bytes(b"")
    refusal = refused(lab, "walk.c3d" if name.endswith(".c3d") else "walk.trc")
    expect_found(refusal, "F103" if name.endswith(".xml") else "F104", {"file": name}, found="empty|no element")


INCOMPLETE = {".xml": "F103", ".mot": "F105"}
"""A force file does not say how many rows it has: its last row is too short."""


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("share", [0.02, 0.7])
def test_truncated_file(lab, name, share):
    content = (lab / name).read_bytes()
    (lab / name).write_bytes(content[: int(share * len(content))])
    refusal = refused(lab, "walk.c3d" if name.endswith(".c3d") else "walk.trc")
    expect_found(refusal, INCOMPLETE.get(name[-4:], "F104"), {"file": name})
    if name.endswith(".c3d"):
        expect_evidence(refusal.blocking[0], {"bytes": int(share * len(content))})


@pytest.mark.parametrize(
    ("source", "name", "changes"),
    [
        ("walk.trc", "walk.csv", {"walk": "walk.csv", "static": "static.trc"}),
        ("walk.mot", "forces.csv", {"forces": "forces.csv"}),
        ("walk.mot", "other.trc", {"walk": "other.trc"}),
        ("walk.trc", "other.mot", {"forces": "other.mot"}),
        ("walk.trc", "other.xml", {"loads": "other.xml"}),
        ("walk.c3d", "other.trc", {"walk": "other.trc"}),
        ("walk.trc", "other.c3d", {"walk": "other.c3d"}),
        ("walk.c3d", "other.mot", {"forces": "other.mot"}),
    ],
)
def test_wrong_type(lab, source, name, changes):
    shutil.copyfile(lab / source, lab / name)
    code = "F102" if name == "forces.csv" else "F103"
    expect_found(refused(lab, **changes), code, {"file": name}, expected=".")


def test_spoiled_trc(lab):
    """What else is wrong inside files is told by their readers."""
    spoil(lab / "static.trc", edit_cell(20, 1, "0.9"))
    refusal = refused(lab)
    expect_found(refusal, "T101", {"file": "static.trc", "line": 21}, step_s=-0.76, usual_s=0.01)
    assert "static.trc, line 21" in refusal.message


@pytest.mark.parametrize(
    ("changes", "code", "evidence"),
    [
        ({"mass": "72600"}, "S102", {"quantity": "mass", "value": 72600.0, "unit": "grams"}),
        ({"mass": "-72.6"}, "S102", {"quantity": "mass", "value": -72.6}),
        ({"mass": "nan"}, "S102", {"quantity": "mass"}),
        ({"height": "180.3"}, "S102", {"quantity": "stature", "value": 180.3, "unit": "centimetres"}),
        ({"height": "1803"}, "S102", {"quantity": "stature", "value": 1803.0, "unit": "millimetres"}),
        ({"mass": None}, "S101", {"quantity": "mass"}),
        ({"height": None}, "S101", {"quantity": "stature"}),
        ({"method": "three-level"}, "F191", {"value": "three-level", "expected": "two-level"}),
        ({"markers": "cleveland"}, "F101", {"hint": "cleveland-clinic, .*plug-in-gait, .*rajagopal, rajagopal-run"}),
    ],
)
def test_implausible_or_missing_option(lab, changes, code, evidence):
    refusal = refused(lab, **changes)
    expect_found(refusal, code, **evidence)
    if code == "S101":
        assert f"--{next(iter(changes))}" in refusal.message


@pytest.mark.parametrize("option", ["trial", "--static", "--forces", "--model"])
def test_a_missing_file_is_named_before_missing_options(lab, option):
    """Without --sex, too: nobody types an option more for a file that is not there."""
    gone = lab / "gone.c3d"
    given = ["fit", gone if option == "trial" else lab / "walk.trc", *([] if option == "trial" else [option, gone])]
    outcome = run(*given, "-o", lab / "out")
    assert outcome.status == 2
    assert " F101 " in outcome.err
    assert "gone.c3d" in outcome.err
    assert "--sex" not in outcome.err


def test_missing_option(lab):
    expect(refused(lab, sex=None), "--sex")
    no_static = refused(lab, static=None)
    expect_found(no_static, "S208")
    assert "--static" in no_static.message


def test_options_beside_a_subject_file(lab):
    (lab / "subject.toml").write_text("")
    expect(complaint(lab, lab / "subject.toml", "--mass", "70"), "--mass", "put .* into it")


def without(path, *labels):
    markers = read_trc(path)
    assert set(labels) <= set(markers.labels)
    write_trc(path, markers.select([label for label in markers.labels if label not in labels]))


def test_static_trial_without_landmark(lab):
    without(lab / "static.trc", "L.Knee.Lat")
    refusal = refused(lab, markers="cleveland-clinic")
    where = {"trial": "static", "part": "knee_l"}
    expect_found(refusal, "L105", where, landmark=r"knee_lateral_l .*L\.Knee\.Lat")


def test_static_trial_without_a_spine(lab):
    without(lab / "static.trc", "R.ASIS")
    refusal = refused(lab, markers="cleveland-clinic")
    expect_found(refusal, "L106", {"trial": "static", "markers": ["R.ASIS", "L.ASIS"]}, absent=1)


def test_no_fully_measured_frame(lab):
    """After 2.35 s of the walk no foot stands on a plate."""
    write_trc(lab / "late.trc", read_trc(lab / "walk.trc").cut(2.35, 2.65))
    expect_found(refused(lab, "late.trc"), "P278", {"trial": "late"}, shared=0.0)


def hide(path, label):
    def change(positions, index):
        positions[:, index(label)] = np.nan

    changed_markers(path, change)


def test_marker_of_three_missing_for_the_whole_trial(lab):
    hide(lab / "walk.trc", "V.Sacral")
    expect(refused(lab), "trial 'walk'", "2 of the markers on the pelvis", "at least 3")


@pytest.mark.slow
def test_marker_missing_for_the_whole_trial(lab):
    """The others say where its segment is: a note."""
    hide(lab / "walk.trc", "R.Heel")
    files = {name: lab / COMMAND[name] if name in ("forces", "loads", "static") else COMMAND[name] for name in COMMAND}
    options = [word for name, value in files.items() for word in (f"--{name}", value)]
    outcome = run("fit", lab / "walk.trc", *options, "-o", lab / "out", "--json")
    assert outcome.status in (0, 1), outcome.err
    (found,) = [finding for finding in json.loads(outcome.out)["findings"] if finding["code"] == "M101"]
    assert (found["severity"], found["where"]) == ("INFO", {"trial": "walk", "markers": ["R.Heel"]})


UNUSABLE = {
    "other labels": ["L101"],
    "labels twice": ["L101"],
    "plates alone": ["F164"],
    "rotations_only": ["L101", "P271"],
    "plates_kistler_type3": ["F164"],
    "plates_type1": ["L101"],
    "bts": ["L101"],
    "duplicate_labels": ["M121", "L101", "P271"],
}
"""C3D files: those of which the name has a blank are written, the others are measured."""
LARGE = ("plates_kistler_type3", "bts")
AT_HAND = named_here({name: f"{'synthetic' if ' ' in name else 'c3d_variety'}/{name}.c3d" for name in UNUSABLE})


def write_unusable(path, markers):
    """A walk with markers of no known set, or with labels twice; or plates alone."""
    points, labels = 1000.0 * markers.positions, [f"M{k:02d}" for k in range(len(markers.labels))]
    if path.stem == "labels twice":
        labels = [*labels[::2], *labels[::2]][: len(labels)]
    if path.stem == "plates alone":
        points, labels = points[:, :0], []
    forces = np.tile([0.0, 0.0, -600.0, 6e4, -3e4, 0.0], (10 * len(points), 1))
    corners = np.array([[[0, 500, 0], [500, 500, 0], [500, 0, 0], [0, 0, 0]]], float)
    parameters = {"POINT": {"Y_SCREEN": ["+Y"]}, "FORCE_PLATFORM": plate_parameters(corners)}
    write_c3d(path, points, labels, forces, parameters)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LARGE)) for name in AT_HAND])
def test_c3d_that_cannot_be_used(lab, file_of, name):
    if " " in name:
        write_unusable(lab / f"{name}.c3d", read_c3d(lab / "walk.c3d").markers)
    else:
        shutil.copyfile(file_of(AT_HAND[name]), lab / f"{name}.c3d")
    refusal = refused(lab, f"{name}.c3d", mass="60", height="1.7")
    assert sorted(refusal.codes) == sorted(UNUSABLE[name]), refusal.message
    assert refusal.message.count(name) >= len(refusal.codes)


def test_c3d_without_plates(lab):
    """A static trial in place of the walk: Plug-in Gait markers, and plates that nothing was read from."""
    content = (lab / "walk.c3d").read_bytes()
    at = content.index(b"FORCE_PLATFORM")
    used = content.index(b"USED", at) + 4
    # after the name: offset (2), type (1), number of dimensions (1), value
    (lab / "walk.c3d").write_bytes(content[: used + 4] + b"\0\0" + content[used + 6 :])
    expect_found(refused(lab, "walk.c3d"), "P271", {"trial": "walk"})


def test_output_that_is_a_file(lab):
    (lab / "taken").write_text("mine")
    outcome = run("fit", lab / "walk.c3d", "--static", lab / "static.c3d", "--sex", "male", "-o", lab / "taken")
    assert outcome.status == 2
    assert "taken: is a file" in outcome.err
    assert (lab / "taken").read_text() == "mine"


def test_names_with_brackets_are_printed_as_they_are(lab):
    (lab / "walk[bold]x[red].trc").write_bytes(b"")
    refusal = refused(lab, "walk[bold]x[red].trc", **COMMAND)
    expect_found(refusal, "F104", {"file": "walk[bold]x[red].trc"})
    assert "walk[bold]x[red].trc: " in refusal.message


@pytest.mark.parametrize(
    "arguments", [("fit",), ("fit", "a.trc", "--mass", "heavy"), ("fit", "a.trc", "--no-such"), ("no-such",)]
)
def test_usage_errors(arguments):
    outcome = run(*arguments)
    assert outcome.status == 2
    assert "Traceback" not in outcome.err
    assert "Usage: kinertia" in outcome.err


def test_a_file_stands_for_its_folder_in_a_draft(c3d_lab, tmp_path):
    shutil.copyfile(c3d_lab / "walk.c3d", tmp_path / "walk.c3d")
    outcome = run("init", tmp_path / "walk.c3d")
    assert outcome.status == 0, outcome.err
    assert (tmp_path / "subject.toml").is_file()


def test_a_folder_that_cannot_be_written_to_gets_no_draft(tmp_path, monkeypatch):
    monkeypatch.setattr("os.access", lambda path, mode: mode != os.W_OK)
    outcome = run("init", tmp_path)
    assert outcome.status == 2
    assert "copy the files into a folder of your own" in " ".join(outcome.err.split())


@pytest.mark.parametrize("command", ["check", "fit"])
def test_a_folder_that_is_not_there_is_named_with_similar_ones(tmp_path, command):
    (tmp_path / "person01").mkdir()
    outcome = run(command, tmp_path / "persn01")
    assert outcome.status == 2
    assert "F101" in outcome.err
    assert "person01" in outcome.err
