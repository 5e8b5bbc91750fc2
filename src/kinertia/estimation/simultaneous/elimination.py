"""The motion of a trial eliminated from its normal equations, stretch by stretch.

Stretches are assembled and eliminated in turn; each passes its contribution to the first block of the next one on.
Steps and the covariance of the motion need the factors again: those of the last stretch stay in memory, those of the
others go to a temporary file.

The border, which is most of the work, is in single precision. Gradients and the motion's own factor are in double, so
that the optimum does not move; the information on what does not move loses nothing either, as long as eliminating the
motion leaves a fair share of it: `UNSAFE`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.block_tridiagonal import BlockBand
from kinertia.estimation.simultaneous.kept_arrays import KeptArrays
from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK, Gradient, NormalEquations
from kinertia.estimation.simultaneous.stretches import Stretch
from kinertia.model.compiled import compiled

UNSAFE = 1e4
"""Information on a static unknown with the motion known, over that with it unknown, from which on the border is in
double precision. In measured trials it is at most 500."""
_ROWS_AT_ONCE = 2000
"""Sums in single precision are no longer."""


@dataclass(frozen=True)
class Carried:
    """What the stretches before a block say of it, their own splines eliminated.

    Attributes:
        diagonal: (k, k) to be added to the block.
        border: (k, S) to its border.
    """

    diagonal: np.ndarray
    border: np.ndarray


@dataclass(frozen=True)
class Factored:
    """A stretch with its motion eliminated.

    Attributes:
        stretch: of the trial.
        band: factor L of the motion's own normal matrix, those before it eliminated.
        border: (b, k, S) L^-1 times the border, in single or double precision.
        left: to the block after the stretch; None after the last.
    """

    stretch: Stretch
    band: BlockBand
    border: np.ndarray
    left: Carried | None

    @property
    def lost(self) -> np.ndarray:
        """(S, S) what it takes of the information on the static unknowns."""
        blocks, wide, s = self.border.shape
        flat = self.border.reshape(blocks * wide, s)
        result = np.zeros((s, s))
        for start in range(0, len(flat), _ROWS_AT_ONCE):
            rows = flat[start : start + _ROWS_AT_ONCE]
            result += rows.T @ rows
        return result


@dataclass(frozen=True)
class Eliminated:
    """A trial with its motion eliminated.

    Attributes:
        gradient: of the whole trial, before.
        static_diagonal: (S,) diagonal of the information on the static unknowns with the motion known.
        information: (S, S) on them with the motion unknown (Schur complement).
        stretches: in time.
        before: what is kept of all stretches but the last.
        last: the last one.
    """

    gradient: Gradient
    static_diagonal: np.ndarray
    information: np.ndarray
    stretches: tuple[Stretch, ...]
    before: KeptArrays
    last: Factored

    @classmethod
    def of(cls, stretches: Sequence[Stretch], of: Callable[[Stretch], NormalEquations], damping: float) -> Eliminated:
        """Eliminate the motion.

        Args:
            stretches: of the trial.
            of: makes the normal equations of one.
            damping: share by which the motion's diagonal is raised.
        """
        result = cls._of(stretches, of, damping, np.float32)
        if (result.static_diagonal > UNSAFE * np.diag(result.information)).any():
            return cls._of(stretches, of, damping, np.float64)
        return result

    @classmethod
    def _of(
        cls,
        stretches: Sequence[Stretch],
        of: Callable[[Stretch], NormalEquations],
        damping: float,
        precision: type[np.floating],
    ) -> Eliminated:
        normal = of(stretches[0])
        whole = Gradient.zero(stretches[-1].splines.stop, normal.right.shape[1], len(normal.static_right))
        static, lost, kept, carried = np.zeros_like(normal.static), np.zeros_like(normal.static), KeptArrays(), None
        for k, stretch in enumerate(stretches):
            normal = of(stretch) if k else normal
            whole.add(normal, stretch.touched)
            static += normal.static
            part = factored(normal, stretch, damping, carried, precision)
            lost += part.lost
            carried = part.left
            if not stretch.is_last:
                kept.add(part.band.diagonal, part.band.below, part.border)
        return cls(whole, np.diag(static), static - lost, tuple(stretches), kept, part)

    def forwards(self) -> Iterator[Factored]:
        """The stretches from the first to the last; what they left to one another is gone."""
        for k, stretch in enumerate(self.stretches[:-1]):
            yield self._kept(k, stretch)
        yield self.last

    def backwards(self) -> Iterator[Factored]:
        """The stretches from the last to the first."""
        yield self.last
        for k in range(len(self.stretches) - 2, -1, -1):
            yield self._kept(k, self.stretches[k])

    def _kept(self, k: int, stretch: Stretch) -> Factored:
        diagonal, below, border = self.before.get(k)
        return Factored(stretch, BlockBand(diagonal, below), border, None)

    def forward(self, right: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        """L^-1 times a right-hand side (size, c) of the motion, per stretch (b, k, 1), and what it takes of the
        right-hand side of the static unknowns (S,).
        """
        solved, lost = [], np.zeros(len(self.information))
        carried: np.ndarray | float = 0.0
        for part in self.forwards():
            blocks, wide = part.band.diagonal.shape[:2]
            flat = np.zeros((blocks * wide, 1))
            own = right[part.stretch.splines].ravel()
            flat[: len(own), 0] = own
            flat[:wide] += carried
            motion = part.band.forward(flat.reshape(blocks, wide, 1))
            if not part.stretch.is_last:
                carried = -part.band.below[-1] @ motion[-1]
            rows = part.border.reshape(blocks * wide, len(lost))
            lost += motion.ravel().astype(rows.dtype) @ rows
            solved.append(motion)
        return solved, lost

    def motion_step(self, solved: Sequence[np.ndarray], static: np.ndarray) -> np.ndarray:
        """(size, c) step of the motion for a step (S,) of the static unknowns; `solved` is what `forward` gives."""
        result, after = np.empty_like(self.gradient.right), None
        for part, motion in zip(self.backwards(), reversed(solved), strict=True):
            rows = part.border @ static.astype(part.border.dtype)
            step = part.band.backward(motion - rows[..., None], after)
            own = result[part.stretch.splines]
            own[:] = step.reshape(-1, own.shape[1])[: len(own)]
            after = step[0]
        return result


def factored(
    normal: NormalEquations,
    stretch: Stretch,
    damping: float,
    carried: Carried | None,
    precision: type[np.floating],
) -> Factored:
    """Eliminate the splines of a stretch, with their diagonal raised by this share.

    Args:
        normal: its normal equations.
        carried: what the stretches before it leave to its first block.
        precision: of the border.
    """
    size, c, s = normal.border.shape
    # one block more than just fits, so that six active splines always lie in two
    count = size // SPLINES_PER_BLOCK + (1 if stretch.is_last else 0)
    diagonal, below = _blocks(normal.band, count, damping)
    border = np.empty((count * SPLINES_PER_BLOCK, c, s), precision)
    border[:size], border[size:] = normal.border, 0.0
    border = border.reshape(count, SPLINES_PER_BLOCK * c, s)
    if carried is not None:
        diagonal[0] += carried.diagonal
        border[0] += carried.border
    own = count if stretch.is_last else count - 1
    band = BlockBand.factor(diagonal[:own], below, in_place=True)
    same = band.as_precise(precision)
    solved, left = border[:own], None
    if s:
        same.forward(solved, in_place=True)
    if own < count:
        reach = band.below[-1]
        left = Carried(diagonal[own] - reach @ reach.T, border[own] - same.below[-1] @ solved[-1])
    return Factored(stretch, band, solved, left)


@compiled
def _blocks(band: np.ndarray, count: int, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """Diagonal blocks (b, k, k), k = c SPLINES_PER_BLOCK, and those below (b - 1, k, k); ones where the band ends."""
    size, wide, c, _ = band.shape
    each = SPLINES_PER_BLOCK
    diagonal, below = np.zeros((count, each * c, each * c)), np.zeros((count - 1, each * c, each * c))
    for spline in range(size):
        block, i = spline // each, spline % each
        for offset in range(min(wide, size - spline)):
            j = i + offset
            for row in range(c):
                for column in range(c):
                    value = band[spline, offset, row, column]
                    if j >= each:
                        below[block, (j - each) * c + column, i * c + row] = value
                    else:
                        diagonal[block, i * c + row, j * c + column] = value
                        diagonal[block, j * c + column, i * c + row] = value
        for row in range(c):
            diagonal[block, i * c + row, i * c + row] *= 1.0 + damping
    for spline in range(size, count * each):
        for row in range(c):
            place = spline % each * c + row
            diagonal[spline // each, place, place] = 1.0
    return diagonal, below
