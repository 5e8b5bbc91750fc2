"""Force plates of C3D files: types, units, shapes of their parameters, loads that are wrong."""

import numpy as np
import pytest

from c3d_writer import plate_parameters, write_c3d
from kinertia.findings.finding import Severity
from kinertia.io.c3d.ezc3d_library import read_content
from kinertia.io.c3d.plates import lab_plates
from kinertia.io.c3d.reader import read_c3d
from person_on_plate import CORNERS, SCREEN, expect_centre_of_pressure, plate_file, standing, stepping
from refusals import codes, only, refused


def in_unit(unit):
    """Points, labels, analogs and parameters of somebody standing on a plate, lengths in this unit."""
    size = {"m": 1000, "cm": 10, "mm": 1}[unit]
    points, labels = standing()
    plate = plate_parameters(CORNERS / size, origin_z=-20 / size)
    analogs = stepping() / [1, 1, 1, size, size, size]
    return points / size, labels, analogs, {**SCREEN, "FORCE_PLATFORM": plate}


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_load_about_the_ground_origin(tmp_path, unit):
    content = in_unit(unit)
    path = write_c3d(tmp_path / "x.c3d", *content, unit=unit)
    recording = read_c3d(path)
    assert codes(recording.findings) == ["F133"]
    only(recording.findings, "F133", axis="+Z")
    np.testing.assert_allclose(recording.markers.positions[0, 0], [0.25, 0.03, -0.24], atol=1e-6)
    expect_centre_of_pressure(recording.plates)
    np.testing.assert_allclose(recording.plates.time[:3], [0, 0.001, 0.002])
    np.testing.assert_allclose(recording.plates.corners[0, 0], [0, 0, -0.5], atol=1e-6)


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_plates_of_a_file_whose_length_unit_is_inferred(tmp_path, unit):
    content = in_unit(unit)
    for said in ("", f"N{unit}"):
        path = write_c3d(tmp_path / "x.c3d", *content, unit="", moment_unit=said)
        recording = read_c3d(path)
        assert recording.length_unit == unit
        expect_centre_of_pressure(recording.plates)


def test_plates_of_a_file_whose_length_unit_has_no_entry(tmp_path):
    points, labels = standing()
    parameters = {"POINT": {"Y_SCREEN": ["+Z"], "UNITS": []}, "FORCE_PLATFORM": plate_parameters(CORNERS)}
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, stepping(), parameters))
    assert recording.length_unit == "mm"
    expect_centre_of_pressure(recording.plates)


def test_calibrated_plate_of_type_4(tmp_path):
    plate = plate_parameters(CORNERS, kind=4)
    plate["CAL_MATRIX"] = 2 * plate["CAL_MATRIX"]
    expect_centre_of_pressure(read_c3d(plate_file(tmp_path / "x.c3d", stepping() / 2, plate)).plates)


SHAPES = [("USED", (1, 1)), ("TYPE", (2, 1)), ("TYPE", (1, 2)), ("CHANNEL", (6, 2, 1)), ("CORNERS", (24,))]


@pytest.mark.parametrize(("name", "shape"), SHAPES)
def test_parameters_of_plates_in_other_shapes(tmp_path, name, shape):
    plates = plate_parameters(np.concatenate((CORNERS, CORNERS + np.array([600, 0, 0]))))
    plates[name] = np.reshape(plates[name], shape, order="F")
    analogs = np.hstack((stepping(), stepping()))
    path = plate_file(tmp_path / "x.c3d", analogs, plates)
    assert read_c3d(path).plates.names == ("plate 1", "plate 2")


@pytest.mark.parametrize("name", ["CORNERS", "ORIGIN", "CAL_MATRIX"])
def test_lengths_and_matrices_of_plates_stored_as_integers(tmp_path, name):
    plate = plate_parameters(CORNERS, kind=4)
    plate[name] = plate[name].astype(np.int16)
    expect_centre_of_pressure(read_c3d(plate_file(tmp_path / "x.c3d", stepping(), plate)).plates)


@pytest.mark.parametrize("kind", [2, 4])
def test_integers_of_plates_stored_as_floats(tmp_path, kind):
    """As ezc3d writes them when Python adds them as lists."""
    plate = plate_parameters(CORNERS, kind)
    floats = {name: plate[name].astype(float) for name in ("USED", "TYPE", "ZERO", "CHANNEL")}
    expect_centre_of_pressure(read_c3d(plate_file(tmp_path / "x.c3d", stepping(), {**plate, **floats})).plates)


