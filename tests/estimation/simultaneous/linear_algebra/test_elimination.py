"""A trial cut into time blocks gives what it gives in one."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

import kinertia.estimation.simultaneous.linear_algebra.elimination as elimination
import kinertia.estimation.simultaneous.linear_algebra.frame_blocks as limits
import kinertia.estimation.simultaneous.solver as solver
from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock, halves, joined, time_blocks
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import StaticInformation
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations, curve_deviations
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import _Steps
from kinertia.motion import workload
from kinertia.synthetic.walk import walk, walking_subject
from small_problem import point, small_ground, small_problem, small_skin
from validation.study_bound import dense_band

DAMPING = 1e-3


def close(actual: np.ndarray, expected: np.ndarray, share: float = 1e-9) -> None:
    np.testing.assert_allclose(actual, expected, rtol=share, atol=share * np.abs(expected).max())


def longer_problem() -> MapProblem:
    """A second of walking: 25 splines, more than four blocks; markers with gaps, frames that are not dynamic."""
    problem = small_problem()
    trial = walk(walking_subject(), 1.0, 50.0, trapezoid=False)
    trial = replace(trial, skeleton=problem.skeleton)
    rng = np.random.default_rng(0)
    markers = trial.markers.positions + rng.normal(0.0, 0.01, trial.markers.positions.shape)
    markers[2, 1] = markers[20:26, 3] = np.nan
    dynamic = np.ones(len(trial.time), dtype=bool)
    dynamic[:2] = dynamic[-1] = dynamic[30] = False
    observation = replace(
        problem.trials[0],
        time=trial.time,
        markers=markers,
        q=trial.motion.q,
        spacing_s=0.05,
        dynamic=dynamic,
        ground=small_ground(trial, rng),
        skin=small_skin(trial.skeleton, len(trial.time)),
    )
    return MapProblem(problem.skeleton, problem.prior, problem.calibration, [observation])


@pytest.fixture(scope="module")
def whole():
    problem = longer_problem()
    problem.time_blocks = [(TimeBlock.whole(basis),) for basis in problem.bases]
    return problem


@pytest.fixture(scope="module", params=[1, 2, 3])
def cut(request):
    """The same in time blocks of at most so many blocks of splines."""
    problem = longer_problem()
    problem.time_blocks = [time_blocks(basis, 6 * request.param) for basis in problem.bases]
    assert len(problem.time_blocks[0]) == {1: 4, 2: 2, 3: 2}[request.param]
    return problem


@pytest.fixture(scope="module")
def here(whole):
    (coefficients,), static = point(whole)
    return coefficients, static


@pytest.fixture
def double(monkeypatch):
    """All in double precision."""
    monkeypatch.setattr(elimination, "UNSAFE", 0.0)


def test_normal_equations_are_the_sum_over_time_blocks(whole, cut, here):
    expected, actual = whole.normal(0, *here), cut.gradient(0, *here)
    close(actual.static_rhs, expected.static_rhs)
    close(actual.rhs, expected.rhs)
    assert actual.cost == pytest.approx(expected.cost, rel=1e-12)
    static, band, border = (np.zeros_like(matrix) for matrix in (expected.static, expected.band, expected.border))
    for time_block in cut.time_blocks[0]:
        part = cut.normal(0, *here, time_block)
        static += part.static
        band[time_block.touched] += part.band
        border[time_block.touched] += part.border
    close(static, expected.static)
    close(band, expected.band)
    close(border, expected.border)


def test_elimination_and_steps_are_those_of_the_whole(whole, cut, here, double):
    expected, actual = (posed.eliminated(0, *here, DAMPING) for posed in (whole, cut))
    close(actual.gradient.rhs, whole.normal(0, *here).rhs)
    close(actual.information, expected.information)
    close(actual.static_diagonal, np.diag(whole.normal(0, *here).static))
    rng = np.random.default_rng(0)
    rhs, step = rng.normal(size=here[0].shape), rng.normal(0.0, 1e-3, len(here[1]))
    (solved, lost), (in_one, lost_in_one) = actual.forward(rhs), expected.forward(rhs)
    close(lost, lost_in_one)
    close(actual.motion_step(solved, step), expected.motion_step(in_one, step))


def test_elimination_is_that_of_the_dense_matrix(whole, here, double):
    normal, eliminated = whole.normal(0, *here), whole.eliminated(0, *here)
    n, s = normal.rhs.size, len(here[1])
    band, border = dense_band(normal.band), normal.border.reshape(n, s)
    close(eliminated.information, normal.static - border.T @ np.linalg.solve(band, border), 1e-7)
    step = np.random.default_rng(0).normal(0.0, 1e-3, s)
    solved, lost = eliminated.forward(normal.rhs)
    close(lost, border.T @ np.linalg.solve(band, normal.rhs.ravel()), 1e-7)
    expected = np.linalg.solve(band, normal.rhs.ravel() - border @ step)
    close(eliminated.motion_step(solved, step).ravel(), expected, 1e-6)


def test_single_precision_loses_nothing_that_counts(cut, here, monkeypatch):
    """In units of each unknown's own information, and of how much of that with the motion known is left of it."""
    monkeypatch.setattr(elimination, "UNSAFE", np.inf)
    single = cut.eliminated(0, *here)
    assert single.middle.border.dtype == np.float32
    monkeypatch.setattr(elimination, "UNSAFE", 0.0)
    double = cut.eliminated(0, *here)
    assert double.middle.border.dtype == np.float64
    # zeros and plates of this problem are shown by next to nothing else
    scale = np.sqrt(1.0 + np.diag(double.information) + np.diag(cut.prior_information(here[1])))
    left = (double.static_diagonal / scale**2).max()
    off = (single.information - double.information) / np.outer(scale, scale)
    assert np.abs(off).max() < 2e-6 * left
    rhs = double.gradient.rhs
    difference = (single.forward(rhs)[1] - double.forward(rhs)[1]) / scale
    assert np.abs(difference).max() < 2e-6 * left * np.linalg.norm(double.forward(rhs)[1] / scale)


