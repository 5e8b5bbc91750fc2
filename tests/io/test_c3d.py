import numpy as np
import pytest

from c3d_writer import plate_parameters, write_c3d
from kinertia.findings.finding import Severity
from kinertia.io.c3d import read_c3d
from kinertia.io.c3d_plates import lab_plates
from kinertia.io.ezc3d_library import read_content
from recordings import here, is_here
from refusals import codes, only, refused

GRAVITY = 9.80665
CORNERS = np.array([[[0, 500, 0], [500, 500, 0], [500, 0, 0], [0, 0, 0]]], float)  # mm, type 2: z down
SCREEN = {"POINT": {"Y_SCREEN": ["+Z"]}}


def standing(n=20, labels=("RHEE", "RTOE", "RASI", "RFHD")):
    """Points (n, m, 3) mm of somebody upright over the plate, Z up."""
    height = np.linspace(30, 1700, len(labels))
    points = np.column_stack(
        (np.full(len(labels), 250.0) + 20 * np.arange(len(labels)), np.full(len(labels), 240.0), height)
    )
    return np.tile(points, (n, 1, 1)), list(labels)


def stepping(n=20, per_frame=10, vertical=-600.0):
    """Analogs (n * s, 6) N, N mm of a constant load at (300, 200) mm, in plate axes (-X, Y, down)."""
    force = np.array([-30.0, 20.0, vertical])
    point = np.array([-(300 - 250), 200 - 250, 20.0]) * [1, 1, -1]  # from the transducer 20 mm below the surface
    return np.tile(np.concatenate((force, np.cross(point, force))), (n * per_frame, 1))


def expect_centre_of_pressure(plates, x, z, force):
    np.testing.assert_allclose(plates.force[:, 0], np.tile(force, (len(plates.time), 1)), atol=1e-4)
    np.testing.assert_allclose(
        plates.moment[:, 0], np.tile(np.cross((x, 0, z), force), (len(plates.time), 1)), atol=1e-3
    )


VARIETY = {
    "synthetic/walk.c3d": (270, 35, 2),
    "c3d_variety/bts.c3d": (675, 22, 6),
    "c3d_variety/duplicate_labels.c3d": (1050, 22, 0),
    "c3d_variety/ist.c3d": (134, 24, 2),
    "c3d_variety/motion_analysis_walk.c3d": (151, 37, 2),
    "c3d_variety/plates_kistler_type3.c3d": "F164",
    "c3d_variety/plates_type1.c3d": (634, 22, 1),
    "c3d_variety/rotations_only.c3d": (340, 36, 0),
    "c3d_variety/subject_prefixed_labels.c3d": (333, 86, 2),
}


LARGE = ("c3d_variety/bts.c3d", "c3d_variety/plates_kistler_type3.c3d")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LARGE)) for name in here(VARIETY)]
)
def test_every_maker(file_of, name):
    expected, path = VARIETY[name], file_of(name)
    if isinstance(expected, str):
        with refused(expected):
            read_c3d(path)
        return
    recording = read_c3d(path)
    frames, count, plates = expected
    assert recording.markers.positions.shape == (frames, count, 3)
    assert (0 if recording.plates is None else len(recording.plates.names)) == plates
    seen = recording.markers.positions[np.isfinite(recording.markers.positions).all(axis=2)]
    assert 0.7 < np.percentile(seen[:, 1], 99) < 2.0, "Y is up and metres"


def centres_of_pressure(plates, p, threshold_n=100.0):
    """(k,) s, (k, 3) m, (k,) N m: time, centre of pressure in the plate's plane and free moment about the
    vertical."""
    loaded = plates.force[:, p, 1] > threshold_n
    force, moment = plates.force[loaded, p], plates.moment[loaded, p]
    height = plates.corners[p, :, 1].mean()
    x = (moment[:, 2] + height * force[:, 0]) / force[:, 1]
    z = (height * force[:, 2] - moment[:, 0]) / force[:, 1]
    point = np.column_stack((x, np.full_like(x, height), z))
    return plates.time[loaded], point, (moment - np.cross(point, force))[:, 1]


