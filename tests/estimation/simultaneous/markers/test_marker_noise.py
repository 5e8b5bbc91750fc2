"""Sums over frames, a few at a time, against those over all frames at once."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.markers import marker_noise as module
from kinertia.estimation.simultaneous.markers.marker_noise import Repetition, repeats
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
        of_segment = filled[:, skeleton.marker_segments == segment]
        expected = max(1.0, np.square(of_segment.sum(axis=1)).sum() / np.square(of_segment).sum())
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


STRIDE = 60


@pytest.fixture
def stride():
    """(STRIDE, 30) slow periodic errors."""
    rng = np.random.default_rng(0)
    errors = np.cumsum(rng.normal(size=(STRIDE, 30)), axis=0)
    errors -= np.linspace(0, 1, STRIDE)[:, None] * (errors[-1] - errors[0])
    return errors - errors.mean(axis=0)


def steps(stride: np.ndarray, count: float, start: int = 0) -> np.ndarray:
    return stride[np.arange(start, start + round(count * len(stride))) % len(stride)]


@pytest.mark.parametrize("count", [2, 3, 4, 8])
def test_noise_that_comes_back_with_every_stride_says_nothing_new(stride, count):
    """A stride, not two, is found to come back, whichever of the peaks is the largest."""
    rng = np.random.default_rng(1)
    repetition = Repetition.of(steps(stride, count) + 0.05 * stride.std() * rng.normal(size=(count * STRIDE, 30)))
    assert repetition.period == pytest.approx(STRIDE, abs=1)
    assert repetition.strides == pytest.approx(count, rel=0.1)


def test_noise_of_the_cameras_hides_no_repeats(stride):
    rng = np.random.default_rng(1)
    noisy = [steps(stride, 3) + 0.5 * stride.std() * rng.normal(size=(3 * STRIDE, 30)) for _ in range(2)]
    counts = repeats(noisy, [100.0, 100.0])
    assert counts == pytest.approx(np.full((2, 2), 3.0), rel=0.12)
    assert Repetition.of(noisy[0]).slow == pytest.approx(0.8, abs=0.08)


def test_white_noise_is_alike_over_one_frame_and_never_comes_back():
    repetition = Repetition.of(np.random.default_rng(0).normal(size=(480, 30)))
    assert (repetition.frames, repetition.strides) == pytest.approx((1.0, 1.0), abs=0.1)
    assert repetition.period is None


def test_nothing_to_see():
    assert Repetition.of(np.zeros((20, 3))) == Repetition(1.0, None, 1.0, 0.0)
    assert repeats([np.zeros((20, 3)), np.ones((20, 3))], [100.0, 100.0]) == pytest.approx(np.eye(2))


def test_length_of_slow_noise():
    """Of an autoregressive process: (1 + a) / (1 - a) frames."""
    rng, a = np.random.default_rng(0), 0.9
    errors = np.zeros((2000, 60))
    for t in range(1, 2000):
        errors[t] = a * errors[t - 1] + rng.normal(size=60)
    assert Repetition.of(errors).frames == pytest.approx(19.0, rel=0.15)


def test_other_trials_with_the_same_errors_count_by_their_strides(stride):
    trials = [steps(stride, 2), steps(stride, 4, 17), 3.0 * steps(stride, 1, 40)]
    counts = repeats(trials, [100.0] * 3)
    assert counts.sum(axis=1) == pytest.approx(np.full(3, 7.0), rel=0.15)
    assert counts[0, 1] == pytest.approx(4.0, rel=0.15)
    assert counts[1, 0] == pytest.approx(2.0, rel=0.15)


def test_trials_with_errors_of_their_own_do_not_count():
    rng = np.random.default_rng(2)
    slow = [np.cumsum(rng.normal(size=(200, 120)), axis=0) for _ in range(2)]
    slow = [errors_m - errors_m.mean(axis=0) for errors_m in slow]
    assert repeats(slow, [100.0, 100.0]) == pytest.approx(np.eye(2), abs=1e-12)


@pytest.mark.parametrize("pace", [1.02, 1.06, 1.2])
@pytest.mark.parametrize("count", [2, 4, 8])
def test_pace_may_differ(stride, pace, count):
    """A phase of the stride errs as in the other walk, whenever it comes."""
    walks = []
    for speed in (1.0, pace):
        phase = speed * np.arange(round(count * STRIDE / speed))
        walks.append(
            np.stack([np.interp(phase, np.arange(STRIDE + 1), [*c, c[0]], period=STRIDE) for c in stride.T], 1)
        )
    counts = repeats(walks, [100.0, 100.0])
    assert counts == pytest.approx(np.full((2, 2), float(count)), rel=0.15)


def test_white_noise_and_flicker_never_come_back():
    noise = np.random.default_rng(0).normal(size=(120, 90))
    assert repeats([noise, noise], [100.0, 100.0]) == pytest.approx(np.eye(2))
    flicker = np.where(np.arange(120) % 2, 1.0, -1.0)[:, None] * noise[0]
    assert Repetition.of(flicker).strides == 1.0


def test_the_same_trial_twice_counts_twice(stride):
    """Never more, however little of the errors is slow."""
    rng = np.random.default_rng(1)
    noisy = steps(stride, 1) + 2.0 * stride.std() * rng.normal(size=(STRIDE, 30))
    assert repeats([noisy, noisy], [100.0, 100.0]) == pytest.approx(np.ones((2, 2)))


def test_rates_may_differ(stride):
    fast = np.repeat(steps(stride, 2), 2, axis=0)
    assert repeats([steps(stride, 2), fast], [100.0, 200.0])[0, 1] == pytest.approx(2.0, rel=0.1)


def test_frames_in_common_do_not_make_two_parts_of_a_trial_alike():
    """Windows cut from one recording overlap by what surrounds them."""
    rng = np.random.default_rng(3)
    whole = np.cumsum(rng.normal(size=(150, 120)), axis=0)
    parts = [part - part.mean(axis=0) for part in (whole[:90], whole[60:])]
    assert repeats(parts, [60.0, 60.0]) == pytest.approx(np.eye(2), abs=1e-12)
