from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.inputs import BSP, PLACES, SKIN, STILL
from kinertia.estimation.simultaneous.instruments.instrument_errors import BENDING
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.search.problem import MapProblem, Point
from kinertia.estimation.simultaneous.terms.instrument_term import CLOCK, GAINS, PLATES, TRIAL_DELAYS, ZEROS
from kinertia.estimation.simultaneous.terms.model_terms import LEAST_INFORMATION
from kinertia.model.log_cholesky import nearest_consistent
from small_problem import curved_problem, point, residuals, small_problem
from validation.study_bound import dense_band


@pytest.fixture(scope="module")
def problem():
    return small_problem()


@pytest.fixture(scope="module", params=["27 DOF", "curved axes"])
def any_problem(request, problem, tmp_path_factory):
    """Also one in which several axes follow one coordinate by curves, and the root stands on turned frames."""
    if request.param == "27 DOF":
        return problem
    return curved_problem(tmp_path_factory.mktemp("curved") / "small.osim")


@pytest.fixture(scope="module")
def here(problem):
    coefficients, static = point(problem)
    return coefficients[0], static


def cost(problem: MapProblem, coefficients: np.ndarray, static: np.ndarray) -> float:
    return problem.slope(Point((coefficients,), static, problem.beginning.displaced)).cost


def sloped(function, size: float) -> float:
    """Derivative at zero of a function of one number, by central differences."""
    return (function(size) - function(-size)) / (2 * size)


@pytest.mark.parametrize("kind", [BSP, STILL, PLACES, SKIN, PLATES, CLOCK, ZEROS, GAINS, BENDING])
def test_gradient_of_static_unknowns(problem, here, kind):
    coefficients, static = here
    part = problem.layout[kind]
    step = np.zeros_like(static)
    step[part] = np.random.default_rng(0).normal(size=step[part].shape)
    rhs = problem.normal(0, coefficients, static).static_rhs + problem.prior_slope(static)[0]
    slope = sloped(lambda h: cost(problem, coefficients, static + h * step), 1e-6)
    assert -rhs @ step == pytest.approx(slope, rel=1e-5)


def test_gradient_of_delays():
    """Those of a trial say nothing of another."""
    pair = small_problem(2)
    coefficients, static = point(pair)
    delays = np.arange(len(static))[pair.layout[TRIAL_DELAYS]]
    assert len(delays) == 2
    for k in range(2):
        normal = pair.normal(k, coefficients[k], static)
        assert normal.static_rhs[delays[1 - k]] == 0.0
        step = np.eye(len(static))[delays[k]]
        slope = sloped(lambda h, k=k, step=step: pair.normal(k, coefficients[k], static + h * step).cost, 1e-6)
        assert -normal.static_rhs[delays[k]] == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize("coordinate", ["pelvis_tx", "pelvis_list", "hip_flexion_r", "ankle_angle_l", "arm_add_l"])
def test_gradient_of_the_motion(problem, here, coordinate):
    coefficients, static = here
    step = np.zeros_like(coefficients)
    column = problem.skeleton.coordinates.index(coordinate)
    step[:, column] = np.random.default_rng(0).normal(size=len(step))
    slope = sloped(lambda h: cost(problem, coefficients + h * step, static), 1e-6)
    assert -(problem.normal(0, coefficients, static).rhs * step).sum() == pytest.approx(slope, rel=1e-5)


def test_cost_is_half_the_sum_of_squares(any_problem):
    problem = any_problem
    (coefficients,), static = point(problem)
    expected = 0.5 * np.square(residuals(problem, 0, coefficients, static)).sum()
    assert cost(problem, coefficients, static) == pytest.approx(expected + problem.prior_slope(static)[1])


@pytest.mark.parametrize("any_problem", [pytest.param("27 DOF", marks=pytest.mark.slow), "curved axes"], indirect=True)
def test_normal_equations_are_those_of_a_dense_jacobian(any_problem):
    problem = any_problem
    (coefficients,), static = point(problem)
    size, c = coefficients.shape
    motion = np.arange(size * c)
    still = size * c + np.arange(len(static))
    start = np.concatenate([coefficients.ravel(), static])

    def left(x):
        return residuals(problem, 0, x[motion].reshape(size, c), x[still])

    h = 1e-5
    columns = []
    for j in range(len(start)):
        ahead, behind = start.copy(), start.copy()
        ahead[j] += h
        behind[j] -= h
        columns.append((left(ahead) - left(behind)) / (2 * h))
    jacobian = np.stack(columns, axis=1)
    dense, gradient = jacobian.T @ jacobian, jacobian.T @ left(start)
    normal = problem.normal(0, coefficients, static)

    tolerance = 1e-6 * np.sqrt(np.outer(np.diag(dense), np.diag(dense))) + 1e-6
    normal_matrix = np.block(
        [
            [dense_band(normal.band), normal.border.reshape(size * c, -1)],
            [normal.border.reshape(size * c, -1).T, normal.static],
        ]
    )
    assert (np.abs(normal_matrix - dense) <= tolerance).all()
    rhs = np.concatenate([normal.rhs.ravel(), normal.static_rhs])
    np.testing.assert_allclose(-rhs, gradient, atol=1e-6 * np.abs(gradient).max())


