"""Events of C3D files, as Vicon, Motion Analysis and others write them."""

from pathlib import Path

import numpy as np
import pytest

from c3d_writer import write_c3d
from kinertia.io.c3d.file_contents import EventToWrite, add_events, file_events, subject_data, subject_of
from kinertia.io.c3d.parameters import ParameterSection
from kinertia.io.c3d.reader import read_c3d
from kinertia.trial.file_contents import GaitEvent


def events_of(path, contexts, labels, seconds, minutes=0.0, **more):
    points = np.tile([[250.0, 240.0, 30.0], [260.0, 240.0, 1700.0]], (20, 1, 1))
    times = np.array([np.full(len(seconds), minutes), seconds])
    event = {"USED": np.array([len(seconds)], np.int16), "CONTEXTS": contexts, "LABELS": labels, "TIMES": times, **more}
    screen = {"POINT": {"Y_SCREEN": ["+Z"]}, "EVENT": event}
    read = read_c3d(write_c3d(path / "x.c3d", points, ["RHEE", "RFHD"], parameters=screen, first_frame=101))
    return [(event.side, event.kind, event.label, event.subject, round(event.time_s, 4)) for event in read.events]


def test_vicon(tmp_path):
    found = events_of(
        tmp_path,
        ["Right", "Left", "General"],
        ["Foot Off", "Foot Strike", "Left-FP"],
        [1.15, 1.05, 1.1],
        SUBJECTS=["Ann", "Ann", ""],
    )
    strike, general, off = found
    assert strike == ("l", "heel strike", "Foot Strike", "Ann", 1.05)
    assert general == ("", None, "Left-FP", "", 1.1)
    assert off == ("r", "toe off", "Foot Off", "Ann", 1.15)


@pytest.mark.parametrize(
    ("label", "side", "kind"),
    [
        ("RHS", "r", "heel strike"),
        ("LTO", "l", "toe off"),
        ("R_TO", "r", "toe off"),
        ("RON", "r", "heel strike"),
        ("LOFF", "l", "toe off"),
        ("Right Foot Strike", "r", "heel strike"),
        ("left_toe-off", "l", "toe off"),
        ("Left Initial Contact", "l", "heel strike"),
    ],
)
def test_one_label_for_side_and_kind(tmp_path, label, side, kind):
    assert events_of(tmp_path, [label], [""], [1.05])[0][:2] == (side, kind)


@pytest.mark.parametrize(("context", "side", "kind"), [("Right", "r", "heel strike"), ("Left", "l", None)])
def test_a_label_with_a_side_counts_only_on_the_side_of_its_context(tmp_path, context, side, kind):
    assert events_of(tmp_path, [context], ["Right Foot Strike"], [1.05])[0][:2] == (side, kind)


def test_minutes_and_a_single_event(tmp_path):
    assert events_of(tmp_path, ["Right"], ["Foot Strike"], [2.5], minutes=1.0)[0][-1] == 62.5


def test_a_file_without_events_has_none(tmp_path):
    points = np.tile([[250.0, 240.0, 30.0]], (20, 1, 1))
    path = write_c3d(tmp_path / "x.c3d", points, ["RHEE"], parameters={"POINT": {"Y_SCREEN": ["+Z"]}})
    assert read_c3d(path).events == ()


def test_events_of_another_person_are_left_out():
    event = {
        "TIMES": {"value": np.array([[0.0, 0.0], [1.0, 2.0]])},
        "CONTEXTS": {"value": ["Left", "Left"]},
        "LABELS": {"value": ["Foot Strike", "Foot Strike"]},
        "SUBJECTS": {"value": ["Ann", "Ben"]},
    }
    (found_event,) = file_events({"EVENT": event}, ["LHEE", "Ben:LHEE"])
    assert found_event.subject == "Ann"


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["Ann"], ["Ann", ""]),
        (["Eve"], ["Ann", "", "Ben"]),
        (["Ann", "Ben"], ["Ann", "", "Ben"]),
        ([], ["Ann", "", "Ben"]),
    ],
)
def test_events_of_another_person_are_known_by_the_subject_of_the_file(names, expected):
    """Where the file names somebody else than all of its events do, the person was renamed."""
    event = {
        "TIMES": {"value": np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])},
        "CONTEXTS": {"value": ["Left", "General", "Left"]},
        "LABELS": {"value": ["Foot Strike", "Event", "Foot Strike"]},
        "SUBJECTS": {"value": ["Ann", "", "Ben"]},
    }
    found = file_events({"EVENT": event, "SUBJECTS": {"NAMES": {"value": names}}}, ["LHEE"])
    assert [found_event.subject for found_event in found] == expected


@pytest.mark.parametrize("times", [np.zeros(3), np.array(["a", "b"]), np.array([[0.0], [np.nan]])])
def test_times_that_are_none_are_no_events(times):
    assert file_events({"EVENT": {"TIMES": {"value": times}}}) == ()


