"""What is read from subject files."""

import pytest

from kinertia.errors import FileError
from kinertia.io.subject.reader import read_subject
from kinertia.settings import Settings
from whole_subject_file import GOOD, changed, read


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
        "convention": None,
        "force_cutoff_hz": "none",
    }


def test_the_signs_of_the_report(folder):
    stated = 'hip_centre = "harrington"'
    assert read(folder, changed(stated, f'{stated}\nconvention = "isb"')).settings.convention == "isb"
    with pytest.raises(FileError, match="convention"):
        read(folder, changed(stated, f'{stated}\nconvention = "vicon"'))


def test_the_task_of_a_trial(folder):
    result = read(folder, changed('name = "second"', 'name = "second"\ntask = "turn"'))
    assert [trial.task for trial in result.trials] == [None, "turn"]
    with pytest.raises(FileError, match="task"):
        read(folder, changed('name = "second"', 'task = "dance"'))


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
        "convention": None,
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


def test_result_is_frozen(folder):
    with pytest.raises(ValueError, match="frozen"):
        read(folder, GOOD).settings.symmetry = True
