import numpy as np
import pytest

from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis

TIME = 3.0 + np.arange(101) / 100.0


@pytest.fixture(scope="module")
def basis():
    return MotionBasis(TIME, 0.07)


def test_splines_are_a_partition_of_unity(basis):
    np.testing.assert_allclose(basis.values[0].sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(basis.values[1].sum(axis=1), 0.0, atol=1e-10)
    np.testing.assert_allclose(basis.values[2].sum(axis=1), 0.0, atol=1e-8)
    assert basis.values[0].min() > -1e-15
    assert basis.active.min() == 0
    assert basis.active.max() == basis.size - 1


def test_knots_are_no_farther_apart_than_asked(basis):
    steps = np.diff(basis.knots)
    np.testing.assert_allclose(steps, steps[0])
    assert 0.06 < steps[0] <= 0.07
    assert basis.size == round(1.0 / steps[0]) + 5


def test_derivatives_agree_with_finite_differences():
    """Three grids, shifted by h, share their knots: the first and last frame of each stand on the outer ones."""
    h = 1e-4
    inner = np.linspace(0.1, 0.9, 33)
    q, qd, qdd = {}, {}, {}
    coefficients = np.random.default_rng(0).normal(size=(15, 2))
    for shift in (-h, 0.0, h):
        basis = MotionBasis(np.concatenate([[0.0], inner + shift, [1.0]]), 0.1)
        parts = basis.evaluate(coefficients)
        q[shift], qd[shift], qdd[shift] = (part[1:-1] for part in parts)
    np.testing.assert_allclose(qd[0.0], (q[h] - q[-h]) / (2 * h), rtol=0, atol=1e-6 * np.abs(qd[0.0]).max())
    np.testing.assert_allclose(qdd[0.0], (qd[h] - qd[-h]) / (2 * h), rtol=0, atol=1e-5 * np.abs(qdd[0.0]).max())


@pytest.mark.parametrize("degree", range(6))
def test_polynomials_up_to_the_degree_are_met_exactly(basis, degree):
    at = TIME - 3.5
    polynomial = np.polynomial.Polynomial([0.3, -1.0, 2.0, 1.0, -4.0, 5.0][: degree + 1])
    design = np.zeros((len(TIME), basis.size))
    np.put_along_axis(design, basis.active, basis.values[0], axis=1)
    coefficients = np.linalg.lstsq(design, polynomial(at)[:, None])[0]
    for derivative, values in enumerate(basis.evaluate(coefficients)):
        np.testing.assert_allclose(values[:, 0], polynomial.deriv(derivative)(at), atol=1e-7)
    # the fit has a small ridge, which tells where splines hardly show in the data
    np.testing.assert_allclose(basis.evaluate(basis.fit(polynomial(at)[:, None]))[0][:, 0], polynomial(at), atol=1e-5)


def test_accelerations_of_results_are_constant_at_the_ends(basis):
    changed = np.flatnonzero((basis.steady_values != basis.values).any(axis=(0, 2)))
    assert changed.tolist() == [0, 1, 2, 98, 99, 100]
    np.testing.assert_array_equal(basis.steady_values[:2], basis.values[:2])
    for ends in ([0, 1, 2, 3], [97, 98, 99, 100]):
        (constant,) = np.unique(basis.steady_values[2, ends], axis=0)
        assert constant.tolist() in basis.values[2, [3, 97]].tolist()
    coefficients = np.random.default_rng(0).normal(size=(basis.size, 2))
    plain, steady = basis.evaluate(coefficients), basis.evaluate_steady(coefficients, np.arange(101))
    np.testing.assert_array_equal(steady[:2], plain[:2])
    np.testing.assert_array_equal(steady[2], plain[2][np.clip(np.arange(101), 3, 97)])


def test_missing_frames_have_no_weight(basis):
    q = np.column_stack([np.sin(5 * TIME), np.cos(5 * TIME)])
    holed = q.copy()
    holed[40:44, 0] = np.nan
    filled = basis.evaluate(basis.fit(holed))[0]
    np.testing.assert_allclose(filled[:, 0], q[:, 0], atol=1e-4)
    np.testing.assert_allclose(filled[:, 1], basis.evaluate(basis.fit(q))[0][:, 1], atol=1e-12)


@pytest.mark.parametrize("offset", [-9.0, 1000.0])
def test_the_origin_does_not_matter(basis, offset):
    """The outermost splines hardly affect any frame, but accelerations there."""
    q = np.sin(5 * TIME)[:, None]
    for here, moved in zip(basis.evaluate(basis.fit(q)), basis.evaluate(basis.fit(q + offset)), strict=True):
        np.testing.assert_allclose(moved - moved[50], here - here[50], atol=1e-9 * abs(offset) / 0.07**2)
    np.testing.assert_allclose(basis.fit(q + offset) - basis.fit(q), offset, rtol=1e-9)


def test_what_no_frame_shows_continues_in_a_straight_line(basis):
    q = np.tile(2.0 + 3.0 * TIME[:, None], 3)
    q[30:70, 0] = q[60:, 1] = q[:, 2] = np.nan
    filled = basis.evaluate(basis.fit(q))[0]
    np.testing.assert_allclose(filled[:, :2], np.tile(2.0 + 3.0 * TIME[:, None], 2), atol=1e-4)
    np.testing.assert_array_equal(filled[:, 2], 0.0)


def test_last_frame_belongs_to_the_last_interval():
    basis = MotionBasis(np.linspace(0.0, 1.0, 11), 0.1)
    assert basis.first[-1] == basis.size - 6
    np.testing.assert_allclose(basis.values[0, -1].sum(), 1.0)


@pytest.mark.parametrize("phase", [0.25, 0.5])
def test_knots_moved_by_a_phase_make_splines_as_good(basis, phase):
    moved = MotionBasis(TIME, 0.07, phase)
    step = moved.knots[1] - moved.knots[0]
    assert moved.knots[5] == pytest.approx(TIME[0] - phase * step)
    assert moved.knots[-6] == pytest.approx(TIME[-1])
    assert moved.size == basis.size
    np.testing.assert_allclose(moved.values[0].sum(axis=1), 1.0, atol=1e-12)
    quintic = np.polynomial.Polynomial([0.1, -2.0, 3.0, 1.0, -4.0, 2.0], domain=[3.0, 4.0])
    orders = moved.evaluate(moved.fit(quintic(TIME)[:, None]))
    for order, values in enumerate(orders):
        expected = quintic.deriv(order)(TIME) if order else quintic(TIME)
        np.testing.assert_allclose(values[10:-10, 0], expected[10:-10], atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize("phase", [0.0, 0.5])
def test_frames_around_a_part_do_not_move_its_knots(phase):
    """The motion near measured windows must not depend on how long the trial is observed around them."""
    time = np.linspace(0.0, 3.0, 301)
    part = slice(77, 190)
    alone, within = MotionBasis(time[part], 0.07, phase), MotionBasis(time, 0.07, phase, part)
    # the last frame is at a knot: between other splines, to the same effect
    inner = alone.values[:, :-1]
    np.testing.assert_allclose(within.values[:, part][:, :-1], inner, atol=1e-7 * np.abs(inner).max())
    assert set(np.round((alone.knots[5:-5, None] - within.knots).__abs__().min(axis=1), 9)) == {0.0}
    assert within.knots[5] <= time[0]
    assert time[-1] <= within.knots[-6] + 1e-9
    assert within.size == MotionBasis(time, 0.07, 0.0, part).size
