"""A foot has landed when it is as slow as loaded feet, even where the landings on plates were slower than that."""

import numpy as np

from kinertia.trial.data import FootLoads
from kinertia.trial.foot_motion import FootMotion
from kinertia.trial.ground_contact import _learned, ground_contact
from walk_on_plates import FEET, walk

RATE_HZ, FRAMES = 100, 100


def foot(speeds):
    """A foot with one marker, on the floor, of these speeds (m/s)."""
    velocity = np.zeros((FRAMES, 1, 3))
    velocity[:, 0, 0] = speeds
    return FootMotion(np.zeros((FRAMES, 1)), velocity, np.zeros(FRAMES, dtype=bool))


def test_slow_landings_do_not_hide_a_foot_that_rolls():
    """Markers are noisy: of a heel that rolls at 0.25 m/s, a landing may show 0.14, as in a fast walk that was seen."""
    loaded = np.zeros((FRAMES, 2), dtype=bool)
    loaded[30:70, 0] = loaded[60:90, 1] = True
    rolling = np.full(FRAMES, 3.0)
    rolling[30:70], rolling[29] = 0.25, 0.18
    rolling[30] = 0.10
    other = np.full(FRAMES, 3.0)
    other[60:90], other[59] = 0.25, 0.18
    other[60] = 0.10
    _, landing, leaving = _learned([foot(rolling), foot(other)], loaded)
    assert 0.2 <= landing <= 0.3
    assert leaving >= landing


def test_a_toe_that_brushes_over_the_plate_shows_no_landing():
    """62 N for 20 ms in swing made both feet land 0.2 s before they did."""
    recording = walk([("r", 0), ("l", -1)])  # a single landing
    plates, times = recording.plates, recording.markers.time
    brushed = plates.force.copy()
    brushed[(plates.time > 0.895) & (plates.time < 0.915), 0, 1] = 62.0
    expected, found = (
        ground_contact(recording.markers, FootLoads(plates.time, force, np.zeros_like(force)), FEET)
        for force in (plates.force, brushed)
    )
    there = found.loaded[:, 0] & (times > 0.85)
    assert there.any()
    assert np.array_equal(found.ground[~there], expected.ground[~there])