def written(section) -> list[tuple[str, str, str, float]]:
    """Context, label, description and time of the events of a section."""
    texts = [section.get("EVENT", name) for name in ("CONTEXTS", "LABELS", "DESCRIPTIONS")]
    seconds = section.get("EVENT", "TIMES").reshape(-1, 2)[:, 1]
    return [(*row, round(float(time), 4)) for *row, time in zip(*texts, seconds, strict=True)]


def test_events_that_are_missing_are_added_with_their_method_and_no_others():
    section = ParameterSection(bytes([1, 80, 1, 84]).ljust(512, b"\0"), "<")
    strike, off = GaitEvent(1.5, "r", "heel strike"), GaitEvent(2.1, "r", "toe off")
    assert add_events(section, [EventToWrite(strike, "force plate")], "Ann") == 1
    assert written(section) == [("Right", "Foot Strike", "Kinertia: force plate", 1.5)]
    assert section.get("EVENT", "SUBJECTS") == ["Ann"]
    again = [EventToWrite(strike._replace(time_s=1.52), "motion"), EventToWrite(off, "motion")]
    assert add_events(section, again, "Ann") == 2
    assert [time for *_, time in written(section)] == [1.52, 2.1]


def test_events_of_the_file_stay_as_they_are():
    section = ParameterSection(bytes([1, 80, 1, 84]).ljust(512, b"\0"), "<")
    section.put("EVENT", "USED", np.array([1], np.int16))
    for name, text in {"CONTEXTS": "Right", "LABELS": "Foot Strike", "DESCRIPTIONS": "by hand"}.items():
        section.put("EVENT", name, [text])
    section.put("EVENT", "TIMES", np.array([0.0, 1.49]), (2, 1))
    before = section.content()
    strike, off = GaitEvent(1.5, "r", "heel strike"), GaitEvent(2.1, "r", "toe off")
    assert add_events(section, [EventToWrite(strike, "force plate")], "") == 0
    assert section.content() == before
    assert add_events(section, [EventToWrite(strike, "force plate"), EventToWrite(off, "motion")], "") == 1
    assert written(section) == [
        ("Right", "Foot Strike", "by hand", 1.49),
        ("Right", "Foot Off", "Kinertia: motion", 2.1),
    ]


@pytest.mark.parametrize(("flags", "size"), [(None, 1), ([0, 1], 1), ([0, 1], 2), ([0, 300], 2)])
def test_flags_are_stored_as_in_the_file(flags, size):
    """One byte each in Vicon's files; elsewhere two."""
    section = section_of({"EVENT": EVENTS})
    if flags is not None:
        section.put("EVENT", "GENERIC_FLAGS", np.array(flags, np.int8 if size == 1 else np.int16))
    add_events(section, [EventToWrite(GaitEvent(3.0, "r", "heel strike"), "motion")], "")
    stored = section.get("EVENT", "GENERIC_FLAGS")
    assert (stored.dtype.itemsize, stored.tolist()) == (size, [*(flags or [0, 0]), 0])


