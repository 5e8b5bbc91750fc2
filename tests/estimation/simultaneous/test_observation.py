from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.markers.marker_noise import SMALLEST_MARKER_SD_M
from kinertia.estimation.simultaneous.markers.skin import girdle_variance
from kinertia.estimation.simultaneous.observation import FORCE_SD_OF_WEIGHT, MOMENT_ARM_M, observe
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.kinematics import AROUND_WINDOW_S
from kinertia.synthetic.laboratory import SkinMotion, camera_noise, study_noise
from validation.synthetic_walks import kinematics_of, study_walk

MASS_KG = 72.6


@pytest.fixture(scope="module")
def trial():
    return study_walk(1.0)


def observed(trial, markers, motion_hz=10.0):
    return separate(trial.skeleton, kinematics_of(trial, markers), motion_hz)


def separate(skeleton, kinematics, motion_hz=10.0):
    seen = observe(skeleton, [kinematics], MASS_KG, [Bandwidth(motion_hz)])
    return seen.separate[0], seen.noise[0]


@pytest.fixture(scope="module")
def white(trial):
    return observed(trial, camera_noise(trial.markers, 0.005, np.random.default_rng(0)))


def test_effective_deviation_of_white_noise_is_its_deviation(trial, white):
    seen, noise = white
    assert np.median(list(noise.sd_m.values())) == pytest.approx(0.005, rel=0.1)
    assert noise.correlation_s == pytest.approx(1.0 / trial.markers.rate_hz, rel=0.2)
    assert np.median(seen.marker_sd) == pytest.approx(0.005, rel=0.15)
    assert seen.marker_frames == pytest.approx(1.0, abs=0.2)
    assert noise.drifting == ()


def test_slow_noise_is_alike_from_frame_to_frame(trial, white):
    """The study's noise is correlated over some pi / 25 s, more than ten frames."""
    slow = study_noise(trial.markers, np.random.default_rng(0))
    seen, noise = observed(trial, slow)
    sd = np.std(slow.positions - trial.markers.positions)
    assert np.median(list(noise.sd_m.values())) == pytest.approx(sd, rel=0.3)
    assert 0.05 < noise.correlation_s < 0.5
    assert seen.marker_frames > 5.0
    assert np.median(seen.marker_sd) > 1.1 * np.median(list(noise.sd_m.values()))


def test_exact_markers_keep_a_smallest_deviation(trial):
    seen, noise = observed(trial, trial.markers)
    assert set(noise.sd_m.values()) == {SMALLEST_MARKER_SD_M}
    assert np.isfinite(seen.marker_sd).all()


def test_a_drifting_marker_counts_less_and_is_named(trial):
    rng = np.random.default_rng(0)
    noisy = camera_noise(trial.markers, 0.002, rng)
    at = noisy.labels.index("R.Thigh.Front")
    positions = noisy.positions.copy()
    positions[:, at] += rng.normal(0.0, 0.02, positions[:, at].shape)
    seen, noise = observed(trial, replace(noisy, positions=positions))
    assert noise.drifting == ("R.Thigh.Front",)
    assert max(noise.sd_m, key=lambda label: noise.sd_m[label]) == "R.Thigh.Front"
    assert seen.marker_sd[at] > 3.0 * np.median(seen.marker_sd)


def test_gaps_are_missing_and_a_marker_that_the_trial_lacks_too(trial):
    positions = camera_noise(trial.markers, 0.002, np.random.default_rng(0)).positions.copy()
    positions[40:50, 3] = np.nan
    kept = [i for i in range(positions.shape[1]) if i != 7]
    markers = replace(trial.markers, positions=positions).select([trial.markers.labels[i] for i in kept])
    seen, noise = observed(trial, markers)
    offset = np.flatnonzero(np.isclose(trial.time, seen.time[0]))[0]
    assert np.isnan(seen.markers[40 - offset : 50 - offset, 3]).all()
    assert np.isnan(seen.markers[:, 7]).all()
    assert trial.markers.labels[7] not in noise.sd_m
    assert np.isfinite(seen.markers[:, 8]).all()


