"""Times that were rounded when they were written are put back on the even grid that they came from."""

from pathlib import Path

import numpy as np
import pytest

from c3d_writer import plate_parameters, write_c3d
from kinertia.errors import FileError
from kinertia.io.c3d.reader import read_c3d
from kinertia.io.text.number_table import uniform_times, without_prefixes
from person_on_plate import CORNERS
from refusals import only, refused

PATH = Path("walk.mot")


@pytest.mark.parametrize(("rate_hz", "decimals"), [(2000.0, 3), (300.0, 3), (300.0, 2)])
def test_rounded_times_are_restored(rate_hz, decimals):
    true = np.arange(600) / rate_hz
    times, findings = uniform_times(PATH, true.round(decimals))
    assert [finding.code for finding in findings] == ["T102"]
    assert np.diff(times) == pytest.approx(1.0 / rate_hz, rel=1e-3)


def test_times_in_tenths_of_seconds_show_no_rate():
    with pytest.raises(FileError):
        uniform_times(PATH, (np.arange(600) / 30.0).round(1))


def test_even_times_stay_as_they_are():
    true = np.arange(600) / 1000.0
    times, findings = uniform_times(PATH, true)
    assert findings == ()
    assert times.tolist() == true.tolist()


PERSON = np.random.default_rng(0).uniform((100, 100, 0), (400, 400, 1800), (20, 9, 3))


ASIDE = np.array([0.0, 1200.0, 0.0])


def two_people(path, first, second, load_n=600.0):
    """A C3D file of Anna and Ben, of whom one may be on a plate that carries a load."""
    points = np.concatenate([PERSON + first, PERSON[::-1] + second], axis=1)
    points[5, :4] = np.nan
    labels = [f"{name}:M{k}" for name in ("Anna", "Ben") for k in range(9)]
    loads = np.tile([0.0, 0.0, -load_n, 0.0, 0.0, 0.0], (200, 1))
    loads[:50] = 0.0
    parameters = {"POINT": {"Y_SCREEN": ["+Z"]}, "FORCE_PLATFORM": plate_parameters(CORNERS)}
    return write_c3d(path, points, labels, loads, parameters), points


@pytest.mark.parametrize(("first", "second", "subject", "other"), [(0 * ASIDE, ASIDE, "Anna", "Ben"),
                                                                  (ASIDE, 0 * ASIDE, "Ben", "Anna")])  # fmt: skip
def test_the_trial_is_that_of_the_person_on_the_plates(tmp_path, first, second, subject, other):
    path, points = two_people(tmp_path / "x.c3d", first, second)
    recording = read_c3d(path)
    measured = recording.markers.select([f"M{k}" for k in range(9)]).positions
    columns = slice(0, 9) if subject == "Anna" else slice(9, 18)
    np.testing.assert_allclose(measured[..., 1], points[:, columns, 2] / 1000, atol=1e-6)
    only(recording.findings, "F163", count=9, what=f"'{subject}:' (not those of {other})")
    only(recording.findings, "F162", person=subject, people="Anna, Ben")


@pytest.mark.parametrize(("aside", "load_n"), [(0.0, 600.0), (1.0, 0.0)])
def test_people_of_whom_nobody_knows_who_is_meant(tmp_path, aside, load_n):
    path, _ = two_people(tmp_path / "x.c3d", aside * ASIDE, 0 * ASIDE, load_n)
    with refused("F161", None, people="Anna: 9, Ben: 9", count=2):
        read_c3d(path)


def test_labels_without_data_are_no_second_person(tmp_path):
    points = np.concatenate([np.full_like(PERSON, np.nan), PERSON], axis=1)
    labels = [f"{name}:M{k}" for name in ("Anna", "Ben") for k in range(9)]
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, parameters={"POINT": {"Y_SCREEN": ["+Z"]}}))
    assert np.isfinite(recording.markers.select([f"M{k}" for k in range(9)]).positions).all()


def test_a_few_markers_of_something_else_are_no_person(tmp_path):
    labels = [f"Anna:M{k}" for k in range(9)]
    names, _ = without_prefixes(tmp_path / "x.trc", ["Wand:A", "Wand:B", *labels])
    assert names == ["Wand:A", "Wand:B", *(f"M{k}" for k in range(9))]
    with refused("F161", None, people="Anna: 9, Ben: 8"):
        without_prefixes(tmp_path / "x.trc", [*(f"Ben:M{k}" for k in range(8)), *labels])


def test_forces_have_ten_samples_a_second_at_least():
    """At fewer, times are in another unit, or not of forces."""
    assert uniform_times(PATH, 0.099 * np.arange(50))[1] == ()
    with pytest.raises(FileError) as error:
        uniform_times(PATH, 0.101 * np.arange(50))
    assert error.value.finding.code == "T106"
