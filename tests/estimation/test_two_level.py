import numpy as np
import pytest

from generic_static import generic_model, smooth_motion
from kinertia.estimation.identifiability import ParameterVector
from kinertia.estimation.two_level import (
    LONGEST_INTERVAL_S,
    Integration,
    TwoLevelProblem,
    Window,
    correct_pelvis,
    estimate_two_level,
    intervals,
)
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.dynamics import residual, root_regressor
from kinertia.synthetic.walk import balancing_wrench


@pytest.fixture(scope="module")
def model():
    return generic_model()


def symmetric(bsp: BodySegmentParameters) -> BodySegmentParameters:
    """The same without products of inertia, left mirroring right, as the study has it."""
    table = bsp.table()
    table[:, 7:] = 0.0
    plain = BodySegmentParameters.from_table(bsp.segments, table)
    vector = ParameterVector(plain, True)
    return vector.bsp(vector.values(plain))


@pytest.fixture(scope="module")
def truth(model):
    """Dumas' parameters, with CoMs off the segment axes."""
    return symmetric(literature_bsp(70.0, 1.75, "male", model.geometry))


def window_of(skeleton, bsp, n=60, rate_hz=60.0, seed=0) -> Window:
    time, motion = smooth_motion(skeleton, n, rate_hz, seed)
    return Window(time, motion, balancing_wrench(skeleton, bsp, motion))


def disturbed(window: Window, seed=0) -> Window:
    """A window whose residual is far from zero."""
    noise = np.random.default_rng(seed).normal(0, 20, window.wrench.shape)
    return Window(window.time, window.motion, window.wrench + noise)


def started(bsp: BodySegmentParameters, symmetric: bool, seed: int, spread: float = 0.5) -> BodySegmentParameters:
    vector = ParameterVector(bsp, symmetric)
    theta = vector.values(bsp)
    return vector.bsp(theta * np.random.default_rng(seed).uniform(1.0 - spread, 1.0 + spread, len(theta)))


@pytest.mark.parametrize("correct", [False, True])
def test_jacobian_agrees_with_finite_differences(model, truth, correct):
    windows = [disturbed(window_of(model.skeleton, truth, n, seed=n), n) for n in (12, 9)]
    vector = ParameterVector(truth, True)
    problem = TwoLevelProblem(model.skeleton, vector, windows, correct, 0.5)
    theta = vector.values(started(truth, True, 1))
    analytic = problem.jacobian(theta)
    assert analytic.shape == (6 * 21, 49)
    h = 1e-6
    steps = h * np.eye(len(theta))
    numeric = np.stack([(problem.residuals(theta + s) - problem.residuals(theta - s)) / (2 * h) for s in steps], axis=1)
    np.testing.assert_allclose(analytic, numeric, atol=1e-6 * np.abs(numeric).max())


def test_tracking_is_the_best_of_all_constants():
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0.0, 1.0, 30))
    acceleration, measured = rng.normal(size=(30, 2)), rng.normal(size=(30, 2))
    position, velocity = Integration(time).track(acceleration, measured)
    step = np.diff(time)[:, None]
    once = np.vstack([np.zeros(2), np.cumsum((acceleration[1:] + acceleration[:-1]) / 2 * step, axis=0)])
    twice = np.vstack([np.zeros(2), np.cumsum((once[1:] + once[:-1]) / 2 * step, axis=0)])
    constants, *_ = np.linalg.lstsq(np.column_stack([np.ones(30), time]), measured - twice, rcond=None)
    np.testing.assert_allclose(position, twice + constants[0] + np.outer(time, constants[1]), atol=1e-10)
    np.testing.assert_allclose(velocity, once + constants[1], atol=1e-10)


def test_tracking_a_parabola_returns_it():
    time = np.linspace(2.0, 3.0, 41)
    fall = 1.0 + 0.5 * time - 4.9 * time**2
    position, velocity = Integration(time).track(np.full((41, 1), -9.8), fall[:, None])
    np.testing.assert_allclose(velocity[:, 0], 0.5 - 9.8 * time, atol=1e-9)
    # the trapezoid rule's error of the second integral
    np.testing.assert_allclose(position[:, 0], fall, atol=9.8 / 12 * (time[1] - time[0]) ** 2)


