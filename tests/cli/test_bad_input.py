"""Every kind of bad input through the command line: one line that says what, where and what to do; status 2."""

import re
import shutil

import numpy as np
import pytest

from c3d_writer import plate_parameters, write_c3d
from command_line import run
from kinertia.io.c3d import read_c3d
from kinertia.io.sto import read_sto, write_sto
from kinertia.io.trc import read_trc, write_trc
from recordings import named_here
from spoilt_lab import COMMAND, changed_markers, complaint, edit_cell, expect, refused, replace_in, spoil


@pytest.mark.parametrize(
    ("changes", "where", "advice"),
    [
        ({"walk": "walc.trc"}, r"F101 .* in .*lab", "nearest.*walk.trc"),
        ({"forces": "walc.mot"}, r"F101 .* in .*lab", "nearest.*walk.mot"),
        ({"loads": "walc.xml"}, r"F101 .* in .*lab", "nearest.*walk.xml"),
        ({"static": "statik.trc"}, r"F101 .* in .*lab", "nearest.*static.trc"),
        ({"walk": "../lab"}, "holds no subject file", "kinertia init"),
    ],
)
def test_missing_file(lab, changes, where, advice):
    expect(refused(lab, **{"walk": "walk.trc", **COMMAND, **changes}), where, advice)


def test_missing_subject_file(lab):
    expect(complaint(lab, lab / "subject.toml"), r"subject\.toml: F101 ", "expected a subject file")


@pytest.mark.parametrize("name", ["walk.trc", "walk.mot", "walk.xml", "static.trc", "walk.c3d", "static.c3d"])
def test_empty_file(lab, name):
    (lab / name).write_bytes(b"")
    walk = "walk.c3d" if name.endswith(".c3d") else "walk.trc"
    expect(refused(lab, walk), re.escape(str(lab / name)), "empty|no element", "export|give")


@pytest.mark.parametrize("name", ["walk.trc", "walk.mot", "walk.xml", "static.trc", "walk.c3d", "static.c3d"])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.7])
def test_truncated_file(lab, name, share):
    content = (lab / name).read_bytes()
    (lab / name).write_bytes(content[: int(share * len(content))])
    walk = "walk.c3d" if name.endswith(".c3d") else "walk.trc"
    expect(refused(lab, walk), re.escape(str(lab / name)), "export|repair|give|check")


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
    expect(refused(lab, **changes), re.escape(str(lab / name)), "expected|not a")


def test_xml_that_explains_no_loads(lab):
    tool = "<InverseKinematicsTool><time_range>0 1</time_range></InverseKinematicsTool>"
    (lab / "walk.xml").write_text(f"<OpenSimDocument>{tool}</OpenSimDocument>", encoding="utf-8")
    expect(refused(lab), r"walk\.xml", "ExternalLoads|ExternalForce")


@pytest.mark.parametrize("name", ["walk.trc", "static.trc"])
@pytest.mark.parametrize(
    ("change", "line", "what"),
    [
        (edit_cell(4, 5, ""), ", line 4", r"F112 .*\d\d labels for \d+ columns"),
        (edit_cell(3, 3, "many"), ", line 3", "many"),
        (edit_cell(3, 4, "furlong"), ", line 3", "furlong.*expected.*mm"),
        (
            lambda lines: lines.__setitem__(19, lines[19].rsplit("\t", 60)[0] + "\t1.0"),
            ", line 20",
            "values|coordinates",
        ),
        (edit_cell(20, 5, "1o3.2"), ", line 20", "1o3.2.*number"),
        (edit_cell(20, 1, "0.9"), r", line 2\d", "time"),
    ],
    ids=["markers", "not a count", "unit", "short row", "not a number", "time"],
)
def test_spoiled_trc(lab, name, change, line, what):
    spoil(lab / name, change)
    expect(refused(lab), re.escape(str(lab / name)) + line, what, "(?i)expected|correct|export|repair")


