"""Rotations next to SciPy's."""

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.model.rotations import about, least_turn, three_angles

RNG = np.random.default_rng(5)


def test_about_an_axis():
    axis = RNG.normal(size=3)
    axis /= np.linalg.norm(axis)
    for angle in (0.0, 1e-9, 0.7, -3.0, 9.0):
        np.testing.assert_allclose(about(axis, angle), Rotation.from_rotvec(axis * angle).as_matrix(), atol=1e-15)


def test_the_least_turn_from_one_direction_to_another():
    start, end = RNG.normal(size=(2, 3))
    expected = Rotation.align_vectors(end[None], start[None])[0].as_matrix()
    np.testing.assert_allclose(least_turn(start, end), expected, atol=1e-12)
    np.testing.assert_allclose(least_turn(start, 2.0 * start), np.eye(3), atol=1e-15)
    opposite = least_turn(start, -start)
    np.testing.assert_allclose(opposite @ start, -start, atol=1e-15)
    assert np.linalg.det(opposite) == pytest.approx(1.0)


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [2, 1, 0], [1, 0, 2]])
def test_three_angles_make_up_the_rotation(order):
    turned = Rotation.random(rng=RNG).as_matrix()
    axes = turned[:, order]
    rotation = Rotation.random(50, rng=RNG)
    expected = rotation.as_davenport(axes.T, "intrinsic")
    np.testing.assert_allclose(three_angles(rotation.as_matrix(), axes), expected, atol=1e-12)


@pytest.mark.parametrize("tilt", [np.pi / 2, -np.pi / 2])
def test_at_gimbal_lock_one_of_the_triples_is_given(tilt):
    rotation = about(np.eye(3)[0], 0.3) @ about(np.eye(3)[1], tilt) @ about(np.eye(3)[2], 0.4)
    angles = three_angles(rotation, np.eye(3))
    with warnings.catch_warnings(action="ignore"):
        again = Rotation.from_euler("XYZ", angles).as_matrix()
    np.testing.assert_allclose(again, rotation, atol=1e-7)