WALKS = ["synthetic/walk", "pig_c3d/subject_a_walk", "pig_c3d/subject_b_walk", "c3d_variety/ist", "c3d_variety/bts",
         "c3d_variety/motion_analysis_walk", "c3d_variety/subject_prefixed_labels"]  # fmt: skip


@pytest.mark.parametrize("name", [name for name in WALKS if is_here(f"{name}.c3d")])
def test_centre_of_pressure_lies_within_the_corners(file_of, name):
    plates = read_c3d(file_of(f"{name}.c3d")).plates
    for p in range(len(plates.names)):
        _, point, free_moment = centres_of_pressure(plates, p)
        low, high = plates.corners[p].min(axis=0), plates.corners[p].max(axis=0)
        assert (point[:, [0, 2]] > low[[0, 2]] - 0.02).all()
        assert (point[:, [0, 2]] < high[[0, 2]] + 0.02).all()
        assert (np.abs(free_moment) < 20).all()
        assert plates.force[:, p, 1].min() >= 0


FEET = {
    "synthetic/walk.c3d": ("R", "L"),
    "pig_c3d/subject_a_walk.c3d": ("L", "R"),
    "pig_c3d/subject_b_walk.c3d": ("R", "L"),
}
"""By file: whose foot is on the first plate, and on the second."""


@pytest.mark.parametrize("file", here(FEET))
def test_centre_of_pressure_runs_under_the_stance_foot(file_of, file):
    recording = read_c3d(file_of(file))
    for p, side in enumerate(FEET[file]):
        time, point, _ = centres_of_pressure(recording.plates, p, 200.0)
        heel, toe = recording.markers.select([f"{side}HEE", f"{side}TOE"]).positions.swapaxes(0, 1)
        middle = np.column_stack(
            [np.interp(time, recording.markers.time, (heel + toe)[:, axis] / 2) for axis in (0, 2)]
        )
        assert np.median(np.linalg.norm(point[:, [0, 2]] - middle, axis=1)) < 0.12


@pytest.mark.parametrize("file", here(FEET))
def test_force_on_the_person_brakes_then_drives(file_of, file):
    recording = read_c3d(file_of(file))
    pelvis = recording.markers.select(["LASI"]).positions[:, 0]
    forward = pelvis[-1] - pelvis[0]
    for p in range(2):
        along = recording.plates.force[:, p] @ (forward / np.linalg.norm(forward))
        when = np.flatnonzero(recording.plates.force[:, p, 1] > 100)
        early, late = np.array_split(when, 2)
        assert along[early].mean() < -10
        assert along[late].mean() > 10


@pytest.mark.parametrize(("subject", "mass_kg", "height_m"), [("a", 41.5, 1.61), ("b", 47.5, 1.505)])
def test_static_trials_weigh_the_subject(file_of, subject, mass_kg, height_m):
    recording = read_c3d(file_of(f"pig_c3d/subject_{subject}_static.c3d"))
    mean = recording.plates.force[:, :, 1].sum(axis=1).mean() / GRAVITY
    assert mean == pytest.approx(mass_kg, rel=0.05)
    assert recording.mass_kg == mass_kg
    assert recording.height_m == pytest.approx(height_m)
    assert 0.05 < recording.measurements["LKneeWidth"] < 0.15
    assert all(0.01 < value < 1.2 for value in recording.measurements.values())


def test_plug_in_gait_outputs_go_and_virtual_markers_stay(file_of):
    recording = read_c3d(file_of("pig_c3d/subject_a_walk.c3d"))
    labels = recording.markers.labels
    assert {"RHEE", "LFEO", "CentreOfMass"} <= set(labels)
    assert not [label for label in labels if label.endswith(("Angles", "Force", "Moment", "Power"))]
    assert recording.markers.time[0] == pytest.approx(1.52)
    assert recording.plates.time[0] == pytest.approx(1.52)
    assert recording.plates.time[-1] == pytest.approx(5.159)


