from dataclasses import replace

import numpy as np
import pytest

from kinertia.synthetic.laboratory import (
    ARTEFACT_RANGE_M,
    OTHER_ARTEFACT_RANGE_M,
    STRIDE_S,
    ClusterMotion,
    SkinMotion,
    artefact_range,
    camera_noise,
    plate_noise,
    study_noise,
)
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import LOAD_THRESHOLD_N, Markers, PlateLoads


@pytest.fixture(scope="module")
def trial():
    return walk(walking_subject())


@pytest.fixture
def still():
    """Very many markers that do not move, for 10 s."""
    n, m = 1001, 500
    return Markers(np.arange(n) / 100.0, tuple(f"M{k}" for k in range(m)), np.zeros((n, m, 3)))


def plates(fy=500.0) -> PlateLoads:
    k = 4000
    force = np.zeros((k, 2, 3))
    force[1000:3000, :, 1] = fy
    corners = np.array([[5.3, 0, 1.2], [4.7, 0, 1.2], [4.7, 0, 0.8], [5.3, 0, 0.8]])[None].repeat(2, axis=0)
    moment = np.cross(corners.mean(axis=1), force)
    return PlateLoads(np.arange(k) / 1000.0, ("1", "2"), force, moment, (None, None), corners)


def test_study_noise_is_4_mm_rms_and_at_most_1_cm(still):
    error = study_noise(still, np.random.default_rng(0)).positions
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.0041, rel=0.05)
    assert 0.0095 < np.abs(error).max() <= 0.01


