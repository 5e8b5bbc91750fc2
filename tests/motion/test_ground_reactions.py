from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from kinertia.motion.ground_reactions import ground_reactions, measured_reactions
from kinertia.motion.smoothing import smooth
from kinertia.trial.data import FootLoads
from kinertia.trial.ground_contact import centre_of_pressure

RATE_HZ, WEIGHT_N = 1000.0, 700.0
TIME = np.arange(2000) / RATE_HZ
PLACES = np.array([[0.6, 0.0, 0.1], [0.1, 0.0, -0.1]])


def loads(right_n: np.ndarray, left_n: np.ndarray) -> np.ndarray:
    """(k, 2, 6) of vertical forces with some push forward, at PLACES, with a free moment."""
    force = np.stack([right_n, left_n], axis=1)[..., None] * [0.1, 1.0, 0.02]
    moment = np.cross(PLACES, force) + force[..., 1:2] * [0.0, 0.01, 0.0]
    return np.concatenate([force, moment], axis=-1)


def kinematics(wrench: np.ndarray, noise_n: float = 0.0):
    """As far as ground reactions look at a trial."""
    feet = FootLoads(TIME, wrench[..., :3], wrench[..., 3:], noise_n=noise_n)
    everywhere = np.ones(len(TIME), bool)
    trial = SimpleNamespace(loads=feet)
    return SimpleNamespace(trial=trial, near_window=everywhere, cutoff_hz=10.0, inside=lambda time: everywhere)


def step(at_s: float, over_s: float = 0.01) -> np.ndarray:
    """From 1 to 0 within some milliseconds."""
    x = np.clip((TIME - at_s) / over_s, 0.0, 1.0)
    return 1.0 - x**2 * (3.0 - 2.0 * x)


def passed_on() -> np.ndarray:
    """The weight goes from foot to foot within 10 ms: the body's acceleration does not know."""
    return loads(WEIGHT_N * (1.0 - step(1.0)), WEIGHT_N * step(1.0))


def struck() -> np.ndarray:
    """The right foot lands with an impact of 20 ms while the left foot stands."""
    bump = 400.0 * np.exp(-0.5 * np.square((TIME - 1.0) / 0.005))
    return loads(WEIGHT_N * 0.3 * (TIME > 0.9) + bump, np.full(len(TIME), 0.6 * WEIGHT_N))


def test_what_one_foot_passes_to_the_other_stays_as_sharp_as_it_is():
    wrench = passed_on()
    reactions = ground_reactions(kinematics(wrench), 12.0)
    assert reactions.cutoff_hz is None
    np.testing.assert_allclose(reactions.wrench, wrench, atol=1e-9)
    assert reactions.impact_n == pytest.approx(0.0, abs=1e-9)


def test_an_impact_is_taken_off_the_foot_that_makes_it():
    wrench = struck()
    reactions = ground_reactions(kinematics(wrench), 12.0)
    assert reactions.impact_n > 10.0
    at = np.argmax(wrench[:, 0, 1])
    slow = smooth(TIME, wrench[..., :3].sum(axis=1), 12.0)(TIME)[at]
    left = reactions.wrench[at, :, :3].sum(axis=0) - slow
    assert np.linalg.norm(left) < 0.1 * np.linalg.norm(wrench[at, :, :3].sum(axis=0) - slow)
    assert np.abs(reactions.wrench - wrench)[at, 1, 1] < 0.05 * np.abs(reactions.wrench - wrench)[at, 0, 1]
    np.testing.assert_allclose(centre_of_pressure(reactions.wrench[at]), PLACES, atol=1e-6)


def test_the_user_may_keep_impacts_and_still_hears_of_them():
    wrench = struck()
    reactions = ground_reactions(kinematics(wrench), 12.0, "none")
    np.testing.assert_array_equal(reactions.wrench, wrench)
    assert reactions.impact_n > 10.0


def test_the_user_may_ask_for_a_low_pass():
    reactions = ground_reactions(kinematics(passed_on()), 12.0, 8.0)
    assert reactions.cutoff_hz == 8.0
    expected = smooth(TIME, passed_on().reshape(-1, 12), 8.0)(TIME).reshape(-1, 2, 6)
    np.testing.assert_allclose(reactions.wrench, expected)