def test_deviations_of_curves_are_those_of_the_whole(whole, cut, here, double):
    expected, actual = (posed.eliminated(0, *here) for posed in (whole, cut))
    information = expected.information + np.diag(1.0 / np.maximum(np.abs(here[1]), 0.1) ** 2)
    root = StaticInformation.of(information, whole.layout.in_root.stop).root_of_covariance()
    sd = [
        curve_deviations(posed, 0, *here, part, root, np.ones(3)) for posed, part in ((whole, expected), (cut, actual))
    ]
    for field in fields(CurveDeviations):
        close(getattr(sd[1], field.name), getattr(sd[0], field.name))


@pytest.mark.slow
def test_the_estimate_is_that_of_the_whole(whole, monkeypatch):
    """Two trials, whose time blocks are as short as can be."""
    given = (
        whole.skeleton,
        whole.prior,
        whole.calibration,
        [whole.trials[0], replace(small_problem().trials[0], spacing_s=0.05)],
    )
    monkeypatch.setattr(elimination, "UNSAFE", 0.0)
    monkeypatch.setattr(solver, "_MAX_ITERATIONS", 6)
    expected = estimate_simultaneous(*given)
    monkeypatch.setattr(limits, "TOGETHER_BYTES", 1)
    actual = estimate_simultaneous(*given)
    assert actual.iterations == expected.iterations
    assert actual.cost == pytest.approx(expected.cost, rel=1e-9)
    close(actual.bsp.table(), expected.bsp.table())
    close(actual.bsp_covariance, expected.bsp_covariance)
    for k in range(2):
        close(actual.motions[k].qdd, expected.motions[k].qdd)
        close(actual.curve_deviations[k].moments, expected.curve_deviations[k].moments)


def test_two_threads_give_what_one_gives_bit_for_bit(monkeypatch):
    monkeypatch.setattr(solver, "_MAX_ITERATIONS", 4)
    problem = longer_problem()
    given = problem.skeleton, problem.prior, problem.calibration, problem.trials
    results = []
    for cores in (1, 2):
        monkeypatch.setattr(workload, "cores", lambda cores=cores: cores)
        results.append(estimate_simultaneous(*given))
    single, two = results
    assert len(problem.time_blocks[0]) > 1
    assert two.cost == single.cost
    np.testing.assert_array_equal(two.bsp.table(), single.bsp.table())
    np.testing.assert_array_equal(two.bsp_covariance, single.bsp_covariance)
    np.testing.assert_array_equal(two.motions[0].qdd, single.motions[0].qdd)
    for field in fields(CurveDeviations):
        np.testing.assert_array_equal(*(getattr(result.curve_deviations[0], field.name) for result in results))


@pytest.mark.parametrize("splines", [6, 7, 11, 12, 13, 18, 19, 40])
def test_gradients_are_taken_of_the_same_frames_in_longer_time_blocks(splines, monkeypatch):
    monkeypatch.setattr(limits, "_FRAMES_OF_GRADIENT", 30)
    basis = MotionBasis(np.linspace(0.0, 1.0, 4 * splines), 1.0 / (splines - 5))
    parts = time_blocks(basis, 6)
    front, back = (joined(half) for half in halves(parts))
    every = [*front, *reversed(back)]
    assert [frame for part in every for frame in range(part.frames.start, part.frames.stop)] == list(
        range(len(basis.first))
    )
    assert [spline for part in every for spline in range(part.splines.start, part.splines.stop)] == list(range(splines))
    for part in every:
        assert basis.active[part.frames].min() >= part.touched.start
        assert basis.active[part.frames].max() < part.touched.stop


@pytest.mark.parametrize("splines", [6, 7, 11, 12, 13, 18, 19, 40])
def test_time_blocks_share_splines_and_frames_out(splines):
    basis = MotionBasis(np.linspace(0.0, 1.0, 4 * splines), 1.0 / (splines - 5))
    assert basis.size == splines
    parts = time_blocks(basis, 12)
    assert [part.is_last for part in parts] == [False] * (len(parts) - 1) + [True]
    indices = [spline for part in parts for spline in range(part.splines.start, part.splines.stop)]
    assert indices == list(range(splines))
    frames = [frame for part in parts for frame in range(part.frames.start, part.frames.stop)]
    assert frames == list(range(len(basis.first)))
    for part in parts:
        active = basis.active[part.frames]
        # markers see the frame after theirs, too
        assert active.min() >= part.touched.start
        assert active.max() + (not part.is_last) < part.touched.stop


def test_all_draws_at_once_are_the_steps_of_each(cut, here, double):
    """Those of the static unknowns one by one; of what they leave open, nothing where nothing is random."""
    coefficients, static = here
    trial = cut.eliminated(0, coefficients, static, DAMPING)
    steps = np.random.default_rng(4).standard_normal((3, cut.layout.size))
    silent = SimpleNamespace(standard_normal=np.zeros)
    written = _Steps(steps.T, silent, np.full((6, *coefficients.shape), np.nan))
    middle = written.write(trial.middle)
    for branch in trial.branches:
        block = middle
        for part in branch.outwards():
            block = written.write(part, block)
    still = trial.forward(np.zeros_like(coefficients))[0]
    for found, step in zip(written.into[:3], steps, strict=True):
        close(found, trial.motion_step(still, step))
    assert not written.into[3:].any()