def test_study_noise_is_one_slow_sinusoid_per_coordinate(still):
    error = study_noise(still, np.random.default_rng(0)).positions.reshape(len(still.time), -1)
    power = np.abs(np.fft.rfft(error * np.hanning(len(error))[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(error), 0.01)
    assert power[frequency > 25.0 / (2 * np.pi) + 0.3].sum() < 1e-3 * power.sum()
    top = frequency[power.argmax(axis=0)]
    assert np.histogram(top, bins=4, range=(0, 25 / (2 * np.pi)))[0].min() > 300


def skin_moved(trial):
    q = trial.motion.q
    return SkinMotion.draw(trial.skeleton, q, np.random.default_rng(3)).moved(trial.markers, trial.skeleton, q)


def test_artefact_is_rigid_per_segment_and_in_the_published_range(trial):
    noisy = skin_moved(trial)
    pose = trial.skeleton.pose(trial.motion.q)
    ground = noisy.positions - trial.markers.positions
    local = np.einsum("nmji,nmj->nmi", pose.rotation[:, trial.skeleton.marker_segments], ground)
    for s, segment in enumerate(trial.skeleton.segments):
        on_segment = local[:, trial.skeleton.marker_segments == s]
        if not on_segment.shape[1]:
            continue
        np.testing.assert_allclose(on_segment, on_segment[:, :1].repeat(on_segment.shape[1], axis=1), atol=1e-12)
        low, high = ARTEFACT_RANGE_M.get(segment.rpartition("_")[0], OTHER_ARTEFACT_RANGE_M)
        assert low <= np.linalg.norm(np.ptp(on_segment[:, 0], axis=0)) <= high, segment


def test_artefact_is_linear_in_the_neighbouring_joint_angles(trial):
    noisy = skin_moved(trial)
    pose = trial.skeleton.pose(trial.motion.q)
    k = trial.skeleton.labels.index("R.Thigh.Front")
    rotation = pose.rotation[:, trial.skeleton.marker_segments[k]]
    local = np.einsum("nji,nj->ni", rotation, (noisy.positions - trial.markers.positions)[:, k])
    names = ("hip_flexion_r", "hip_adduction_r", "hip_rotation_r", "knee_angle_r")
    angles = trial.motion.q[:, [trial.skeleton.coordinates.index(name) for name in names]]
    design = np.column_stack([np.ones(len(angles)), angles])
    left = local - design @ np.linalg.lstsq(design, local, rcond=None)[0]
    assert np.abs(left).max() < 1e-12
    assert np.ptp(local, axis=0).max() > 0.001


def test_skin_moves_alike_in_every_trial(trial):
    """What another motion's angles make of the same skin; nothing at the reference pose."""
    skin = SkinMotion.draw(trial.skeleton, trial.motion.q, np.random.default_rng(3))
    bent = skin.reference + np.outer([0.0, 1.0, 2.0], np.radians(20.0) * trial.skeleton.rotational)
    exact = Markers(np.arange(3.0), trial.skeleton.labels, trial.skeleton.marker_positions(trial.skeleton.pose(bent)))
    away = np.linalg.norm(skin.moved(exact, trial.skeleton, bent).positions - exact.positions, axis=2)
    assert not away[0].any()
    np.testing.assert_allclose(away[2], 2.0 * away[1])
    assert away[1, trial.skeleton.labels.index("R.Thigh.Front")] > 0.001


def test_camera_noise_is_white(still):
    error = camera_noise(still, 0.0005, np.random.default_rng(0)).positions
    assert error.std() == pytest.approx(0.0005, rel=0.01)
    assert abs(np.mean(error[1:] * error[:-1])) < 0.01 * error.var()


def test_plate_noise_has_its_offset_and_spares_unloaded_samples():
    clean = plates()
    noisy = plate_noise(clean, 2.0, 5.0, 0.3, np.random.default_rng(4))
    assert not noisy.force[:1000].any()
    assert not noisy.moment[3000:].any()
    error = (noisy.force - clean.force)[1000:3000]
    assert error.std(axis=0) == pytest.approx(np.full((2, 3), 2.0), rel=0.1)
    assert 1.0 < np.abs(error.mean(axis=0)).max() < 15.0


def test_errors_of_force_act_at_the_plate():
    """Else a newton of offset would move the centre of pressure by the plate's distance from the ground origin."""
    clean = plates()
    noisy = plate_noise(clean, 2.0, 5.0, 0.0, np.random.default_rng(4))
    centre = clean.corners.mean(axis=1)
    about_centre = (noisy.moment - np.cross(centre, noisy.force))[1000:3000]
    np.testing.assert_allclose(about_centre, 0.0, atol=1e-9)


def test_samples_that_fall_below_the_load_threshold_are_zero():
    noisy = plate_noise(plates(LOAD_THRESHOLD_N + 1.0), 3.0, 0.0, 0.0, np.random.default_rng(5))
    loaded = noisy.force[..., 1] > 0
    assert 0.1 < 1 - loaded[1000:3000].mean() < 0.9
    assert noisy.force[..., 1][loaded].min() >= LOAD_THRESHOLD_N
    assert not noisy.moment[~loaded].any()


def test_same_seed_same_noise_other_seed_other_noise(trial):
    short = replace(trial.markers, time=trial.markers.time[:9], positions=trial.markers.positions[:9])
    models = {
        "study": lambda rng: study_noise(short, rng).positions,
        "artefact": lambda rng: SkinMotion.draw(trial.skeleton, trial.motion.q, rng).slopes["thigh_r"],
        "camera": lambda rng: camera_noise(short, 0.001, rng).positions,
        "plate": lambda rng: plate_noise(plates(), 1.0, 1.0, 0.1, rng).force,
    }
    for name, model in models.items():
        first, again, other = (model(np.random.default_rng(seed)) for seed in (1, 1, 2))
        np.testing.assert_array_equal(first, again, err_msg=name)
        assert np.abs(first - other).max() > 1e-6, name


def test_clusters_stay_rigid_and_come_back_with_every_stride():
    trial = walk(walking_subject(), 2 * STRIDE_S + 0.02, trapezoid=False)
    skin = ClusterMotion.draw(trial.skeleton, np.random.default_rng(0))
    moved = skin.moved(trial.markers, trial.skeleton, trial.motion.q)
    turned = trial.skeleton.pose(trial.motion.q).rotation[:, trial.skeleton.marker_segments].transpose(0, 1, 3, 2)
    local = (turned @ (moved.positions - trial.markers.positions)[..., None])[..., 0]
    stride = round(STRIDE_S / 0.01)
    np.testing.assert_allclose(local[stride : 2 * stride], local[:stride], atol=1e-9)
    for segment in np.unique(trial.skeleton.marker_segments):
        on_segment = trial.skeleton.marker_segments == segment
        low, high = artefact_range(trial.skeleton.segments[segment])
        assert 0.95 * low < np.linalg.norm(np.ptp(local[:, on_segment].mean(axis=1), axis=0)) < 1.05 * high
        places = trial.skeleton.marker_locals[on_segment]
        apart = np.linalg.norm((places + local[:, on_segment])[:, :1] - (places + local[:, on_segment]), axis=-1)
        # turns are small: distances change by their square
        assert apart == pytest.approx(np.tile(apart.mean(axis=0), (len(apart), 1)), abs=2e-3)
