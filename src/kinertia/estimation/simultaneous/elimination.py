"""The motion of a trial eliminated from its normal equations, stretch by stretch.

Forwards, each stretch is made, summed and eliminated, and all that stays of it is what it says of the static unknowns
and of the block after it. Backwards, where a step of the motion or its covariance is asked for, the last stretch is
still there; those before it are made anew, each from what the stretch before has left to it. A trial of one stretch
keeps everything and computes nothing twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from kinertia.estimation.simultaneous.block_tridiagonal import BlockBand
from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK, NormalEquations
from kinertia.estimation.simultaneous.stretches import Stretch

_Lost: TypeAlias = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Carried:
    """What the stretches before a block say of it, their own splines eliminated.

    Attributes:
        diagonal: (k, k) to be added to the block.
        right: (k, S + 1) to its border and right-hand side.
    """

    diagonal: np.ndarray
    right: np.ndarray


@dataclass(frozen=True)
class Factored:
    """A stretch with its motion eliminated.

    Attributes:
        stretch: of the trial.
        band: factor L of the motion's own normal matrix, those before it eliminated.
        border: (b, k, S) L^-1 times the border.
        motion: (b, k, 1) L^-1 times the motion's right-hand side.
        left: to the block after the stretch; None after the last.
    """

    stretch: Stretch
    band: BlockBand
    border: np.ndarray
    motion: np.ndarray
    left: Carried | None

    @property
    def lost(self) -> _Lost:
        """What it takes of the information on the static unknowns (S, S), and of its right-hand side (S,)."""
        flat = self.border.reshape(-1, self.border.shape[2])
        return flat.T @ flat, flat.T @ self.motion.ravel()


@dataclass(frozen=True)
class TrialNormal:
    """Normal equations of a whole trial.

    Attributes:
        static, static_right, right, cost: as `NormalEquations` has them, of all stretches together.
        stretches: in time.
        of: makes the normal equations of a stretch.
        last: those of the last one.
        damping: share by which the motion's diagonal is raised in what follows.
        carried: per stretch what those before it leave to its first block; None for the first.
        lost: as `Factored` has it, of all stretches before the last.
    """

    static: np.ndarray
    static_right: np.ndarray
    right: np.ndarray
    cost: float
    stretches: tuple[Stretch, ...]
    of: Callable[[Stretch], NormalEquations]
    last: NormalEquations
    damping: float
    carried: tuple[Carried | None, ...]
    lost: _Lost


@dataclass(frozen=True)
class Reduced:
    """Normal equations of a trial with the motion eliminated.

    Attributes:
        information: (S, S) on the static unknowns (Schur complement).
        right: (S,) its right-hand side.
        normal: at the damping that was asked for.
        last: its last stretch.
    """

    information: np.ndarray
    right: np.ndarray
    normal: TrialNormal
    last: Factored

    def backwards(self) -> Iterator[Factored]:
        """The stretches from the last to the first."""
        yield self.last
        normal = self.normal
        for stretch, carried in zip(normal.stretches[-2::-1], normal.carried[-2::-1], strict=True):
            yield factored(normal.of(stretch), stretch, normal.damping, carried)

    def motion_step(self, step: np.ndarray) -> np.ndarray:
        """(size, c) step of the coefficients that goes with a step (S,) of the static unknowns."""
        result, after = np.empty_like(self.normal.right), None
        for part in self.backwards():
            stretch_step = part.band.backward(part.motion - part.border @ step[:, None], after)
            own = result[part.stretch.splines]
            own[:] = stretch_step.reshape(-1, own.shape[1])[: len(own)]
            after = stretch_step[0]
        return result


def summed(stretches: Sequence[Stretch], of: Callable[[Stretch], NormalEquations], damping: float) -> TrialNormal:
    """Normal equations of a trial, all stretches but the last eliminated.

    Args:
        stretches: of the trial.
        of: makes the normal equations of one.
        damping: share by which the motion's diagonal is to be raised; trials of one stretch do not need to know.
    """
    normal = of(stretches[0])
    c, s = normal.border.shape[1:]
    static, static_right, right, cost = np.zeros((s, s)), np.zeros(s), np.zeros((stretches[-1].splines.stop, c)), 0.0
    lost: _Lost = (np.zeros((s, s)), np.zeros(s))
    carried: tuple[Carried | None, ...] = (None,)
    for k, stretch in enumerate(stretches):
        normal = of(stretch) if k else normal
        static += normal.static
        static_right += normal.static_right
        right[stretch.touched] += normal.right
        cost += normal.cost
        if not stretch.is_last:
            part = factored(normal, stretch, damping, carried[-1])
            lost, carried = _both(lost, part.lost), (*carried, part.left)
    return TrialNormal(static, static_right, right, cost, tuple(stretches), of, normal, damping, carried, lost)


def reduced(normal: TrialNormal, damping: float) -> Reduced:
    """Eliminate the motion, with its diagonal raised by this share; what is known for another one is made anew."""
    if damping != normal.damping and len(normal.stretches) > 1:
        normal = summed(normal.stretches, normal.of, damping)
    last = factored(normal.last, normal.stretches[-1], damping, normal.carried[-1])
    information, right = _both(normal.lost, last.lost)
    return Reduced(normal.static - information, normal.static_right - right, normal, last)


def _both(lost: _Lost, more: _Lost) -> _Lost:
    return lost[0] + more[0], lost[1] + more[1]


def factored(normal: NormalEquations, stretch: Stretch, damping: float, carried: Carried | None) -> Factored:
    """Eliminate the splines of a stretch, with their diagonal raised by this share.

    Args:
        normal: its normal equations.
        carried: what the stretches before it leave to its first block.
    """
    size, c, s = normal.border.shape
    # one block more than just fits, so that six active splines always lie in two
    count = size // SPLINES_PER_BLOCK + (1 if stretch.is_last else 0)
    diagonal, below = _blocks(normal.band, count, damping)
    right = np.zeros((count * SPLINES_PER_BLOCK, c, s + 1))
    right[:size, :, :s], right[:size, :, s] = normal.border, normal.right
    right = right.reshape(count, -1, s + 1)
    if carried is not None:
        diagonal[0] += carried.diagonal
        right[0] += carried.right
    own = count if stretch.is_last else count - 1
    band = BlockBand.factor(diagonal[:own], below)
    solved = band.forward(right[:own])
    left = None
    if own < count:
        reach = band.below[-1]
        left = Carried(diagonal[own] - reach @ reach.T, right[own] - reach @ solved[-1])
    return Factored(stretch, band, solved[..., :s], solved[..., s:], left)


def _blocks(band: np.ndarray, count: int, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """Diagonal blocks (b, k, k), k = c SPLINES_PER_BLOCK, and those below (b - 1, k, k); ones where the band ends."""
    size, wide, c, _ = band.shape
    each = SPLINES_PER_BLOCK
    padded = np.zeros((each * count + each, wide, c, c))
    padded[:size] = band
    diagonal, below = np.zeros((count, each, c, each, c)), np.zeros((count, each, c, each, c))
    for i in range(each):
        rows = padded[i : each * count : each]
        for offset in range(wide):
            j = i + offset
            if j < each:
                diagonal[:, i, :, j, :] += rows[:, offset]
                if offset:
                    diagonal[:, j, :, i, :] += rows[:, offset].transpose(0, 2, 1)
            else:
                below[:, j - each, :, i, :] = rows[:, offset].transpose(0, 2, 1)
    k = each * c
    inside = np.arange(count * k) < size * c
    entries = np.einsum("bii->bi", diagonal.reshape(count, k, k))
    entries *= 1.0 + damping
    entries += np.where(inside, 0.0, 1.0).reshape(count, -1)
    return diagonal.reshape(count, k, k), below.reshape(count, k, k)[:-1]