def test_unknown_unit_in_c3d(lab):
    content = (lab / "walk.c3d").read_bytes()
    at = content.index(b"UNITS") + 5
    at = content.index(b"mm", at)
    (lab / "walk.c3d").write_bytes(content[:at] + b"qq" + content[at + 2 :])
    expect(refused(lab, "walk.c3d"), r"walk\.c3d", "qq", "expected.*mm")


def test_forces_without_the_columns_that_the_loads_file_names(lab):
    replace_in(lab / "walk.mot", "\t1_ground_force_vx\t1_ground_force_vy", "\tfx\tfy")
    expect(refused(lab), r"walk\.mot", "1_ground_force_v", r"walk\.xml", "columns")


def test_loads_file_that_names_other_columns(lab):
    replace_in(lab / "walk.xml", "1_ground_force_v", "plate1_force_v")
    expect(refused(lab), "plate1_force_v", r"walk\.mot", r"walk\.xml", "1_ground_force_vx")


def test_forces_without_overlap(lab):
    table = read_sto(lab / "walk.mot")
    table.index += 100.0
    write_sto(lab / "walk.mot", table, False, "late")
    expect(refused(lab), r"100\.0", r"2\.690", "do not overlap", "one trial")


def test_not_a_number_in_forces(lab):
    spoil(lab / "walk.mot", edit_cell(1507, 2, "nan"))
    expect(refused(lab), r"walk\.mot", "1_ground_force_vy", r"1\.499", "no number", "fill")


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"mass": "72600"}, ("mass_kg = 72600", "grams", "in kilograms")),
        ({"mass": "-72.6"}, ("mass_kg", "kg")),
        ({"mass": "nan"}, ("mass_kg = nan",)),
        ({"height": "180.3"}, ("height_m = 180.3", "centimetres", "in metres")),
        ({"height": "1803"}, ("height_m = 1803", "millimetres", "in metres")),
        ({"mass": None}, ("mass_kg", "--mass")),
        ({"height": None}, ("height_m", "--height")),
        ({"sex": None}, ("--sex",)),
        ({"static": None}, ("--static",)),
        ({"method": "three-level"}, ("method", "two-level")),
        ({"markers": "cleveland"}, ("cleveland", "cleveland-clinic", "plug-in-gait", "rajagopal", "rajagopal-run")),
    ],
)
def test_implausible_or_missing_option(lab, changes, parts):
    expect(refused(lab, **changes), *parts)


def test_implausible_subject_file_names_the_line(lab):
    text = '[subject]\nsex = "male"\nmass_kg = 72600.0\nheight_m = 1.803\n[model]\nstatic = "static.trc"\n'
    (lab / "subject.toml").write_text(text + '[[trial]]\nmarkers = "walk.trc"\nforces = "walk.mot"\n')
    expect(complaint(lab, lab / "subject.toml"), r"subject\.toml, line 3: ", "72600")


def test_options_beside_a_subject_file(lab):
    (lab / "subject.toml").write_text("")
    expect(complaint(lab, lab / "subject.toml", "--mass", "70"), "--mass", "put .* into it")


def without(path, *labels):
    markers = read_trc(path)
    assert set(labels) <= set(markers.labels)
    write_trc(path, markers.select([label for label in markers.labels if label not in labels]))


@pytest.mark.parametrize(
    ("label", "joint"),
    [("R.ASIS", "hip|pelvis"), ("L.Knee.Med", "knee"), ("R.Ankle.Lat", "ankle"), ("R.Elbow", "elbow")],
)
def test_static_trial_without_landmark(lab, label, joint):
    without(lab / "static.trc", label)
    expect(refused(lab, markers="cleveland-clinic"), re.escape(label), joint)


def test_static_trial_of_another_marker_set(lab):
    message = refused(lab, "walk.trc", markers="plug-in-gait")
    expect(message, "plug-in-gait|Plug-in Gait", "RASI", r"R\.ASIS")


def test_no_fully_measured_frame(lab):
    """After 2.35 s of the walk no foot stands on a plate."""
    write_trc(lab / "late.trc", read_trc(lab / "walk.trc").cut(2.35, 2.65))
    expect(refused(lab, "late.trc"), "trial 'late'", "measured|plate", "left|right")


