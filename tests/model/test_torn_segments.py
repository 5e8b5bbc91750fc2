"""Markers that do not move with their segment are named with those that they go with; sound trials never are."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.model.torn_segments import torn_segments_trouble

OPENCAP = Path(__file__).parents[1] / "subject4.toml"
SOUND = [
    "gait2354/subject01_walk1.trc",
    "rajagopal_walk/motion_capture_walk.trc",
    "pig_c3d/subject_a_walk.c3d",
    "pig_c3d/subject_b_walk.c3d",
    "subject4/walking1.trc",
    "subject4/squats1.trc",
    "field/rajagopal_run/motion_capture_run.trc",
    "field/hamner_run/subject02_running.trc",
    "c3d_variety/subject_prefixed_labels.c3d",
]
EXCHANGED = [
    ("rajagopal_walk/motion_capture_walk.trc", [(f"R.SH{k}", f"L.SH{k}") for k in (1, 2, 3, 4)], "shank"),
    ("rajagopal_walk/motion_capture_walk.trc", [(f"R.TH{k}", f"R.SH{k}") for k in (1, 2, 3)], "shank_r"),
    ("rajagopal_walk/motion_capture_walk.trc", [("R.Heel", "L.Heel"), ("R.Toe", "L.Toe"), ("R.MT5", "L.MT5")], "ankle"),
    ("pig_c3d/subject_a_walk.c3d", [("RTIB", "LTIB")], "shank"),
    ("pig_c3d/subject_b_walk.c3d", [("RTHI", "LTHI")], "thigh"),
]
"""With what moves by itself then."""


CROSSED = [
    ("gait2354/subject01_walk1.trc", "thigh"),
    ("gait2354/subject01_walk1.trc", "shank"),
    ("gait2354/subject01_walk1.trc", "foot"),
    ("field/rajagopal_run/motion_capture_run.trc", "thigh"),
    ("field/rajagopal_run/motion_capture_run.trc", "shank"),
]
"""Walks whose sets have no markers at the joints."""


def read(recording_of, name):
    markers = recording_of(name).markers
    marker_set = read_marker_set(OPENCAP) if "subject4" in name else choose_marker_set(markers.labels)
    return markers.select([label for label in marker_set.labels if label in markers.labels]), marker_set


@pytest.mark.parametrize("name", SOUND)
def test_sound_trials(name, recording_of):
    assert torn_segments_trouble(*read(recording_of, name)) == ""


@pytest.mark.parametrize(("name", "pairs", "where"), EXCHANGED)
def test_exchanged_labels(name, pairs, where, recording_of):
    markers, marker_set = read(recording_of, name)
    other = {a: b for one in pairs for a, b in (one, one[::-1])}
    swapped = replace(markers, labels=tuple(other.get(label, label) for label in markers.labels))
    trouble = torn_segments_trouble(swapped, marker_set)
    joined, one, two = re.match(
        r"markers (.*) do not move together: the distance from (\S+) to (\S+) changes", trouble
    ).groups()
    assert where in joined
    assert {one, two} & set(other)
    assert "correct the labels" in trouble


def with_soft_thigh(recording_of):
    """A walk with a thigh marker that skin takes along with the hip's angle, so that the distance to the knee's changes
    by more than 60 mm.
    """
    markers, marker_set = read(recording_of, "rajagopal_walk/motion_capture_walk.trc")
    places = markers.positions.copy()
    thigh, knee, ankle = (markers.labels.index(name) for name in ("R.TH1", "R.Knee", "R.Ankle"))
    along = places[:, knee] - places[:, ankle]
    swing = along[:, 0] / np.linalg.norm(along, axis=1)
    places[:, thigh, 0] += 0.09 * (swing - swing.mean()) / np.ptp(swing)
    return replace(markers, positions=places), marker_set


def test_soft_thighs_are_no_exchanged_labels(recording_of):
    markers, marker_set = with_soft_thigh(recording_of)
    place = markers.positions
    apart = [
        np.linalg.norm(place[:, markers.labels.index("R.TH1")] - place[:, markers.labels.index(k)], axis=1)
        for k in ("R.Knee", "R.TH2", "R.TH3")
    ]
    assert max(np.ptp(np.nanquantile(one, [0.1, 0.9])) for one in apart) > 0.06
    assert torn_segments_trouble(markers, marker_set) == ""


def test_what_a_marker_goes_with_instead(recording_of):
    markers, marker_set = read(recording_of, "pig_c3d/subject_a_walk.c3d")
    other = {"RTIB": "LTIB", "LTIB": "RTIB"}
    swapped = replace(markers, labels=tuple(other.get(label, label) for label in markers.labels))
    trouble = torn_segments_trouble(swapped, marker_set)
    assert re.search(r"and that from (RTIB to L|LTIB to R)(KNE|ANK) \((thigh|shank)_[rl]\) by \d+ mm", trouble)


@pytest.mark.parametrize(("name", "segment"), CROSSED)
def test_whole_segments_of_the_other_leg(name, segment, recording_of):
    markers, marker_set = read(recording_of, name)
    right, left = (sorted(marker_set.segments[f"{segment}_{side}"]) for side in "rl")
    other = {a: b for one in zip(right, left, strict=True) for a, b in (one, one[::-1])}
    swapped = replace(markers, labels=tuple(other.get(label, label) for label in markers.labels))
    trouble = torn_segments_trouble(swapped, marker_set)
    assert "of the other leg" in trouble
    assert f"{'shank' if segment == 'foot' else segment}s" in trouble