def test_load_about_the_ground_origin(tmp_path):
    points, labels = standing()
    path = write_c3d(
        tmp_path / "x.c3d", points, labels, stepping(), {**SCREEN, "FORCE_PLATFORM": plate_parameters(CORNERS)}
    )
    recording = read_c3d(path)
    assert codes(recording.findings) == ["F133"]
    only(recording.findings, "F133", axis="+Z")
    np.testing.assert_allclose(recording.markers.positions[0, 0], [0.25, 0.03, -0.24], atol=1e-6)
    expect_centre_of_pressure(recording.plates, 0.3, -0.2, [30, 600, -20])
    np.testing.assert_allclose(recording.plates.time[:3], [0, 0.001, 0.002])
    np.testing.assert_allclose(recording.plates.corners[0, 0], [0, 0, -0.5], atol=1e-6)


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_units(tmp_path, unit):
    size = {"m": 1000, "cm": 10, "mm": 1}[unit]
    points, labels = standing()
    analogs = stepping() / [1, 1, 1, size, size, size]
    plate = plate_parameters(CORNERS / size, origin_z=-20 / size)
    path = write_c3d(tmp_path / "x.c3d", points / size, labels, analogs, {**SCREEN, "FORCE_PLATFORM": plate}, unit=unit)
    recording = read_c3d(path)
    np.testing.assert_allclose(recording.markers.positions[0, 0], [0.25, 0.03, -0.24], atol=1e-6)
    expect_centre_of_pressure(recording.plates, 0.3, -0.2, [30, 600, -20])


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_plates_of_a_file_whose_length_unit_is_inferred(tmp_path, unit):
    size = {"m": 1000, "cm": 10, "mm": 1}[unit]
    points, labels = standing()
    analogs = stepping() / [1, 1, 1, size, size, size]
    plate = plate_parameters(CORNERS / size, origin_z=-20 / size)
    parameters = {**SCREEN, "FORCE_PLATFORM": plate}
    for said in ("", f"N{unit}"):
        path = write_c3d(tmp_path / "x.c3d", points / size, labels, analogs, parameters, unit="", moment_unit=said)
        recording = read_c3d(path)
        assert recording.length_unit == unit
        expect_centre_of_pressure(recording.plates, 0.3, -0.2, [30, 600, -20])


def test_plates_of_a_file_whose_length_unit_has_no_entry(tmp_path):
    points, labels = standing()
    parameters = {"POINT": {"Y_SCREEN": ["+Z"], "UNITS": []}, "FORCE_PLATFORM": plate_parameters(CORNERS)}
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, stepping(), parameters))
    assert recording.length_unit == "mm"
    expect_centre_of_pressure(recording.plates, 0.3, -0.2, [30, 600, -20])


def test_calibrated_plate_of_type_4(tmp_path):
    points, labels = standing()
    plate = plate_parameters(CORNERS, kind=4)
    plate["CAL_MATRIX"] = 2 * plate["CAL_MATRIX"]
    path = write_c3d(tmp_path / "x.c3d", points, labels, stepping() / 2, {**SCREEN, "FORCE_PLATFORM": plate})
    expect_centre_of_pressure(read_c3d(path).plates, 0.3, -0.2, [30, 600, -20])


SHAPES = [("USED", (1, 1)), ("TYPE", (2, 1)), ("TYPE", (1, 2)), ("CHANNEL", (6, 2, 1)), ("CORNERS", (24,))]


@pytest.mark.parametrize(("name", "shape"), SHAPES)
def test_parameters_of_plates_in_other_shapes(tmp_path, name, shape):
    points, labels = standing()
    plates = plate_parameters(np.concatenate((CORNERS, CORNERS + np.array([600, 0, 0]))))
    plates[name] = np.reshape(plates[name], shape, order="F")
    analogs = np.hstack((stepping(), stepping()))
    path = write_c3d(tmp_path / "x.c3d", points, labels, analogs, {**SCREEN, "FORCE_PLATFORM": plates})
    assert read_c3d(path).plates.names == ("plate 1", "plate 2")


