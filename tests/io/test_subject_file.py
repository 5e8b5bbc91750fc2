import os
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinertia.errors import FileError, SettingsError
from kinertia.io.subject_file import STUDY_FILE, read_subject, subject_file_in, subject_from_options, with_settings
from kinertia.io.subject_tables import SubjectFile
from kinertia.io.toml_lines import TomlFile
from kinertia.settings import Overrule, Settings, Subject
from refusals import refused

elsewhere = pytest.mark.skipif(os.name == "nt", reason="Windows has drives")

GOOD = """\
[subject]
sex = "female"
mass_kg = 61.5
height_m = 1.68

[model]
static = "static.trc"
markers = "plug-in-gait"

[[trial]]
markers = "data/walk1.trc"
forces = "data/walk1.mot"   # comment
loads = "data/walk1.xml"
window_s = [0.4, 2]

[[trial]]
markers = "data/walk2.c3d"
name = "second"

[settings]
bsp = "deleva"
symmetry = false
cutoff_hz = 6
hip_centre = "harrington"
force_cutoff_hz = "none"
"""


@pytest.fixture
def folder(tmp_path):
    root = tmp_path / "anna"
    (root / "data").mkdir(parents=True)
    for name in (
        "static.trc",
        "data/walk1.trc",
        "data/walk1.mot",
        "data/walk1.xml",
        "data/walk2.c3d",
        "my.toml",
    ):
        (root / name).touch()
    return root


def read(folder, text):
    (folder / "subject.toml").write_text(text, encoding="utf-8")
    return read_subject(folder / "subject.toml")


def changed(old, new):
    assert GOOD.count(old) == 1, old
    return GOOD.replace(old, new)


def test_reads_everything(folder):
    result = read(folder, GOOD)
    assert result.subject.model_dump(exclude_none=True) == {
        "name": "anna",
        "sex": "female",
        "mass_kg": 61.5,
        "height_m": 1.68,
    }
    assert result.model.static == folder / "static.trc"
    assert result.model.markers == "plug-in-gait"
    first, second = result.trials
    assert first.name == "walk1"
    assert first.markers == folder / "data/walk1.trc"
    assert first.forces == folder / "data/walk1.mot"
    assert first.loads == folder / "data/walk1.xml"
    assert first.window_s == (0.4, 2.0)
    assert (second.name, second.forces, second.loads, second.window_s) == ("second", None, None, None)
    assert result.settings.model_dump() == {
        "method": "simultaneous",
        "bsp": "deleva",
        "symmetry": False,
        "cutoff_hz": 6.0,
        "joint_axes": None,
        "hip_centre": "harrington",
        "force_cutoff_hz": "none",
    }


def test_least_file_gets_defaults(folder):
    result = read(
        folder,
        '[subject]\nsex = "male"\n[model]\nstatic = "static.trc"\n[[trial]]\nmarkers = "data/walk2.c3d"\n',
    )
    assert (result.subject.mass_kg, result.subject.height_m, result.model.markers) == (None, None, None)
    assert result.settings == Settings()
    assert Settings().model_dump() == {
        "method": "simultaneous",
        "bsp": "dumas",
        "symmetry": True,
        "cutoff_hz": "gcv",
        "joint_axes": None,
        "hip_centre": "bell",
        "force_cutoff_hz": "auto",
    }


def test_own_marker_set_and_absolute_paths(folder):
    result = read(folder, changed('"plug-in-gait"', '"my.toml"').replace('"static.trc"', f"'{folder}/static.trc'"))
    assert result.model.markers == folder / "my.toml"
    assert result.model.static == folder / "static.trc"


def test_paths_with_the_separators_of_windows(folder):
    trial = read(folder, changed('"data/walk1.trc"', r"'data\walk1.trc'")).trials[0]
    assert trial.markers == folder / "data" / "walk1.trc"
    assert trial.name == "walk1"