@pytest.mark.parametrize(("noise_n", "cutoff_hz"), [(0.9, None), (4.0, 31.25), (30.0, 10.0)])
def test_noisy_plates_are_low_passed_as_far_as_their_noise_wants(noise_n, cutoff_hz):
    rng = np.random.default_rng(0)
    wrench = passed_on()
    noisy = wrench + rng.normal(0.0, noise_n, wrench.shape)
    reactions = measured_reactions(kinematics(noisy, noise_n))
    assert reactions.cutoff_hz == cutoff_hz
    if cutoff_hz == 31.25:
        calm = slice(300, 700)
        assert np.std((reactions.wrench - wrench)[calm, 1, 1]) < 1.3


def test_between_samples_loads_are_splines_of_force_point_and_torque():
    reactions = measured_reactions(kinematics(passed_on()))
    np.testing.assert_allclose(reactions.at(TIME[5:-5]), reactions.wrench[5:-5], atol=1e-9)
    h, at = 1e-6, TIME[100:-100:50] + 0.0003
    slope = (reactions.at(at + h) - reactions.at(at - h)) / (2 * h)
    loads, rates = reactions.with_rate(at)
    np.testing.assert_allclose(rates, slope, atol=1e-4 * np.abs(slope).max())
    columns = np.concatenate([reactions.wrench[..., :3], reactions.point, reactions.torque], axis=-1)
    force, point, torque = np.split(CubicSpline(TIME, columns, bc_type="natural")(at), 3, axis=-1)
    expected = np.concatenate([force, torque + np.cross(point, force)], axis=-1)
    np.testing.assert_allclose(loads, expected, atol=1e-9)


@pytest.mark.parametrize("beyond_s", [-0.0002, 0.0002])
def test_loads_just_beyond_the_samples_go_on(beyond_s):
    """Clocks differ: the first or last frame may lie outside."""
    reactions = measured_reactions(kinematics(passed_on()))
    end = reactions.time[[0 if beyond_s < 0.0 else -1]]
    loads, rates = reactions.with_rate(end)
    np.testing.assert_allclose(reactions.at(end + beyond_s), loads + beyond_s * rates, atol=1e-3)


def test_no_times_have_no_loads():
    reactions = measured_reactions(kinematics(passed_on()))
    assert reactions.at(np.empty(0)).shape == (0, 2, 6)


def test_a_foot_off_the_ground_keeps_its_last_centre_of_pressure():
    reactions = measured_reactions(kinematics(passed_on()))
    np.testing.assert_allclose(reactions.point[:, 0], np.broadcast_to(PLACES[0], (len(TIME), 3)), atol=1e-9)
    assert not reactions.wrench[:900, 0].any()


def test_an_impact_acts_under_the_foot_where_a_light_load_puts_its_centre_of_pressure_metres_away():
    wrench = struck()
    lands = (TIME > 0.9) & (TIME < 0.95)
    wrench[lands, 0, :3] *= 0.2
    wrench[lands, 0, 3:] = np.cross([-2.7, 0.0, -1.6], wrench[lands, 0, :3])
    reactions = ground_reactions(kinematics(wrench), 12.0)
    taken = reactions.impact[lands, 0]
    assert np.abs(taken[:, 1]).max() > 50.0
    about_foot = taken[:, 3:] - np.cross(PLACES[0], taken[:, :3])
    np.testing.assert_allclose(about_foot[:, [0, 2]], 0.0, atol=1e-6)


def stance(at_s: float) -> np.ndarray:
    """A step of 0.6 s that begins and ends within milliseconds."""
    return WEIGHT_N * (1.0 - step(at_s)) * step(at_s + 0.6) * (1.0 + 0.1 * np.cos(4.0 * np.pi * (TIME - at_s) / 0.6))


def test_forces_that_were_low_passed_are_uncertain_around_contacts():
    sound = loads(stance(0.3), stance(0.9))
    assert not np.any(measured_reactions(kinematics(sound)).blurred)
    filtered = smooth(TIME, sound.reshape(-1, 12), 8.0)(TIME).reshape(-1, 2, 6)
    reactions = ground_reactions(kinematics(filtered), 10.0)
    lost, expected = (sound - filtered)[..., 1], reactions.blurred[..., 1]
    near = np.abs(TIME[:, None] - np.array([0.3, 0.9])) < 0.1
    assert 0.2 < np.sqrt(np.square(expected[near]).mean() / np.square(lost[near]).mean()) < 1.0
    middle = slice(500, 700)  # of the first stance
    assert np.square(expected[middle, 0]).mean() < 0.04 * np.square(expected[near]).mean()
    np.testing.assert_array_equal(reactions.uncertain, reactions.impact + reactions.blurred)
