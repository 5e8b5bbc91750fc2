import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments.plates import SWING, swing_factors

TIME = np.arange(200) / 100.0
WEIGHT_N = 700.0
UP = np.array([0.0, 1.0, 0.0])


def test_who_stands_is_as_sure_as_before():
    factors = swing_factors(TIME, np.outer(np.full(200, WEIGHT_N), UP), np.ones(200, bool), WEIGHT_N, 3.5)
    np.testing.assert_allclose(factors, 1.0)


def test_deviations_grow_with_the_force_that_accelerates_in_any_direction():
    force = np.tile([200.0, WEIGHT_N, -100.0], (200, 1))
    factors = swing_factors(TIME, force, np.ones(200, bool), WEIGHT_N, 3.5)
    assert factors[100] == pytest.approx(np.sqrt(1.0 + (SWING * np.hypot(200.0, 100.0) / 3.5) ** 2))


def test_frames_without_measured_contacts_say_nothing_of_the_body_s_acceleration():
    dynamic = TIME < 1.0
    factors = swing_factors(TIME, np.outer(np.where(dynamic, WEIGHT_N, 0.0), UP), dynamic, WEIGHT_N, 3.5)
    np.testing.assert_allclose(factors, 1.0)
