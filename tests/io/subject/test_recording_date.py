"""The day of a recording: only where a file says so."""

from datetime import date

import pytest

from kinertia.errors import FileError
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.recording_date import recording_date, session_date


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
