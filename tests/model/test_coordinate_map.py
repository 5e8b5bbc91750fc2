import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.model.axis_functions import polynomial, simm_spline
from kinertia.model.coordinate_map import CoordinateMap, Root

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