def test_a_gradient_alone_is_that_of_the_normal_equations(any_problem):
    problem = any_problem
    (coefficients,), static = point(problem)
    expected, actual = problem.normal(0, coefficients, static), problem.gradient(0, coefficients, static)
    assert actual.cost == pytest.approx(expected.cost, rel=1e-12)
    for ours, theirs in ((actual.rhs, expected.rhs), (actual.static_rhs, expected.static_rhs)):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())


def test_equations_of_the_motion_alone_are_those_of_everything_without_their_border(any_problem):
    (coefficients,), static = point(any_problem)
    whole = any_problem.normal(0, coefficients, static)
    alone = any_problem.normal(0, coefficients, static, bordered=False)
    assert not alone.border.size
    assert alone.cost == pytest.approx(whole.cost, rel=1e-12)
    np.testing.assert_allclose(alone.rhs, whole.rhs, rtol=1e-9, atol=1e-9 * np.abs(whole.rhs).max())
    np.testing.assert_allclose(alone.band, whole.band, rtol=1e-9, atol=1e-12 * np.abs(whole.band).max())


def test_a_slope_is_the_derivative_of_the_cost_by_everything(problem):
    """Displacements of two trials and the instruments' Gaussian among it."""
    trial = problem.trials[0]
    sd = np.linspace(0.0, 0.02, len(problem.skeleton.markers))
    trials = [replace(trial, displacement_sd_m=sd), replace(trial, displacement_sd_m=sd[::-1].copy())]
    pair = MapProblem(problem.skeleton, problem.prior, problem.calibration, trials)
    coefficients, static = point(pair)
    rng = np.random.default_rng(0)
    here = Point(tuple(coefficients), static, tuple(rng.normal(size=3 * len(sd)) for _ in range(2)))
    gaussian = GaussianPrior.of(pair.layout.error_priors)
    slope, at = pair.slope(here), pair.at(here)
    assert at.slope.cost == pytest.approx(slope.cost, rel=1e-12)
    np.testing.assert_allclose(at.slope.rhs, slope.rhs, atol=1e-9 * np.abs(slope.rhs).max())
    rhs = slope.under(gaussian)[1]
    sizes = 1.0 / np.maximum(np.abs(rhs), 1.0)
    for _ in range(5):
        step = rng.normal(size=len(rhs)) * sizes
        found = sloped(lambda h, s=step: pair.slope(here.like(here.vector + h * s)).under(gaussian)[0], 1e-5)
        assert -rhs @ step == pytest.approx(found, rel=1e-4, abs=1e-6 * np.abs(rhs * step).sum())


def test_prior_information_is_the_derivative_of_its_gradient(problem):
    """At the prior's mean the gaps vanish, so that Gauss-Newton is exact there."""
    static = problem.layout.start
    information, (rhs, value) = problem.prior_information(static), problem.prior_slope(static)
    # without that of the instruments, about which this says nothing
    places = problem.layout.errors
    information[places, places] += GaussianPrior.of(problem.layout.error_priors).precision
    scale = 1.0 / np.sqrt(np.diag(information))
    np.testing.assert_allclose(rhs * scale, 0.0, atol=1e-6)
    assert value == pytest.approx(0.0, abs=1e-12)
    h = 1e-5
    information = problem.prior_information(static)
    for j in np.random.default_rng(0).choice(len(static), 30, replace=False):
        step = np.zeros_like(static)
        step[j] = h * scale[j]
        slope = (problem.prior_slope(static - step)[0] - problem.prior_slope(static + step)[0]) / (2 * h)
        np.testing.assert_allclose(slope * scale, information[:, j] * scale[j] * scale, atol=1e-4)


def test_prior_cost_counts_deviations(problem):
    """One deviation of a quantity that nothing else is tied to costs one half."""
    layout = problem.layout
    prior = problem.calibration
    cases = [(layout[STILL].start, 0.01), (layout[PLACES].start + 4, float(prior.marker_sd_m[1]))]
    for at, deviation in cases:
        static = problem.layout.start.copy()
        static[at] += deviation
        assert problem.prior_slope(static)[1] == pytest.approx(0.5)


def test_prior_cost_of_a_body_is_its_mahalanobis_distance_and_the_scale(problem, here):
    _, static = here
    static = np.where(np.arange(len(static)) < problem.layout[BSP].stop, static, problem.layout.start)
    bsp, prior = problem.model.bsp(static), problem.prior
    gap = (bsp.table() - prior.mean.table()).ravel()
    scale = (bsp.total_mass_kg - prior.mass_kg) / prior.mass_sd_kg
    expected = 0.5 * (gap @ np.linalg.solve(prior.covariance, gap) + scale**2)
    assert problem.prior_slope(static)[1] == pytest.approx(expected, rel=1e-6)