@pytest.mark.parametrize(("name", "shape"), [("TYPE", ()), ("CHANNEL", (6,)), ("CORNERS", (3, 4)), ("ORIGIN", (3,))])
def test_parameters_of_one_plate_in_other_shapes(tmp_path, name, shape):
    points, labels = standing()
    plate = plate_parameters(CORNERS)
    plate[name] = np.reshape(plate[name], shape, order="F")
    path = write_c3d(tmp_path / "x.c3d", points, labels, stepping(), {**SCREEN, "FORCE_PLATFORM": plate})
    expect_centre_of_pressure(read_c3d(path).plates, 0.3, -0.2, [30, 600, -20])
    if name != "TYPE":  # ezc3d itself reads beyond too few dimensions, and now and then finds no plate
        assert np.shape(read_content(path)["parameters"]["FORCE_PLATFORM"][name]["value"])[-1] == 1


@pytest.mark.parametrize("units", [[], ["N"]])
def test_channels_without_units_are_in_those_of_the_points(tmp_path, units):
    points, labels = standing()
    parameters = {**SCREEN, "FORCE_PLATFORM": plate_parameters(CORNERS), "ANALOG": {"UNITS": units}}
    path = write_c3d(tmp_path / "x.c3d", points, labels, stepping(), parameters)
    expect_centre_of_pressure(read_c3d(path).plates, 0.3, -0.2, [30, 600, -20])
    content = read_content(path)
    del content["parameters"]["ANALOG"]
    assert lab_plates(path, content, "mm")[0].names == ("plate 1",)


def test_plate_of_type_1_tells_the_centre_of_pressure(tmp_path):
    points, labels = standing()
    analogs = np.tile([-30.0, 20, -600, -(300 - 250), 200 - 250, 4000], (200, 1))  # plate axes; free moment 4 N m down
    plate = plate_parameters(CORNERS, kind=1)
    path = write_c3d(tmp_path / "x.c3d", points, labels, analogs, {**SCREEN, "FORCE_PLATFORM": plate})
    plates = read_c3d(path).plates
    np.testing.assert_allclose(plates.force[0, 0], [30, 600, -20], atol=1e-4)
    np.testing.assert_allclose(plates.moment[0, 0], np.cross((0.3, 0, -0.2), (30, 600, -20)) - (0, 4, 0), atol=1e-3)


def test_load_on_the_plate_is_reversed(tmp_path):
    points, labels = standing()
    path = write_c3d(
        tmp_path / "x.c3d", points, labels, -stepping(), {**SCREEN, "FORCE_PLATFORM": plate_parameters(CORNERS)}
    )
    recording = read_c3d(path)
    expect_centre_of_pressure(recording.plates, 0.3, -0.2, [30, 600, -20])
    reversed_ = only(recording.findings, "F157", force_n=-600.0)
    assert (reversed_.where.plate, reversed_.severity) == ("plate 1", Severity.CORRECTED)


def test_unloaded_plate_is_zero(tmp_path):
    points, labels = standing()
    path = write_c3d(
        tmp_path / "x.c3d",
        points,
        labels,
        stepping(vertical=-18.0),
        {**SCREEN, "FORCE_PLATFORM": plate_parameters(CORNERS)},
    )
    recording = read_c3d(path)
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
    assert (sound.idle[0].subtracted, wrong.idle[0].subtracted) == (False, True)
    np.testing.assert_allclose(wrong.force, sound.force, atol=1e-3)
    np.testing.assert_allclose(wrong.moment, sound.moment, atol=1e-2)


