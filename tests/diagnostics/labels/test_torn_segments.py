"""Markers that do not move with their segment are named with those that they go with; sound trials never are."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinertia.diagnostics.labels.torn_segments import torn_segments_trouble
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from recordings import here

OPENCAP = Path(__file__).parents[1] / "subject4.toml"
LOW_WANDS = "synthetic/walk.c3d with low wands"
"""On the thighs, 9 cm above the knee as those of subject B; in the file they are twice as far up."""
SOUND = here(
    [
        "synthetic/walk.trc",
        "synthetic/run.trc",
        "synthetic/squats.trc",
        "synthetic/walk.c3d",
        LOW_WANDS,
        "synthetic/clusters_walk.trc",
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
)
CLUSTERS = here(["synthetic/clusters_walk.trc", "rajagopal_walk/motion_capture_walk.trc"])
SOFT_M = {"synthetic/clusters_walk.trc": 0.11, "rajagopal_walk/motion_capture_walk.trc": 0.09}
"""How far skin takes a thigh's marker along."""
WANDS = here(["synthetic/walk.c3d", "pig_c3d/subject_a_walk.c3d"])
EXCHANGED = [
    *[(name, [(f"R.SH{k}", f"L.SH{k}") for k in (1, 2, 3, 4)], "shank") for name in CLUSTERS],
    *[(name, [(f"R.TH{k}", f"R.SH{k}") for k in (1, 2, 3)], "shank_r") for name in CLUSTERS],
    *[(name, [("R.Heel", "L.Heel"), ("R.Toe", "L.Toe"), ("R.MT5", "L.MT5")], "ankle") for name in CLUSTERS],
    *[(name, [("RTIB", "LTIB")], "shank") for name in WANDS],
    *[(name, [("RTHI", "LTHI")], "thigh") for name in here([LOW_WANDS, "pig_c3d/subject_b_walk.c3d"])],
]
"""With what moves by itself then."""
CROSSED = [
    *[(name, "foot") for name in here(["synthetic/walk.trc", "gait2354/subject01_walk1.trc"])],
    *[
        (name, segment)
        for segment in ("thigh", "shank")
        for name in here(
            [
                "synthetic/walk.trc",
                "synthetic/run.trc",
                "gait2354/subject01_walk1.trc",
                "field/rajagopal_run/motion_capture_run.trc",
            ]
        )
    ],
]
"""Walks whose sets have no markers at the joints."""


def read(recording_of, name):
    markers = recording_of(name.removesuffix(" with low wands")).markers
    if name == LOW_WANDS:
        markers = with_low_wands(markers)
    marker_set = read_marker_set(OPENCAP) if "subject4" in name else choose_marker_set(markers.labels)
    return markers.select([label for label in marker_set.labels if label in markers.labels]), marker_set


def with_low_wands(markers):
    places = markers.positions.copy()
    for side in "RL":
        wand, knee = (markers.labels.index(f"{side}{label}") for label in ("THI", "KNE"))
        places[:, wand] = places[:, [wand, knee]].mean(axis=1)
    return replace(markers, positions=places)


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


def with_soft_thigh(recording_of, name):
    """A walk with a thigh marker that skin takes along with the hip's angle, so that the distance to the knee's changes
    by more than 60 mm.
    """
    markers, marker_set = read(recording_of, name)
    places = markers.positions.copy()
    thigh, knee, ankle = (markers.labels.index(name) for name in ("R.TH1", "R.Knee", "R.Ankle"))
    along = places[:, knee] - places[:, ankle]
    swing = along[:, 0] / np.linalg.norm(along, axis=1)
    places[:, thigh, 0] += SOFT_M[name] * (swing - swing.mean()) / np.ptp(swing)
    return replace(markers, positions=places), marker_set


@pytest.mark.parametrize("name", CLUSTERS)
def test_soft_thighs_are_no_exchanged_labels(name, recording_of):
    markers, marker_set = with_soft_thigh(recording_of, name)
    place = markers.positions
    apart = [
        np.linalg.norm(place[:, markers.labels.index("R.TH1")] - place[:, markers.labels.index(k)], axis=1)
        for k in ("R.Knee", "R.TH2", "R.TH3")
    ]
    assert max(np.ptp(np.nanquantile(one, [0.1, 0.9])) for one in apart) > 0.06
    assert torn_segments_trouble(markers, marker_set) == ""


@pytest.mark.parametrize("name", WANDS)
def test_what_a_marker_goes_with_instead(name, recording_of):
    markers, marker_set = read(recording_of, name)
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
