import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kinertia.model.coordinate_map import (
    Composed,
    CoordinateMap,
    Root,
    constant,
    constant_value,
    linear,
    piecewise_linear,
    polynomial,
    simm_spline,
    unit_slope,
)

KNEE = simm_spline([-2.0, -1.0, 0.0, 0.6, 1.5], [0.1, -0.2, 0.0, 0.3, 0.1])


CURVED = CoordinateMap.of(
    ("slide", "knee", "hip"),
    ("slide", "knee", "knee", "hip", "knee"),
    (None, None, KNEE, None, polynomial([0.5, 0.1, 0])),
)


PLAIN = CoordinateMap.of(("a", "b"), ("a", "b"), (None, None))


@pytest.fixture
def state():
    rng = np.random.default_rng(0)
    return rng.uniform(-0.9, 0.5, (6, 3)), rng.normal(0, 2, (6, 3)), rng.normal(0, 9, (6, 3))


def test_motion_is_the_derivative_of_places(state):
    q, qd, qdd = state
    h = 1e-4

    def at(t):
        return CURVED.axes(q + qd * t + 0.5 * qdd * t**2)

    x, xd, xdd = CURVED.motion(q, qd, qdd)
    np.testing.assert_allclose(x, at(0.0))
    np.testing.assert_allclose(xd, (at(h) - at(-h)) / (2 * h), atol=1e-5)
    np.testing.assert_allclose(xdd, (at(h) - 2 * at(0.0) + at(-h)) / h**2, atol=1e-3)


def test_forces_do_the_work_of_the_axes(state):
    q, qd, qdd = state
    forces = np.random.default_rng(1).normal(size=(6, 5))
    rate = CURVED.motion(q, qd, qdd)[1]
    generalised = CURVED.to_coordinates(forces, CURVED.slopes(q))
    np.testing.assert_allclose((generalised * qd).sum(axis=1), (forces * rate).sum(axis=1))


def test_derivatives_by_coordinates_are_finite_differences(state):
    """Of a smooth function of the axes' places, rates and accelerations."""
    rng = np.random.default_rng(2)
    weights = rng.normal(size=(3, 2, 5))

    def function(*motion):
        return np.sin(
            sum(np.einsum("ra,na->nr", w, part) for w, part in zip(weights, CURVED.motion(*motion), strict=True))
        )

    inside = sum(np.einsum("ra,na->nr", w, p) for w, p in zip(weights, CURVED.motion(*state), strict=True))
    by_axes = tuple(np.cos(inside)[:, :, None] * w for w in weights)
    derivatives = CURVED.derivatives_to_coordinates(by_axes, *state)
    h = 1e-6
    for order in range(3):
        for column in range(3):
            ahead, behind = (list(state) for _ in range(2))
            step = h * np.eye(3)[column]
            ahead[order], behind[order] = state[order] + step, state[order] - step
            slope = (function(*ahead) - function(*behind)) / (2 * h)
            np.testing.assert_allclose(derivatives[order][:, :, column], slope, atol=1e-6)


def test_a_plain_model_costs_nothing():
    q = np.ones((4, 2))
    columns = np.ones((4, 6, 2))
    assert PLAIN.identity
    assert PLAIN.axes(q) is q
    assert PLAIN.slopes(q) is None
    assert PLAIN.to_coordinates(columns, None) is columns
    assert all(a is b for a, b in zip(PLAIN.motion(q, q, q), (q, q, q), strict=True))


@pytest.mark.parametrize("axes", [PLAIN, CURVED])
def test_compiled_functions_get_contiguous_places_and_slopes(axes):
    q = np.asfortranarray(np.random.default_rng(3).uniform(-0.9, 0.5, (6, axes.count)))
    places, slopes = axes.places_and_slopes(q)
    assert places.flags.c_contiguous
    assert slopes.flags.c_contiguous
    np.testing.assert_array_equal(places, axes.axes(q))
    np.testing.assert_array_equal(slopes, 1.0 if axes.identity else axes.slopes(q))


def test_a_shared_coordinate_is_not_plain():
    assert not CoordinateMap.of(("a",), ("a", "a"), (None, None)).identity
    assert not CURVED.identity