def test_unloaded_plates(lab):
    table = read_sto(lab / "walk.mot")
    write_sto(lab / "walk.mot", table * 0.0, False, "nothing")
    expect(refused(lab), "trial 'walk'", "load|force|plate")


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
    outcome = run("fit", lab / "walk.trc", *options, "-o", lab / "out", "-v")
    assert outcome.status in (0, 1), outcome.err
    noted = " ".join(outcome.out.split())
    assert "walk: visible in no frame, left out: R.Heel" in noted


def test_segment_without_markers(lab):
    without(lab / "walk.trc", *(label for label in read_trc(lab / "walk.trc").labels if label.startswith("R.Shank")))
    expect(refused(lab), "trial 'walk'", "shank_r", r"R\.Shank\.Front", "use|give")


def test_no_marker_of_a_foot(lab):
    foot = ("R.Heel", "R.Toe", "R.Midfoot")
    without(lab / "walk.trc", *(label for label in read_trc(lab / "walk.trc").labels if label.startswith(foot)))
    expect(refused(lab), "trial 'walk'", "right foot")


def test_trial_without_forces(lab):
    expect(refused(lab, forces=None, loads=None), "walk", "force", "--forces|give")


UNUSABLE = {
    "other labels": ("marker",),
    "labels twice": ("marker",),
    "plates alone": ("no points", "marker"),
    "rotations_only": ("marker",),
    "plates_kistler_type3": ("no points", "marker"),
    "plates_type1": ("marker",),
    "bts": ("marker",),
    "duplicate_labels": ("marker",),
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
    forces = np.tile([0.0, 0.0, -600.0, 0.0, 0.0, 0.0], (10 * len(points), 1))
    corners = np.array([[[0, 500, 0], [500, 500, 0], [500, 0, 0], [0, 0, 0]]], float)
    parameters = {"POINT": {"Y_SCREEN": ["+Y"]}, "FORCE_PLATFORM": plate_parameters(corners)}
    write_c3d(path, points, labels, forces, parameters)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LARGE)) for name in AT_HAND])
def test_c3d_that_cannot_be_used(lab, file_of, name):
    if " " in name:
        write_unusable(lab / f"{name}.c3d", read_c3d(lab / "walk.c3d").markers)
    else:
        shutil.copyfile(file_of(AT_HAND[name]), lab / f"{name}.c3d")
    expect(refused(lab, f"{name}.c3d", mass="60", height="1.7"), name, *UNUSABLE[name])


def test_c3d_without_plates(lab):
    """A static trial in place of the walk: Plug-in Gait markers, and plates that nothing was read from."""
    content = (lab / "walk.c3d").read_bytes()
    at = content.index(b"FORCE_PLATFORM")
    used = content.index(b"USED", at) + 4
    # after the name: offset (2), type (1), number of dimensions (1), value
    (lab / "walk.c3d").write_bytes(content[: used + 4] + b"\0\0" + content[used + 6 :])
    expect(refused(lab, "walk.c3d"), "walk", "plate|force", "--forces|give|use")


def test_output_that_is_a_file(lab):
    (lab / "taken").write_text("mine")
    outcome = run("fit", lab / "walk.c3d", "--static", lab / "static.c3d", "--sex", "male", "-o", lab / "taken")
    assert outcome.status == 2
    expect(outcome.err, "taken: is a file", "give a folder")
    assert (lab / "taken").read_text() == "mine"


def test_names_with_brackets_are_printed_as_they_are(lab):
    (lab / "walk[bold]x[red].trc").write_bytes(b"")
    expect(refused(lab, "walk[bold]x[red].trc", **COMMAND), re.escape("walk[bold]x[red].trc: "))


@pytest.mark.parametrize(
    "arguments", [("fit",), ("fit", "a.trc", "--mass", "heavy"), ("fit", "a.trc", "--no-such"), ("no-such",)]
)
def test_usage_errors(arguments):
    outcome = run(*arguments)
    assert outcome.status == 2
    assert "Traceback" not in outcome.err
    assert "Usage: kinertia" in outcome.err
