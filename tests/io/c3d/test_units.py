"""C3D files whose unit of length is stated, empty, or has to be told from the size of a person."""

import numpy as np
import pytest

from c3d_writer import plate_parameters, write_c3d
from kinertia.errors import TrialError
from kinertia.findings.finding import Severity
from kinertia.io.c3d.reader import read_c3d
from kinertia.io.recording import read_recording
from kinertia.trial.plate_assignment import assign_plates
from refusals import codes, only, refused


@pytest.mark.parametrize("unit_in_file", ["", "m", "inch"])
def test_a_stated_length_unit_goes_before_what_the_file_says(tmp_path, unit_in_file):
    person = np.random.default_rng(0).uniform((0.0, 0.0, 0.0), (0.6, 0.5, 1.8), (4, 9, 3))
    file = write_c3d(tmp_path / "x.c3d", 100.0 * person, [f"M{k}" for k in range(9)], unit=unit_in_file)
    recording = read_recording(file, length_unit="cm")
    assert recording.length_unit == "cm"
    extents = np.ptp(recording.markers.positions[..., 1], axis=1)
    np.testing.assert_allclose(extents, np.ptp(person[..., 2], axis=1), atol=1e-6)
    only(recording.findings, "F123", stated="cm", unit=f"'{unit_in_file}'")


@pytest.mark.parametrize(("unit", "metres"), [("mm", 0.001), ("cm", 0.01), ("m", 1.0)])
def test_an_empty_length_unit_is_inferred_from_the_size_of_a_person(tmp_path, unit, metres):
    person = np.random.default_rng(0).uniform((0.0, 0.0, 0.0), (0.6, 0.5, 1.8), (4, 9, 3))
    file = write_c3d(tmp_path / "x.c3d", person / metres, [f"M{k}" for k in range(9)], unit="")
    recording = read_c3d(file)
    assert recording.length_unit == unit
    np.testing.assert_allclose(
        np.ptp(recording.markers.positions[..., 1], axis=1), np.ptp(person[..., 2], axis=1), atol=1e-6
    )
    inferred = only(recording.findings, "F122", unit=unit)
    assert inferred.evidence["extent_m"].value == pytest.approx(np.ptp(person, axis=1).max(), rel=0.2)
    ant = write_c3d(tmp_path / "y.c3d", 0.1 * person, [f"M{k}" for k in range(9)], unit="")
    with refused("F121", None, what="POINT:UNITS", unit="not stated") as caught:
        read_c3d(ant)
    assert 0.1 < caught.value.finding.evidence["extent"].value < 0.2


def test_a_length_unit_is_inferred_though_no_frame_shows_every_marker(tmp_path):
    person = np.random.default_rng(0).uniform((0.0, 0.0, 0.0), (0.6, 0.5, 1.8), (40, 9, 3))
    for k in range(40):
        person[k, k % 8] = np.nan
    person[:, 8] = np.nan
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", 1000.0 * person, [f"M{k}" for k in range(9)], unit=""))
    assert recording.length_unit == "mm"


PLATE_AXES = np.array([[0.8, 0.6, 0.0], [0.6, -0.8, 0.0], [0.0, 0.0, -1.0]])
"""Columns: a turned plate's axes in the laboratory, z down."""


def on_turned_plate(path, moment_unit, per_unit, kind=2):
    """A C3D file in mm of somebody whose load acts 50 and -40 mm from the middle of a plate, along its axes; moments
    are in N mm / `per_unit`."""
    person = np.random.default_rng(0).uniform((0.0, 0.0, 0.0), (600.0, 500.0, 1800.0), (20, 9, 3))
    to_surface = np.array([12.0, -9.0, -20.0])
    force, place = np.array([-30.0, 20.0, -600.0]), np.array([50.0, -40.0, 0.0])
    load = np.concatenate((force, np.cross(place + to_surface, force) / per_unit))
    corners = np.array([[300.0, 200, 0], [-300, 200, 0], [-300, -200, 0], [300, -200, 0]]) @ PLATE_AXES.T
    plate = {**plate_parameters(corners[None], kind), "ORIGIN": to_surface[:, None]}
    parameters = {"POINT": {"Y_SCREEN": ["+Z"]}, "FORCE_PLATFORM": plate}
    labels = [f"M{k}" for k in range(9)]
    return write_c3d(path, person, labels, np.tile(load, (200, 1)), parameters, moment_unit=moment_unit)