IDENTITY = np.eye(3)


TRIPLES = {
    "tilt, list, rotation": np.eye(3)[[2, 0, 1]].T,
    "x, y, z": np.eye(3),
    "left-handed": np.eye(3)[[1, 0, 2]].T * [1, -1, 1],
    "oblique": Rotation.from_euler("xyz", [0.3, -0.5, 0.7]).as_matrix()[:, [2, 0, 1]],
}


@pytest.fixture(params=TRIPLES)
def root(request):
    turned = [Rotation.from_euler("xyz", angles).as_matrix() for angles in ([0.4, 0.2, -0.3], [-0.2, 0.5, 0.1])]
    shift = np.array([[0.1, -0.2, 0.3], [0.05, 0.02, -0.04]])
    return Root(turned[0], shift[0], IDENTITY[[1, 2, 0]].T, TRIPLES[request.param], turned[1], shift[1])


def place(root: Root, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and origin of the root segment, one axis after the other."""
    rotation, at = root.rotation, root.translation
    for direction, value in zip(root.slides.T, q[:3], strict=True):
        at = at + rotation @ direction * value
    for direction, value in zip(root.turns.T, q[3:6], strict=True):
        rotation = rotation @ Rotation.from_rotvec(direction * value).as_matrix()
    rotation = rotation @ root.child_rotation.T
    return rotation, at - rotation @ root.child_translation


@pytest.fixture
def q():
    rng = np.random.default_rng(0)
    return np.hstack(
        [
            rng.normal(size=(9, 3)),
            rng.uniform(-3, 3, (9, 1)),
            rng.uniform(-1.5, 1.5, (9, 1)),
            rng.uniform(-3, 3, (9, 1)),
        ]
    )


def test_coordinates_place_the_segment(root, q):
    rotation, translation = map(np.array, zip(*(place(root, row) for row in q), strict=True))
    coordinates = root.coordinates(rotation, translation)
    np.testing.assert_allclose(coordinates[:, :3], q[:, :3], atol=1e-12)
    np.testing.assert_allclose((coordinates[:, 3:] - q[:, 3:] + np.pi) % (2 * np.pi), np.pi, atol=1e-9)


def test_axes_and_centre_are_those_of_the_motion(root, q):
    """The segment's angular velocity for each angle at unit rate; the centre does not move with them."""
    h = 1e-6
    axes, centre = root.axes(q), root.centre(q)
    for row, at in enumerate(q):
        for k in range(3):
            step = h * np.eye(6)[3 + k]
            (ahead, there), (behind, back) = place(root, at + step), place(root, at - step)
            omega = Rotation.from_matrix(ahead @ behind.T).as_rotvec() / (2 * h)
            np.testing.assert_allclose(axes[row, :, k], omega, atol=1e-7)
            fixed = [r @ root.child_translation + t for r, t in ((ahead, there), (behind, back))]
            np.testing.assert_allclose(fixed, np.tile(centre[row], (2, 1)), atol=1e-9)


def test_a_load_about_the_centre_does_the_same_work(root, q):
    rng = np.random.default_rng(1)
    load, rates = rng.normal(size=(9, 6)), rng.normal(size=(9, 6))
    about = root.about_centre(q, load)
    velocity = rates[:, :3] @ (root.rotation @ root.slides).T
    omega = np.einsum("nij,nj->ni", root.axes(q), rates[:, 3:])
    work = (about[:, :3] * velocity + about[:, 3:] * omega).sum(axis=1)
    at_origin = velocity - np.cross(omega, root.centre(q))
    np.testing.assert_allclose((load[:, :3] * at_origin + load[:, 3:] * omega).sum(axis=1), work)


def test_what_the_centre_adds_to_a_load_when_it_moves(root, q):
    load = np.random.default_rng(2).normal(size=(9, 6))
    change = root.centre_moves(load)
    h = 1e-6
    for k in range(3):
        ahead, behind = (root.about_centre(q + s * h * np.eye(6)[k], load) for s in (1, -1))
        np.testing.assert_allclose(-change[:, :, k], ((ahead - behind) / (2 * h))[:, 3:], atol=1e-7)


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
