"""Errors of known power, and what of it is seen in the motion's band."""

import numpy as np
import pytest
from scipy.signal import lfilter

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.markers.marker_errors import ErrorProcess
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observation
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.uncertainty import motion_noise as module
from kinertia.estimation.simultaneous.uncertainty.motion_noise import motion_noise
from kinertia.synthetic.walk import SyntheticTrial, walk, walking_subject
from small_problem import INSTRUMENTS, small_ground

FRAMES_ALIKE, SD_M, SPACING_S = 9.0, 0.004, 0.05


@pytest.fixture(scope="module")
def trial() -> SyntheticTrial:
    return walk(walking_subject(), 6.0, trapezoid=False)


@pytest.fixture(scope="module")
def expected(trial) -> np.ndarray:
    """Errors as the estimate expects them, m."""
    process, (n, m, _) = ErrorProcess.double_over(FRAMES_ALIKE), trial.markers.positions.shape
    fresh = np.random.default_rng(0).normal(0.0, np.sqrt(process.new), (500 + n, m, 3))
    return SD_M * lfilter([1.0], [1.0, *(-each for each in process.of_before)], fresh, axis=0)[500:]


def found(trial: SyntheticTrial, errors: np.ndarray) -> np.ndarray:
    """At the true motion and body, which have taken up none of the errors."""
    markers = trial.markers.positions + errors
    seen = Observation(
        trial.time,
        markers,
        np.full(markers.shape[1], SD_M),
        FRAMES_ALIKE,
        trial.motion.q,
        SPACING_S,
        np.arange(len(trial.time)) > 30,
        small_ground(trial, np.random.default_rng(1)),
        6.0,
        2.0,
    )
    calibration = CalibrationPrior({}, np.full(markers.shape[1], 0.005), INSTRUMENTS)
    prior = literature_prior(walking_subject().literature)
    problem = MapProblem(trial.skeleton, prior, calibration, [seen])
    return motion_noise(problem, 0, problem.beginning.coefficients[0], problem.layout.start)


def taken_up(trial: SyntheticTrial) -> float:
    """By 27 coordinates of three times the markers."""
    return 27.0 / trial.markers.positions[0].size


@pytest.mark.parametrize("size", [0.3, 0.45, 0.6, 1.5])
def test_errors_as_expected_but_for_their_size(trial, expected, size):
    power = size**2 / (1.0 - taken_up(trial))
    shares = found(trial, size * expected)
    np.testing.assert_allclose(shares, min(3.0 * power, 1.0), rtol=0.1)


def test_slow_errors_hardly_accelerate(trial):
    """As skin that follows the gait: 8 mm to and fro at the strides' rate."""
    slow = 0.004 * np.sin(2.0 * np.pi * 0.8 * trial.time + np.arange(trial.markers.positions[0].size)[:, None]).T
    place, rate, acceleration = found(trial, slow.reshape(trial.markers.positions.shape))
    assert place > 0.9
    assert acceleration < 0.01 < rate < 0.2


def test_gaps_and_parts_change_little(trial, expected, monkeypatch):
    whole = found(trial, 0.3 * expected)
    monkeypatch.setattr(module, "_MOST_FRAMES", 320)
    np.testing.assert_allclose(found(trial, 0.3 * expected), whole, rtol=0.15)
    gaps = 0.3 * expected
    gaps[100:300, :5] = np.nan
    gaps[:, 7] = np.nan
    gaps[::40, 9] = np.nan
    gaps[50:, 11] = np.nan
    np.testing.assert_allclose(found(trial, gaps), whole, rtol=0.15)


def test_nothing_seen_is_as_expected(trial, expected):
    assert found(trial, np.nan * expected).tolist() == [1.0, 1.0, 1.0]