def plates_left_out(tmp_path, plate, **arguments):
    points, labels = standing()
    path = write_c3d(tmp_path / "x.c3d", points, labels, stepping(), {**SCREEN, "FORCE_PLATFORM": plate}, **arguments)
    recording = read_c3d(path)
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
    points, labels = standing()
    analogs = stepping()
    analogs[25, 2] = np.nan
    path = write_c3d(
        tmp_path / "x.c3d", points, labels, analogs, {**SCREEN, "FORCE_PLATFORM": plate_parameters(CORNERS)}
    )
    with refused("F172", None, time_s=0.025) as caught:
        read_c3d(path)
    assert caught.value.finding.where.plate == "plate 1"


@pytest.mark.parametrize("vertical", ["+Z", "-Y", "+X", "-X", "+Y", "-Z"])
def test_vertical_axis(tmp_path, vertical):
    points, labels = standing()
    up = np.zeros(3)
    up["XYZ".index(vertical[1])] = -1 if vertical[0] == "-" else 1
    side = np.roll(up, 1)
    to_lab = np.column_stack((side, np.cross(up, side), up))  # columns: lab axes of our X, Y, Z
    path = write_c3d(tmp_path / "x.c3d", points @ to_lab.T, labels, parameters={"POINT": {"Y_SCREEN": [vertical]}})
    recording = read_c3d(path)
    np.testing.assert_allclose(recording.markers.positions[0, :, 1], points[0, :, 2] / 1000, atol=1e-6)
    assert codes(recording.findings) == ["F133"] * (vertical != "+Y")
    blind = read_c3d(write_c3d(tmp_path / "y.c3d", points @ to_lab.T, labels))
    np.testing.assert_allclose(blind.markers.positions, recording.markers.positions, atol=1e-6)
    only(blind.findings, "F131", axis=vertical, source="markers", entry="POINT:Y_SCREEN")
    gaps = np.linalg.norm(np.diff(recording.markers.positions[0], axis=0), axis=1)
    np.testing.assert_allclose(gaps, np.linalg.norm(np.diff(points[0], axis=0), axis=1) / 1000, atol=1e-6)


def test_contradicted_vertical_axis_is_noted(tmp_path):
    points, labels = standing()
    parameters = {"POINT": {"Y_SCREEN": ["+Y"]}, "FORCE_PLATFORM": plate_parameters(CORNERS)}
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, stepping(), parameters))
    wrong = only(recording.findings, "F132", stated="+Y", axis="+Z", source="forces")
    assert wrong.severity is Severity.CORRECTED
    expect_centre_of_pressure(recording.plates, 0.3, -0.2, [30, 600, -20])
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, parameters={"POINT": {"Y_SCREEN": ["+Y"]}}))
    only(recording.findings, "F132", stated="+Y", axis="+Z", source="markers")


def test_arms_spread_wider_than_tall_do_not_turn_the_lab(tmp_path):
    points, labels = standing(labels=("RHEE", "RASI", "LFIN", "RFIN"))
    points[:, 2], points[:, 3] = [-700, 240, 1300], [1100, 240, 1300]
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, parameters=SCREEN))
    assert codes(recording.findings) == ["F133"]


def test_labels(tmp_path):
    points, _ = standing(labels=range(12))
    points[:, 1] = np.nan
    points[3, 2] = 0.0
    points[4:6, 2] = -9999.0
    labels = ["Ann:RHEE", "Ann:RTOE", "Ann:RTOE", "Ann:RASI", "Bob:RASI", "*3", "", "Ann:RKneeAngles", "Listed",
              "Ann:RTOE", "LHipForce", "CentreOfMass"]  # fmt: skip
    parameters = {"POINT": {"Y_SCREEN": ["+Z"], "SCALARS": ["Listed"]}}
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, parameters=parameters))
    assert recording.markers.labels == ("RHEE", "RTOE", "RASI", "Bob:RASI", "CentreOfMass")
    toe = recording.markers.select(["RTOE"]).positions[:, 0]
    assert np.isnan(toe[3:6]).all()
    np.testing.assert_allclose(toe[0] * 1000, points[0, 2][[0, 2, 1]] * [1, 1, -1], atol=1e-3)
    counts = {
        one.evidence["what"].value: one.evidence["count"].value for one in recording.findings if one.code == "F163"
    }
    assert counts == {
        "label prefixes 'Ann:' (not those of Bob)": 5,
        "model outputs (Ann:RKneeAngles, LHipForce, Listed)": 3,
        "unnamed points": 2,
    }
    assert only(recording.findings, "F113", label="RTOE", count=3).severity is Severity.INFO
    missing = {one.evidence["written"].value: one for one in recording.findings if one.code == "F115"}
    assert {what: one.evidence["count"].value for what, one in missing.items()} == {"0 0 0": 1, "-9999 -9999 -9999": 2}
    assert {one.where.markers for one in missing.values()} == {("RTOE",)}


