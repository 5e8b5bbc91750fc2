"""What plates read while nobody stands on them, and what then is a load."""

import numpy as np
import pytest

from kinertia.trial.data import PlateLoads
from kinertia.trial.plate_loading import largest_n, with_unloaded_levels, without_unloaded_level

RATE_HZ = 1000.0
TIME = np.arange(3000) / RATE_HZ
MIDDLE = np.array([0.4, 0.0, -0.2])
LEVEL_N, LEVEL_NM = np.array([4.0, -30.0, -2.0]), np.array([5.0, 2.0, -3.0])
STEP = (TIME > 1.0) & (TIME < 1.6)


def steps(noise_n=0.5):
    """Force and moment of one step in the middle of a plate, with noise of the vertical force."""
    force = np.outer(np.where(STEP, 700.0 * np.abs(np.sin(np.pi * (TIME - 1.0) / 0.6)) ** 0.5, 0.0), [0.1, 1.0, 0.05])
    moment = np.cross(MIDDLE, force)
    return force + np.outer(np.random.default_rng(1).normal(0.0, noise_n, len(TIME)), [0.0, 1.0, 0.0]), moment


def test_the_level_is_taken_off_force_and_moment():
    force, moment = steps()
    load = without_unloaded_level(TIME, force + LEVEL_N, moment + LEVEL_NM)
    sound = without_unloaded_level(TIME, force, moment)
    assert load.unloaded.subtracted
    assert not sound.unloaded.subtracted
    assert load.unloaded.level_n == pytest.approx(LEVEL_N, abs=0.1)
    assert load.unloaded.level_nm == pytest.approx(LEVEL_NM, abs=0.1)
    np.testing.assert_allclose(load.force, sound.force, atol=1.5)
    np.testing.assert_allclose(load.moment[STEP], sound.moment[STEP], atol=0.3)


def test_without_a_moment_of_the_idle_plate_the_level_acts_in_the_middle_of_the_loads():
    """Files with points of application have none there."""
    force, moment = steps(noise_n=0.0)
    moment = np.where(STEP[:, None], moment + np.cross(MIDDLE, LEVEL_N), 0.0)
    load = without_unloaded_level(TIME, force + LEVEL_N, moment)
    assert load.unloaded.subtracted
    assert load.unloaded.twist_nm == 0.0
    firm = STEP & (load.force[:, 1] > 100.0)
    np.testing.assert_allclose(load.moment[firm], np.cross(MIDDLE, load.force[firm]), atol=0.8)


@pytest.mark.parametrize("torque_nm", [0.0, 1.5])
def test_a_horizontal_level_that_acts_in_the_middle_of_the_loads_is_taken_off_once(torque_nm):
    """It has a vertical moment only, as a torque without a point of application has."""
    level_n, torque = np.array([0.0, 0.0, -8.0]), np.array([0.0, torque_nm, 0.0])
    force, moment = steps(noise_n=0.0)
    load = without_unloaded_level(TIME, force + level_n, moment + np.cross(MIDDLE, level_n) + torque)
    assert load.unloaded.twist_nm == pytest.approx(torque_nm, abs=0.01)
    np.testing.assert_allclose(load.moment[STEP], moment[STEP], atol=0.01)


def test_a_torque_without_a_point_of_application_acts_in_the_middle_of_the_loads():
    level_n, torque = np.array([0.0, 0.0, -8.0]), np.array([0.0, 1.5, 0.0])
    force, moment = steps(noise_n=0.0)
    there = np.cross(MIDDLE, level_n) + torque
    load = without_unloaded_level(TIME, force + level_n, moment + np.where(STEP[:, None], there, torque))
    assert load.unloaded.twist_nm == pytest.approx(1.5)
    np.testing.assert_allclose(load.moment[STEP], moment[STEP], atol=0.01)


def test_a_moment_alone_is_a_level_too():
    force, moment = steps()
    load = without_unloaded_level(TIME, force, moment + np.array([0.0, 2.0, 0.0]))
    assert load.unloaded.subtracted
    assert load.unloaded.twist_nm == pytest.approx(2.0)


def test_who_vouches_for_the_zeros_keeps_them():
    force, moment = steps()
    load = without_unloaded_level(TIME, force + LEVEL_N, moment + LEVEL_NM)
    plates = PlateLoads(TIME, ("1",), load.force[:, None], load.moment[:, None], (None,), unloaded=(load.unloaded,))
    kept = with_unloaded_levels(plates)
    loaded = load.force.any(axis=1)
    np.testing.assert_allclose(kept.force[loaded, 0], (force + LEVEL_N)[loaded], atol=1e-9)
    np.testing.assert_allclose(kept.moment[STEP, 0], (moment + LEVEL_NM)[STEP], atol=1e-9)
    assert not kept.force[~loaded].any()
    assert kept.unloaded[0].remaining_n == load.unloaded.level_n
    assert with_unloaded_levels(kept).force is not plates.force
    np.testing.assert_array_equal(with_unloaded_levels(kept).force, kept.force)


@pytest.mark.parametrize("mains_hz", [50.0, 60.0])
def test_interference_of_the_mains_begins_and_ends_no_load(mains_hz):
    """50 N RMS, with a level beside it."""
    force, moment = steps(noise_n=2.0)
    force = force + np.outer(25.0 + 71.0 * np.sin(2 * np.pi * mains_hz * TIME), [0.0, 1.0, 0.0])
    load = without_unloaded_level(TIME, force, moment)
    loaded = np.flatnonzero(load.force.any(axis=1))
    assert TIME[loaded[0]] == pytest.approx(1.0, abs=0.015)
    assert TIME[loaded[-1]] == pytest.approx(1.6, abs=0.015)
    assert len(loaded) == pytest.approx(600, abs=25)
    assert load.unloaded.level_n[1] == pytest.approx(25.0, abs=2.0)


@pytest.mark.parametrize("offset_n", [0.0, 15.0])
def test_a_plate_that_shakes_around_the_threshold_is_not_stood_on(offset_n):
    """Stairs shake while somebody walks on their other steps."""
    rng = np.random.default_rng(2)
    shaking = np.convolve(rng.normal(0.0, 1.0, len(TIME)), np.hanning(60), mode="same")
    shaking *= 12.0 / shaking.std()
    force, moment = steps()
    load = without_unloaded_level(TIME, force + np.outer(offset_n + shaking, [0.0, 1.0, 0.0]), moment)
    loaded = np.flatnonzero(load.force.any(axis=1))
    assert (TIME[loaded[0]], TIME[loaded[-1]]) == (pytest.approx(1.0, abs=0.03), pytest.approx(1.6, abs=0.03))
    assert len(loaded) > 560


def test_a_level_that_changes_stays():
    force, moment = steps()
    force = force + np.outer(np.where(TIME < 0.8, -20.0, 20.0), [0.0, 1.0, 0.0])
    assert not without_unloaded_level(TIME, force, moment).unloaded.subtracted


def test_a_plate_that_is_pulled_at_rest_does_not_point_down():
    force, _ = steps()
    unloaded = np.where(STEP[:, None], 0.0, force)
    assert abs(largest_n(TIME, unloaded - [0.0, 30.0, 0.0])) < 5.0
    assert largest_n(TIME, -force) == pytest.approx(-700.0, abs=5.0)