@pytest.mark.parametrize(("name", "shape"), [("TYPE", ()), ("CHANNEL", (6,)), ("CORNERS", (3, 4)), ("ORIGIN", (3,))])
def test_parameters_of_one_plate_in_other_shapes(tmp_path, name, shape):
    plate = plate_parameters(CORNERS)
    plate[name] = np.reshape(plate[name], shape, order="F")
    path = plate_file(tmp_path / "x.c3d", stepping(), plate)
    expect_centre_of_pressure(read_c3d(path).plates)
    if name != "TYPE":  # ezc3d itself reads beyond too few dimensions, and now and then finds no plate
        assert np.shape(read_content(path)["parameters"]["FORCE_PLATFORM"][name]["value"])[-1] == 1


@pytest.mark.parametrize("units", [[], ["N"]])
def test_channels_without_units_are_in_those_of_the_points(tmp_path, units):
    points, labels = standing()
    parameters = {**SCREEN, "FORCE_PLATFORM": plate_parameters(CORNERS), "ANALOG": {"UNITS": units}}
    path = write_c3d(tmp_path / "x.c3d", points, labels, stepping(), parameters)
    expect_centre_of_pressure(read_c3d(path).plates)
    content = read_content(path)
    del content["parameters"]["ANALOG"]
    assert lab_plates(path, content, "mm")[0].names == ("plate 1",)


def test_plate_of_type_1_tells_the_centre_of_pressure(tmp_path):
    analogs = np.tile([-30.0, 20, -600, -(300 - 250), 200 - 250, 4000], (200, 1))  # plate axes; free moment 4 N m down
    plates = read_c3d(plate_file(tmp_path / "x.c3d", analogs, plate_parameters(CORNERS, kind=1))).plates
    np.testing.assert_allclose(plates.force[0, 0], [30, 600, -20], atol=1e-4)
    np.testing.assert_allclose(plates.moment[0, 0], np.cross((0.3, 0, -0.2), (30, 600, -20)) - (0, 4, 0), atol=1e-3)


def test_load_on_the_plate_is_reversed(tmp_path):
    recording = read_c3d(plate_file(tmp_path / "x.c3d", -stepping()))
    expect_centre_of_pressure(recording.plates)
    reversed_ = only(recording.findings, "F157", force_n=-600.0)
    assert (reversed_.where.plate, reversed_.severity) == ("plate 1", Severity.CORRECTED)


def test_unloaded_plate_is_zero(tmp_path):
    recording = read_c3d(plate_file(tmp_path / "x.c3d", stepping(vertical=-18.0)))
    assert not recording.plates.force.any()
    assert not recording.plates.moment.any()
    assert codes(recording.findings) == ["F133"], "such an offset is examined with the recording"


def test_what_an_idle_plate_reads_is_taken_off_its_loads(tmp_path):
    points, labels = standing(n=80)
    level = np.array([2.7, -1.8, -7.0, 1500.0, 0.0, 0.0])
    steps = np.concatenate((0.0 * stepping(60), stepping(20)))
    plate = {**SCREEN, "FORCE_PLATFORM": plate_parameters(CORNERS)}
    sound, wrong = (
        read_c3d(write_c3d(tmp_path / name, points, labels, steps + more, plate)).plates
        for name, more in (("sound.c3d", 0.0 * level), ("wrong.c3d", level))
    )
    assert (sound.unloaded[0].subtracted, wrong.unloaded[0].subtracted) == (False, True)
    np.testing.assert_allclose(wrong.force, sound.force, atol=1e-3)
    np.testing.assert_allclose(wrong.moment, sound.moment, atol=1e-2)


def plates_left_out(tmp_path, plate):
    recording = read_c3d(plate_file(tmp_path / "x.c3d", stepping(), plate))
    assert recording.plates is None
    return only(recording.findings, "F151")


def test_plates_that_cannot_be_used_are_left_out(tmp_path):
    unreadable = plates_left_out(tmp_path, plate_parameters(CORNERS, kind=5))
    assert "type (5)" in unreadable.evidence["reason"].value
    assert unreadable.where.plate is None
    for size in (1e8, 0.0):
        lost = plates_left_out(tmp_path, plate_parameters(size * CORNERS))
        assert (lost.where.plate, lost.severity) == ("plate 1", Severity.WARNING)
        assert lost.evidence["edges_m"].value == pytest.approx([0.5 * size] * 4)


def test_analog_without_a_number(tmp_path):
    analogs = stepping()
    analogs[25, 2] = np.nan
    path = plate_file(tmp_path / "x.c3d", analogs)
    with refused("F172", None, time_s=0.025) as caught:
        read_c3d(path)
    assert caught.value.finding.where.plate == "plate 1"
