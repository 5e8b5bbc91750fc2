"""The cutoff of a filter is read from the loads of contacts, whatever the reader did with small forces."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from kinertia.motion.ground_reactions import load_bandwidth_hz

RATE_HZ = 1000.0
TIME = np.arange(2400) / RATE_HZ


def step(start_s, heel_strike_n=150.0):
    """A contact with a transient of 12 ms after it begins, N."""
    after = np.clip((TIME - start_s) / 0.65, 0.0, 1.0)
    transient = np.exp(-0.5 * np.square((TIME - start_s - 0.02) / 0.006)) * (start_s < TIME)
    rise = 1.0 - np.exp(-(TIME - start_s) / 0.01)
    humps = 900.0 * (np.sin(np.pi * after) + 0.35 * np.sin(3 * np.pi * after))
    return np.where(after > 0.0, humps * np.maximum(rise, 0.0) + heel_strike_n * transient, 0.0)


def steps(*starts_s):
    return np.stack([step(start) for start in starts_s], axis=1)


def low_passed(force, cutoff_hz):
    """By a zero-phase Butterworth filter with this cutoff (-3 dB); what is small is zero."""
    smooth = sosfiltfilt(butter(2, cutoff_hz / 0.802, fs=RATE_HZ, output="sos"), force, axis=0)
    return np.where(smooth < 10.0, 0.0, smooth)


@pytest.mark.parametrize("cutoff_hz", [6.0, 8.0, 10.0, 15.0])
def test_the_cutoff_of_a_filter(cutoff_hz):
    found = load_bandwidth_hz(TIME, low_passed(steps(0.5, 1.2), cutoff_hz))
    assert found == pytest.approx(cutoff_hz, rel=0.25)


def test_loads_as_plates_gave_them():
    sound = steps(0.5, 1.2)
    assert load_bandwidth_hz(TIME, sound) > 20.0
    # noise of the plates is not taken for less bandwidth, nor for more where there was a filter
    noise = np.random.default_rng(3).normal(0.0, 0.1, sound.shape)
    assert load_bandwidth_hz(TIME, sound + noise) > 20.0
    assert load_bandwidth_hz(TIME, low_passed(sound, 8.0) + noise) < 11.0


def test_times_that_a_file_rounds():
    filtered = low_passed(steps(0.5, 1.2), 8.0)
    assert load_bandwidth_hz(np.round(TIME + 1 / 3000, 3), filtered) == pytest.approx(
        load_bandwidth_hz(TIME, filtered), rel=0.01
    )


@pytest.mark.parametrize(
    "vertical",
    [np.zeros((2400, 1)), steps(-0.3), steps(2.0), np.full((2400, 1), 700.0), 0.2 * steps(0.5)],
    ids=["unloaded", "begins loaded", "ends loaded", "standing", "small"],
)
def test_without_a_whole_contact_nothing_is_known(vertical):
    assert load_bandwidth_hz(TIME, vertical) is None


def test_too_few_samples():
    assert load_bandwidth_hz(TIME[::25], steps(0.5)[::25]) is None
