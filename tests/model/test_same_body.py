"""A static trial of another person is told by its lengths; the person's own never is."""

import pytest

from kinertia.io.marker_set_file import choose_marker_set
from kinertia.model.same_body import body_trouble
from kinertia.trial.data import Markers

PEOPLE = [
    ("gait2354/subject01_static.trc", "gait2354/subject01_walk1.trc"),
    ("rajagopal_walk/static_walk_1.trc", "rajagopal_walk/motion_capture_walk.trc"),
    ("pig_c3d/subject_a_static.c3d", "pig_c3d/subject_a_walk.c3d"),
    ("pig_c3d/subject_b_static.c3d", "pig_c3d/subject_b_walk.c3d"),
]


@pytest.fixture(params=PEOPLE, ids=[static for static, _ in PEOPLE])
def person(request, measured_recording):
    """Markers of somebody's static trial and walk, and their set."""
    static, walk = (measured_recording(name).markers for name in request.param)
    return static, walk, choose_marker_set(static.labels)


def test_the_own_static_trial(person):
    assert body_trouble(*person) == ""


@pytest.mark.parametrize("size", [0.9, 1.1])
def test_the_static_trial_of_a_person_of_another_size(person, size):
    static, walk, marker_set = person
    other = Markers(static.time, static.labels, size * static.positions)
    told = body_trouble(other, walk, marker_set)
    assert ("longer" if size < 1 else "shorter") in told
    assert "another person" in told
