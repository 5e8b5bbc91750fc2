import numpy as np
import pytest

from kinertia.estimation.simultaneous.markers.marker_errors import ErrorInformation, ErrorProcess
from tests.small_problem import process_covariance

PROCESSES = [ErrorProcess(), ErrorProcess.double_over(9.0), ErrorProcess.with_smaller(0.2, 9.0)]


def made(process: ErrorProcess, n: int, rng: np.random.Generator, columns: int = 40) -> np.ndarray:
    """(n, columns) errors of unit variance, begun long before."""
    (lag1, two), errors = process.of_before, np.zeros((n + 500, columns))
    news = np.sqrt(process.new) * rng.standard_normal(errors.shape)
    for k in range(2, len(errors)):
        errors[k] = lag1 * errors[k - 1] + two * errors[k - 2] + news[k]
    return errors[500:]


def together(errors: np.ndarray) -> np.ndarray:
    three = np.stack([errors[2:], errors[1:-1], errors[:-2]]).reshape(3, -1)
    return three @ three.T / three.shape[1]


@pytest.mark.parametrize("frames", [1.0, 1.5, 4.0, 30.0])
@pytest.mark.parametrize("smaller", [None, 0.0, 0.15])
def test_the_poles_make_errors_alike_over_so_many_frames(frames, smaller):
    double = ErrorProcess.double_over(frames)
    process = double if smaller is None else ErrorProcess.with_smaller(smaller, frames)
    assert process.frames == pytest.approx(frames, rel=1e-9)
    assert process_covariance(process, np.abs(np.arange(-2000, 2001))).sum() == pytest.approx(frames, rel=1e-9)


def test_news_is_what_a_frame_shows_beyond_the_two_before_it():
    rng = np.random.default_rng(0)
    process = ErrorProcess.with_smaller(0.3, 12.0)
    beyond = np.array([1.0, *(-coefficient for coefficient in process.of_before)])
    assert beyond @ together(made(process, 4000, rng)) @ beyond == pytest.approx(process.new, rel=0.02)


@pytest.mark.parametrize("frames", [1.0, 3.0, 12.0, 60.0])
def test_a_process_with_a_double_pole_is_found_again(frames):
    process = ErrorProcess.double_over(frames)
    recovered, variance = ErrorProcess.read(frames, together(made(process, 4000, np.random.default_rng(1)))[None])
    assert variance == pytest.approx(1.0, abs=0.03)
    assert recovered.larger == pytest.approx(process.larger, abs=0.04)
    assert recovered.smaller == pytest.approx(process.smaller, abs=0.08)


@pytest.mark.parametrize("white", [0.001, 0.03, 0.3])
def test_no_less_news_than_in_the_errors_where_the_cameras_add_theirs(white):
    """Slow errors of a posture, and white noise: as the double pole alone has it, a frame would tell far too much."""
    rng = np.random.default_rng(2)
    slow = made(ErrorProcess.double_over(46.0), 4000, rng)
    errors = np.sqrt(1.0 - white) * slow + np.sqrt(white) * rng.standard_normal(slow.shape)
    seen, frames = together(errors), 46.0 * (1.0 - white) + white
    double = ErrorProcess.double_over(frames)
    recovered, variance = ErrorProcess.read(frames, seen[None])
    for process, scale, least, most in ((recovered, variance, 0.6, 1.0 + 1e-9), (double, 1.0, 1.4, np.inf)):
        beyond = np.array([1.0, *(-coefficient for coefficient in process.of_before)])
        assert least < (beyond @ seen @ beyond) / (scale * process.new) < most
    assert recovered.frames * variance == pytest.approx(frames, rel=1e-6)
    assert recovered.smaller < double.smaller


@pytest.mark.parametrize("process", PROCESSES)
@pytest.mark.parametrize("gaps", [[], [0], [4], [1, 3], [2, 3, 9], list(range(1, 10))])
def test_information_is_the_inverse_of_the_covariance_of_every_run(process, gaps):
    n, sd = 12, 0.003
    seen = np.ones((n, 1), dtype=bool)
    seen[gaps] = False
    information = ErrorInformation.of(seen, np.array([sd]), process)
    dense = np.diag(information.same[:, 0])
    for later, part in ((1, information.next), (2, information.second)):
        dense += np.diag(part[:, 0], later) + np.diag(part[:, 0], -later)
    expected = np.zeros((n, n))
    there = np.flatnonzero(seen[:, 0])
    for run in np.split(there, np.flatnonzero(np.diff(there) > 1) + 1):
        lags = np.abs(run[:, None] - run)
        expected[np.ix_(run, run)] = np.linalg.inv(sd**2 * process_covariance(process, lags))
    np.testing.assert_allclose(dense, expected, atol=1e-9 * expected.max())
