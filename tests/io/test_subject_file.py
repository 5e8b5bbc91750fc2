import os
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinertia.errors import FileError
from kinertia.io.subject_file import SubjectFile, read_subject
from kinertia.io.toml_lines import TomlFile
from kinertia.settings import Settings, Subject

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
        "joint_axes": False,
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
        "joint_axes": False,
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
    with pytest.raises(FileError, match=rf"unknown key 'zzz' in \[{table}\]; known: "):
        read(folder, text)


def test_a_segment_is_a_table_of_its_own(folder):
    with pytest.raises(FileError, match=r"under a heading like \[segment.thigh_r\]"):
        read(folder, f"{GOOD}\n[segment]\nthigh_r = 8.9\n")
    with pytest.raises(FileError, match=r"mass_kg = 8.9: must be a value with its standard deviation in quotes"):
        read(folder, f"{GOOD}\n[segment.thigh_r]\nmass_kg = 8.9\n")
    known = read(folder, f'{GOOD}\n[segment.thigh_r]\nmass_kg = "8.9 ± 0.4"\nsource = "DXA"\n').segments
    assert known["thigh_r"].parameters() == {"mass": (8.9, 0.4)}


def test_result_is_frozen(folder):
    with pytest.raises(ValueError, match="frozen"):
        read(folder, GOOD).settings.symmetry = True


CASES = [
    ("mass_kg = 61.5", "mass = 61.5", 3, "unknown key 'mass' in [subject]; did you mean 'mass_kg'?"),
    ("mass_kg = 61.5", "zzz = 1", 3, "unknown key 'zzz' in [subject]; known: name, sex, mass_kg, height_m"),
    ("[settings]", "[setings]", 20, "unknown key 'setings'; did you mean 'settings'?"),
    ("cutoff_hz = 6", "cut_off_hz = 6", 23, "did you mean 'cutoff_hz'?"),
    ("loads =", "load =", 13, "unknown key 'load' in [trial]; did you mean 'loads'?"),
    ('sex = "female"\n', "", 1, "[subject] lacks 'sex'"),
    ('markers = "data/walk2.c3d"\n', "", 16, "[trial] lacks 'markers'"),
    ('sex = "female"', 'sex = "x"', 2, 'sex = "x": must be "male" or "female"'),
    ('bsp = "deleva"', 'bsp = "leva"', 21, 'must be "dumas" or "deleva"'),
    ("symmetry = false", 'symmetry = "no"', 22, 'symmetry = "no"'),
    ("cutoff_hz = 6", "cutoff_hz = 0", 23, 'must be "gcv" or a positive frequency in Hz'),
    ("cutoff_hz = 6", 'cutoff_hz = "6"', 23, 'must be "gcv" or a positive frequency in Hz'),
    ('force_cutoff_hz = "none"', 'force_cutoff_hz = "raw"', 25, 'must be "auto", "none" or a positive frequency in Hz'),
    ("cutoff_hz = 6", "cutoff_hz = true", 23, 'must be "gcv" or a positive frequency in Hz'),
    ("window_s = [0.4, 2]", "belt_speed_m_s = { right = 1.2 }", 14, "of two belts { right = 1.2, left = 0.6 }"),
    ("window_s = [0.4, 2]", "belt_speed_m_s = { right = 1.2, left = 25 }", 14, "of two belts"),
    ("window_s = [0.4, 2]", "belt_speed_m_s = 25", 14, "belt_speed_m_s = 25: must be the speed of a treadmill"),
    ("[0.4, 2]", "[2, 0.4]", 14, "window_s = [2, 0.4]: must be [start, end] in seconds"),
    ("[0.4, 2]", "[2]", 14, "must be [start, end] in seconds"),
    ("mass_kg = 61.5", 'mass_kg = "61.5"', 3, "must be a valid number; write it without quotes: 61.5"),
    ("mass_kg = 61.5", 'mass_kg = "61,5"', 3, "must be a valid number; write it without quotes: 61.5"),
    ("mass_kg = 61.5", "mass_kg = 61500", 3, "grams"),
    ("mass_kg = 61.5", "mass_kg = nan", 3, "mass_kg"),
    ("height_m = 1.68", "height_m = 168", 4, "centimetres"),
    ('"static.trc"', '"sttaic.trc"', 7, "did you mean 'static.trc'?"),
    ('"static.trc"', "7", 7, "static = 7: must be a path in quotes"),
    ('"plug-in-gait"', '"plugin"', 8, "'opencap', 'opencap-mocap', 'plug-in-gait', 'plug-in-gait-lower-body'"),
    ('name = "second"', 'name = "walk1"', 18, "trial 'walk1' is there already"),
    ('name = "second"', 'name = ""', 18, "must be a name that a folder can have"),
    ('name = "second"', 'name = "../second"', 18, "must be a name that a folder can have"),
    ('name = "second"', 'name = "nul"', 18, 'name = "nul": must be a name that a folder can have on every system'),
    ('name = "second"', 'name = "walk: 2"', 18, "must be a name that a folder can have on every system"),
    ('name = "second"', 'name = "Walk1"', 18, "trial 'walk1' is there already; Windows and macOS"),
    ('"data/walk2.c3d"', '"data"', 17, "data is a folder; give a file"),
    ('sex = "female"', "sex = female", 2, "put text in quotes"),
    ("height_m = 1.68", "height_m = 1.68\nheight_m = 1.7", 5, "not valid TOML"),
    ('"data/walk1.mot"', '"C:\\walk1.mot"', 12, "write paths with /"),
    ('"data/walk1.mot"', '"C:\\Users\\a.mot"', 12, "write paths with /"),
    ('"data/walk1.mot"', '"C:\\trials\\new.mot"', 12, "write / instead of"),
    pytest.param('"data/walk1.mot"', '"C:/a.mot"', 12, "is on drive C: of Windows", marks=elsewhere),
    pytest.param('"data/walk1.mot"', "'C:\\data\\a.mot'", 12, "is on drive C: of Windows", marks=elsewhere),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), CASES)
