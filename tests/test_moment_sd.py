import numpy as np
import pytest

from kinertia.block_band import BlockBand
from kinertia.dynamics import Motion, inverse_dynamics
from kinertia.moment_sd import joint_moment_sd, moment_derivatives
from kinertia.normal_equations import reduced
from kinertia.simultaneous import root_of_covariance
from small_problem import curved_problem, point, small_problem
from study_bound import dense_band


@pytest.fixture(scope="module", params=["27 DOF", "curved axes"])
def estimate(request, tmp_path_factory):
    """Also of a model in which several axes follow one coordinate by curves."""
    curved = request.param == "curved axes"
    problem = curved_problem(tmp_path_factory.mktemp("curved") / "small.osim") if curved else small_problem()
    (coefficients,), static = point(problem)
    return problem, coefficients, static


def moments(problem, coefficients: np.ndarray, static: np.ndarray, added: np.ndarray | None = None) -> np.ndarray:
    """(d, c) joint moments at a point, by `inverse_dynamics`; with other loads added to those on the feet."""
    names = problem.calibration.coordinates
    values = dict(zip(names, static[problem.layout.coordinates].tolist(), strict=True))
    dynamic = np.flatnonzero(problem.trials[0].dynamic)
    motion = Motion(*problem.bases[0].evaluate(coefficients)).cut(dynamic)
    loads = problem.foot_loads(0, static) + (0.0 if added is None else added)
    loads = loads[dynamic]
    return inverse_dynamics(problem.skeleton.lock(values), problem.bsp(static), motion, loads)


def dense(problem, coefficients: np.ndarray, static: np.ndarray) -> np.ndarray:
    """Information on all coefficients and static unknowns as one matrix."""
    normal = problem.normal(0, coefficients, static)
    band = dense_band(normal.band)
    n, s = len(band), problem.layout.size
    full = np.zeros((n + s, n + s))
    full[:n, :n] = band
    full[:n, n:] = normal.border.reshape(n, s)
    full[n:, :n] = full[:n, n:].T
    full[n:, n:] = normal.static + problem.prior_terms(static)[0]
    return full


def dense_derivative(problem, coefficients: np.ndarray, static: np.ndarray) -> np.ndarray:
    """(d, c, unknowns) derivative of the joint moments by all coefficients and static unknowns."""
    basis, frames = problem.bases[0], np.flatnonzero(problem.trials[0].dynamic)
    motion = [part[frames] for part in problem.full(basis.evaluate(coefficients), static)]
    by = moment_derivatives(problem, 0, motion, static, frames)
    size, c = coefficients.shape
    through = np.zeros((len(frames), c, size, c))
    for row, t in enumerate(frames):
        for a, spline in enumerate(basis.active[t]):
            parts = zip(basis.values[:, t, a], (by.q, by.qd, by.qdd), strict=True)
            through[row, :, spline] = sum(value * part[row] for value, part in parts)
    rest = np.zeros((len(frames), c, problem.layout.size - by.static.shape[2]))
    return np.concatenate([through.reshape(len(frames), c, -1), by.static, rest], axis=2)


def test_derivatives_agree_with_finite_differences(estimate):
    """In random directions of one kind of unknown each, by `inverse_dynamics`."""
    problem, coefficients, static = estimate
    n, layout = coefficients.size, problem.layout
    derivative = dense_derivative(problem, coefficients, static)
    rng = np.random.default_rng(0)
    parts = [slice(0, n), *(slice(n + p.start, n + p.stop) for p in (layout.theta, layout.plates, layout.coordinates))]
    parts.append(slice(n + layout.clock, n + layout.clock + 1))
    for part in parts:
        for _ in range(3):
            h = np.zeros(n + layout.size)
            h[part] = rng.normal(0.0, 1e-5, part.stop - part.start)
            ahead, behind = (
                moments(problem, coefficients + s * h[:n].reshape(coefficients.shape), static + s * h[n:])
                for s in (1.0, -1.0)
            )
            found = derivative @ h
            np.testing.assert_allclose(found, (ahead - behind) / 2.0, atol=1e-6 * np.abs(found).max())


def test_deviations_are_those_of_the_dense_covariance(estimate):
    problem, coefficients, static = estimate
    root = root_of_covariance(dense(problem, coefficients, static))
    full = root @ root.T
    n = coefficients.size
    by = dense_derivative(problem, coefficients, static)
    expected = np.sqrt(np.einsum("dri,ij,drj->dr", by, full, by, optimize=True) + lost(problem, coefficients, static))
    part = reduced(problem.normal(0, coefficients, static), 0.0)
    root = root_of_covariance(problem.prior_terms(static)[0] + part.information)
    np.testing.assert_allclose(root @ root.T, full[n:, n:], rtol=1e-4, atol=1e-6 * np.abs(full[n:, n:]).max())
    found = joint_moment_sd(problem, 0, coefficients, static, part, root)
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def lost(problem, coefficients: np.ndarray, static: np.ndarray) -> np.ndarray:
    """(d, c) moving mean square of what the loads that smoothing took off would have added to the joint moments."""
    (trial,) = problem.trials
    more = moments(problem, coefficients, static, trial.ground.lost) - moments(problem, coefficients, static)
    basis = problem.bases[0]
    half = round(2.0 * len(basis.first) / (basis.size - 5))
    rows = np.clip(np.arange(len(more))[:, None] + np.arange(-half, half + 1), 0, len(more) - 1)
    return np.square(more)[rows].mean(axis=1)


def test_blocks_of_the_inverse():
    rng = np.random.default_rng(0)
    b, k = 4, 3
    factor = np.tril(rng.normal(size=(b * k, b * k)))
    for i in range(b):
        factor[k * (i + 2) :, k * i : k * i + k] = 0.0
    matrix = factor @ factor.T + np.eye(b * k)
    blocks = matrix.reshape(b, k, b, k).transpose(0, 2, 1, 3)
    band = BlockBand.factor(
        np.array([blocks[i, i] for i in range(b)]), np.array([blocks[i + 1, i] for i in range(b - 1)])
    )
    inverse = np.linalg.inv(matrix).reshape(b, k, b, k).transpose(0, 2, 1, 3)
    diagonal, below = band.inverse_blocks()
    np.testing.assert_allclose(diagonal, [inverse[i, i] for i in range(b)])
    np.testing.assert_allclose(below, [inverse[i + 1, i] for i in range(b - 1)])
