from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.motion.smoothing import smooth
from kinertia.trial.data import FootLoads

TIME = np.arange(2000) / 1000.0


def trial(hz: float, amplitude_n: float = 40.0, rate_hz: float = 100.0):
    """A trial whose vertical force swings at this frequency about 700 N."""
    force = np.zeros((len(TIME), 2, 3))
    force[:, 0, 1] = 700.0 + amplitude_n * np.sin(2 * np.pi * hz * TIME)
    feet = FootLoads(TIME, force, np.zeros_like(force))
    return SimpleNamespace(
        trial=SimpleNamespace(loads=feet, markers=SimpleNamespace(rate_hz=rate_hz)),
        windows_s=((0.3, 1.7),),
        inside=lambda time: (time >= 0.3) & (time <= 1.7),
        smoothed_loads=lambda cutoff: smooth(TIME, feet.wrench.reshape(-1, 12), cutoff),
    )


@pytest.mark.parametrize(("hz", "expected"), [(4.0, 10.0), (7.5, 12.0), (9.0, 15.0), (30.0, 15.0)])
def test_it_follows_the_sum_of_the_forces(hz, expected):
    assert [bandwidth.motion_hz for bandwidth in Bandwidth.of([trial(hz)])] == [expected]


def test_markers_show_nothing_faster_than_their_frames():
    assert Bandwidth.of([trial(30.0, rate_hz=60.0)])[0].motion_hz == 12.0
    assert Bandwidth.of([trial(30.0, rate_hz=30.0)])[0].motion_hz == 10.0


def test_each_of_several_trials_has_its_own():
    assert [bandwidth.motion_hz for bandwidth in Bandwidth.of([trial(4.0), trial(9.0), trial(4.0)])] == [
        10.0,
        15.0,
        10.0,
    ]


def test_the_user_may_choose():
    for bandwidth in Bandwidth.of([trial(4.0), trial(9.0)], 8.0, "none"):
        assert (bandwidth.motion_hz, bandwidth.force, bandwidth.spacing_s) == (8.0, "none", 0.0625)
