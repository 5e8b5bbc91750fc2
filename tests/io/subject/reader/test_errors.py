"""Subject files that are refused: with which code, in which line."""

import os
import re

import pytest

from kinertia.errors import FileError, SettingsError
from kinertia.io.subject.reader import read_subject, subject_file_in, subject_from_options, with_settings
from kinertia.io.subject.tables import SubjectFile
from refusals import refused
from whole_subject_file import GOOD, changed, read

elsewhere = pytest.mark.skipif(os.name == "nt", reason="Windows has drives")
CASES = [
    ("mass_kg = 61.5", "mass = 61.5", 3, "F191", {"key": "mass", "entry": "[subject]", "expected": "'mass_kg'"}),
    ("mass_kg = 61.5", "zzz = 1", 3, "F191", {"value": "1", "expected": "known are name, sex, mass_kg, height_m"}),
    ("[settings]", "[setings]", 20, "F191", {"key": "setings", "expected": "'settings'"}),
    ("cutoff_hz = 6", "cut_off_hz = 6", 23, "F191", {"expected": "'cutoff_hz'"}),
    ("loads =", "load =", 13, "F191", {"entry": "'load' in [trial]", "expected": "'loads'"}),
    ('sex = "female"\n', "", 1, "F191", {"key": "sex", "entry": "[subject] lacks"}),
    ('markers = "data/walk2.c3d"\n', "", 16, "F191", {"key": "markers", "entry": "[[trial]] lacks"}),
    ('sex = "female"', 'sex = "x"', 2, "F191", {"value": '"x"', "expected": '"male" or "female"'}),
    ('bsp = "deleva"', 'bsp = "leva"', 21, "F191", {"expected": '"dumas" or "deleva"'}),
    ("symmetry = false", 'symmetry = "no"', 22, "F191", {"value": '"no"', "expected": "without quotes"}),
    ("cutoff_hz = 6", "cutoff_hz = 0", 23, "F191", {"expected": "frequency in Hz"}),
    ("cutoff_hz = 6", 'cutoff_hz = "6"', 23, "F191", {"expected": "frequency in Hz"}),
    ('force_cutoff_hz = "none"', 'force_cutoff_hz = "raw"', 25, "F191", {"expected": '"auto", "none"'}),
    ("cutoff_hz = 6", "cutoff_hz = true", 23, "F191", {"expected": "frequency in Hz"}),
    (
        "window_s = [0.4, 2]",
        "belt_speed_m_s = { right = 1.2 }",
        14,
        "F191",
        {"expected": "{right=1.2, left=0.6}"},
    ),
    ("window_s = [0.4, 2]", "belt_speed_m_s = { right = 1.2, left = 25 }", 14, "F191", {"expected": "of two belts"}),
    ("window_s = [0.4, 2]", "belt_speed_m_s = 25", 14, "F191", {"key": "belt_speed_m_s", "value": "25"}),
    ("[0.4, 2]", "[2, 0.4]", 14, "F191", {"value": "[2, 0.4]", "expected": "[start, end]"}),
    ("[0.4, 2]", "[2]", 14, "F191", {"expected": "[start, end]"}),
    ("mass_kg = 61.5", 'mass_kg = "61.5"', 3, "F191", {"expected": "without quotes: 61.5"}),
    ("mass_kg = 61.5", 'mass_kg = "61,5"', 3, "F191", {"expected": "without quotes: 61.5"}),
    ('"static.trc"', '"sttaic.trc"', 7, "F101", {"key": "static", "file": "sttaic.trc", "nearest": "static.trc"}),
    ('"static.trc"', "7", 7, "F191", {"entry": "static = 7", "expected": "in quotes"}),
    (
        '"plug-in-gait"',
        '"plugin"',
        8,
        "F101",
        {"hint": "opencap, opencap-mocap, plug-in-gait, plug-in-gait-lower-body"},
    ),
    ('name = "second"', 'name = "walk1"', 18, "F192", {"name": '"walk1"', "problem": "already"}),
    ('name = "second"', 'name = ""', 18, "F192", {"problem": "folder"}),
    ('name = "second"', 'name = "../second"', 18, "F192", {"name": '"../second"', "problem": "folder"}),
    ('name = "second"', 'name = "nul"', 18, "F192", {"name": '"nul"', "problem": "on every system"}),
    ('name = "second"', 'name = "walk: 2"', 18, "F192", {"problem": "on every system"}),
    ('name = "second"', 'name = "Walk1"', 18, "F192", {"problem": "Windows and macOS"}),
    ('"data/walk2.c3d"', '"data"', 17, "F102", {"given": "folder", "key": "markers"}),
    ('sex = "female"', "sex = female", 2, "F103", {"kind": "TOML", "expected": "in quotes"}),
    ("height_m = 1.68", "height_m = 1,68", 4, "F103", {"expected": "decimal point, not a comma: 1.68"}),
    ('sex = "female"', "sex = “female”", 2, "F103", {"kind": "TOML", "expected": "straight quotes"}),
    ("height_m = 1.68", "height_m = 1.68\nheight_m = 1.7", 5, "F103", {"kind": "TOML"}),
    ('"data/walk1.mot"', '"C:\\walk1.mot"', 12, "F103", {"expected": "with /"}),
    ('"data/walk1.mot"', '"C:\\Users\\a.mot"', 12, "F103", {"expected": "with /"}),
    ('"data/walk1.mot"', '"C:\\trials\\new.mot"', 12, "F101", {"key": "forces", "hint": "write / instead of"}),
    pytest.param('"data/walk1.mot"', '"C:/a.mot"', 12, "F101", {"hint": "drive C: of Windows"}, marks=elsewhere),
    pytest.param('"data/walk1.mot"', "'C:\\data\\a.mot'", 12, "F101", {"hint": "drive C: of"}, marks=elsewhere),
]


