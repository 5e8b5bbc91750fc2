"""Sums over frames, a few at a time, against those over all frames at once."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.markers import marker_noise as module
from kinertia.motion import workload
from kinertia.synthetic.walk import walking_subject

N = 50


@pytest.fixture
def seen(monkeypatch):
    """Skeleton and errors (n, m, 3), of which some were not seen; frames come in seven pieces."""
    monkeypatch.setattr(module, "pieces", lambda count: workload.pieces(count, 8))
    skeleton, rng = walking_subject().skeleton, np.random.default_rng(1)
    errors = rng.normal(0.0, 0.01, (N, len(skeleton.markers), 3)).cumsum(axis=0)
    errors[rng.random(errors.shape[:2]) < 0.1] = np.nan
    errors[:, 4] = np.nan
    return skeleton, errors


def test_root_mean_squares(seen):
    _, errors = seen
    result = module.root_mean_square(errors)
    shown = np.arange(errors.shape[1]) != 4
    np.testing.assert_allclose(result[shown], np.sqrt(np.nanmean(np.square(errors[:, shown]), axis=(0, 2))))
    assert result[4] == 0.0


def test_markers_that_err_alike(seen):
    skeleton, errors = seen
    errors[:, 0] = np.nan
    result, filled = module.markers_in_common(skeleton, errors), np.nan_to_num(errors)
    for segment in np.unique(skeleton.marker_segments):
        own = filled[:, skeleton.marker_segments == segment]
        expected = max(1.0, np.square(own.sum(axis=1)).sum() / np.square(own).sum())
        np.testing.assert_allclose(result[skeleton.marker_segments == segment], expected)
    np.testing.assert_array_equal(module.markers_in_common(skeleton, np.zeros_like(errors)), 1.0)


def test_products_with_the_two_frames_before(seen):
    skeleton, errors = seen
    sd = np.random.default_rng(2).uniform(0.01, 0.02, errors.shape[1])
    three = np.stack([errors[2:], errors[1:-1], errors[:-2]]) / sd[:, None]
    shown = np.isfinite(three).all(axis=(0, 3))
    three[:, ~shown] = 0.0
    segments = np.unique(skeleton.marker_segments)
    common = np.stack([three[:, :, skeleton.marker_segments == s].sum(axis=2) for s in segments])
    expected = [np.einsum("anmk,bnmk->ab", three, three), np.einsum("santk,sbntk->ab", *[common[..., None, :]] * 2)]
    result = module._products(skeleton, errors, sd)
    np.testing.assert_allclose(result, np.stack(expected) / (3 * np.count_nonzero(shown)), rtol=1e-12)
