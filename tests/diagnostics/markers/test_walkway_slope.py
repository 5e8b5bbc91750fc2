"""Cameras whose vertical is tilted along the walk are named; level floors, boxes and belts never are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.diagnostics.markers.walkway_slope import walkway_slope_doubts
from kinertia.io.marker_set_file import choose_marker_set
from recordings import here

OPENCAP = {"r": ("r_calc", "r_5meta", "r_toe"), "l": ("L_calc", "L_5meta", "L_toe")}
LEVEL = here(
    [
        "synthetic/walk.trc",
        "synthetic/long.trc",
        "synthetic/walk.c3d",
        "rajagopal_walk/motion_capture_walk.trc",
        "pig_c3d/subject_a_walk.c3d",
        "pig_c3d/subject_b_walk.c3d",
    ]
)
WALKS = [
    *LEVEL,
    *here(["subject4/walking1.trc", "subject4/walking2.trc", "field/laiarnold6_walk/walking1.trc"]),
]
OTHERS = here(
    [
        "synthetic/squats.trc",
        "synthetic/run.trc",
        "gait2354/subject01_walk1.trc",
        "subject4/squats1.trc",
        "field/laiarnold5_jump/DJ1.trc",
        "field/rajagopal_run/motion_capture_run.trc",
        "field/hamner_run/subject02_running.trc",
    ]
)


def read(recording_of, name):
    markers = recording_of(name).markers
    if "r_calc" in markers.labels:
        return markers, OPENCAP
    return markers, choose_marker_set(markers.labels).foot_labels()


@pytest.mark.parametrize("name", [*WALKS, *OTHERS])
def test_sound_floors(name, recording_of):
    assert walkway_slope_doubts(*read(recording_of, name)) == []


@pytest.mark.parametrize("degrees", [1.5, -3.0])
@pytest.mark.parametrize("name", WALKS)
def test_tilted_cameras(name, degrees, recording_of):
    markers, feet = read(recording_of, name)
    way = markers.positions[-1] - markers.positions[0]
    axis = "z" if np.nanmax(abs(way[:, 0])) > np.nanmax(abs(way[:, 2])) else "x"
    turn = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    (doubt,) = walkway_slope_doubts(replace(markers, positions=markers.positions @ turn.T), feet)
    said = float(doubt.partition("rises by ")[2].partition(" degrees")[0])
    assert said == pytest.approx(abs(degrees), abs=0.3)


@pytest.mark.parametrize("name", LEVEL)
def test_a_level_floor_that_is_turned(name, recording_of):
    markers, feet = read(recording_of, name)
    turn = Rotation.from_euler("y", 40, degrees=True).as_matrix()
    assert walkway_slope_doubts(replace(markers, positions=markers.positions @ turn.T), feet) == []
