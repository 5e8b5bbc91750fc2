"""Points and parameters put into a C3D file: everything else keeps its bytes."""

import struct

import numpy as np
import pytest

from c3d_writer import plate_parameters, write_c3d
from kinertia.errors import FileError
from kinertia.io.c3d.file_contents import EventToWrite
from kinertia.io.c3d.outputs import Measure, OutputPoint, frames_of, with_outputs
from kinertia.io.c3d.parameters import ParameterSection
from kinertia.io.c3d.reader import read_c3d
from kinertia.io.c3d.structure import doubts_about
from kinertia.io.versions import VERSION
from kinertia.trial.file_contents import GaitEvent
from recordings import here

MAKERS = (
    "synthetic/walk.c3d",
    "pig_c3d/subject_a_walk.c3d",
    "pig_c3d/subject_b_walk.c3d",
    "field/biomechzoo/HC002D/straight.c3d",
    "field/unipd/walking1.c3d",
    "c3d_variety/motion_analysis_walk.c3d",
)
LISTS = ("LABELS", "DESCRIPTIONS", "ANGLES", "MOMENTS", "ANGLE_UNITS", "MOMENT_UNITS")
CHANGED = {"USED", "DATA_START", "TYPE_GROUPS", *LISTS, *(f"{name}{k}" for name in LISTS for k in (2, 3))}
UNITS = {"ANGLES": "deg", "FORCES": "N", "MOMENTS": "Nmm", "POWERS": "W"}


def outputs(count, suffix="", seed=0):
    """A few points, the first frames missing."""
    values = np.random.default_rng(seed).normal(0.0, 100.0, (4, count, 3))
    values[:, :2] = np.nan
    names = (("LHipAngles", "ANGLES"), ("LHipAnglesSD", "ANGLES"), ("LHipMoment", "MOMENTS"), ("LHJC", ""))
    return [OutputPoint(label + suffix, kind, value) for (label, kind), value in zip(names, values, strict=True)]


def written(path, target, suffix="Kin", seed=0, prefix=""):
    """A copy of a file with outputs."""
    frames = frames_of(path)
    parameters = {"VERSION": (["1"], None), "COM": (np.arange(6.0).reshape(2, 3), (3, 2))}
    target.write_bytes(with_outputs(frames, outputs(len(frames.points), suffix, seed), prefix, UNITS, parameters))
    return target


def sections(content):
    """Parameters, and words (f, w) of the data with the number of points."""
    start = 512 * (content[0] - 1)
    order = "<" if content[start + 3] == 84 else ">"
    section = ParameterSection(content[start : start + 512 * content[start + 2]], order)
    points, analogs, first, last = struct.unpack_from(f"{order}4H", content, 2)
    at = 512 * (struct.unpack_from(f"{order}H", content, 16)[0] - 1)
    shape = (last - first + 1, 4 * points + analogs)
    return section, np.frombuffer(content, f"{order}u4", shape[0] * shape[1], at).reshape(shape), points


@pytest.mark.parametrize("name", here(MAKERS))
def test_what_was_in_the_file_keeps_its_bytes(file_of, tmp_path, name):
    path = file_of(name)
    new = written(path, tmp_path / path.name)
    assert doubts_about(new) == ""
    before, after = path.read_bytes(), new.read_bytes()
    assert before[4:16] + before[18:512] == after[4:16] + after[18:512]  # all of the header but two numbers
    (old, words, points), (section, more, all_points) = sections(before), sections(after)
    np.testing.assert_array_equal(words[:, : 4 * points], more[:, : 4 * points])
    np.testing.assert_array_equal(words[:, 4 * points :], more[:, 4 * all_points :])
    groups = {-record.group: record.name for record in old.records if record.group < 0}
    kept = [
        record
        for record in old.records
        if record.group < 0 or groups[record.group] != "POINT" or record.name not in CHANGED
    ]
    assert kept == [record for record in section.records if record in kept]
    for kind in ("LABELS", "LABELS2"):
        had = old.get("POINT", kind) or []
        assert list(section.get("POINT", kind) or [])[: len(had)] == list(had)