def test_one_trial_needs_no_folder_of_its_own(folder):
    text = GOOD[: GOOD.index("[[trial]]")] + '[[trial]]\nmarkers = "data/walk2.c3d"\nname = "walk: 2"\n'
    assert read(folder, text).trials[0].name == "walk: 2"


def test_paths_do_not_depend_on_the_working_folder(folder, monkeypatch):
    (folder / "subject.toml").write_text(GOOD)
    monkeypatch.chdir(folder / "data")
    assert read_subject("../subject.toml").trials[0].markers == folder / "data/walk1.trc"


def test_inline_tables_and_dotted_keys(folder):
    text = (
        'subject.sex = "male"\nsubject.mass_kg = 70\nmodel = {static = "static.trc"}\n'
        'trial = [{markers = "data/walk2.c3d"}]\n'
    )
    assert read(folder, text).subject.mass_kg == 70
    for old, new, line in (("70", "70000", 2), ("walk2", "walk3", 4), ("static.trc", "nothing.trc", 3)):
        with pytest.raises(FileError) as caught:
            read(folder, text.replace(old, new))
        assert caught.value.line == line


def test_speeds_of_two_belts(folder):
    text = GOOD.replace("window_s = [0.4, 2]", "belt_speed_m_s = { right = 1.2, left = 1 }")
    assert read(folder, text).trials[0].belt_speed_m_s == (1.2, 1.0)


def test_byte_order_mark_and_windows_line_ends(folder):
    (folder / "subject.toml").write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert read_subject(folder / "subject.toml").subject.sex == "female"


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


def test_result_is_frozen(folder):
    with pytest.raises(ValueError, match="frozen"):
        read(folder, GOOD).settings.symmetry = True


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


def test_forces_of_one_trial_at_least_are_used(folder):
    markers_only = re.sub(r"(\[\[trial\]\])", r'\1\nuse = "kinematics"', GOOD)
    first = markers_only[: markers_only.index("use =")].count("\n") + 1
    with refused("F191", first, key="use", expected="forces"):
        read(folder, markers_only)
    assert len(read(folder, markers_only.replace('use = "kinematics"\n', "", 1)).trials) == 2


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


@given(
    st.lists(
        st.tuples(st.booleans(), st.lists(st.sampled_from(["a", "b-c", "d_1"]), unique=True), st.integers(0, 2)),
        max_size=6,
    )
)
def test_locator_finds_every_key(tables):
    text, expected, counts = [], {}, {}
    for number, (array, keys, blank) in enumerate(tables):
        name = "trial" if array else f"t{number}"
        place = (name, counts.setdefault(name, 0)) if array else (name,)
        counts[name] = counts.get(name, 0) + 1
        text += [""] * blank + [f"[[ {name} ]]  # x" if array else f"[{name}]"]
        expected[place] = len(text)
        for key in keys:
            text += [f"  {key} = [1,", "   2]"]
            expected[(*place, key)] = len(text) - 1
    document = TomlFile("\n".join(text), {})
    for place, line in expected.items():
        assert document.line(place) == line
    assert document.line(("nowhere", 1)) is None


OWN = """\
[subject]
mass_kg = 61.5

[model]
osim = "scaled.osim"

[[trial]]
markers = "data/walk1.trc"
"""


def test_an_opensim_model_needs_neither_static_trial_nor_sex(folder):
    (folder / "scaled.osim").touch()
    result = read(folder, OWN)
    assert result.model.osim == folder / "scaled.osim"
    assert (result.model.static, result.subject.sex, result.model.calibrate) == (None, None, False)
    assert read(folder, OWN.replace("[[trial]]", "calibrate = true\n[[trial]]")).model.calibrate