@pytest.mark.parametrize(("old", "new", "line", "code", "evidence"), CASES)
def test_errors_name_the_line(folder, old, new, line, code, evidence):
    with refused(code, line, **evidence) as caught:
        read(folder, changed(old, new))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("mass_kg = 61.5", "mass_kg = 61500", 3),
        ("mass_kg = 61.5", "mass_kg = nan", 3),
        ("height_m = 1.68", "height_m = 168", 4),
    ],
)
def test_implausible_body_data_are_named_with_their_line(folder, old, new, line):
    with pytest.raises(FileError) as caught:
        read(folder, changed(old, new))
    assert caught.value.line == line
    assert caught.value.finding.code in ("F191", "S102"), "its own code where the check of a body gives one"


@pytest.mark.parametrize(
    ("text", "line", "code", "evidence"),
    [
        ("", 1, "F191", {"expected": "no such heading"}),
        (GOOD[: GOOD.index("[model]")], 6, "F191", {"entry": "[[trial]]", "expected": "no such heading"}),
        ("subject = 3\n" + GOOD[GOOD.index("[model]") :], 1, "F191", {"entry": "[subject]"}),
        (
            re.sub(r"\[\[trial\]\](.|\n)*\[\[trial\]\]", "[trial]", GOOD),
            10,
            "F191",
            {"expected": "[[trial]], in double brackets"},
        ),
        (
            "trial = []\n" + re.sub(r"\[\[trial\]\](.|\n)*\[settings", "[settings", GOOD),
            1,
            "F191",
            {"expected": "[[trial]], in double"},
        ),
        (GOOD + "[settings", 26, "F103", {"kind": "TOML"}),
    ],
)
def test_errors_of_the_whole(folder, text, line, code, evidence):
    with refused(code, line, **evidence):
        read(folder, text)


def test_a_marker_set_is_no_subject_file(folder):
    path = folder / "markers.toml"
    path.write_text('name = "ours"\n[landmarks]\nasis_r = ["RASI"]\n', encoding="utf-8")
    with pytest.raises(FileError) as caught:
        read_subject(path)
    assert (caught.value.finding.code, caught.value.finding.evidence["entry"].value) == ("F191", "a marker set")


