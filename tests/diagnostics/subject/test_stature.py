"""A stature or a floor that the markers contradict is named."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.subject.stature import flat_feet_doubts, floor_doubts, stature_doubts
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.data import Markers
from recordings import is_here

STATURES_M = {
    "synthetic/static.trc": 1.803,
    "synthetic/static.c3d": 1.803,
    "synthetic/clusters_static.trc": 1.803,
    "gait2354/subject01_static.trc": 1.803,
    "rajagopal_walk/static_walk_1.trc": 1.83,
    "pig_c3d/subject_a_static.c3d": 1.61,
    "pig_c3d/subject_b_static.c3d": 1.505,
}
PEOPLE = {name: height_m for name, height_m in STATURES_M.items() if is_here(name)}


@pytest.fixture(params=PEOPLE.items(), ids=list(PEOPLE))
def person(request, recording_of):
    name, height_m = request.param
    static = recording_of(name)
    return static, choose_marker_set(static.markers.labels), height_m


def test_the_own_stature_and_floor(person):
    static, marker_set, height_m = person
    assert stature_doubts(static, marker_set, height_m) == []
    assert floor_doubts(static.markers, marker_set) == []
    assert flat_feet_doubts(static.markers, marker_set) == []


@pytest.mark.parametrize("off_m", [-0.2, 0.2])
def test_another_stature(person, off_m):
    static, marker_set, height_m = person
    (doubt,) = stature_doubts(static, marker_set, height_m + off_m)
    by_markers = float(doubt.partition("a stature of about ")[2].split()[0])
    assert by_markers == pytest.approx(height_m, abs=0.08)


@pytest.mark.parametrize("rise_m", [-0.06, 0.06])
def test_another_floor(person, rise_m):
    static, marker_set, _ = person
    markers = static.markers
    raised = Markers(markers.time, markers.labels, markers.positions + np.array([0.0, rise_m, 0.0]))
    (doubt,) = floor_doubts(raised, marker_set)
    assert "above the floor" in doubt


def test_feet_that_are_not_marked_enough(person):
    static, marker_set, _ = person
    without = replace(marker_set, landmarks={k: v for k, v in marker_set.landmarks.items() if "heel" not in k})
    assert floor_doubts(static.markers, without) == []


@pytest.mark.parametrize(("landmark", "rise_m"), [("heel_r", 0.06), ("metatarsal_l", 0.06), ("heel_l", 0.02)])
def test_a_foot_that_does_not_stand_flat(person, landmark, rise_m):
    static, marker_set, _ = person
    markers = static.markers
    positions = markers.positions.copy()
    positions[:, markers.labels.index(marker_set.landmarks[landmark][0]), 1] += rise_m
    doubts = flat_feet_doubts(Markers(markers.time, markers.labels, positions), marker_set)
    name, side = landmark.split("_")
    where = f"the {name} of the {'right' if side == 'r' else 'left'} foot is "
    assert [where in doubt for doubt in doubts] == [True] * (rise_m > 0.04)
