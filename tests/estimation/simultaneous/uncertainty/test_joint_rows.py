"""What bodies and loads make of the forces of axes, against matrix products and finite differences."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.uncertainty.joint_rows import add_bodies, take_load
from kinertia.synthetic.walk import walking_subject

N, STATIC = 4, 37


@pytest.fixture
def body():
    """Skeleton, coordinates, axes in ground, slopes, and rows of which some are missing."""
    skeleton, rng = walking_subject().skeleton, np.random.default_rng(2)
    q = rng.uniform(-0.5, 0.5, (N, len(skeleton.coordinates)))
    rows = np.where(np.arange(q.shape[1]) % 4 == 3, -1, np.cumsum(np.arange(q.shape[1]) % 4 != 3) - 1)
    return skeleton, q, skeleton.pose(q).axes, rng.uniform(0.5, 2.0, q.shape), rows


def test_bodies_are_carried_by_the_axes_that_move_them(body):
    skeleton, _, axes, slopes, rows = body
    rng = np.random.default_rng(4)
    segments, chain = np.array([0, 2, 5]), rng.standard_normal((3, 10, 10))
    by_parameter = rng.standard_normal((N, 6, 8, 10))
    support, out = skeleton.support[segments], np.zeros((N, rows.max() + 1, STATIC))
    add_bodies(axes, slopes, rows, support, by_parameter, segments, chain, out)
    by_body = np.einsum("nrsp,spk->nrsk", by_parameter[:, :, segments], chain).reshape(N, 6, -1)
    carried = np.repeat(support.T, 10, axis=1)
    expected = slopes[..., None] * np.where(carried, axes @ by_body, 0.0)
    np.testing.assert_allclose(out[:, :, : carried.shape[1]], expected[:, rows >= 0], atol=1e-12)
    assert not out[:, :, carried.shape[1] :].any()


def test_a_load_is_taken_off_and_its_derivatives(body):
    skeleton, q, axes, slopes, rows = body
    rng = np.random.default_rng(5)
    moved = np.flatnonzero(skeleton.support[skeleton.segments.index(skeleton.feet[0])])
    loads, by_load, first = rng.standard_normal((N, 6)), rng.standard_normal((N, 6, STATIC)), 30
    tau, by_place = np.zeros(q.shape), np.zeros((*q.shape, q.shape[1]))
    out = np.zeros((N, rows.max() + 1, STATIC))
    take_load(axes, slopes, rows, moved, loads, by_load, first, tau, by_place, out)
    mask = np.isin(np.arange(q.shape[1]), moved)[:, None]
    jacobian = axes * mask
    np.testing.assert_allclose(tau, -(jacobian @ loads[..., None])[..., 0], atol=1e-12)
    expected = -slopes[..., None] * (jacobian @ by_load)
    np.testing.assert_allclose(out[:, :, first:], expected[:, rows >= 0][..., first:], atol=1e-12)
    assert not out[:, :, :first].any()
    step = 1e-6
    for j in range(q.shape[1]):
        aside = np.eye(q.shape[1])[j] * step
        forces = [-((skeleton.pose(at).axes * mask) @ loads[..., None])[..., 0] for at in (q + aside, q - aside)]
        np.testing.assert_allclose(by_place[..., j], (forces[0] - forces[1]) / (2.0 * step), atol=1e-7)
