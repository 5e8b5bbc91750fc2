"""C3D files of many makers, and what is read from any: axes, labels, measures, times."""

import numpy as np
import pytest

from c3d_writer import plate_parameters, write_c3d
from kinertia.findings.finding import Severity
from kinertia.io.c3d.reader import read_c3d
from person_on_plate import CORNERS, SCREEN, expect_centre_of_pressure, standing, stepping
from recordings import here, is_here
from refusals import codes, only, refused

GRAVITY = 9.80665
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
@pytest.mark.measured
def test_static_trials_weigh_the_subject(file_of, subject, mass_kg, height_m):
    recording = read_c3d(file_of(f"pig_c3d/subject_{subject}_static.c3d"))
    mean = recording.plates.force[:, :, 1].sum(axis=1).mean() / GRAVITY
    assert mean == pytest.approx(mass_kg, rel=0.05)
    assert recording.mass_kg == mass_kg
    assert recording.height_m == pytest.approx(height_m)
    assert 0.05 < recording.measurements["LKneeWidth"] < 0.15
    assert all(0.01 < value < 1.2 for value in recording.measurements.values())


@pytest.mark.measured
def test_plug_in_gait_outputs_go_and_virtual_markers_stay(file_of):
    recording = read_c3d(file_of("pig_c3d/subject_a_walk.c3d"))
    labels = recording.markers.labels
    assert {"RHEE", "LFEO", "CentreOfMass"} <= set(labels)
    assert not [label for label in labels if label.endswith(("Angles", "Force", "Moment", "Power"))]
    assert recording.markers.time[0] == pytest.approx(1.52)
    assert recording.plates.time[0] == pytest.approx(1.52)
    assert recording.plates.time[-1] == pytest.approx(5.159)


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
    expect_centre_of_pressure(recording.plates)
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
    points[4:, 9] = np.nan
    labels = ["Ann:RHEE", "Ann:RTOE", "Ann:RTOE", "Ann:RASI", "Bob:RASI", "*3", "", "Ann:RKneeAngles", "Listed",
              "Ann:RTOE", "LHipForce", "CentreOfMass"]  # fmt: skip
    parameters = {"POINT": {"Y_SCREEN": ["+Z"], "SCALARS": ["Listed"]}}
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, labels, parameters=parameters))
    assert recording.markers.labels == ("RHEE", "RTOE", "RASI", "Bob:RASI", "CentreOfMass")
    toe = recording.markers.select(["RTOE"]).positions[:, 0]
    assert np.isnan(toe[3:6]).all()
    np.testing.assert_allclose(toe[0] * 1000, points[0, 2][[0, 2, 1]] * [1, 1, -1], atol=1e-3)
    counts = {
        finding.evidence["what"].value: finding.evidence["count"].value
        for finding in recording.findings
        if finding.code == "F163"
    }
    assert counts == {
        "label prefixes 'Ann:' (not those of Bob)": 5,
        "model outputs (Ann:RKneeAngles, LHipForce, Listed)": 3,
        "unnamed points": 2,
    }
    assert only(recording.findings, "F113", label="RTOE", count=3).severity is Severity.INFO
    missing = {finding.evidence["written"].value: finding for finding in recording.findings if finding.code == "F115"}
    assert {what: finding.evidence["count"].value for what, finding in missing.items()} == {
        "0 0 0": 1,
        "-9999 -9999 -9999": 2,
    }
    assert {finding.where.markers for finding in missing.values()} == {("RTOE",)}


def test_of_repeated_labels_the_one_in_most_frames_is_kept(tmp_path):
    points, _ = standing(labels=range(3))
    points[5:, 0] = np.nan
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", points, ["RTOE", "RTOE", "RASI"], parameters=SCREEN))
    toe = recording.markers.select(["RTOE"]).positions[:, 0]
    np.testing.assert_allclose(toe[0] * 1000, points[0, 1][[0, 2, 1]] * [1, 1, -1], atol=1e-3)


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


def test_a_file_of_a_mips_computer_is_whole_but_unknown(tmp_path):
    """It was called damaged, with a request of ezc3d's to open an issue on GitHub."""
    points, labels = standing()
    path = write_c3d(tmp_path / "x.c3d", points, labels, stepping(), SCREEN)
    header = bytearray(path.read_bytes())
    for at, size in ((2, 2), (4, 2), (6, 2), (8, 2), (10, 2), (12, 4), (16, 2), (18, 2), (20, 4), (300, 2)):
        header[at : at + size] = header[at : at + size][::-1]
    header[515] = 86
    path.write_bytes(bytes(header))
    with refused("F102", None, given="MIPS", expected="Intel"):
        read_c3d(path)


@pytest.mark.parametrize("file", here(["synthetic/walk.c3d", "pig_c3d/subject_b_walk.c3d"]))
def test_a_file_cut_anywhere(file_of, tmp_path, file):
    whole = file_of(file).read_bytes()
    for size in (10, 600, 20_000, 200_000, len(whole) - 20_000):
        (tmp_path / "x.c3d").write_bytes(whole[:size])
        with refused("F104", None):
            read_c3d(tmp_path / "x.c3d")


def test_modelled_markers_are_read_and_other_outputs_are_not(tmp_path):
    labels = ["LASI", "LKNE", "LKneeAngles"]
    groups = {"TYPE_GROUPS": ["ANGLES", "ANGLE", "MODELED_MARKERS", "MODELED_MARKER"], "ANGLES": ["LKneeAngles"],
              "MODELED_MARKERS": ["LKNE"]}  # fmt: skip
    path = write_c3d(tmp_path / "static.c3d", np.full((20, 3, 3), 500.0), labels, parameters={"POINT": groups})
    recording = read_c3d(path)
    assert recording.markers.labels == ("LASI", "LKNE")
    assert only(recording.findings, "F166", points="LKNE")
    assert only(recording.findings, "F163", count=1.0)