@pytest.mark.parametrize("name", here(MAKERS))
def test_readers_find_them(file_of, tmp_path, name):
    """ezc3d, the package c3d, and Kinertia's own, which passes them over."""
    ezc3d, c3d = pytest.importorskip("ezc3d"), pytest.importorskip("c3d")
    path = file_of(name)
    new = written(path, tmp_path / path.name)
    expected = outputs(len(frames_of(path).points))
    file = ezc3d.c3d(str(new))
    with new.open("rb") as stream:
        other = np.array([points for _, points, _ in c3d.Reader(stream).read_frames()])
    for k, added in enumerate(expected, start=-len(expected)):
        np.testing.assert_allclose(file["data"]["points"][:3, k].T, added.values, rtol=1e-6)
        np.testing.assert_allclose(other[2:, k, :3], added.values[2:], rtol=1e-6)
        assert (other[:2, k, 3] == -1.0).all()
    assert "LHipMomentKin" in file["parameters"]["POINT"]["MOMENTS"]["value"]
    parameters = file["parameters"]["KINERTIA"]
    assert parameters["LABELS"]["value"] == [output.label + "Kin" for output in outputs(3)]
    np.testing.assert_array_equal(parameters["COM"]["value"], np.arange(6.0).reshape(2, 3).T)
    before, after = read_c3d(path), read_c3d(new)
    assert before.markers.labels == after.markers.labels
    np.testing.assert_array_equal(before.markers.positions, after.markers.positions)
    if before.plates is not None:
        np.testing.assert_array_equal(before.plates.wrench, after.plates.wrench)
    assert [finding.message for finding in before.findings] == [finding.message for finding in after.findings]


def test_written_twice_they_are_replaced(file_of, tmp_path):
    path = file_of("synthetic/walk.c3d")
    once = written(path, tmp_path / "once.c3d", seed=1)
    again = written(written(path, tmp_path / "other.c3d", seed=0), tmp_path / "twice.c3d", seed=1)
    (once_read, words, points), (two, more, as_many) = sections(once.read_bytes()), sections(again.read_bytes())
    assert points == as_many
    np.testing.assert_array_equal(words, more)
    assert once_read.get("POINT", "LABELS") == two.get("POINT", "LABELS")
    assert once_read.get("POINT", "ANGLES") == two.get("POINT", "ANGLES")


def person(path, integers=False, labels=9, parameters=None, prefix=""):
    rng = np.random.default_rng(0)
    places = 0.1 * rng.integers((0, 0, 0), (6000, 5000, 18000), (20, labels, 3))
    corners = np.array([[[0, 500, 0], [500, 500, 0], [500, 0, 0], [0, 0, 0]]], float)
    loads = rng.integers(-400, 400, (200, 6)) - [0, 0, 6000, 0, 0, 0]
    groups = {"POINT": {"Y_SCREEN": ["+Z"]}, "FORCE_PLATFORM": plate_parameters(corners), **(parameters or {})}
    return write_c3d(path, places, [f"{prefix}M{k}" for k in range(labels)], loads, groups, integers=integers)


def test_files_of_integers_become_floats(tmp_path):
    path = person(tmp_path / "integers.c3d", integers=True)
    new = written(path, tmp_path / "new.c3d")
    before, after = read_c3d(path), read_c3d(new)
    np.testing.assert_allclose(before.markers.positions, after.markers.positions, atol=1e-7)
    np.testing.assert_array_equal(before.plates.wrench, after.plates.wrench)
    section, *_ = sections(new.read_bytes())
    assert section.get("POINT", "SCALE")[0] < 0


def test_measures_of_strides_are_added_where_a_file_states_none(tmp_path):
    """As Vicon has them; an earlier export's are replaced, a file's own stay; the file says who changed it."""
    ezc3d = pytest.importorskip("ezc3d")
    speeds = [Measure(side, "Walking Speed", "m/s", value) for side, value in (("Left", 1.25), ("Right", 1.5))]

    def exported(source, target, measures):
        frames = frames_of(source)
        target.write_bytes(with_outputs(frames, outputs(20), "", UNITS, {}, (), measures))
        return ezc3d.c3d(str(target))["parameters"]

    once = exported(
        person(tmp_path / "plain.c3d"), tmp_path / "once.c3d", [Measure("Left", "Cadence", "steps/min", 1.0)]
    )
    assert once["ANALYSIS"]["NAMES"]["value"] == ["Cadence"]
    twice = exported(tmp_path / "once.c3d", tmp_path / "twice.c3d", speeds)["ANALYSIS"]
    assert twice["USED"]["value"] == [2]
    assert (twice["CONTEXTS"]["value"], twice["UNITS"]["value"]) == (["Left", "Right"], ["m/s", "m/s"])
    np.testing.assert_array_equal(twice["VALUES"]["value"], [1.25, 1.5])
    analysis = {
        "NAMES": ["Cadence"],
        "DESCRIPTIONS": [""],
        "VALUES": np.array([120.0]),
        "USED": np.array([1], np.int16),
    }
    clinic = person(tmp_path / "clinic.c3d", parameters={"ANALYSIS": analysis, "MANUFACTURER": {"EDITED": ["Mokka"]}})
    kept = exported(clinic, tmp_path / "kept.c3d", speeds)
    assert (kept["ANALYSIS"]["NAMES"]["value"], kept["ANALYSIS"]["VALUES"]["value"]) == (["Cadence"], [120.0])
    assert kept["MANUFACTURER"]["EDITED"]["value"] == ["Mokka", f"Kinertia {VERSION}"]
    assert once["KINERTIA"]["__METADATA__"]["DESCRIPTION"].startswith("Results of Kinertia")