def section_of(parameters: dict[str, dict[str, object]]) -> ParameterSection:
    section = ParameterSection(bytes([1, 80, 1, 84]).ljust(512, b"\0"), "<")
    for group, entries in parameters.items():
        for name, value in entries.items():
            section.put(group, name, value, (2, len(value) // 2) if name == "TIMES" else None)
    return section


EVENTS = {
    "CONTEXTS": ["Right", "Right"],
    "LABELS": ["Foot Strike", "Foot Off"],
    "TIMES": np.array([0.0, 1.5, 0.0, 2.1]),
}


@pytest.mark.parametrize(
    ("parameters", "prefix", "expected"),
    [
        ({"SUBJECTS": {"NAMES": ["Ann"]}}, "", "Ann"),
        ({"SUBJECTS": {"NAMES": ["Ann", "Ben"]}}, "", ""),
        ({"SUBJECTS": {"NAMES": ["Ann", "Ben"]}}, "Ben", "Ben"),
        ({"SUBJECTS": {"NAMES": ["Ann"]}, "EVENT": {**EVENTS, "SUBJECTS": ["Old", "Old"]}}, "", "Old"),
        ({"SUBJECTS": {"NAMES": ["Ann"]}, "EVENT": {**EVENTS, "SUBJECTS": ["", ""]}}, "", ""),
        ({"SUBJECTS": {"NAMES": ["Ann"]}, "EVENT": {**EVENTS, "SUBJECTS": ["Ann", "Ben"]}}, "", "Ann"),
        ({}, "", ""),
    ],
)
def test_events_have_the_subject_that_the_file_knows(parameters, prefix, expected):
    assert subject_of(section_of(parameters), prefix) == expected


@pytest.mark.parametrize(("subjects", "others", "added"), [("Ann", (), 0), ("Ben", (), 0), ("Ben", {"Ben"}, 2)])
def test_events_of_other_people_state_nothing_of_this_one(subjects, others, added):
    section = section_of({"EVENT": {**EVENTS, "SUBJECTS": [subjects] * 2}})
    strike, off = GaitEvent(1.5, "r", "heel strike"), GaitEvent(2.1, "r", "toe off")
    assert (
        add_events(section, [EventToWrite(gait_event, "motion") for gait_event in (strike, off)], "Ann", others)
        == added
    )


WHERE = Path("walk.c3d")


def read(group="PROCESSING", **values):
    entries = {key: {"value": np.array([value]) if np.isscalar(value) else value} for key, value in values.items()}
    return subject_data(WHERE, {group: entries, "POINT": {}})


def codes(data):
    return [finding.code for finding in data.findings]


@pytest.mark.parametrize("group", ["PROCESSING", "SUBJECT", "SUBJECTS"])
@pytest.mark.parametrize(
    "mass", ["Bodymass", "BodyMass", "BODY_MASS", "Mass", "Weight", "Mass_kg", "Body weight (kg)", "A_BodyMass_kg"]
)
@pytest.mark.parametrize("height", ["Height", "HEIGHT", "BodyHeight", "Stature", "Subject_Height", "A_Height_mm"])
def test_mass_and_stature_by_any_name(group, mass, height):
    data = read(group, **{mass: 41.5, height: 1610.0})
    assert (data.mass_kg, data.height_m) == (41.5, pytest.approx(1.61))


@pytest.mark.parametrize(
    "key",
    ["RKneeWidth", "R_KneeWidth", "RightKneeWidth", "Right Knee Width", "R.Knee.Width", "KneeWidth_R", "rkneediameter"],
)
def test_joint_widths_by_any_name(key):
    data = read(Height=1700.0, **{key: 102.0})
    assert data.measurements["RKneeWidth"] == pytest.approx(0.102)
    assert "LKneeWidth" not in data.measurements


def test_a_width_without_a_side_is_of_both():
    data = read(AnkleWidth=70.0)
    assert data.measurements["RAnkleWidth"] == data.measurements["LAnkleWidth"] == pytest.approx(0.07)


@pytest.mark.parametrize(
    ("height", "width"), [(1700.0, 102.0), (170.0, 10.2), (1.7, 0.102), (170.0, 102.0), (1.7, 102.0)]
)
def test_units_follow_from_the_stature_or_else_from_what_people_have(height, width):
    data = read(Height=height, LKneeWidth=width)
    assert (data.height_m, data.measurements["LKneeWidth"]) == (pytest.approx(1.7), pytest.approx(0.102))


def test_a_unit_that_is_named_counts():
    data = read(**{"Height_cm": 170.0, "LKneeWidth (mm)": 102.0, "Mass": "60,5 kg"})
    assert (data.mass_kg, data.height_m) == (60.5, pytest.approx(1.7))
    assert data.measurements["LKneeWidth"] == pytest.approx(0.102)


@pytest.mark.parametrize(
    ("mass_kg", "height_mm", "width_mm"),
    [(10.5, 780.0, 62.0), (16.0, 1040.0, 70.0), (25.0, 1225.0, 92.0), (150.0, 1900.0, 140.0)],
)
def test_children_and_heavy_adults_are_plausible(mass_kg, height_mm, width_mm):
    data = read(Bodymass=mass_kg, Height=height_mm, RKneeWidth=width_mm)
    assert (data.mass_kg, data.height_m) == (mass_kg, pytest.approx(height_mm / 1e3))
    assert codes(data) == ["F124"]


def test_what_cannot_be_true_is_not_used():
    data = read(Bodymass=700.0, Height=1700.0, RKneeWidth=1.0e6)
    assert (data.mass_kg, data.height_m, data.measurements) == (None, pytest.approx(1.7), {})
    assert [finding.evidence["quantity"].value for finding in data.findings if finding.code == "F125"] == [
        "mass",
        "RKneeWidth",
    ]
    assert read(Bodymass=400.0, Height=1250.0).mass_kg is None, "a weight in newtons"
    assert read(Height=9000.0).height_m is None


@pytest.mark.parametrize(
    "values", [{}, {"Bodymass": 0.0}, {"Bodymass": np.nan}, {"Bodymass": [60.0, 70.0]}, {"Bodymass": ""}]
)
def test_nothing_is_made_of_nothing(values):
    """Of two persons' masses nobody knows which is whose."""
    data = read(**values)
    assert (data.mass_kg, data.height_m, data.measurements, data.findings) == (None, None, {}, [])


def test_lengths_of_other_kinds_keep_their_keys_and_angles_are_none():
    data = read(Height=1700.0, InterAsisDistance=240.0, HeadOffset=10.0, LTibialTorsion=0.3)
    assert data.measurements == {"InterAsisDistance": pytest.approx(0.24)}
