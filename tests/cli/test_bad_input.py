"""Every kind of bad input through the command line: one line that says what, where and what to do; status 2."""

import re
import shutil

import numpy as np
import pytest

from command_line import run
from kinertia.io.sto import read_sto, write_sto
from kinertia.io.trc import read_trc, write_trc

COMMAND = {
    "forces": "walk.mot",
    "loads": "walk.xml",
    "static": "static.trc",
    "mass": "72.6",
    "height": "1.803",
    "sex": "male",
}


@pytest.fixture
def lab(tmp_path, shared_data):
    """The gait2354 walk under short names, and a C3D walk with its static trial; free to be spoiled."""
    folder = tmp_path / "lab"
    folder.mkdir()
    gait, pig = shared_data / "gait2354", shared_data / "pig_c3d"
    for source, name in (
        (gait / "subject01_walk1.trc", "walk.trc"),
        (gait / "subject01_walk1_grf.mot", "walk.mot"),
        (gait / "subject01_walk1_grf.xml", "walk.xml"),
        (gait / "subject01_static.trc", "static.trc"),
        (pig / "subject_a_walk.c3d", "walk.c3d"),
        (pig / "subject_a_static.c3d", "static.c3d"),
    ):
        shutil.copyfile(source, folder / name)
    return folder


def refused(lab, walk="walk.trc", **changes):
    """Run `kinertia fit` where it must fail; the message. The folder beside the results must stay as it was."""
    options = {**(COMMAND if walk.endswith(".trc") else {"static": "static.c3d", "sex": "male"}), **changes}
    arguments = [walk if walk.startswith("/") else lab / walk]
    for name, value in options.items():
        if value is not None:
            arguments += [f"--{name}", lab / value if name in ("forces", "loads", "static") else value]
    return complaint(lab, *arguments)


def complaint(lab, *arguments):
    outcome = run("fit", *arguments, "-o", lab.parent / "results" / "out")
    assert outcome.status == 2, outcome
    assert outcome.out == ""
    *before, last = outcome.err.splitlines()
    assert set(before) <= {"reading", "calibration", "inverse kinematics"}
    assert last.startswith("error: ")
    assert [path.name for path in lab.parent.iterdir()] == ["lab"]
    return last


def expect(message, *parts):
    for part in parts:
        assert re.search(part, message), f"{part!r} is not in {message!r}"


def spoil(path, change):
    """Rewrite a text file line by line: `change` gets the list of lines and alters it."""
    lines = path.read_text().splitlines()
    change(lines)
    path.write_text("\n".join(lines) + "\n")


def replace_in(path, old, new):
    text = path.read_text()
    assert text.count(old) >= 1, old
    path.write_text(text.replace(old, new, 1))


def edit_cell(line, column, value):
    def change(lines):
        cells = lines[line - 1].split("\t")
        cells[column] = value
        lines[line - 1] = "\t".join(cells)

    return change


@pytest.mark.parametrize(
    ("changes", "where", "advice"),
    [
        ({"walk": "walc.trc"}, r"no such file in .*lab", "did you mean 'walk.trc'"),
        ({"forces": "walc.mot"}, r"no such file in .*lab", "did you mean 'walk.mot'"),
        ({"loads": "walc.xml"}, r"no such file in .*lab", "did you mean 'walk.xml'"),
        ({"static": "statik.trc"}, r"no such file in .*lab", "did you mean 'static.trc'"),
        ({"walk": "../lab"}, "holds no subject file", "kinertia init"),
    ],
)
def test_missing_file(lab, changes, where, advice):
    expect(refused(lab, **{"walk": "walk.trc", **COMMAND, **changes}), where, advice)


def test_missing_subject_file(lab):
    expect(complaint(lab, lab / "subject.toml"), r"subject\.toml: no such file", "expected a subject file")


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


def test_xml_that_explains_no_loads(lab, shared_data):
    shutil.copyfile(shared_data / "gait2354" / "subject01_Setup_IK.xml", lab / "walk.xml")
    expect(refused(lab), r"walk\.xml", "ExternalLoads|ExternalForce")


