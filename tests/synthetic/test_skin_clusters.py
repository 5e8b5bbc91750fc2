import numpy as np
import pytest

from kinertia.synthetic.noise import artefact_range
from kinertia.synthetic.skin_clusters import STRIDE_S, ClusterMotion
from kinertia.synthetic.walk import walk, walking_subject


def test_clusters_stay_rigid_and_come_back_with_every_stride():
    trial = walk(walking_subject(), 2 * STRIDE_S + 0.02, trapezoid=False)
    skin = ClusterMotion.draw(trial.skeleton, np.random.default_rng(0))
    moved = skin.moved(trial.markers, trial.skeleton, trial.motion.q)
    turned = trial.skeleton.pose(trial.motion.q).rotation[:, trial.skeleton.marker_segments].transpose(0, 1, 3, 2)
    local = (turned @ (moved.positions - trial.markers.positions)[..., None])[..., 0]
    stride = round(STRIDE_S / 0.01)
    np.testing.assert_allclose(local[stride : 2 * stride], local[:stride], atol=1e-9)
    for segment in np.unique(trial.skeleton.marker_segments):
        own = trial.skeleton.marker_segments == segment
        low, high = artefact_range(trial.skeleton.segments[segment])
        assert 0.95 * low < np.linalg.norm(np.ptp(local[:, own].mean(axis=1), axis=0)) < 1.05 * high
        places = trial.skeleton.marker_locals[own]
        apart = np.linalg.norm((places + local[:, own])[:, :1] - (places + local[:, own]), axis=-1)
        # turns are small: distances change by their square
        assert apart == pytest.approx(np.tile(apart.mean(axis=0), (len(apart), 1)), abs=2e-3)