def test_more_than_255_labels(tmp_path):
    points = np.tile(standing(n=2)[0], (1, 70, 1))
    labels = [f"m{k}" for k in range(280)]
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, parameters=SCREEN))
    assert recording.markers.labels == tuple(labels)


@pytest.mark.parametrize(("given", "height_m"), [(1610.0, 1.61), (161.0, 1.61), (1.61, 1.61)])
def test_measurements(tmp_path, given, height_m):
    points, labels = standing()
    processing = {
        "Bodymass": 70.0,
        "Height": given,
        "LKneeWidth": given / 16.1,
        "LTibialTorsion": 0.3,
        "RLegLength": 0.0,
    }
    parameters = {**SCREEN, "PROCESSING": {key: np.array([value]) for key, value in processing.items()}}
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, parameters=parameters))
    assert recording.mass_kg == 70.0
    assert recording.height_m == pytest.approx(height_m)
    assert recording.measurements == {"LKneeWidth": pytest.approx(0.1)}
    only(recording.findings, "F124", unit={1610.0: "mm", 161.0: "cm", 1.61: "m"}[given])


def test_time_of_a_cropped_trial(tmp_path):
    points, labels = standing()
    path = write_c3d(tmp_path / "x.c3d", points, labels, stepping(), SCREEN, rate_hz=50.0, first_frame=101)
    assert read_c3d(path).markers.time[0] == pytest.approx(2.0)


def test_files_that_are_no_trial(tmp_path):
    points, labels = standing()
    path = write_c3d(tmp_path / "x.c3d", points, labels, stepping(), SCREEN)
    whole = path.read_bytes()
    for content, code, evidence in (
        (b"", "F104", {"bytes": 0}),
        (b"PathFileType\t4\n" * 100, "F103", {"kind": "C3D"}),
        (whole[:100], "F104", {"bytes": 100, "announced": 512}),
        (whole[:700], "F104", {"bytes": 700, "announced": 7104}),
        (whole[:-1], "F104", {"bytes": 7103, "announced": 7104}),
        (b"\1" + whole[1:], "F106", {"what": "block 1"}),
        (whole[:515] + b"\0" + whole[516:], "F106", {"what": "processor"}),
        (whole.replace(b"POINT", b"PAINT"), "F164", {}),
    ):
        path.write_bytes(content)
        with refused(code, None, **evidence):
            read_c3d(path)
    with refused("F101", None):
        read_c3d(tmp_path / "y.c3d")
    with refused("F121", None, unit="inch"):
        read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, unit="inch"))
    with refused("F164", None):
        read_c3d(write_c3d(tmp_path / "x.c3d", points, [f"{label}Angles" for label in labels]))
    with refused("F164", None):
        read_c3d(write_c3d(tmp_path / "x.c3d", points * np.nan, labels))


@pytest.mark.parametrize("file", here(["synthetic/walk.c3d", "pig_c3d/subject_b_walk.c3d"]))
def test_a_file_cut_anywhere(file_of, tmp_path, file):
    whole = file_of(file).read_bytes()
    for size in (10, 600, 20_000, 200_000, len(whole) - 20_000):
        (tmp_path / "x.c3d").write_bytes(whole[:size])
        with refused("F104", None):
            read_c3d(tmp_path / "x.c3d")
