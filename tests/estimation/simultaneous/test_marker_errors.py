import numpy as np
import pytest

from kinertia.estimation.simultaneous.marker_errors import ErrorInformation, double_pole


def covariance(n: int, frames: float) -> np.ndarray:
    """Of a process with a double pole (Box and Jenkins, second-order autoregression)."""
    r, lag = double_pole(frames), np.abs(np.subtract.outer(range(n), range(n)))
    return r**lag * (1.0 + lag * (1.0 - r * r) / (1.0 + r * r))


@pytest.mark.parametrize("frames", [1.0, 1.5, 4.0, 30.0])
def test_the_pole_makes_errors_alike_over_so_many_frames(frames):
    assert covariance(4001, frames)[2000].sum() == pytest.approx(frames, rel=1e-9)


@pytest.mark.parametrize("frames", [1.0, 9.0])
@pytest.mark.parametrize("gaps", [[], [0], [4], [1, 3], [2, 3, 9], list(range(1, 10))])
def test_information_is_the_inverse_of_the_covariance_of_every_run(frames, gaps):
    n, sd = 12, 0.003
    seen = np.ones((n, 1), dtype=bool)
    seen[gaps] = False
    found = ErrorInformation.of(seen, np.array([sd]), frames)
    dense = np.diag(found.own[:, 0])
    for later, part in ((1, found.next), (2, found.second)):
        dense += np.diag(part[:, 0], later) + np.diag(part[:, 0], -later)
    expected = np.zeros((n, n))
    there = np.flatnonzero(seen[:, 0])
    for run in np.split(there, np.flatnonzero(np.diff(there) > 1) + 1):
        expected[np.ix_(run, run)] = np.linalg.inv(sd**2 * covariance(len(run), frames))
    np.testing.assert_allclose(dense, expected, atol=1e-9 * expected.max())