@pytest.mark.parametrize(
    ("old", "new", "line", "code", "evidence"),
    [
        ("osim = ", 'static = "static.trc"\nosim = ', 5, "F193", {"one": "osim", "other": "static"}),
        ("osim = ", 'markers = "plug-in-gait"\nosim = ', 5, "F193", {"one": "osim", "other": "markers"}),
        ('osim = "scaled.osim"', 'static = "static.trc"', 1, "F191", {"entry": "[subject] lacks 'sex'"}),
        ("[[trial]]", '[settings]\nmethod = "two-level"\n[[trial]]', 8, "F193", {"one": "two-level", "other": "osim"}),
        ('osim = "scaled.osim"', 'osim = "scald.osim"', 5, "F101", {"key": "osim", "nearest": "scaled.osim"}),
    ],
)
def test_what_does_not_go_with_an_opensim_model(folder, old, new, line, code, evidence):
    (folder / "scaled.osim").touch()
    with refused(code, line, **evidence):
        read(folder, OWN.replace(old, new))


def test_all_that_the_subject_lacks_is_said_at_once(folder):
    """A C3D file may know mass and stature; a TRC file cannot."""
    text = '[subject]\nname = "a"\n[model]\nstatic = "static.trc"\n[[trial]]\nmarkers = "static.trc"\n'
    with refused("F191", 1, entry="[subject] lacks 'sex', 'mass_kg', 'height_m'"):
        read(folder, text)


def test_calibration_is_of_opensim_models(folder):
    with refused("F193", 8, one="calibrate"):
        read(folder, changed('markers = "plug-in-gait"', "calibrate = true"))


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


OVERRULED = '[diagnostics]\nignore = ["M102", "R40"]\nwaive = ["P244"]\n'


def test_findings_are_overruled_for_person_trial_and_study(folder):
    text = GOOD.replace("[settings]", '[trial.diagnostics]\nwaive = ["P21"]\n\n[settings]')
    plain, own = read(folder, text), read(folder, text + OVERRULED)
    assert plain.diagnostics.overrule == Overrule()
    assert own.diagnostics.overrule == Overrule(waive=("P244",), ignore=("M102", "R40"))
    assert [trial.diagnostics.overrule for trial in own.trials] == [Overrule(), Overrule(waive=("P21",))]
    (folder.parent / STUDY_FILE).write_text('[diagnostics]\nignore = ["P268"]\n', encoding="utf-8")
    both = read(folder, text + OVERRULED).diagnostics.overrule
    assert both == Overrule(waive=("P244",), ignore=("P268", "M102", "R40"))
    (folder / STUDY_FILE).write_text('[diagnostics]\nwaive = ["M"]\n', encoding="utf-8")
    assert read(folder, text).diagnostics.overrule == Overrule(waive=("M",)), "the nearest one counts"
    (folder / "my.toml").unlink()
    assert subject_file_in(folder) == folder / "subject.toml"


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "expected"),
    [
        ('"M102"', '"M1O2"', 27, "ignore", "M102"),
        ('"M102"', "102", 27, "ignore", "in quotes"),
        ('["P244"]', '"P244"', 28, "waive", "list"),
        ('"P244"', '"P278"', 28, "waive", "nothing can be computed"),
        ("waive", "waives", 28, "waives", "'waive'"),
    ],
)
def test_only_codes_can_be_overruled(folder, old, new, line, key, expected):
    with refused("F191", line, key=key, expected=expected):
        read(folder, GOOD + OVERRULED.replace(old, new))
    (folder / STUDY_FILE).write_text(OVERRULED.replace(old, new), encoding="utf-8")
    with refused("F191", line - GOOD.count("\n"), key=key, expected=expected) as caught:
        read(folder, GOOD)
    assert caught.value.path.name == STUDY_FILE


def test_what_is_overruled_in_a_trial_is_found_in_its_line(folder):
    with refused("F191", 21, key="waive"):
        read(folder, GOOD.replace("[settings]", '[trial.diagnostics]\nwaive = ["X1"]\n\n[settings]'))


@pytest.mark.parametrize(("written", "meant"), [("f", "female"), ("F", "female"), ("Female", "female"), ("m", "male")])
def test_sex_may_be_abbreviated(written, meant):
    assert Subject(name="A", sex=written).sex == meant
