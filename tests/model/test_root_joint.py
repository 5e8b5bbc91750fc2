import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.model.root_joint import Root

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