def test_consistent_data_need_no_correction(model, truth):
    window = window_of(model.skeleton, truth, n=200, rate_hz=200.0)
    corrected = correct_pelvis(model.skeleton, truth, window)
    np.testing.assert_allclose(corrected.q, window.motion.q, atol=1e-4)
    np.testing.assert_allclose(corrected.qdd, window.motion.qdd, atol=1e-6)


def test_correction_reduces_the_residual_of_wrong_parameters(model, truth):
    window = window_of(model.skeleton, truth)
    wrong = started(truth, True, 3)
    before = residual(model.skeleton, wrong, window.motion, window.wrench)
    after = residual(model.skeleton, wrong, correct_pelvis(model.skeleton, wrong, window), window.wrench)
    assert np.square(after[:, :3]).sum() < np.square(before[:, :3]).sum()
    assert np.square(after[:, 3:]).sum() < np.square(before[:, 3:]).sum()


@pytest.mark.parametrize(("mirrored", "count"), [(True, 49), (False, 84)])
def test_perfect_data_give_back_all_parameters(model, truth, mirrored, count):
    windows = [window_of(model.skeleton, truth, n=150, seed=seed) for seed in (0, 1)]
    start = started(truth, mirrored, 7)
    assert len(ParameterVector(truth, mirrored).names) == count
    result = estimate_two_level(model.skeleton, start, windows, symmetric=mirrored, correct=False)
    assert result.converged
    assert np.abs(start.mass_kg - truth.mass_kg).max() > 5.0
    np.testing.assert_allclose(result.bsp.mass_kg, truth.mass_kg, atol=1e-5)
    np.testing.assert_allclose(result.bsp.com_m, truth.com_m, atol=1e-5)
    np.testing.assert_allclose(result.bsp.inertia_kgm2, truth.inertia_kgm2, atol=1e-5)
    assert result.cost[1] < 1e-9 * result.cost[0]


def rank(skeleton, bsp) -> int:
    vector = ParameterVector(bsp, True)
    window = window_of(skeleton, bsp, n=150)
    columns = root_regressor(skeleton, bsp.segments, window.motion) @ vector.jacobian(vector.values(bsp))
    columns = columns.reshape(-1, len(vector.names))
    singular = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False)
    return int((singular > 1e-9 * singular[0]).sum())


def test_masses_are_lost_when_the_centres_of_mass_lie_on_the_axes(model, truth):
    """zero products of inertia separate masses only through off-axis centres of mass."""
    table = truth.table()
    table[:, [1, 3]] = 0.0
    assert rank(model.skeleton, truth) == 49
    assert rank(model.skeleton, BodySegmentParameters.from_table(truth.segments, table)) < 49


@pytest.mark.usefixtures("few_evaluations")
def test_estimate_with_correction_explains_the_loads_better(model, truth):
    windows = [window_of(model.skeleton, truth, n=12)]
    seen = []
    start = started(truth, True, 2, spread=0.1)
    result = estimate_two_level(model.skeleton, start, windows, progress=seen.append)
    assert result.cost[1] < 0.5 * result.cost[0]
    assert result.bsp.mass_kg.min() > 0
    assert np.diagonal(result.bsp.inertia_kgm2, axis1=1, axis2=2).min() > 0
    assert seen
    assert max(seen) <= 1.0
    expected = residual(model.skeleton, result.bsp, result.motions[0], windows[0].wrench)
    np.testing.assert_allclose(result.residuals[0], expected)


@pytest.mark.parametrize("seconds", [0.5, 1.1, 1.2, 3.4])
def test_intervals_cover_the_window_once(model, truth, seconds):
    window = window_of(model.skeleton, truth, n=round(seconds * 60) + 1)
    parts = intervals(window)
    assert max(part.time[-1] - part.time[0] for part in parts) <= LONGEST_INTERVAL_S + 1e-9
    np.testing.assert_array_equal(np.concatenate([part.time for part in parts]), window.time)
    np.testing.assert_array_equal(np.concatenate([part.motion.qdd for part in parts]), window.motion.qdd)
    np.testing.assert_array_equal(np.concatenate([part.wrench for part in parts]), window.wrench)