MOMENT_UNITS = [
    ("Nm", 1e3),
    ("N-m", 1e3),
    ("Newton-meters", 1e3),
    ("newton metre", 1e3),
    ("Ncm", 10.0),
    ("Newton-Centimeter", 10.0),
    ("Nmm", 1.0),
    ("Newton-millimeters", 1.0),
    ("", 1.0),
]


@pytest.mark.parametrize(("unit", "per_unit"), MOMENT_UNITS)
def test_moments_in_another_unit_than_lengths_are_converted(tmp_path, unit, per_unit):
    recording = read_c3d(on_turned_plate(tmp_path / "x.c3d", unit, per_unit))
    x, y, _ = PLATE_AXES @ [0.05, -0.04, 0.0]
    force = recording.plates.force[:, 0]
    np.testing.assert_allclose(recording.plates.moment[:, 0], np.cross((x, 0.0, -y), force), atol=1e-3)
    assert codes(recording.findings) == [*["F152"] * (per_unit != 1.0), "F133"]
    for finding in recording.findings[:-1]:
        assert (finding.where.plate, finding.evidence["unit"].value, finding.severity) == (
            "plate 1",
            unit,
            Severity.CORRECTED,
        )


@pytest.mark.parametrize(("unit", "per_unit"), [("Nm", 1e3), ("Nmm", 1.0), ("", 1.0)])
def test_free_moments_of_type_1_in_another_unit_than_lengths_are_converted(tmp_path, unit, per_unit):
    person = np.random.default_rng(0).uniform((0.0, 0.0, 0.0), (600.0, 500.0, 1800.0), (20, 9, 3))
    load = np.array([-30.0, 20.0, -600.0, 0.0, 0.0, 4000.0 / per_unit])
    corners = np.array([[300.0, 200, 0], [-300, 200, 0], [-300, -200, 0], [300, -200, 0]]) @ PLATE_AXES.T
    parameters = {"POINT": {"Y_SCREEN": ["+Z"]}, "FORCE_PLATFORM": plate_parameters(corners[None], kind=1)}
    labels = [f"M{k}" for k in range(9)]
    path = write_c3d(tmp_path / "x.c3d", person, labels, np.tile(load, (200, 1)), parameters, moment_unit=unit)
    recording = read_c3d(path)
    np.testing.assert_allclose(recording.plates.moment[:, 0], np.tile([0.0, -4.0, 0.0], (200, 1)), atol=1e-3)
    assert codes(recording.findings) == [*["F152"] * (per_unit != 1.0), "F133"]


@pytest.mark.parametrize("per_unit", [1.0, 1e3])
def test_moments_of_type_4_have_the_unit_that_puts_the_load_on_the_plate(tmp_path, per_unit):
    """Its matrix may give the unit of its channels, or that of lengths."""
    recording = read_recording(on_turned_plate(tmp_path / "x.c3d", "Nm", per_unit, kind=4))
    x, y, _ = PLATE_AXES @ [0.05, -0.04, 0.0]
    force = recording.plates.force[:, 0]
    np.testing.assert_allclose(recording.plates.moment[:, 0], np.cross((x, 0.0, -y), force), atol=1e-3)
    assert codes(recording.findings) == [*["F152"] * (per_unit != 1.0), "F133"]


def test_a_plate_whose_moments_nobody_can_convert_is_left_out(tmp_path):
    recording = read_recording(on_turned_plate(tmp_path / "x.c3d", "Nm", 0.01, kind=4))
    assert recording.plates is None
    found = only(recording.findings, "F151", reason="in Nm while points are in mm")
    assert (found.where.plate, found.severity) == ("plate 1", Severity.WARNING)
    assert recording.left_out == (found.message,)
    with pytest.raises(TrialError) as caught:
        assign_plates(recording, {"r": ("M0",), "l": ("M1",)})
    assert caught.value.finding.code == "P271"
