"""Covariance of a time block's splines, and their dependence on static unknowns, against dense matrices."""

import numpy as np
import pytest

from block_systems import random_system
from kinertia.estimation.simultaneous.linear_algebra.block_tridiagonal import BlockBand
from kinertia.estimation.simultaneous.linear_algebra.elimination import Factored
from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock
from kinertia.estimation.simultaneous.uncertainty.curve_variances import EndSpread, MotionSpread

BLOCKS, WIDE, STATIC, START = 5, 12, 7, 18
"""Blocks of six splines of two coordinates, static unknowns, and the first of the splines."""
TOUCHED = slice(START, START + 6 * BLOCKS)


def blocks_of(matrix: np.ndarray) -> np.ndarray:
    return matrix.reshape(BLOCKS, WIDE, -1)


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize(
    "needed", [slice(START, START + 29), slice(START + 13, START + 22), slice(START + 12, START + 18)]
)
def test_active_splines_are_those_of_the_dense_inverse(backwards, needed):
    rng = np.random.default_rng(2)
    dense, diagonal, below = random_system(BLOCKS, WIDE)
    across, root = rng.normal(size=(BLOCKS * WIDE, STATIC)), np.tril(rng.normal(size=(STATIC, STATIC)))
    inverse = np.linalg.inv(dense)
    carried, order = inverse @ across @ root, slice(None, None, -1 if backwards else 1)
    if backwards:
        diagonal, below = diagonal[::-1], below[::-1].transpose(0, 2, 1)
    band = BlockBand.factor(diagonal[:-1], below)
    part = Factored(TOUCHED, backwards, band, band.forward(blocks_of(across)[order][:-1]))
    last = slice(0, WIDE) if backwards else slice(-WIDE, None)
    end = EndSpread(inverse[last, last], carried[last])
    found = MotionSpread.of(part, TimeBlock(TOUCHED, TOUCHED, slice(0, 0)), root, end, needed)
    assert found is not None
    for first in range(needed.start, needed.stop - 5):
        covariance, dependence = found[0].active(first)
        here = slice(2 * (first - START), 2 * (first - START) + 12)
        np.testing.assert_allclose(covariance, inverse[here, here], atol=1e-12)
        np.testing.assert_allclose(dependence.reshape(12, -1), carried[here], atol=1e-12)
    outermost = blocks_of(carried)[order][0]
    assert np.allclose(found[1].carried, outermost) == (needed.start == START)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_time_block_beyond_what_is_needed_has_none(backwards):
    diagonal, below, border = np.ones((3, 12, 12)), np.ones((3, 12, 12)), np.ones((3, 12, STATIC))
    part = Factored(TOUCHED, backwards, BlockBand(diagonal, below), border)
    needed = slice(START - 9, START + 3) if backwards else slice(START + 21, START + 40)
    end = EndSpread(np.ones((12, 12)), np.ones((12, STATIC)))
    assert MotionSpread.of(part, TimeBlock(TOUCHED, TOUCHED, slice(0, 0)), np.eye(STATIC), end, needed) is None
