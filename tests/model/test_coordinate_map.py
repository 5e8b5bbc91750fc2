import numpy as np
import pytest

from kinertia.model.axis_functions import polynomial, simm_spline
from kinertia.model.coordinate_map import CoordinateMap

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
