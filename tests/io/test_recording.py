from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from c3d_writer import write_c3d
from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.markers.axes_and_floor import unit_and_vertical
from kinertia.errors import TrialError
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.recording import read_recording
from kinertia.io.text.sto import write_sto
from kinertia.io.text.trc import write_trc
from kinertia.trial.data import Markers
from kinertia.trial.trial_input import with_plates_of_trial
from refusals import codes, expect_evidence, only, refused


@pytest.fixture
def files(tmp_path):
    """A second of markers, as TRC and C3D, and of forces."""
    markers = Markers(np.arange(101) / 100, ("R.Heel",), np.ones((101, 1, 3)))
    write_trc(tmp_path / "walk.trc", markers)
    write_c3d(tmp_path / "walk.c3d", 1000 * markers.positions, ["R.Heel"], parameters={"POINT": {"Y_SCREEN": ["+Y"]}})
    write_forces(tmp_path / "walk_grf.mot", 0.0)
    return tmp_path


def write_forces(path, start_s):
    columns = {f"ground_force_{kind}{axis}": np.full(1001, 400.0 * (axis == "y")) for kind in "vp" for axis in "xyz"}
    write_sto(path, pd.DataFrame(columns, index=start_s + np.arange(1001) / 1000), in_degrees=False, name="grf")


def test_text_files(files):
    recording = read_recording(files / "walk.trc", files / "walk_grf.mot")
    assert recording.name == "walk"
    assert recording.markers.labels == ("R.Heel",)
    assert recording.plates.force[0, 0, 1] == 400.0
    assert recording.findings == ()
    np.testing.assert_allclose(recording.plates.moment[0, 0], np.cross((0, 400, 0), (0, 400, 0)))


@pytest.fixture
def upright():
    """A walk along +X with markers from heels to head, arms half out."""
    places = [
        (0.0, 0.03, 0.1),
        (0.2, 0.02, -0.1),
        (0.0, 0.5, 0.1),
        (0.1, 0.9, 0.2),
        (0.0, 1.3, -0.45),
        (0.0, 1.6, 0.45),
    ]
    step = np.outer(np.arange(101) / 100, [1.2, 0.0, 0.0])
    return Markers(np.arange(101) / 100, tuple("ABCDEF"), np.array(places) + step[:, None])


def z_up(vectors):
    """(x, y, z) of ground axes as (x, -z, y)."""
    return vectors[..., [0, 2, 1]] * [1.0, -1.0, 1.0]


def test_somebody_upright_along_z_in_a_trc_file_is_turned_and_the_forces_with_them(tmp_path, upright):
    names = [f"ground_{kind}{axis}" for kind in ("force_v", "force_p", "torque_") for axis in "xyz"]
    load = np.tile([30.0, 700.0, -20.0, 0.3, 0.0, 0.1, 0.0, 4.0, 0.0], (1001, 1))
    for folder, turn in (("ground", lambda vectors: vectors), ("lab", z_up)):
        (tmp_path / folder).mkdir()
        write_trc(tmp_path / folder / "walk.trc", Markers(upright.time, upright.labels, turn(upright.positions)))
        values = turn(load.reshape(-1, 3, 3)).reshape(-1, 9)
        table = pd.DataFrame(values, index=np.arange(1001) / 1000, columns=names)
        write_sto(tmp_path / folder / "walk.mot", table, in_degrees=False, name="grf")
    ground, lab = (
        read_recording(tmp_path / part / "walk.trc", tmp_path / part / "walk.mot") for part in ("ground", "lab")
    )
    np.testing.assert_allclose(lab.markers.positions, ground.markers.positions, atol=1e-8)
    np.testing.assert_allclose(lab.plates.force, ground.plates.force)
    np.testing.assert_allclose(lab.plates.moment, ground.plates.moment, atol=1e-9)
    assert (ground.vertical, lab.vertical) == ("+Y", "+Z")
    assert ground.findings == ()
    assert codes(lab.findings) == ["F133"]
    only(lab.findings, "F133", axis="+Z")
    with refused("P201", axis="Y", vertical="Z", peak_n=(30.0, 700.0, 20.0)):
        read_recording(tmp_path / "lab" / "walk.trc", tmp_path / "ground" / "walk.mot")


@pytest.mark.parametrize("shift", [0.3, -1.0, 5.0])
def test_whoever_may_lie_is_not_turned(tmp_path, upright, shift):
    lying = z_up(upright.positions) + np.array([0.0, 0.0, shift])
    write_trc(tmp_path / "walk.trc", Markers(upright.time, upright.labels, lying))
    recording = read_recording(tmp_path / "walk.trc")
    assert recording.findings == ()
    (found,) = unit_and_vertical(RecordingContext(recording))
    assert (found.code, found.severity.name) == ("M142", "ERROR")
    expect_evidence(found, up="Z", expected="Y")


