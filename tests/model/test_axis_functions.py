import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinertia.model.axis_functions import (
    Composed,
    constant,
    constant_value,
    linear,
    piecewise_linear,
    polynomial,
    simm_spline,
    unit_slope,
)

POINTS = ([-2.0, -1.2, 0.1, 0.5, 1.9, 2.2], [0.3, -0.1, 0.4, 0.2, 0.9, 0.8])


def theirs(opensim, function, x: float, order: int) -> float:
    at = opensim.Vector(1, float(x))
    if order == 0:
        return function.calcValue(at)
    return function.calcDerivative([0] * order, at)  # its own StdVectorInt may be taken for ezc3d's


def filled(function, points):
    for x, y in zip(*points, strict=True):
        function.addPoint(float(x), float(y))
    return function


@st.composite
def points(draw, fewest=2):
    gaps = draw(st.lists(st.floats(0.05, 2.0), min_size=fewest, max_size=9))
    x = np.cumsum(gaps) - 3.0
    return x.tolist(), draw(st.lists(st.floats(-2.0, 2.0), min_size=len(x), max_size=len(x)))


@settings(max_examples=60, deadline=None)
@given(points(), st.floats(-1.0, 2.0))
def test_simm_spline_is_opensims(opensim, drawn, share):
    """Value and two derivatives, inside and beyond the ends."""
    x = drawn[0][0] + share * (drawn[0][-1] - drawn[0][0])
    if np.abs(x - np.array(drawn[0])).min() < 1e-9:
        return  # OpenSim takes the end's curvature at an end itself
    ours, reference = simm_spline(*drawn), filled(opensim.SimmSpline(), drawn)
    for order in range(3):
        size = max(1.0, np.abs(ours.coefficients).max())
        assert ours(np.array([x]), order)[0] == pytest.approx(theirs(opensim, reference, x, order), abs=1e-9 * size)


@settings(max_examples=30, deadline=None)
@given(points(), st.floats(-1.0, 2.0))
def test_piecewise_linear_is_opensims(opensim, drawn, share):
    x = drawn[0][0] + share * (drawn[0][-1] - drawn[0][0])
    if np.abs(x - np.array(drawn[0])).min() < 1e-9:
        return
    ours, reference = piecewise_linear(*drawn), filled(opensim.PiecewiseLinearFunction(), drawn)
    for order in range(2):
        assert ours(np.array([x]), order)[0] == pytest.approx(theirs(opensim, reference, x, order), abs=1e-9)


def test_polynomial_is_opensims(opensim):
    coefficients = [0.3, -1.2, 0.7, 2.0]
    vector = opensim.Vector(4, 0.0)
    for i, value in enumerate(coefficients):
        vector.set(i, value)
    reference = opensim.PolynomialFunction(vector)
    for x in (-1.7, 0.0, 0.4, 2.5):
        for order in range(3):
            ours = polynomial(coefficients)(np.array([x]), order)[0]
            assert ours == pytest.approx(theirs(opensim, reference, x, order))


FUNCTIONS = {
    "constant": constant(0.4),
    "linear": linear(-0.7, 0.2),
    "polynomial": polynomial([0.2, -0.5, 0.1, 0.3, 1.0]),
    "piecewise linear": piecewise_linear(*POINTS),
    "spline": simm_spline(*POINTS),
    "scaled spline": simm_spline(*POINTS).scaled(-1.3),
    "spline of a polynomial": Composed(simm_spline(*POINTS), polynomial([0.3, -0.4, 0.1])),
    "polynomial of a spline": Composed(polynomial([0.3, -0.4, 0.1]), simm_spline(*POINTS)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("order", [1, 2, 3])
def test_derivatives_are_finite_differences(name, order):
    """Away from knots, beyond the ends too."""
    x = np.linspace(-3.0, 3.0, 61) + 0.013
    h = 1e-5
    function = FUNCTIONS[name]
    slope = (function(x + h, order - 1) - function(x - h, order - 1)) / (2 * h)
    np.testing.assert_allclose(function(x, order), slope, atol=1e-7)


def test_a_copied_coordinate_is_recognised():
    assert unit_slope(linear(1.0)) == 1.0
    assert unit_slope(linear(-1.0)) == -1.0
    assert unit_slope(polynomial([0.0, 1.0, 0.0])) == 1.0
    for other in (linear(0.9), linear(1.0, 0.1), constant(1.0), polynomial([0.1, 1.0, 0.0]), simm_spline(*POINTS)):
        assert unit_slope(other) is None


def test_a_constant_is_recognised():
    assert constant_value(constant(0.3)) == 0.3
    assert constant_value(constant(0.3).scaled(2.0)) == 0.6
    assert constant_value(polynomial([0.0, 0.0, -0.1])) == -0.1
    assert constant_value(simm_spline([0.0, 1.0, 2.0], [0.5, 0.5, 0.5])) == 0.5
    for other in (linear(1.0), simm_spline(*POINTS), piecewise_linear([0.0, 1.0, 2.0], [0.1, 0.1, 0.2])):
        assert constant_value(other) is None


@pytest.mark.parametrize("build", [simm_spline, piecewise_linear])
def test_points_that_make_no_function_are_refused(build):
    with pytest.raises(ValueError, match="must increase"):
        build([0.0, 1.0, 1.0], [0.0, 1.0, 2.0])
    with pytest.raises(ValueError, match="at least 2"):
        build([0.0], [1.0])
    with pytest.raises(ValueError, match="3 x and 2 y"):
        build([0.0, 1.0, 2.0], [0.0, 1.0])
