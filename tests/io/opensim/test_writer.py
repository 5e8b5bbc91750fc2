import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from generic_static import generic_model, random_coordinates
from kinertia.io.opensim.reader import read_osim
from kinertia.io.opensim.writer import edited_osim, export_osim
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.bsp import BodySegmentParameters
from osim_comparison import RAJAGOPAL, SLOW_IF_LARGE, SMALL, SYNTHETIC, assert_opensim_agrees
from osim_text import custom_root, frame, joint, model, old_model
from recordings import here

PIN = joint("PinJoint", "between", "/bodyset/pelvis", "leg", "a")


def other_bsp(bsp: BodySegmentParameters, seed: int = 0) -> BodySegmentParameters:
    """Every number a little different, masses of massless bodies too."""
    change = np.random.default_rng(seed).uniform(0.01, 0.02, (len(bsp.segments), 10))
    return BodySegmentParameters.from_table(bsp.segments, bsp.table() * 1.1 + change)


def opensim_table(opensim, path) -> dict[str, np.ndarray]:
    loaded = opensim.Model(str(path))
    loaded.initSystem()
    table = {}
    for i in range(loaded.getBodySet().getSize()):
        body = loaded.getBodySet().get(i)
        moments, products = body.getInertia().getMoments(), body.getInertia().getProducts()
        rest = [v.get(k) for v in (body.getMassCenter(), moments, products) for k in range(3)]
        table[body.getName()] = np.array([body.getMass(), *rest])
    return table


def warnings_of(opensim, path, log) -> list[str]:
    opensim.Logger.setLevelString("warn")
    opensim.Logger.addFileSink(str(log))
    opensim.Model(str(path)).initSystem()
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("error")
    return re.findall(r"\[(?:warning|error)\] .*", log.read_text())


def old_text(text: bytes, changes) -> bytes:
    """The text with every change taken back, in the order of the file."""
    for row in changes.itertuples():
        assert text.count(f">{row.new}<".encode()) == 1
        text = text.replace(f">{row.new}<".encode(), f">{row.old}<".encode())
    return text


def write_osim(path, *args, **options):
    """Write the edited file, and return what changed."""
    content, changes = edited_osim(*args, **options)
    path.write_bytes(content)
    return changes


@pytest.mark.parametrize("name", SLOW_IF_LARGE)
def test_only_mass_properties_change(opensim, file_of, tmp_path, name):
    source = file_of(name)
    ours = read_osim(source)
    wanted = other_bsp(ours.bsp)
    path = tmp_path / "out.osim"
    changes = write_osim(path, ours, wanted)
    assert set(changes["property"]) == {"mass", "mass_center", "inertia"}
    assert len(changes) == 3 * len(ours.bsp.segments)
    assert old_text(path.read_bytes(), changes) == ours.content
    np.testing.assert_array_equal(read_osim(path).bsp.table(), wanted.table())
    theirs = opensim_table(opensim, path)
    for segment, row in zip(wanted.segments, wanted.table(), strict=True):
        np.testing.assert_allclose(theirs[segment], row, rtol=1e-15)
    before, after = (warnings_of(opensim, p, tmp_path / f"{p.stem}.log") for p in (source, path))
    assert after == before
    assert_opensim_agrees(path, read_osim(path))


@pytest.mark.parametrize("name", SMALL)
def test_nothing_changes_without_a_change(file_of, tmp_path, name):
    ours = read_osim(file_of(name))
    path = tmp_path / "out.osim"
    assert write_osim(path, ours, ours.bsp).empty
    assert path.read_bytes() == ours.content


@pytest.mark.parametrize("name", here([SYNTHETIC, RAJAGOPAL]))
def test_one_body_changes_alone(file_of, tmp_path, name):
    ours = read_osim(file_of(name))
    i = ours.bsp.segments.index("torso")
    torso = BodySegmentParameters(
        ("torso",), ours.bsp.mass_kg[i : i + 1] + 1, ours.bsp.com_m[i : i + 1], ours.bsp.inertia_kgm2[i : i + 1]
    )
    changes = write_osim(tmp_path / "out.osim", ours, torso)
    assert changes[["component", "property"]].values.tolist() == [["torso", "mass"]]
    assert float(changes["new"][0]) == float(changes["old"][0]) + 1


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(-1e3, 1e3), min_size=20, max_size=20), st.sampled_from([model(custom_root() + PIN), old_model()])
)
def test_round_trip(tmp_path_factory, numbers, text):
    path = tmp_path_factory.mktemp("osim") / "small.osim"
    path.write_text(text)
    ours = read_osim(path)
    table = np.array(numbers).reshape(2, 10)
    table[:, 0] = np.abs(table[:, 0]) + 1e-3
    wanted = BodySegmentParameters.from_table(ours.bsp.segments, table)
    write_osim(path, ours, wanted)
    np.testing.assert_array_equal(read_osim(path).bsp.table(), table)
    np.testing.assert_array_equal(read_osim(path).skeleton.marker_locals, ours.skeleton.marker_locals)