@pytest.mark.parametrize("name", ["walk.trc", "static.trc"])
@pytest.mark.parametrize(
    ("change", "line", "what"),
    [
        (edit_cell(3, 3, "40"), r"(, line \d)?", "40"),
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
    expect(refused(lab), re.escape(str(lab / name)) + line, what, "expected|correct|export|repair")


def test_unknown_unit_in_c3d(lab):
    content = (lab / "walk.c3d").read_bytes()
    at = content.index(b"UNITS") + 5
    at = content.index(b"mm", at)
    (lab / "walk.c3d").write_bytes(content[:at] + b"qq" + content[at + 2 :])
    expect(refused(lab, "walk.c3d"), r"walk\.c3d", "qq", "expected.*mm")


def test_forces_without_the_columns_that_the_loads_file_names(lab):
    replace_in(lab / "walk.mot", "\tground_force_vx\tground_force_vy", "\tfx\tfy")
    expect(refused(lab), r"walk\.mot", "ground_force_v", r"walk\.xml", "columns")


def test_loads_file_that_names_other_columns(lab):
    replace_in(lab / "walk.xml", "ground_force_v", "plate1_force_v")
    expect(refused(lab), "plate1_force_v", r"walk\.mot", r"walk\.xml", "ground_force_vx")


def test_forces_without_overlap(lab):
    table = read_sto(lab / "walk.mot")
    table.index += 100.0
    write_sto(lab / "walk.mot", table, False, "late")
    expect(refused(lab), r"100\.0", r"2\.5", "do not overlap", "same trial")


def test_not_a_number_in_forces(lab):
    spoil(lab / "walk.mot", edit_cell(107, 2, "nan"))
    expect(refused(lab), r"walk\.mot", "ground_force_vy", r"0\.1\d", "no number", "fill")


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
    expect(complaint(lab, lab / "subject.toml"), r"subject\.toml, line 3: mass_kg", "72600")


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


def test_no_fully_measured_frame(lab, shared_data):
    """After 2.2 s of the Rajagopal walk the left foot stands on no plate."""
    walk = shared_data / "rajagopal_walk"
    write_trc(lab / "late.trc", read_trc(walk / "motion_capture_walk.trc").cut(2.2, 2.5))
    shutil.copyfile(walk / "static_walk_1.trc", lab / "static.trc")
    shutil.copyfile(walk / "grf_walk.mot", lab / "walk.mot")
    shutil.copyfile(walk / "grf_walk.xml", lab / "walk.xml")
    expect(refused(lab, "late.trc"), "trial 'late'", "measured|plate", "left|right")


def test_unloaded_plates(lab):
    table = read_sto(lab / "walk.mot")
    write_sto(lab / "walk.mot", table * 0.0, False, "nothing")
    expect(refused(lab), "trial 'walk'", "load|force|plate")


def changed_markers(path, change):
    markers = read_trc(path)
    positions = markers.positions.copy()
    change(positions, markers.labels.index)
    write_trc(path, type(markers)(markers.time, markers.labels, positions))


@pytest.mark.parametrize(
    ("one", "other"), [("R.ASIS", "L.ASIS"), ("R.Heel", "L.Heel"), ("R.Shank.Front", "L.Shank.Front")]
)
def test_markers_swapped_for_the_whole_trial(lab, one, other):
    def swap(positions, index):
        positions[:, [index(one), index(other)]] = positions[:, [index(other), index(one)]]

    changed_markers(lab / "walk.trc", swap)
    expect(refused(lab), "trial 'walk'", re.escape(one), re.escape(other), "labels")


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        ("R.Knee.Lat", "R.Knee.Med", "outer marker of the right knee is on its inner side"),
        ("L.Ankle.Lat", "L.Ankle.Med", "outer marker of the left ankle is on its inner side"),
    ],
)
def test_outer_and_inner_labels_swapped_in_the_static_trial(lab, one, other, words):
    def swap(positions, index):
        positions[:, [index(one), index(other)]] = positions[:, [index(other), index(one)]]

    changed_markers(lab / "static.trc", swap)
    expect(refused(lab), "trial 'static'", words, re.escape(one), re.escape(other), "labels look swapped|look swapped")
    assert_checked(lab, words)


def test_mirrored_axes(lab):
    for name in ("walk.trc", "static.trc"):
        changed_markers(lab / name, lambda positions, _: np.multiply(positions, [1, 1, -1], out=positions))
    expect(refused(lab), "all left and right labels are swapped, or an axis of the laboratory is mirrored", "export")


def test_static_trial_of_another_person(lab):
    changed_markers(lab / "static.trc", lambda positions, _: np.multiply(positions, 1.1, out=positions))
    expect(refused(lab), "trial 'walk'", "9 % shorter than in the static trial", "another person")
    assert_checked(lab, "another person")


def test_spikes(lab):
    def spike(positions, index):
        positions[5::20, index("R.Heel"), 1] += 0.3

    changed_markers(lab / "walk.trc", spike)
    expect(refused(lab), "trial 'walk'", "spikes", r"R\.Heel", r"30\d mm", "delete")
    assert_checked(lab, "spikes")


def changed_forces(path, change):
    table = read_sto(path)
    change(table)
    write_sto(path, table, False, "changed")


@pytest.mark.parametrize(
    ("columns", "factor", "words"),
    [
        ("_vx", -1.0, "the horizontal force along X has the wrong sign"),
        ("_vz", -1.0, "the horizontal force along Z has the wrong sign"),
        ("_v[xz]", -1.0, "the forces are turned by 180 degrees about the vertical"),
        ("torque", 1000.0, "they are in N mm"),
    ],
)
def test_forces_that_do_not_belong_to_the_motion(lab, columns, factor, words):
    def change(table):
        table.loc[:, [name for name in table.columns if re.search(columns, name)]] *= factor

    changed_forces(lab / "walk.mot", change)
    expect(refused(lab), "trial 'walk'", words, "export")
    assert_checked(lab, words)


def assert_checked(lab, words):
    """`kinertia check` says it, too."""
    outcome = run("check", lab / "walk.trc", lab / "walk.mot", lab / "static.trc", "--loads", lab / "walk.xml")
    assert outcome.status == 1
    assert words in " ".join(outcome.out.split())


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


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("rotations_only.c3d", ("no points", "marker")),
        pytest.param("plates_kistler_type3.c3d", ("no points", "marker"), marks=pytest.mark.slow),
        ("plates_type1.c3d", ("marker",)),
        pytest.param("bts.c3d", ("marker",), marks=pytest.mark.slow),
        ("duplicate_labels.c3d", ("marker",)),
    ],
)
def test_c3d_that_cannot_be_used(lab, shared_data, name, parts):
    shutil.copyfile(shared_data / "c3d_variety" / name, lab / name)
    expect(refused(lab, name, mass="60", height="1.7"), re.escape(name.removesuffix(".c3d")), *parts)


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
