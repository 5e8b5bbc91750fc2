"""What was learnt of a group comes back as it was written; files of other kinds are told."""

import numpy as np
import pytest

from kinertia.io.subject.population_file import PopulationFile, population_text, read_population
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
