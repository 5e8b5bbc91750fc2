"""What a subject file states of its recordings: the part of the static trial, plates, whose foot a load is."""

import shutil
from datetime import date

import numpy as np
import pytest

from kinertia.errors import FileError, MarkerSetError, SettingsError
from kinertia.io.subject.person_recordings import read_static, read_trial, recording_date, session_date
from kinertia.io.subject.reader import read_subject
from kinertia.io.text.trc import write_trc
from kinertia.trial.data import Markers
from refusals import refused
from walk_on_plates import walk

COLUMNS = [f"{plate}_{kind}{axis}" for plate in "ab" for kind in ("force_v", "force_p", "moment_") for axis in "xyz"]


@pytest.fixture
def folder(tmp_path):
    """A static trial of 3 s, and a walk with the steps of two feet on plates a and b."""
    recording = walk([("r", 0), ("l", 0)], duration_s=1.5)
    write_trc(tmp_path / "walk.trc", recording.markers)
    still = np.tile(recording.markers.positions[:1], (300, 1, 1))
    write_trc(tmp_path / "static.trc", Markers(np.arange(300) / 100, recording.markers.labels, still))
    plates = recording.plates
    point = np.zeros((len(plates.time), 3))
    columns = [part for p in range(2) for part in (plates.force[:, p], point, plates.moment[:, p])]
    rows = np.column_stack([plates.time, *columns])
    header = ["grf", f"nRows={len(rows)}", f"nColumns={rows.shape[1]}", "endheader", "\t".join(["time", *COLUMNS])]
    text = "\n".join([*header, *("\t".join(f"{value:.6f}" for value in row) for row in rows)])
    (tmp_path / "walk.mot").write_text(text, encoding="utf-8")
    return tmp_path


def subject(folder, model="", trial="", instruments=""):
    path = folder / "subject.toml"
    path.write_text(
        f"""[subject]
sex = "male"
mass_kg = 75.0
height_m = 1.8
[model]
static = "static.trc"
{model}
[[trial]]
markers = "walk.trc"
forces = "walk.mot"
{trial}
[instruments]
{instruments}
""",
        encoding="utf-8",
    )
    return read_subject(path, to_fit=False)


def test_a_window_of_the_static_trial_is_all_that_is_read_of_it(folder):
    static = read_static(subject(folder, model="window_s = [1.0, 1.5]"))
    assert (static.markers.time[0], static.markers.time[-1]) == (pytest.approx(1.0), pytest.approx(1.5))


def test_a_window_outside_the_static_trial_is_refused(folder):
    with pytest.raises(SettingsError, match=r"from 0\.00 to 2\.99 s"):
        read_static(subject(folder, model="window_s = [4.0, 5.0]"))


def test_plates_that_are_named_are_used_and_no_others(folder):
    wanted = subject(folder, instruments='plates = ["b_force"]')
    assert read_trial(wanted, wanted.trials[0]).recording.plates.names == ("b_force",)


def test_stated_feet_reach_the_recording(folder):
    line = 'feet = [{ plate = "a_force", foot = "left", window_s = [0.1, 0.8] }, { plate = "b_force", foot = "none" }]'
    wanted = subject(folder, trial=line)
    stated = read_trial(wanted, wanted.trials[0]).recording.stated_contacts
    assert [(contact.plate, contact.foot, contact.span_s) for contact in stated] == [
        ("a_force", 1, (0.1, 0.8)),
        ("b_force", None, (-np.inf, np.inf)),
    ]


@pytest.mark.parametrize(
    ("entries", "missing"),
    [({"instruments": 'plates = ["a_force", "c"]'}, "c"), ({"trial": 'feet = [{ plate = "d", foot = "left" }]'}, "d")],
)
def test_a_plate_that_is_not_there_is_refused_with_those_that_are(folder, entries, missing):
    wanted = subject(folder, **entries)
    with pytest.raises(SettingsError, match=rf"no '{missing}'; its plates are .*b_force"):
        read_trial(wanted, wanted.trials[0])


@pytest.mark.parametrize("feet", ['"left"', "[]", '[{ plate = "a_force", foot = "links" }]', '[{ foot = "left" }]'])
def test_feet_in_another_form_are_refused(folder, feet):
    with refused("F191"):
        subject(folder, trial=f"feet = {feet}")


@pytest.mark.measured
def test_a_c3d_file_that_says_it(file_of):
    assert recording_date(file_of("c3d_variety/bts.c3d")) == date(2019, 5, 24)


def test_files_that_say_it_and_files_that_do_not(c3d_lab, tmp_path):
    assert recording_date(c3d_lab / "walk.c3d") is None
    (tmp_path / "walk.tsv").write_text("NO_OF_FRAMES\t2\nTIME_STAMP\t2024-02-29, 15:21:26.000\t1.5\n", encoding="utf-8")
    assert recording_date(tmp_path / "walk.tsv") == date(2024, 2, 29)
    (tmp_path / "bad.tsv").write_text("TIME_STAMP\t2024-02-31, 15:21:26.000\t1.5\n", encoding="utf-8")
    assert recording_date(tmp_path / "bad.tsv") is None
    (tmp_path / "broken.c3d").write_bytes(b"\x02\x50")
    assert recording_date(tmp_path / "broken.c3d") is None
    assert recording_date(tmp_path / "none.c3d") is None


def test_what_the_subject_file_states_goes_first(c3d_lab, tmp_path):
    text = (c3d_lab / "subject.toml").read_text(encoding="utf-8")
    for name in ("static.c3d", "walk.c3d"):
        text = text.replace(f'"{name}"', f'"{(c3d_lab / name).as_posix()}"')
    path = tmp_path / "subject.toml"
    path.write_text(text + "\n[instruments]\ndate = 2026-05-03\n", encoding="utf-8")
    assert session_date(read_subject(path)) == date(2026, 5, 3)
    path.write_text(text + "\n[instruments]\ndate = 3.5\n", encoding="utf-8")
    with pytest.raises(FileError, match="date"):
        read_subject(path)


def test_markers_that_a_trial_leaves_out_are_not_read_and_unknown_ones_are_refused(tmp_path, c3d_lab):
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(c3d_lab / name, tmp_path / name)
    path, text = tmp_path / "subject.toml", (c3d_lab / "subject.toml").read_text()
    path.write_text(text)
    wanted = read_subject(path)
    labels = read_trial(wanted, wanted.trials[0]).recording.markers.labels
    path.write_text(f'{text}leave_out = ["{labels[0]}"]\n')
    wanted = read_subject(path)
    assert read_trial(wanted, wanted.trials[0]).recording.markers.labels == labels[1:]
    path.write_text(f'{text}leave_out = ["NOBODY"]\n')
    wanted = read_subject(path)
    with pytest.raises(MarkerSetError) as raised:
        read_trial(wanted, wanted.trials[0])
    assert raised.value.finding.code == "L104"
