"""A static trial that does not show the person standing on the floor, as tall as stated, is found."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.markers.axes_and_floor import floor
from kinertia.diagnostics.markers.marker_set import landmarks
from kinertia.diagnostics.registry import SUBJECT_STATIC_CHECKS
from kinertia.diagnostics.runner import asked
from kinertia.diagnostics.subject.body_data import stature
from kinertia.diagnostics.subject.movements import flat_feet
from kinertia.findings.finding import Severity
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.settings import Subject
from kinertia.trial.data import Markers
from loads_and_feet import context_of
from people import codes, with_markers
from recordings import is_here
from walk_on_plates import FEET, walk

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
def standing(request, recording_of):
    """Somebody's static trial."""
    name, height_m = request.param
    static = recording_of(name)
    return RecordingContext(static, choose_marker_set(static.markers.labels), is_static=True, height_m=height_m)


def moved(context, positions):
    markers = context.recording.markers
    changed = Markers(markers.time, markers.labels, positions)
    return replace(context, recording=with_markers(context.recording, changed))


def test_the_own_stature_and_floor(standing):
    assert asked(SUBJECT_STATIC_CHECKS, standing) == []
    assert list(floor(person(standing, standing))) == []


@pytest.mark.parametrize(
    ("off_m", "severity"),
    [(-0.2, Severity.WARNING), (0.2, Severity.WARNING), (-0.55, Severity.ERROR), (0.6, Severity.ERROR)],
)
def test_another_stature(standing, off_m, severity):
    """1.083 m for 1.803 m was a warning, too, and the prior of a child, or of the obese, was used."""
    (found,) = stature(replace(standing, height_m=standing.height_m + off_m))
    assert (found.code, found.severity) == ("S104", severity)
    assert found.evidence["implied_m"].value == pytest.approx(standing.height_m, abs=0.08)


def person(static, *trials):
    return PersonContext(Subject(name="person"), list(trials), static)


def risen(context, rise_m):
    return moved(context, context.recording.markers.positions + np.array([0.0, rise_m, 0.0]))


def test_one_marker_may_be_several_landmarks(standing):
    landmarks = standing.marker_set.landmarks
    toes = {f"toe_{side}": landmarks[f"metatarsal_{side}"] for side in "rl"}
    both = replace(standing.marker_set, landmarks={**landmarks, **toes})
    assert list(floor(replace(standing, marker_set=both))) == []


@pytest.mark.parametrize("rise_m", [-0.06, 0.06])
def test_another_floor(standing, rise_m):
    """In the static trial and, where there are trials, in all of them."""
    off = risen(standing, rise_m)
    for trials in ([], [off]):
        (found,) = floor(person(off, *trials))
        assert (found.code, found.severity) == ("M143", Severity.WARNING)
        assert found.evidence["height_m"].value == pytest.approx(0.033 + rise_m, abs=0.015)
    assert list(floor(person(standing, off))) == []


@pytest.mark.parametrize("rise_m", [0.06, 0.25])
def test_somebody_who_stands_on_a_box_or_in_thick_soles(standing, rise_m):
    (found,) = floor(person(risen(standing, rise_m), standing))
    assert (found.code, found.severity) == ("M143", Severity.INFO)


@pytest.mark.parametrize(("in_motion_m", "severity"), [(0.048, Severity.INFO), (0.052, Severity.WARNING)])
def test_a_floor_too_low_by_hardly_more_than_soles_is_told_by_the_feet_in_motion(standing, in_motion_m, severity):
    (far,) = floor(person(risen(standing, 0.06)))
    lowest_m = far.evidence["height_m"].value - 0.06
    (found,) = floor(person(risen(standing, 0.055 - lowest_m), risen(standing, in_motion_m - lowest_m)))
    assert (found.code, found.severity) == ("M143", severity)


@pytest.mark.parametrize(("down_m", "severity"), [(0.0, Severity.INFO), (0.06, Severity.WARNING)])
def test_the_floor_in_front_of_stairs_is_below_their_plates(standing, down_m, severity):
    """The origin was on the first step; whether it is right shows where the feet are on the plates."""
    climbing = walk([("r", 0), ("l", 0)], step_m=0.2)
    corners = np.zeros((2, 4, 3))
    corners[:, :, 1] = [[down_m], [0.2 + down_m]]  # feet and loads are at 0 and 0.2 m
    trial = context_of(replace(climbing, plates=replace(climbing.plates, corners=corners)), FEET)
    (found,) = floor(person(risen(standing, -0.16), trial))
    assert (found.code, found.severity) == ("M143", severity)


def test_feet_that_are_not_marked_enough(standing):
    marks = {name: labels for name, labels in standing.marker_set.landmarks.items() if "heel" not in name}
    assert list(floor(person(replace(standing, marker_set=replace(standing.marker_set, landmarks=marks))))) == []


@pytest.mark.parametrize(("landmark", "rise_m"), [("heel_r", 0.06), ("metatarsal_l", 0.06), ("heel_l", 0.02)])
def test_a_foot_that_does_not_stand_flat(standing, landmark, rise_m):
    markers = standing.recording.markers
    positions = markers.positions.copy()
    positions[:, markers.labels.index(standing.marker_set.landmarks[landmark][0]), 1] += rise_m
    found = list(flat_feet(moved(standing, positions)))
    name, side = landmark.split("_")
    where = [(name, "right foot" if side == "r" else "left foot")] if rise_m > 0.04 else []
    assert [(finding.evidence["landmark"].value, finding.where.part) for finding in found] == where
    assert codes(found) == ["S202"] * len(where)


def test_a_walk_that_was_given_as_the_static_trial(recording_of):
    walk = recording_of("synthetic/walk.trc")
    marker_set = choose_marker_set(recording_of("synthetic/static.trc").markers.labels)
    found = asked(SUBJECT_STATIC_CHECKS, RecordingContext(walk, marker_set, is_static=True))
    assert found[0].code == "S201"
    assert found[0].evidence["distance_m"].value > 1.0


def test_a_static_trial_from_which_no_model_can_be_built(standing):
    """A landmark that is not there, and a thigh without length."""
    markers, marks = standing.recording.markers, standing.marker_set.landmarks
    without = markers.select([label for label in markers.labels if label not in marks["asis_r"]])
    (found,) = landmarks(replace(standing, recording=with_markers(standing.recording, without)))
    assert (found.code, found.where.part) == ("L105", "pelvis")
    positions = markers.positions.copy()
    at = [markers.labels.index(marks[f"asis_{side}"][0]) for side in "rl"]
    positions[:, at[1]] = positions[:, at[0]]
    (found,) = landmarks(moved(standing, positions))
    assert found.code == "S206"