def test_frames_stay_uniform_where_the_pelvis_is_not_seen(trial):
    """Terms of neighbouring frames and the window of the other results need every frame."""
    pelvis = [trial.markers.labels.index(m.label) for m in trial.skeleton.markers if m.segment == "pelvis"]
    positions = camera_noise(trial.markers, 0.002, np.random.default_rng(0)).positions.copy()
    gap = slice(50, 58)
    positions[gap, pelvis] = np.nan
    kinematics = kinematics_of(trial, replace(trial.markers, positions=positions))
    seen, noise = separate(trial.skeleton, kinematics)
    np.testing.assert_allclose(np.diff(seen.time), 0.01)
    np.testing.assert_allclose(seen.time[seen.dynamic], kinematics.time)
    here = slice(*(int(np.searchsorted(seen.time, trial.time[i] - 1e-9)) for i in (gap.start, gap.stop)))
    assert np.isnan(seen.markers[here]).all()
    assert np.isfinite(seen.q).all()
    np.testing.assert_allclose(seen.q[here], trial.motion.q[gap], atol=0.15)
    assert np.median(list(noise.sd_m.values())) == pytest.approx(0.002, rel=0.1)


def test_only_the_window_is_dynamic_and_its_surroundings_are_markers(trial):
    whole = kinematics_of(trial, trial.markers)
    kinematics = replace(whole, windows_s=((0.4, 0.6),), known=np.zeros_like(whole.known))
    seen, _ = separate(trial.skeleton, kinematics)
    assert seen.time[seen.dynamic][[0, -1]] == pytest.approx([0.4, 0.6])
    assert seen.time[[0, -1]] == pytest.approx([0.4 - AROUND_WINDOW_S, 0.6 + AROUND_WINDOW_S])
    assert seen.ground.loads.time[[0, -1]] == pytest.approx([0.4 - AROUND_WINDOW_S, 0.6 + AROUND_WINDOW_S])
    np.testing.assert_array_equal(seen.curve_frames, np.flatnonzero(seen.dynamic))


def test_curves_are_reported_wherever_any_load_is_known(trial):
    """Here of the trunk and of a leg in the air or on its plate, before and after the window."""
    whole = kinematics_of(trial, trial.markers)
    known = whole.known.copy()
    known[(whole.trial.markers.time < 0.2) | (whole.trial.markers.time > 0.8)] = False
    seen, _ = separate(trial.skeleton, replace(whole, windows_s=((0.4, 0.6),), known=known))
    assert seen.time[seen.dynamic][[0, -1]] == pytest.approx([0.4, 0.6])
    expected = trial.time[known.any(axis=1)]
    np.testing.assert_allclose(seen.time[seen.curve_frames], expected)
    assert seen.time[0] <= 0.4 - AROUND_WINDOW_S
    assert seen.time[-1] > expected[-1]


def test_deviation_of_forces_grows_with_weight_and_with_repeated_frames(trial, white):
    seen, _ = white
    assert seen.force_sd == pytest.approx(np.sqrt(100.0 / 20.0) * FORCE_SD_OF_WEIGHT * MASS_KG * GRAVITY_M_S2)
    assert seen.moment_sd == pytest.approx(MOMENT_ARM_M * seen.force_sd)
    wide, _ = observed(trial, trial.markers, 100.0)
    assert wide.force_sd == pytest.approx(FORCE_SD_OF_WEIGHT * MASS_KG * GRAVITY_M_S2)


def test_markers_that_err_together_count_as_few(trial):
    """Skin motion moves all markers of a segment as one; noise of each marker on its own counts in full."""
    rng = np.random.default_rng(3)
    apart = camera_noise(trial.markers, 0.004, rng)
    steps = rng.normal(0.0, 0.004, (len(trial.time), len(trial.skeleton.segments), 3))
    shifted = trial.markers.positions + steps[:, trial.skeleton.marker_segments]
    pooled = replace(trial.markers, positions=shifted)
    ratios = []
    for markers in (apart, pooled):
        seen, noise = observed(trial, markers)
        ratios.append(np.square(seen.marker_sd / np.array([noise.sd_m[n] for n in trial.skeleton.labels])))
    assert np.median(ratios[0]) == pytest.approx(1.0, abs=0.1)
    on_thigh = trial.skeleton.marker_segments == trial.skeleton.segments.index("thigh_r")
    assert ratios[1][on_thigh] == pytest.approx(np.full(on_thigh.sum(), on_thigh.sum()), rel=0.4)


