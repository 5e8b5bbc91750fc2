"""Events of C3D files, as Vicon, Motion Analysis and others write them."""

import numpy as np
import pytest

from c3d_writer import write_c3d
from kinertia.io.c3d import read_c3d
from kinertia.io.c3d_events import file_events


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


@pytest.mark.parametrize(("label", "side", "kind"), [("RHS", "r", "heel strike"), ("LTO", "l", "toe off")])
def test_one_label_for_side_and_kind(tmp_path, label, side, kind):
    assert events_of(tmp_path, [label], [""], [1.05])[0][:2] == (side, kind)


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
    (one,) = file_events({"EVENT": event}, ["LHEE", "Ben:LHEE"])
    assert one.subject == "Ann"


@pytest.mark.parametrize("times", [np.zeros(3), np.array(["a", "b"]), np.array([[0.0], [np.nan]])])
def test_times_that_are_none_are_no_events(times):
    assert file_events({"EVENT": {"TIMES": {"value": times}}}) == ()
