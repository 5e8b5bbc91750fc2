"""The part of a recording in which nobody moves."""

import numpy as np
import pytest

from kinertia.trial.data import Markers
from kinertia.trial.stillness import still_span_s

TIME = np.arange(400) / 100


def moving(speed_m_s):
    """Two markers that move along X at this speed (400,) m/s."""
    along = np.cumsum(speed_m_s) / 100
    return Markers(TIME, ("A", "B"), np.stack([np.column_stack([along, 0 * along, 0 * along])] * 2, axis=1))


def test_the_longest_part_is_found():
    walks = (TIME < 0.5) | (TIME > 2.5)
    start, end = still_span_s(moving(np.where(walks, 1.0, 0.01)))
    assert start == pytest.approx(0.5, abs=0.11)
    assert end == pytest.approx(2.5, abs=0.11)


def test_there_is_none_in_a_walk_or_in_a_short_pause():
    assert still_span_s(moving(np.full(400, 1.2))) is None
    assert still_span_s(moving(np.where((TIME > 1.0) & (TIME < 1.3), 0.0, 1.2))) is None