def test_whoever_stands_on_a_step_along_z_is_turned_in_a_static_trial(tmp_path, upright):
    write_trc(
        tmp_path / "static.trc",
        Markers(upright.time, upright.labels, z_up(upright.positions) + np.array([0.0, 0.0, 0.3])),
    )
    recording = read_recording(tmp_path / "static.trc", standing=True)
    assert codes(recording.findings) == ["F133"]
    np.testing.assert_allclose(recording.markers.positions, upright.positions + np.array([0.0, 0.3, 0.0]), atol=1e-8)


def test_arms_that_are_stretched_out_hide_no_one(tmp_path, upright):
    hands = np.array([[0.0, 1.4, -0.8], [0.0, 1.4, 0.9]])
    positions = np.concatenate([upright.positions, np.tile(hands, (len(upright.time), 1, 1))], axis=1)
    labels = (*upright.labels, "left hand", "right hand")
    write_trc(tmp_path / "walk.trc", Markers(upright.time, labels, z_up(positions)))
    assert codes(read_recording(tmp_path / "walk.trc").findings) == ["F133"]
    write_trc(tmp_path / "walk.trc", Markers(upright.time, labels, positions))
    assert read_recording(tmp_path / "walk.trc").findings == ()


def test_statics_need_no_forces(files):
    for name in ("walk.trc", "walk.c3d"):
        recording = read_recording(files / name)
        assert recording.plates is None
        assert recording.mass_kg is None


def test_forces_of_a_force_file_go_before_those_of_the_c3d_file(files, c3d_lab):
    recording = read_recording(c3d_lab / "walk.c3d", files / "walk_grf.mot")
    assert recording.plates.names == ("ground_force",)
    assert recording.mass_kg == pytest.approx(72.6)
    assert only(recording.findings, "F158").where.file == "walk.c3d"
    assert [reported for reported in recording.findings if reported.where.plate is not None] == []


def test_loads_file_alone_names_its_forces(file_of):
    recording = read_recording(file_of("synthetic/walk.trc"), loads_path=file_of("synthetic/walk_grf.xml"))
    assert recording.plates.declared_feet == ("r", "l")
    assert recording.plates.names == ("right", "left")


def test_strings_will_do(files):
    assert read_recording(str(files / "walk.trc"), str(files / "walk_grf.mot")).plates is not None


@pytest.mark.parametrize(
    ("arguments", "code", "evidence"),
    [
        (("walk_grf.mot",), "F102", {"given": ".mot", "what": "hold markers", "expected": ".trc, .c3d, .tsv or .csv"}),
        (("walk.xlsx",), "F102", {"given": ".xlsx", "what": "hold markers"}),
        (
            ("walk.trc", "walk.c3d"),
            "F102",
            {"given": ".c3d", "what": "hold forces", "expected": ".mot, .sto, .tsv or .forces"},
        ),
        (("walk.trc", "walk_grf.mot", "walk.trc"), "F102", {"given": ".trc", "what": "external loads"}),
        (("walk.trc", "walk.tsv"), "F102", {"given": "Qualisys", "expected": ".tsv"}),
        (("wlak.trc",), "F101", {"file": "wlak.trc", "nearest": "walk.trc"}),
        (("walk.trc", "walk_grff.mot"), "F101", {"nearest": "walk_grf.mot"}),
        (("walk.trc", "walk_grf.mot", "walk.xml"), "F101", {"file": "walk.xml"}),
    ],
)
def test_wrong_and_missing_files(files, arguments, code, evidence):
    (files / "walk.tsv").touch()
    with refused(code, None, **evidence):
        read_recording(*(files / name for name in arguments))


def test_only_c3d_files_take_a_unit_of_length(files):
    with refused("F102", what="length_unit"):
        read_recording(files / "walk.trc", length_unit="mm")


def test_forces_and_markers_that_do_not_overlap(files):
    write_forces(files / "late.mot", 5.0)
    with refused("T111", error=TrialError, forces_s=(5.0, 6.0), markers_s=(0.0, 1.0)) as caught:
        read_recording(files / "walk.trc", files / "late.mot")
    assert caught.value.finding.where.trial == "walk"


def test_a_force_that_no_plate_measures(files):
    columns = {f"ground_force_{kind}{axis}": np.full(1001, 2e6 * (axis == "y")) for kind in "vp" for axis in "xyz"}
    write_sto(files / "strong.mot", pd.DataFrame(columns, index=np.arange(1001) / 1000), in_degrees=False, name="grf")
    with refused("F172", error=TrialError, force_n=2e6, time_s=0.0, what="force"):
        read_recording(files / "walk.trc", files / "strong.mot")


def test_notes_are_what_was_assumed_and_corrected(files):
    whole = finding(
        "F131", Where("walk.c3d"), axis=Quantity("+Z"), source=Quantity("markers"), entry=Quantity("Y_SCREEN")
    )
    lost = finding("F151", Where("walk.c3d", plate="plate 1"), reason=Quantity("no samples"))
    recording = replace(read_recording(files / "walk.trc"), findings=(whole, lost))
    assert [note.startswith("walk.c3d: ") for note in recording.notes] == [True]
    assert len(recording.left_out) == 1
    assert [reported.where.plate for reported in with_plates_of_trial(recording).findings] == [None, "plate 1 (walk)"]
