import numpy as np
import pandas as pd
import pytest

from c3d_writer import write_c3d
from kinertia.errors import FileError, TrialError
from kinertia.io.recording import read_recording
from kinertia.io.sto import write_sto
from kinertia.io.trc import write_trc
from kinertia.trial.data import Markers
from kinertia.trial.marker_quality import axes_trouble, extent_m


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
    assert recording.notes == ("walk_grf.mot: no torque columns for ground_force; the free moment was taken as zero",)


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
        read_recording(tmp_path / one / "walk.trc", tmp_path / one / "walk.mot") for one in ("ground", "lab")
    )
    np.testing.assert_allclose(lab.markers.positions, ground.markers.positions, atol=1e-8)
    np.testing.assert_allclose(lab.plates.force, ground.plates.force)
    np.testing.assert_allclose(lab.plates.moment, ground.plates.moment, atol=1e-9)
    assert (ground.vertical, lab.vertical) == ("+Y", "+Z")
    assert ground.notes == ()
    assert lab.notes == ("walk.trc: people stand upright along Z; markers, and forces with them, were turned to Y up",)
    with pytest.raises(FileError, match="in ground_force_vy, along Y, but in the markers people stand along Z"):
        read_recording(tmp_path / "lab" / "walk.trc", tmp_path / "ground" / "walk.mot")


@pytest.mark.parametrize("shift", [0.3, -1.0, 5.0])
def test_whoever_may_lie_is_not_turned(tmp_path, upright, shift):
    lying = z_up(upright.positions) + np.array([0.0, 0.0, shift])
    write_trc(tmp_path / "walk.trc", Markers(upright.time, upright.labels, lying))
    recording = read_recording(tmp_path / "walk.trc")
    assert recording.notes == ()
    assert "which should be up" in axes_trouble(extent_m(recording.markers))


def test_statics_need_no_forces(files):
    for name in ("walk.trc", "walk.c3d"):
        recording = read_recording(files / name)
        assert recording.plates is None
        assert recording.mass_kg is None


def test_forces_of_a_force_file_go_before_those_of_the_c3d_file(files, c3d_lab):
    recording = read_recording(c3d_lab / "walk.c3d", files / "walk_grf.mot")
    assert recording.plates.names == ("ground_force",)
    assert recording.mass_kg == pytest.approx(72.6)
    assert "walk.c3d: its own force plates were not used, the force file was" in recording.notes


def test_loads_file_alone_names_its_forces(file_of):
    recording = read_recording(file_of("synthetic/walk.trc"), loads_path=file_of("synthetic/walk_grf.xml"))
    assert recording.plates.declared_feet == ("r", "l")
    assert recording.plates.names == ("right", "left")


def test_strings_will_do(files):
    assert read_recording(str(files / "walk.trc"), str(files / "walk_grf.mot")).plates is not None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("walk_grf.mot",), "cannot read markers from a '.mot' file; expected .trc, .c3d, .tsv or .csv"),
        (("walk.xlsx",), "cannot read markers from a '.xlsx' file; expected .trc, .c3d, .tsv or .csv"),
        (("walk.trc", "walk.c3d"), "cannot read forces from a '.c3d' file; expected .mot, .sto or .tsv"),
        (("walk.trc", "walk_grf.mot", "walk.trc"), "cannot read external loads from a '.trc' file; expected .xml"),
        (("wlak.trc",), "no such file; looked in {folder}, the nearest names there are walk.trc"),
        (("walk.trc", "walk_grff.mot"), "nearest names there are walk_grf.mot"),
        (("walk.trc", "walk_grf.mot", "walk.xml"), "no such file"),
    ],
)
def test_wrong_and_missing_files(files, arguments, words):
    with pytest.raises(FileError) as caught:
        read_recording(*(files / name for name in arguments))
    assert words.format(folder=files) in str(caught.value)


def test_forces_and_markers_that_do_not_overlap(files):
    write_forces(files / "late.mot", 5.0)
    with pytest.raises(
        TrialError, match=r"trial 'walk': forces from 5.000 to 6.000 s and markers from 0.000 to 1.000 s"
    ):
        read_recording(files / "walk.trc", files / "late.mot")