def test_events_and_measures_have_the_subject_of_the_file(tmp_path):
    """Vicon's programs show only those of a subject."""
    ezc3d = pytest.importorskip("ezc3d")
    path = person(tmp_path / "vicon.c3d", parameters={"SUBJECTS": {"NAMES": ["HC002D"]}})
    event = EventToWrite(GaitEvent(0.1, "r", "heel strike"), "motion")
    measure = Measure("Left", "Cadence", "steps/min", 120.0)
    (tmp_path / "new.c3d").write_bytes(with_outputs(frames_of(path), outputs(20), "", UNITS, {}, [event], [measure]))
    parameters = ezc3d.c3d(str(tmp_path / "new.c3d"))["parameters"]
    assert parameters["EVENT"]["SUBJECTS"]["value"] == parameters["ANALYSIS"]["SUBJECTS"]["value"] == ["HC002D"]


def test_more_points_than_a_list_has_room_for(tmp_path):
    path = person(tmp_path / "many.c3d", labels=254)
    section, _, points = sections(written(path, tmp_path / "new.c3d").read_bytes())
    assert points == 258
    assert section.get("POINT", "LABELS")[-1] == "LHipAnglesKin"
    assert section.get("POINT", "LABELS2") == ["LHipAnglesSDKin", "LHipMomentKin", "LHJCKin"]


def test_labels_have_the_subjects_prefix(tmp_path):
    path = person(tmp_path / "prefixed.c3d", prefix="Anna:")
    new = written(path, tmp_path / "new.c3d", prefix="Anna:")
    section, *_ = sections(new.read_bytes())
    assert section.get("POINT", "LABELS")[-1] == "Anna:LHJCKin"
    assert read_c3d(new).markers.labels == read_c3d(path).markers.labels == tuple(f"M{k}" for k in range(9))


def test_a_file_that_contradicts_itself_is_refused(tmp_path):
    path = person(tmp_path / "broken.c3d", parameters={"ANALOG": {"RATE": np.array([1.0])}})
    with pytest.raises(FileError, match=r"cannot take model outputs: ANALOG:RATE contradicts its header"):
        frames_of(path)


@pytest.mark.parametrize(("unit", "stated"), [("Nmm", ["Nmm"]), ("Nm", None)])
def test_units_that_a_file_leaves_open_are_stated_if_they_are_those_of_its_outputs(tmp_path, unit, stated):
    path = person(tmp_path / "open.c3d", parameters={"POINT": {"Y_SCREEN": ["+Z"], "MOMENTS": ["M0"]}})
    frames, units = frames_of(path), {**UNITS, "MOMENTS": unit}
    path.write_bytes(with_outputs(frames, outputs(len(frames.points), "Kin"), "", units, {}))
    section, *_ = sections(path.read_bytes())
    assert (section.get("POINT", "MOMENT_UNITS"), section.get("POINT", "ANGLE_UNITS")) == (stated, ["deg"])


def test_numbers_of_frames_that_a_crop_left_behind_refuse_nothing(tmp_path):
    """As ezc3d leaves TRIAL where Python cuts frames off."""
    fields = {"ACTUAL_START_FIELD": np.array([148, 0]), "ACTUAL_END_FIELD": np.array([462, 0])}
    path = person(tmp_path / "cropped.c3d", parameters={"TRIAL": fields})
    new = written(path, tmp_path / "new.c3d")
    np.testing.assert_array_equal(read_c3d(new).markers.time, read_c3d(path).markers.time)
    assert sections(new.read_bytes())[0].get("TRIAL", "ACTUAL_START_FIELD").tolist() == [148, 0]
