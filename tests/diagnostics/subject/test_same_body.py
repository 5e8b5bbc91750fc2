"""A static trial of another person is told by its lengths; the person's own never is."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.segment_distances import SegmentDistances
from kinertia.diagnostics.subject.same_body import body_trouble, session_doubts
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.data import Markers
from recordings import here

CLINIC = here(
    [
        ("synthetic/static.trc", "synthetic/walk.trc"),
        ("gait2354/subject01_static.trc", "gait2354/subject01_walk1.trc"),
    ]
)
JOINTS_AND_BACK = here(
    [
        ("synthetic/static.c3d", "synthetic/walk.c3d"),
        ("synthetic/clusters_static.trc", "synthetic/clusters_walk.trc"),
        ("rajagopal_walk/static_walk_1.trc", "rajagopal_walk/motion_capture_walk.trc"),
        ("pig_c3d/subject_a_static.c3d", "pig_c3d/subject_a_walk.c3d"),
        ("pig_c3d/subject_b_static.c3d", "pig_c3d/subject_b_walk.c3d"),
    ]
)
"""With markers at knees and ankles in the walk, and two at the back of the pelvis."""
PEOPLE = [*CLINIC, *JOINTS_AND_BACK]
with_joints_and_back = pytest.mark.parametrize(
    "person", JOINTS_AND_BACK, indirect=True, ids=[static for static, _ in JOINTS_AND_BACK]
)


@pytest.fixture(params=PEOPLE, ids=[static for static, _ in PEOPLE])
def person(request, recording_of):
    """Markers of somebody's static trial and walk, and their set."""
    static, walk = (recording_of(name).markers for name in request.param)
    return static, walk, choose_marker_set(static.labels)


def test_the_own_static_trial(person):
    assert body_trouble(SegmentDistances.of(*person)) == ""
    assert session_doubts(SegmentDistances.of(*person)) == []


@pytest.mark.parametrize("size", [0.9, 1.1])
def test_the_static_trial_of_a_person_of_another_size(person, size):
    static, walk, marker_set = person
    other = Markers(static.time, static.labels, size * static.positions)
    trouble = body_trouble(SegmentDistances.of(other, walk, marker_set))
    assert ("longer" if size < 1 else "shorter") in trouble
    assert "another person" in trouble


@pytest.mark.parametrize(
    "person", [one for one in PEOPLE if one[0] != "synthetic/static.c3d"], indirect=True, ids=lambda one: one[0]
)
@pytest.mark.parametrize("seed", range(3))
def test_markers_put_on_anew(person, seed):
    """By 12 mm, which the two or three markers of a segment in Plug-in Gait show for most people, not for all."""
    static, walk, marker_set = person
    offsets = np.random.default_rng(seed).normal(0.0, 0.012, (len(static.labels), 3))
    put_on_anew = Markers(static.time, static.labels, static.positions + offsets)
    (doubt,) = session_doubts(SegmentDistances.of(put_on_anew, walk, marker_set))
    assert "of another session" in doubt


def test_one_marker_that_was_moved(person):
    static, walk, marker_set = person
    label = marker_set.landmarks["heel_r"][0]
    mates = [one for one in marker_set.segments["foot_r"] if one != label and one in walk.labels]
    places = walk.positions.copy()
    away = places[:, walk.labels.index(label)] - places[:, [walk.labels.index(one) for one in mates]].mean(axis=1)
    places[:, walk.labels.index(label)] += 0.06 * away / np.linalg.norm(away, axis=1, keepdims=True)
    (doubt,) = session_doubts(SegmentDistances.of(static, Markers(walk.time, walk.labels, places), marker_set))
    assert f"the marker {label}" in doubt
    assert "elsewhere" in doubt


@with_joints_and_back
def test_labels_that_were_exchanged(person):
    static, walk, marker_set = person
    knee, ankle = (marker_set.landmarks[f"{name}_lateral_l"][0] for name in ("knee", "ankle"))
    other = {knee: ankle, ankle: knee}
    labels = tuple(other.get(label, label) for label in walk.labels)
    trouble = body_trouble(SegmentDistances.of(static, Markers(walk.time, labels, walk.positions), marker_set))
    assert f"{knee} and {ankle} look swapped" in trouble or f"{ankle} and {knee} look swapped" in trouble


@with_joints_and_back
def test_front_and_back_of_the_pelvis_exchanged_in_one_trial(person):
    """Two pairs at once: either alone is no cure."""
    static, walk, marker_set = person
    other = {}
    for side in "rl":
        (front,), (back,) = (marker_set.landmarks[f"{name}_{side}"] for name in ("asis", "psis"))
        other |= {front: back, back: front}
    labels = tuple(other.get(label, label) for label in static.labels)
    trouble = body_trouble(SegmentDistances.of(Markers(static.time, labels, static.positions), walk, marker_set))
    assert trouble.count(" and ") >= 3
    assert "look swapped" in trouble
    assert all(label in trouble for label in other)


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_another_scale_of_the_cameras(person, factor):
    static, walk, marker_set = person
    scaled = replace(walk, positions=factor * walk.positions)
    (doubt,) = session_doubts(SegmentDistances.of(static, scaled, marker_set))
    assert "segments alike" in doubt
    assert "longer" in doubt if factor > 1 else "shorter" in doubt
    assert float(doubt.partition("segment are ")[2].partition(" %")[0]) == pytest.approx(3.0, abs=1.0)


@pytest.mark.parametrize("factor", [0.985, 1.015])
def test_a_camera_scale_that_is_1_5_percent_off(person, factor):
    """About the middle of the trial, so that the person stays on the plates."""
    static, walk, marker_set = person
    middle = np.nanmean(walk.positions, axis=(0, 1))
    scaled = replace(walk, positions=factor * (walk.positions - middle) + middle)
    (doubt,) = session_doubts(SegmentDistances.of(static, scaled, marker_set))
    assert "longer" in doubt if factor > 1 else "shorter" in doubt
    assert "calibrated anew" in doubt