def test_start_is_the_prior_s_mean(problem):
    start = problem.model.bsp(problem.layout.start)
    np.testing.assert_allclose(start.table(), nearest_consistent(problem.prior.mean).table(), rtol=1e-9, atol=1e-12)
    positions = problem.layout.start[problem.layout[PLACES]].reshape(-1, 3)
    np.testing.assert_array_equal(positions, problem.skeleton.marker_locals)
    assert not problem.layout.start[problem.layout[PLATES]].any()
    assert not problem.layout.start[problem.layout[CLOCK]].any()


def test_trials_share_plates_by_name_and_the_clock():
    pair = small_problem(2)
    other = replace(pair.trials[1], ground=replace(pair.trials[1].ground, plates=("second", "fourth", "third")))
    pair = MapProblem(pair.skeleton, pair.prior, pair.calibration, [pair.trials[0], other])
    assert pair.given.plates == ("first", "second", "third", "fourth")
    coefficients, static = point(pair)
    for k, foreign in ((0, "fourth"), (1, "first")):
        static_terms = pair.normal(k, coefficients[k], static).static
        for i, name in enumerate(pair.given.plates):
            by_plate = np.abs(static_terms[pair.layout[PLATES]][5 * i : 5 * i + 5]).max(axis=1)
            assert (by_plate == 0).all() if name == foreign else (by_plate > 0).all(), (k, name)
        assert static_terms[pair.layout[CLOCK], pair.layout[CLOCK]].item() > 0


def test_displacements_move_the_markers_of_their_trial_only(problem, here):
    coefficients, static = here
    trial = problem.trials[0]
    sd = np.linspace(0.0, 0.02, len(problem.skeleton.markers))
    displaced = replace(trial, displacement_sd_m=sd)
    pair = MapProblem(problem.skeleton, problem.prior, problem.calibration, [displaced, trial])
    drawn = np.random.default_rng(0).normal(size=(len(sd), 3))
    parts = problem.layout[ZEROS], problem.layout[GAINS], problem.layout[BENDING]
    where = np.repeat([part.stop for part in parts], [part.stop - part.start for part in parts])
    same = np.insert(static, where, static[parts[0].start : parts[-1].stop])
    on_time = np.insert(same, [pair.layout[TRIAL_DELAYS].start] * 2, 0.0)
    at = Point((coefficients, coefficients), on_time, (drawn.ravel(), np.zeros(drawn.size)))
    moved = pair.in_trial(0, at)[pair.layout[PLACES]].reshape(-1, 3) - on_time[pair.layout[PLACES]].reshape(-1, 3)
    np.testing.assert_allclose(moved, sd[:, None] * drawn, atol=1e-15)
    np.testing.assert_array_equal(pair.in_trial(1, at), on_time)
    together = pair.at(at)
    assert together.trials[1].gradient.cost == pytest.approx(problem.normal(0, coefficients, static).cost)
    expected = sum(trial.gradient.cost for trial in together.trials) + problem.prior_slope(static)[1]
    assert together.slope.cost == pytest.approx(expected + 0.5 * np.square(drawn).sum())


def test_a_frame_without_dynamics_says_nothing_about_the_body(problem, here):
    """Body segment parameters appear in the root equations only."""
    coefficients, static = here
    normal = problem.normal(0, coefficients, static)
    basis, trial = problem.bases[0], problem.trials[0]
    touched = np.unique(basis.active[trial.dynamic])
    silent = np.setdiff1d(np.arange(basis.size), touched)
    assert not normal.border[silent][..., problem.layout[BSP]].any()
    assert np.abs(normal.border[touched][..., problem.layout[BSP]]).max(axis=(1, 2)).min() > 0


@pytest.mark.parametrize("place", [0, 4, 5, 6], ids=["mass", "Lxx", "Lyy", "Lzz"])
def test_second_derivatives_are_what_gauss_newton_leaves_out(problem, here, place):
    """The cost is a square in masses and second moments: by their logarithms it bends by its slope more.

    Second moments without products, else a diagonal of L stands in other elements, too.
    """
    coefficients, static = here[0], here[1].copy()
    static[problem.layout[BSP]].reshape(-1, 10)[:, 7:] = 0.0
    rows = np.arange(problem.layout[BSP].stop).reshape(-1, 10)[:, place]

    def rhs(values):
        place = Point((coefficients,), values, problem.beginning.displaced)
        return place.like(problem.slope(place).rhs).static

    informed = problem.prior_information(static) + problem.normal(0, coefficients, static).static
    added = problem.second_derivatives(rhs(static))
    assert (added[rows] >= 0.0).all()
    pulled = [row for row in rows if rhs(static)[row] < 0.0]
    assert pulled
    step = 1e-5
    for row in pulled:
        change = np.zeros_like(static)
        change[row] = step
        second = -(rhs(static + change)[row] - rhs(static - change)[row]) / (2.0 * step)
        left_out = second - (informed[row, row] - LEAST_INFORMATION)
        assert added[row] == pytest.approx(left_out, rel=1e-3)
    others = [row for row in rows if rhs(static)[row] > 0.0]
    np.testing.assert_array_equal(added[others], 0.0)