def test_properties_that_the_file_leaves_out_or_empty(tmp_path):
    text = model(custom_root() + PIN).replace("<mass_center>-0.01 -0.2 0.02</mass_center>", "")
    text = text.replace("<mass_center>0.02 -0.1 0.03</mass_center>", "<mass_center>0 0 0</mass_center>")
    path = tmp_path / "small.osim"
    path.write_text(text)
    ours = read_osim(path)
    wanted = other_bsp(ours.bsp)
    changes = write_osim(path, ours, wanted)
    assert "" in changes["old"].tolist()
    np.testing.assert_array_equal(read_osim(path).bsp.table(), wanted.table())


@pytest.mark.parametrize("name", SLOW_IF_LARGE)
def test_markers_and_joints_that_moved(opensim, file_of, tmp_path, name):
    ours = read_osim(file_of(name))
    positions = {m.label: m.position + np.array([0.01, -0.02, 0.03]) for m in ours.skeleton.markers[::5]}
    shift = np.array([0.004, -0.005, 0.006])
    hip, thigh = ("to_thigh_r", "thigh_r") if name == SYNTHETIC else ("hip_r", "femur_r")
    path = tmp_path / "out.osim"
    changes = write_osim(path, ours, ours.bsp, positions, {hip: shift})
    assert sorted(set(changes["property"])) == ["location", "translation"]
    again = read_osim(path)
    for marker in again.skeleton.markers:
        expected = positions.get(marker.label, marker.position)
        np.testing.assert_allclose(marker.position, expected, atol=1e-15)
    before, after = ({j.child: j for j in m.skeleton.joints} for m in (ours, again))
    for child, joint_before in before.items():
        moved = after[child].translation - joint_before.translation
        np.testing.assert_allclose(moved, shift if child == thigh else 0.0, atol=1e-15)
    assert_opensim_agrees(path, again)


def test_a_marker_on_a_turned_frame_and_a_joint_of_format_3(tmp_path):
    outer = frame("outer", "/bodyset/pelvis", "0.1 0.2 0.3", "0.3 -0.2 0.5")
    pin = PIN.replace("<frames>", f"<frames>{outer}")
    text = model(custom_root() + pin).replace(
        '<Marker name="P1"><socket_parent_frame>/bodyset/pelvis',
        '<Marker name="P1"><socket_parent_frame>/jointset/between/outer',
    )
    for content, label, moved in ((text, "P1", "between"), (old_model(), "M", "hip")):
        path = tmp_path / "small.osim"
        path.write_text(content)
        ours = read_osim(path)
        before = next(m.position for m in ours.skeleton.markers if m.label == label)
        shift = np.array([0.01, 0.02, -0.03])
        write_osim(path, ours, ours.bsp, {label: before + shift}, {moved: shift})
        again = read_osim(path)
        after = next(m.position for m in again.skeleton.markers if m.label == label)
        np.testing.assert_allclose(after, before + shift, atol=1e-15)
        gap = again.skeleton.joints[1].translation - ours.skeleton.joints[1].translation
        np.testing.assert_allclose(gap, shift, atol=1e-15)


def test_the_27_dof_model_as_a_file(opensim, tmp_path):
    """Read back by us and by OpenSim it is the same model; OpenSim has nothing to say about it."""
    gait27 = generic_model()
    bsp = literature_bsp(70.0, 1.75, "male", gait27.geometry)
    skeleton = gait27.skeleton.lock({"shoulder_x_r": 0.02, "arm_add_l": -0.1})
    path = tmp_path / "model.osim"
    export_osim(path, skeleton, bsp)
    ours = read_osim(path)
    assert set(ours.skeleton.coordinates) == set(skeleton.coordinates)
    assert ours.skeleton.labels == skeleton.labels
    q = random_coordinates(skeleton, 5)
    order = [skeleton.coordinates.index(name) for name in ours.skeleton.coordinates]
    expected = skeleton.marker_positions(skeleton.pose(q))
    positions = ours.skeleton.marker_positions(ours.skeleton.pose(q[:, order]))
    np.testing.assert_allclose(positions, expected, atol=1e-12)
    rows = [ours.bsp.segments.index(segment) for segment in bsp.segments]
    np.testing.assert_array_equal(ours.bsp.table()[rows], bsp.table())
    assert warnings_of(opensim, path, tmp_path / "log") == []
    assert_opensim_agrees(path, ours)


def test_bodies_are_welded_to_those_of_the_file(opensim, file_of, tmp_path):
    """In format 4 and in format 3, where the joint stands in its body."""
    (tmp_path / "old.osim").write_text(old_model())
    for source in (file_of(SYNTHETIC), tmp_path / "old.osim"):
        ours = read_osim(source)
        parent = ours.skeleton.segments[-1]
        row = np.array([[3.0, -0.1, 0.2, 0.05, 0.03, 0.02, 0.04, 0.001, -0.002, 0.0]])
        wanted = BodySegmentParameters.from_table((*ours.bsp.segments, "bag"), np.concatenate([ours.bsp.table(), row]))
        path = tmp_path / "out.osim"
        changes = write_osim(path, ours, wanted, welds={"bag": parent})
        assert list(changes.component) == ["bag"]
        again = read_osim(path)
        joint = next(candidate for candidate in again.skeleton.joints if candidate.child == "bag")
        assert (joint.parent, joint.axes) == (parent, ())
        np.testing.assert_allclose(opensim_table(opensim, path)["bag"], row[0])
        assert again.skeleton.coordinates == ours.skeleton.coordinates
        assert all(".vtp" in line for line in warnings_of(opensim, path, tmp_path / "log.txt"))