def test_errors_name_the_line(folder, old, new, line, message):
    with pytest.raises(FileError) as caught:
        read(folder, changed(old, new))
    assert caught.value.line == line
    assert message in caught.value.problem
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", 1, "there is no heading"),
        (GOOD[: GOOD.index("[model]")], 6, "there is no heading [[trial]]"),
        ("subject = 3\n" + GOOD[GOOD.index("[model]") :], 1, "heading [subject]"),
        (re.sub(r"\[\[trial\]\](.|\n)*\[\[trial\]\]", "[trial]", GOOD), 10, "[[trial]], in double brackets"),
        (
            "trial = []\n" + re.sub(r"\[\[trial\]\](.|\n)*\[settings", "[settings", GOOD),
            1,
            "[[trial]], in double",
        ),
        (GOOD + "[settings", 26, "not valid TOML"),
    ],
)
def test_errors_of_the_whole(folder, text, line, message):
    with pytest.raises(FileError) as caught:
        read(folder, text)
    assert message in caught.value.problem
    assert caught.value.line == line


@pytest.mark.parametrize("name", ["x" * 300, "a/" * 3000, "x" * 300 + "/walk.trc"])
def test_names_longer_than_the_system_allows_are_no_files(folder, name):
    with pytest.raises(FileError, match="no such file"):
        read(folder, changed('"static.trc"', f'"{name}"'))


def test_brackets_within_brackets(folder):
    with pytest.raises(FileError, match="brackets within brackets"):
        read(folder, changed('"static.trc"', "[" * 5000))


def test_file_that_is_not_text_or_not_there(folder):
    (folder / "subject.toml").write_bytes(b"[subject]\nname = '\xff'\n")
    with pytest.raises(FileError, match="UTF-8") as caught:
        read_subject(folder / "subject.toml")
    assert caught.value.line == 2
    with pytest.raises(FileError, match="no such file"):
        read_subject(folder / "nothing.toml")
    with pytest.raises(FileError, match="no such file"):
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
    ("old", "new", "line", "message"),
    [
        ("osim = ", 'static = "static.trc"\nosim = ', 5, "[model] has both osim and static"),
        ("osim = ", 'markers = "plug-in-gait"\nosim = ', 5, "[model] has both osim and markers"),
        ('osim = "scaled.osim"', "", 4, "[model] lacks 'static'"),
        ('osim = "scaled.osim"', 'static = "static.trc"', 1, "[subject] lacks 'sex'"),
        ("[[trial]]", '[settings]\nmethod = "two-level"\n[[trial]]', 8, "works on the built-in model only"),
        ('osim = "scaled.osim"', 'osim = "scald.osim"', 5, "did you mean 'scaled.osim'?"),
    ],
)
def test_what_does_not_go_with_an_opensim_model(folder, old, new, line, message):
    (folder / "scaled.osim").touch()
    with pytest.raises(FileError, match=re.escape(message)) as error:
        read(folder, OWN.replace(old, new))
    assert error.value.line == line


def test_calibration_is_of_opensim_models(folder):
    with pytest.raises(FileError, match="calibrate goes with osim") as error:
        read(folder, changed('markers = "plug-in-gait"', "calibrate = true"))
    assert error.value.line == 8


@pytest.mark.parametrize(("written", "meant"), [("f", "female"), ("F", "female"), ("Female", "female"), ("m", "male")])
def test_sex_may_be_abbreviated(written, meant):
    assert Subject(name="A", sex=written).sex == meant
