"""What was learnt of a group comes back as it was written; files of other kinds are told."""

import re
import tomllib

import numpy as np
import pytest

from kinertia.cli.common import own_file
from kinertia.errors import FileError
from kinertia.io.subject.learnt_files import (
    PersonInstruments,
    PopulationFile,
    expect_session,
    population_text,
    read_population,
    read_session,
    session_text,
)
from refusals import refused

COVARIANCE = np.eye(10) + 0.1


def example():
    return PopulationFile(
        kinertia="0.1.0",
        people=("Zoë", 'a "b"'),
        files=("9f", "aa"),
        segments=("thigh_r",),
        mean=tuple(np.linspace(-1.0, 1.0, 10).tolist()),
        mean_sd=(0.25,) * 10,
        covariance=tuple(tuple(row) for row in COVARIANCE.tolist()),
    )


def test_it_comes_back(tmp_path):
    path = tmp_path / "population.toml"
    path.write_text(population_text(example()), encoding="utf-8")
    again = read_population(path)
    np.testing.assert_allclose(again.mean, example().mean, rtol=1e-6)
    np.testing.assert_allclose(again.covariance, COVARIANCE, rtol=1e-6)
    assert (again.people, again.files, again.segments) == (example().people, ("9f", "aa"), ("thigh_r",))
    assert "# thigh_r mass          -1.00 +- 0.25   1.05" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('people = ["Zo', 'persons = ["Zo', "people: Field required"),
        ("    [1.1, 0.1,", "    [-1.1, 0.1,", "the covariance is not positive definite"),
        ('segments = ["thigh_r"]', 'segments = ["a", "b"]', "must have 20 rows and columns for 2 segments"),
    ],
)
def test_other_files_are_refused(tmp_path, old, new, problem):
    path = tmp_path / "population.toml"
    text = population_text(example())
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with refused("F185", problem=problem):
        read_population(path)


ROW = (0.1, -2.0, 1e-17, 3.0, 1e9, 0.0, 7.0, 1.0 / 3.0, 5.0)


PERSON = PersonInstruments(
    name='O\'Neill "β"', files=("9f", "a1"), plates=("plate 1",), information=(ROW,) * 9, rhs=ROW
)


FOUND = {
    "plate 1": {"position x": (0.0182, 0.0011, "m"), "free moment": (0.001, 0.0002, "N m/N")},
    "synchronisation": {"delay": (0.01, 0.001, "s")},
}


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "instruments.toml"
    path.write_text(session_text('day "β".toml', "0.1", FOUND, [PERSON, PERSON]), encoding="utf-8")
    return path


def test_what_is_written_is_read(written):
    assert read_session(written) == (PERSON, PERSON)


def test_the_file_names_itself(written):
    commented = [
        line.removeprefix("#") for line in written.read_text(encoding="utf-8").splitlines() if line[0:1] == "#"
    ]
    assert tomllib.loads("\n".join(commented[1:3])) == {"instruments": {"session": 'day "β".toml'}}


def test_people_read_millimetres_and_milliseconds(written):
    text = written.read_text(encoding="utf-8")
    for line in (
        "position_x_mm = 18.200",
        "position_x_sd_mm = 1.100",
        "free_moment_Nm_per_kN = 1.000",
        "delay_ms = 10.000",
    ):
        assert f"\n{line}\n" in text


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('plates = ["plate 1"]', 'plates = ["plate 1", "plate 2"]', "must have 14 rows"),
        ("rhs = [0.1", 'rhs = ["0.1"', "rhs"),
        ("[[person]]", "[[people]]", "person"),
        ("kinertia = ", "x = ", "kinertia"),
    ],
)
def test_another_file_is_refused(written, old, new, problem):
    written.write_text(written.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with refused("F184", problem=problem) as caught:
        read_session(written)
    assert caught.value.line is not None


@pytest.fixture
def outdated(written):
    """A file of an earlier version, in which plates had no rotation of their own: 4 rows a plate."""
    text = written.read_text(encoding="utf-8").replace(", 0.0, 7.0", ", 7.0")
    rows = re.sub(r"( {4}\[.*\],\n)\1{8}", r"\1" * 8, text)
    written.write_text(rows, encoding="utf-8")
    return written


def test_a_file_of_an_earlier_version_is_named_and_can_be_made_again(outdated):
    with refused("F184", rows=8.0, expected=9.0) as caught:
        read_session(outdated)
    assert "earlier version of Kinertia" in caught.value.finding.evidence["problem"].value
    assert "kinertia instruments SUBJECT.toml ... -o instruments.toml" in caught.value.finding.remedy
    own_file(outdated, expect_session, "kinertia instruments")


def test_only_its_own_files_are_written_over(tmp_path):
    other = tmp_path / "subject.toml"
    other.write_text('[subject]\nname = "A"\n', encoding="utf-8")
    with pytest.raises(FileError, match="not a file that kinertia instruments wrote"):
        own_file(other, expect_session, "kinertia instruments")


def test_the_name_that_the_right_hand_side_had_is_still_read(written):
    people = read_session(written)
    written.write_text(written.read_text(encoding="utf-8").replace("rhs = [", "right = ["), encoding="utf-8")
    assert read_session(written) == people