def test_forces_of_one_trial_at_least_are_used(folder):
    markers_only = re.sub(r"(\[\[trial\]\])", r'\1\nuse = "kinematics"', GOOD)
    first = markers_only[: markers_only.index("use =")].count("\n") + 1
    with refused("F191", first, key="use", expected="forces"):
        read(folder, markers_only)
    assert len(read(folder, markers_only.replace('use = "kinematics"\n', "", 1)).trials) == 2


@pytest.mark.parametrize("table", [field.alias or name for name, field in SubjectFile.model_fields.items()])
def test_unknown_key_in_every_table(folder, table):
    table = "segment.thigh_r" if table == "segment" else table
    heading = f"[[{table}]]" if table in ("trial", "attached") else f"[{table}]"
    text = GOOD if heading in GOOD else f"{GOOD}\n{heading}\n"
    text = text.replace(heading, f"{heading}\nzzz = 1", 1)
    with refused("F191", key="zzz", entry=f"in [{table}]", expected="known are"):
        read(folder, text)


def test_a_segment_is_a_table_of_its_own(folder):
    with refused("F191", expected="[segment.thigh_r]"):
        read(folder, f"{GOOD}\n[segment]\nthigh_r = 8.9\n")
    with refused("F191", entry="mass_kg = 8.9", expected="with its standard deviation in quotes"):
        read(folder, f"{GOOD}\n[segment.thigh_r]\nmass_kg = 8.9\n")
    known = read(folder, f'{GOOD}\n[segment.thigh_r]\nmass_kg = "8.9 ± 0.4"\nsource = "DXA"\n').segments
    assert known["thigh_r"].parameters() == {"mass": (8.9, 0.4)}


@pytest.mark.parametrize("name", ["x" * 300, "a/" * 3000, "x" * 300 + "/walk.trc"])
def test_names_longer_than_the_system_allows_are_no_files(folder, name):
    with refused("F101", 7, key="static"):
        read(folder, changed('"static.trc"', f'"{name}"'))


def test_brackets_within_brackets(folder):
    with refused("F103", found="brackets within brackets"):
        read(folder, changed('"static.trc"', "[" * 5000))


def test_file_that_is_not_text_or_not_there(folder):
    (folder / "subject.toml").write_bytes(b"[subject]\nname = '\xff'\n")
    with refused("F103", 2, expected="UTF-8"):
        read_subject(folder / "subject.toml")
    with refused("F101", None, file="nothing.toml", hint="subject file"):
        read_subject(folder / "nothing.toml")
    with refused("F102", None, given="folder"):
        read_subject(folder)


def test_all_that_the_subject_lacks_is_said_at_once(folder):
    """A C3D file may know mass and stature; a TRC file cannot."""
    text = '[subject]\nname = "a"\n[model]\nstatic = "static.trc"\n[[trial]]\nmarkers = "static.trc"\n'
    with refused("F191", 1, entry="[subject] lacks 'sex', 'mass_kg', 'height_m'"):
        read(folder, text)


def test_options_are_refused_with_the_same_findings(folder):
    """The command line has no file and no line."""
    content = {"subject": {"sex": "x"}, "model": {"static": str(folder / "static.trc")}, "trial": []}
    with refused("F191", error=SettingsError, key="sex", value='"x"'):
        subject_from_options({**content, "trial": [{"markers": str(folder / "data/walk1.trc")}]})
    with refused("F191", error=SettingsError, key="cutoff_hz"):
        with_settings(read(folder, GOOD), cutoff_hz=0.0)


def test_a_folder_has_one_subject_file(folder):
    with refused("F108", problem="several .toml files (my.toml, other.toml)"):
        (folder / "other.toml").touch()
        subject_file_in(folder)
    with refused("F108", problem="holds no subject file", action="kinertia init"):
        subject_file_in(folder / "data")
    (folder / "subject.toml").touch()
    assert subject_file_in(folder) == folder / "subject.toml"
