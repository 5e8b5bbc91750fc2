"""A standing pose out of a walk, against the person's own static trial."""

import numpy as np
import pytest

from kinertia.io.marker_set_file import marker_set_of
from kinertia.motion.pose_fit import stance_pose
from kinertia.trial.data import Markers


def legs(marker_set, side):
    return [label for name in ("thigh", "shank", "foot") for label in marker_set.segments[f"{name}_{side}"]]


@pytest.mark.parametrize("name", ["synthetic/walk.c3d"])
def test_distances_within_segments_are_those_of_the_walk(recording_of, name):
    markers = recording_of(name).without_empty_markers().markers
    marker_set = marker_set_of(markers)
    pose = stance_pose(markers, marker_set)
    assert pose is not None
    assert len(pose.time) == 1
    for segment in ("thigh_r", "shank_r", "foot_r", "thigh_l", "shank_l", "foot_l", "pelvis"):
        labels = [label for label in marker_set.segments[segment] if label in markers.labels]
        here, there = pose.select(labels).positions, markers.select(labels).positions
        for k in range(1, len(labels)):
            usual = np.nanmedian(np.linalg.norm(there[:, k] - there[:, 0], axis=1))
            assert np.linalg.norm(here[0, k] - here[0, 0]) == pytest.approx(usual, abs=0.015)


def test_both_feet_are_flat_and_the_pelvis_is_one(recording_of):
    markers = recording_of("synthetic/walk.c3d").without_empty_markers().markers
    marker_set = marker_set_of(markers)
    pose = stance_pose(markers, marker_set)
    assert pose is not None
    place = dict(zip(pose.labels, pose.positions[0], strict=True))
    heels, toes = ([place[f"{side}{part}"][1] for side in "RL"] for part in ("HEE", "TOE"))
    assert abs(heels[0] - heels[1]) < 0.03
    assert abs(toes[0] - toes[1]) < 0.03
    knees = place["RKNE"] - place["LKNE"]
    across = place["RASI"] - place["LASI"]
    assert knees @ across > 0.8 * np.linalg.norm(knees) * np.linalg.norm(across)


def test_no_pose_without_a_landmark_of_a_leg(recording_of):
    markers = recording_of("synthetic/walk.c3d").without_empty_markers().markers
    marker_set = marker_set_of(markers)
    assert stance_pose(markers.select([label for label in markers.labels if label != "RKNE"]), marker_set) is None
    hidden = np.where(np.array([label == "LASI" for label in markers.labels])[None, :, None], np.nan, markers.positions)
    assert stance_pose(Markers(markers.time, markers.labels, hidden), marker_set) is None
