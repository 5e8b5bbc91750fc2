import numpy as np
import pytest

from kinertia.errors import FileError
from kinertia.findings.finding import Severity
from kinertia.io.lab_plates import ground_rotation
from kinertia.io.recording import read_recording
from kinertia.io.subject.draft import has_force_columns
from kinertia.io.text.cortex import read_cortex_forces
from kinertia.io.text.trc import write_trc
from kinertia.trial.data import Markers
from kinertia.workflow.check import files_by_name
from refusals import codes, only, refused

COLUMNS = [f"{name}{plate}" for plate in (1, 2) for name in ("FX", "FY", "FZ", "X", "Y", "Z", "MZ")]
FORCE, POINT_MM, FREE_NM = (20.0, -30.0, 700.0), (300.0, 200.0, 0.0), 4.0


def rows(count=300, sign=1.0, free_unit=1.0):
    """A step on plate 1 in the middle third, Z up; nobody on plate 2."""
    values = np.zeros((count, 14))
    values[count // 3 : 2 * count // 3, :7] = (*(sign * np.array(FORCE)), *POINT_MM, sign * FREE_NM / free_unit)
    return values


@pytest.fixture
def write(tmp_path):
    def write(values, columns=COLUMNS, rate="1000.000000", plates=2, samples=None, first=1):
        header = ["[Force Data]", f"NumberOfForcePlates={plates}", f"SampleRate={rate}"]
        header += [f"NumberOfSamples={len(values) if samples is None else samples}", "\t".join(["#Sample", *columns])]
        table = [f"{k}\t" + "\t".join(f"{v:.4f}" for v in row) for k, row in enumerate(values, start=first)]
        path = tmp_path / "walk.forces"
        path.write_text("\n".join([*header, *table, ""]), encoding="utf-8")
        return path

    return write


def expect_step(plates, turn):
    force, point = turn @ FORCE, turn @ POINT_MM / 1000
    assert plates.names == ("plate 1", "plate 2")
    assert plates.corners is None
    np.testing.assert_allclose(plates.force[150, 0], force)
    np.testing.assert_allclose(plates.moment[150, 0], np.cross(point, force) + turn @ (0, 0, FREE_NM), atol=1e-9)
    assert not plates.force[:, 1].any()
    np.testing.assert_allclose(plates.time, np.arange(300) / 1000)


def test_loads_about_the_ground_origin(write):
    turn = ground_rotation("+Z")
    plates, findings = read_cortex_forces(write(rows()), turn)
    expect_step(plates, turn)
    assert findings == ()


def test_free_moments_in_newton_millimetres_are_seen_from_their_size(write):
    turn = ground_rotation("+Z")
    plates, findings = read_cortex_forces(write(rows(free_unit=1e-3)), turn)
    expect_step(plates, turn)
    found = only(findings, "F152", unit="N mm", lever_arm_m=FREE_NM / 0.7)
    assert (found.where.plate, found.severity) == ("plate 1", Severity.CORRECTED)


def test_the_force_on_the_plate_is_reversed(write):
    turn = ground_rotation("+Z")
    plates, findings = read_cortex_forces(write(rows(sign=-1.0)), turn)
    expect_step(plates, turn)
    only(findings, "F157", force_n=-700.0)


def test_beside_a_trc_file_its_axes_are_those_of_the_markers(write, tmp_path):
    heights = np.array([0.03, 0.05, 0.5, 0.9, 1.3, 1.6])
    places = np.column_stack((np.linspace(0.2, 0.4, 6), np.linspace(0.1, 0.3, 6), heights))
    write_trc(tmp_path / "walk.trc", Markers(np.arange(31) / 100, tuple("ABCDEF"), np.tile(places, (31, 1, 1))))
    forces = write(rows())
    recording = read_recording(tmp_path / "walk.trc", forces)
    assert recording.vertical == "+Z"
    expect_step(recording.plates, ground_rotation("+Z"))
    assert has_force_columns(forces)
    assert files_by_name([tmp_path / "walk.trc", forces])[0].forces == forces
    (tmp_path / "loads.xml").touch()
    with refused("F102", what="explain a .forces file"):
        read_recording(tmp_path / "walk.trc", forces, tmp_path / "loads.xml")


def test_forces_that_are_vertical_along_another_axis_than_the_markers(write):
    with refused("P201", None, axis="Z", vertical="Y", column="FZ1"):
        read_cortex_forces(write(rows()))


def test_a_header_that_counts_wrong_is_a_finding(write):
    _, findings = read_cortex_forces(write(rows(), plates=3, samples=400), ground_rotation("+Z"))
    assert codes(findings) == ["F111", "F111"]
    assert [finding.evidence["found"].value for finding in findings] == [2, 300]


@pytest.mark.parametrize(
    ("change", "code", "evidence"),
    [
        ({"columns": [*COLUMNS[:6], "MX1", *COLUMNS[7:]]}, "F156", {"columns": "MZ1"}),
        ({"columns": ["A"] * 14}, "F156", {"columns": "FX1"}),
        ({"rate": "0"}, "F114", {"key": "SampleRate", "value": "0"}),
        ({"rate": "fast"}, "F114", {"key": "SampleRate", "value": "fast"}),
    ],
)
def test_broken_headers(write, change, code, evidence):
    with refused(code, **evidence):
        read_cortex_forces(write(rows(), **change), ground_rotation("+Z"))


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("[Force Data]", "Force Data", "F103"),
        ("#Sample", "Sample", "F103"),
        ("\n10\t0.0000", "\n12\t0.0000", "T101"),
        ("\n10\t0.0000", "\n10\tx", "F105"),
    ],
)
def test_broken_files(write, old, new, code):
    path = write(rows())
    path.write_text(path.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
    with refused(code):
        read_cortex_forces(path, ground_rotation("+Z"))


def test_a_file_without_rows(write):
    with pytest.raises(FileError) as caught:
        read_cortex_forces(write(rows()[:0]))
    assert caught.value.finding.code == "F114", "it announces no sample"
