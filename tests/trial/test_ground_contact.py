"""A foot has landed when it is as slow as loaded feet, even where the landings on plates were slower than that."""

import numpy as np

from kinertia.trial.foot_motion import FootMotion
from kinertia.trial.ground_contact import _learned

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