def test_markers_off_their_places_are_not_noise(trial):
    """A marker that sits 10 mm elsewhere in its segment all the time has no more noise than before."""
    rng = np.random.default_rng(5)
    noisy = camera_noise(trial.markers, 0.002, rng)
    kinematics = kinematics_of(trial, noisy)
    places = trial.skeleton.marker_locals + rng.normal(0.0, 0.01, trial.skeleton.marker_locals.shape)
    moved = trial.skeleton.with_positions(places)
    (rhs, _), (wrong, _) = (separate(skeleton, kinematics) for skeleton in (trial.skeleton, moved))
    np.testing.assert_allclose(wrong.marker_sd, rhs.marker_sd, rtol=1e-6)


def test_trials_of_one_person(trial):
    """The same walk twice, markers of the right thigh elsewhere in the second."""
    rng = np.random.default_rng(0)
    q = trial.motion.q
    skin = SkinMotion.draw(trial.skeleton, q, rng)
    walks = [camera_noise(skin.moved(trial.markers, trial.skeleton, q), 0.0005, rng) for _ in range(2)]
    thigh = trial.skeleton.marker_segments == trial.skeleton.segments.index("thigh_r")
    turned = trial.skeleton.pose(q).rotation[:, trial.skeleton.marker_segments[thigh]]
    positions = walks[1].positions.copy()
    positions[:, thigh] += turned @ [0.0, 0.0, 0.015]
    alike = observe(trial.skeleton, [kinematics_of(trial, walk) for walk in walks], MASS_KG, [Bandwidth(10.0)] * 2)
    assert alike.repeats == pytest.approx(np.ones((2, 2)), abs=0.1)
    assert np.max(alike.pooled[0].displacement_sd_m) < 0.001
    kinematics = [
        kinematics_of(trial, loads_or_walk) for loads_or_walk in (walks[0], replace(walks[1], positions=positions))
    ]
    seen = observe(trial.skeleton, kinematics, MASS_KG, [Bandwidth(10.0)] * 2)
    assert [o.repeats for o in seen.pooled] == pytest.approx(seen.repeats.sum(axis=1))
    for alone, both in zip(seen.separate, seen.pooled, strict=True):
        assert both.marker_sd == pytest.approx(np.sqrt(both.repeats) * alone.marker_sd)
        assert both.force_sd == pytest.approx(np.sqrt(both.repeats) * alone.force_sd)
        assert both.moment_sd == pytest.approx(np.sqrt(both.repeats) * alone.moment_sd)
        displaced = np.asarray(both.displacement_sd_m)
        # of two: 15 mm / sqrt 2 along one of three axes; inverse kinematics spreads some of it
        assert displaced[thigh] == pytest.approx(np.full(thigh.sum(), 0.015 / np.sqrt(6.0)), rel=0.35)
        assert np.median(displaced[~thigh]) < 0.2 * displaced[thigh].min()
    (single,) = observe(trial.skeleton, kinematics[:1], MASS_KG, [Bandwidth(10.0)]).pooled
    assert not np.any(single.displacement_sd_m)
    assert single.repeats == 1.0


def test_the_process_is_as_dense_at_zero_frequency_as_the_errors(trial):
    """Variance times frames alike is what says how well constants are known; it is that of the errors."""
    seen, noise = observed(trial, study_noise(trial.markers, np.random.default_rng(0)))
    sd = np.array([noise.sd_m[label] for label in trial.skeleton.labels])
    frames = noise.correlation_s * trial.markers.rate_hz
    variance = np.square(seen.marker_sd) - girdle_variance(trial.skeleton, seen.q, np.ones(len(sd), dtype=bool))
    assert (variance / np.square(sd)).min() * seen.marker_frames == pytest.approx(frames, rel=0.2)
