"""Which strides a mean is of."""

import numpy as np

from kinertia.estimation.common_strides import common_strides, mean_of_common

PERCENT = np.arange(101)


def curves(*spans, rise=1.0):
    """Ramps whose level is the number of the stride, known from one percent to another."""
    return np.array(
        [
            np.where((low <= PERCENT) & (high >= PERCENT), rise * PERCENT + 50.0 * k, np.nan)
            for k, (low, high) in enumerate(spans)
        ]
    )


def steps(mean):
    return np.abs(np.diff(mean[np.isfinite(mean)], n=2)).max()


def test_complete_strides_alone_are_averaged():
    values = curves((0, 100), (0, 60), (0, 100), (40, 100))
    assert common_strides(values).tolist() == [True, False, True, False]
    np.testing.assert_allclose(mean_of_common(values), PERCENT + 50.0)


def test_a_mean_has_no_step_where_a_stride_ends():
    """The mean of whatever is measured jumps by tens of units here; that of the same strides is a line."""
    values = curves((0, 95), (2, 97), (4, 99), (60, 100))
    known = np.isfinite(values)
    everything = np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0)
    assert steps(everything) > 10.0
    mean = mean_of_common(values)
    assert steps(mean) < 1e-9
    assert common_strides(values).tolist() == [True, True, True, False]
    assert np.flatnonzero(np.isfinite(mean)).tolist() == list(range(4, 96))


def test_strides_of_different_parts_are_not_joined():
    assert common_strides(curves((0, 40), (30, 100))).tolist() == [False, True]
    assert not common_strides(np.full((2, 101), np.nan)).any()
    assert np.isnan(mean_of_common(np.full((2, 101), np.nan))).all()
