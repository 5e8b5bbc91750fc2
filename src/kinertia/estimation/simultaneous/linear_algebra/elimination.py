"""Eliminates the motion of a trial from its normal equations, from both ends to the middle.

Time blocks are assembled and eliminated in turn; each passes on its contribution to the block of splines at which it
ends. Those before the middle start with the first block, those after it with the last, in a thread of their own: they
meet in one block. Steps and the covariance of the motion need the factors again: those of the time blocks beside the
middle stay in memory, the others go to temporary files.

The border, which is most of the work, is in single precision. Gradients and the motion's own factor are in double
precision, so that the optimum does not change; the information on unknowns that do not move loses nothing either, as
long as a fair share of it remains after eliminating the motion: `UNSAFE`.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.block_tridiagonal import BlockBand, solve_lower
from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import KeptArrays, TimeBlock, halves
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import (
    SPLINES_PER_BLOCK,
    Gradient,
    NormalEquations,
)
from kinertia.model.compiled import Float4, compiled
from kinertia.motion.workload import side_by_side

UNSAFE = 1e4
"""Ratio of the information on a static unknown with the motion known to that with it unknown, above which the border is
in double precision. In measured trials it is at most 500."""
_ROWS_AT_ONCE = 2000
"""Longest sum in single precision."""


@dataclass(frozen=True)
class EndBlock:
    """Contribution of time blocks to the block of splines at which they end, with all others eliminated.

    Attributes:
        diagonal: (k, k).
        border: (k, S).
    """

    diagonal: np.ndarray
    border: np.ndarray


@dataclass(frozen=True)
class Factored:
    """Eliminated neighbouring blocks of splines.

    Attributes:
        splines: indices in the trial, in time; fewer than the blocks hold where the trial ends in one.
        backwards: whether they were eliminated from the last to the first.
        band: factor L of their own normal matrix, after eliminating those before them; blocks in the order of
            elimination.
        border: (b, k, S) L^-1 times the border, in single or double precision.
    """

    splines: slice
    backwards: bool
    band: BlockBand
    border: np.ndarray

    def take_off(self, information: np.ndarray) -> None:
        """Subtract the information (S, S) on the static unknowns that eliminating these splines costs."""
        blocks, wide, s = self.border.shape
        flat = self.border.reshape(blocks * wide, s)
        for start in range(0, len(flat), _ROWS_AT_ONCE):
            rows = flat[start : start + _ROWS_AT_ONCE]
            information -= rows.T @ rows

    def in_blocks(self, motion: np.ndarray) -> np.ndarray:
        """Extract the blocks (b, k, 1) of these splines from values (size, c) of all splines of the trial."""
        blocks, wide = self.band.diagonal.shape[:2]
        flat, values = np.zeros(blocks * wide), motion[self.splines].ravel()
        flat[: len(values)] = values
        return np.ascontiguousarray(self.in_order(flat.reshape(blocks, wide, 1)))

    def in_order(self, blocks: np.ndarray) -> np.ndarray:
        """Reorder blocks (b, ...) from time to the order of elimination, or back."""
        return blocks[::-1] if self.backwards else blocks


@dataclass(frozen=True)
class Branch:
    """One half of a trial, eliminated towards its middle.

    Attributes:
        gradient: of its frames, before elimination.
        static_diagonal: (S,) diagonal of the information on the static unknowns with the motion known.
        information: (S, S) on them with the motion unknown except in the middle.
        time_blocks: in the order of elimination.
        before: stored factors of all time blocks but the last.
        last: factor of the block beside the middle.
        end: contribution to the middle.
    """

    gradient: Gradient
    static_diagonal: np.ndarray
    information: np.ndarray
    time_blocks: tuple[TimeBlock, ...]
    before: KeptArrays
    last: Factored
    end: EndBlock

    @classmethod
    def of(
        cls,
        equations_of: Callable[[TimeBlock], NormalEquations],
        done: Callable[[NormalEquations], None],
        damping: float,
        precision: type[np.floating],
        time_blocks: Sequence[TimeBlock],
    ) -> Self:
        """Eliminate time blocks in this order, backwards if the first is not the beginning of the trial."""
        backwards, end, kept = time_blocks[0].splines.start > 0, None, KeptArrays()
        for k, time_block in enumerate(time_blocks):
            normal = equations_of(time_block)
            s = normal.border.shape[2]
            if k == 0:
                size = max(block.touched.stop for block in time_blocks)
                whole = Gradient.zero(size, normal.rhs.shape[1], len(normal.static_rhs))
                diagonal, information = np.zeros(s), np.zeros((s, s))
            whole.add(normal, time_block.touched)
            information += normal.static[:s, :s]
            diagonal += np.diag(normal.static)[:s]
            part, end = factored(normal, time_block, damping, end, precision, backwards)
            done(normal)
            part.take_off(information)
            if k < len(time_blocks) - 1:
                kept.add(part.band.diagonal, part.band.below, part.border)
        assert end is not None
        return cls(whole, diagonal, information, tuple(time_blocks), kept, part, end)

    def outwards(self) -> Iterator[Factored]:
        """Yield the factors from the middle to the end of the trial."""
        yield self.last
        for k in range(len(self.time_blocks) - 2, -1, -1):
            yield self._kept(k)

    def inwards(self) -> Iterator[Factored]:
        """Yield the factors from the end of the trial to the middle."""
        for k in range(len(self.time_blocks) - 1):
            yield self._kept(k)
        yield self.last

    def _kept(self, k: int) -> Factored:
        diagonal, below, border = self.before.get(k)
        backwards = self.last.backwards
        return Factored(_eliminated(self.time_blocks[k], backwards), backwards, BlockBand(diagonal, below), border)

    def forward(self, rhs: np.ndarray) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """Apply L^-1 to a right-hand side (size, c) of the motion; return it per time block (b, k, 1).

        The other two results are what is to be subtracted from the right-hand sides of the static unknowns (S,) and of
        the middle block (k, 1).
        """
        solved, lost, carried = [], np.zeros(len(self.information)), np.zeros((len(self.end.diagonal), 1))
        for part in self.inwards():
            flat = part.in_blocks(rhs)
            flat[:1] -= carried
            motion = part.band.forward(flat, in_place=True)
            carried = part.band.below[-1] @ motion[-1]
            lost += taken(part, motion)
            solved.append(motion)
        return solved, lost, carried

    def step(self, solved: Sequence[np.ndarray], static: np.ndarray, middle: np.ndarray, into: np.ndarray) -> None:
        """Write the step of the branch's splines into that of the motion (size, c).

        `static` (S,) is the step of the static unknowns, `middle` (k, 1) the step of the middle block.
        """
        after = middle
        for part, motion in zip(self.outwards(), reversed(solved), strict=True):
            after = write_step(part, motion, static, into, after)[0]


@dataclass(frozen=True)
class Eliminated:
    """A trial whose motion has been eliminated.

    Attributes:
        gradient: of the whole trial, before elimination.
        static_diagonal: (S,) diagonal of the information on the static unknowns with the motion known.
        information: (S, S) on them with the motion unknown (Schur complement).
        branches: the trial's halves; a single one for a very short trial.
        middle: the block between them.
    """

    gradient: Gradient
    static_diagonal: np.ndarray
    information: np.ndarray
    branches: tuple[Branch, ...]
    middle: Factored

    @classmethod
    def of(
        cls,
        time_blocks: Sequence[TimeBlock],
        equations_of: Callable[[TimeBlock], NormalEquations],
        done: Callable[[NormalEquations], None],
        damping: float,
        precise: bool = False,
    ) -> Self:
        """Eliminate the motion of a trial.

        Args:
            time_blocks: time blocks of the trial.
            equations_of: makes the normal equations of one block.
            done: called with them when they are no longer needed.
            damping: share by which the motion's diagonal is raised.
            precise: with the border in double precision.
        """
        if precise:
            return cls._of(time_blocks, partial(Branch.of, equations_of, done, damping, np.float64))
        result = cls._of(time_blocks, partial(Branch.of, equations_of, done, damping, np.float32))
        if (result.static_diagonal > UNSAFE * np.diag(result.information)).any():
            return cls.of(time_blocks, equations_of, done, damping, precise=True)
        return result

    @classmethod
    def _of(cls, time_blocks: Sequence[TimeBlock], branch_of: Callable[[Sequence[TimeBlock]], Branch]) -> Self:
        branches = tuple(side_by_side(branch_of, [half for half in halves(time_blocks) if half]))
        size, (_, c) = time_blocks[-1].splines.stop, branches[0].gradient.rhs.shape
        whole = Gradient.zero(size, c, len(branches[0].gradient.static_rhs))
        for branch in branches:
            whole.add(branch.gradient, slice(0, len(branch.gradient.rhs)))
        diagonal, border = (
            sum(getattr(half_branch.end, name) for half_branch in branches) for name in ("diagonal", "border")
        )
        start = branches[0].last.splines.stop
        splines = slice(start, min(start + SPLINES_PER_BLOCK, size))
        band = BlockBand.factor(diagonal[None], np.zeros((0, *diagonal.shape)))
        if border.size:
            solve_lower(band.as_precise(border.dtype).diagonal[0], border)
        middle = Factored(splines, False, band, border[None])
        information, known = branches[0].information.copy(), branches[0].static_diagonal.copy()
        for branch in branches[1:]:
            information += branch.information
            known += branch.static_diagonal
        middle.take_off(information)
        return cls(whole, known, information, branches, middle)

    def forward(self, rhs: np.ndarray) -> tuple[list[list[np.ndarray]], np.ndarray]:
        """Apply L^-1 to a right-hand side (size, c) of the motion, per branch and block (b, k, 1), then the middle.

        The second result is what is to be subtracted from the right-hand side of the static unknowns (S,).
        """
        halves = side_by_side(lambda branch: branch.forward(rhs), self.branches)
        flat = self.middle.in_blocks(rhs) - sum(carried for _, _, carried in halves)
        middle = self.middle.band.forward(flat, in_place=True)
        lost = taken(self.middle, middle) + sum(lost for _, lost, _ in halves)
        return [*(solved for solved, _, _ in halves), [middle]], lost

    def following(self, static: np.ndarray) -> np.ndarray:
        """Return the motion's step (size, c) for a step (S,) of the static unknowns, from the optimum for those."""
        still = [[np.zeros((*part.border.shape[:2], 1)) for part in branch.inwards()] for branch in self.branches]
        return self.motion_step([*still, [np.zeros((*self.middle.border.shape[:2], 1))]], static)

    def motion_step(self, solved: Sequence[Sequence[np.ndarray]], static: np.ndarray) -> np.ndarray:
        """Return the motion's step (size, c) for a step (S,) of the static unknowns; `solved` is from `forward`."""
        result = np.empty_like(self.gradient.rhs)
        *halves, (middle,) = solved
        (block,) = write_step(self.middle, middle, static, result)
        side_by_side(
            lambda half: half[0].step(half[1], static, block, result), list(zip(self.branches, halves, strict=True))
        )
        return result


def taken(part: Factored, motion: np.ndarray) -> np.ndarray:
    """Return what L^-1 times the motion's right-hand side subtracts from that of the static unknowns (S,)."""
    rows = part.border.reshape(motion.size, part.border.shape[2])
    result: np.ndarray = motion.ravel().astype(rows.dtype) @ rows
    return result


def write_step(
    part: Factored, motion: np.ndarray, static: np.ndarray, into: np.ndarray, after: np.ndarray | None = None
) -> np.ndarray:
    """Write the step of some splines into that of the motion (size, c), and return it as blocks (b, k, 1).

    Blocks are in the order of elimination; `after` (k, 1) is the step of the block eliminated next.
    """
    rows = part.border @ static.astype(part.border.dtype)
    step = part.band.backward(motion - rows[..., None], after, in_place=True)
    target = into[part.splines]
    target[:] = part.in_order(step).reshape(-1, target.shape[1])[: len(target)]
    return step


def factored(
    normal: NormalEquations,
    time_block: TimeBlock,
    damping: float,
    carried: EndBlock | None,
    precision: type[np.floating],
    backwards: bool = False,
) -> tuple[Factored, EndBlock]:
    """Eliminate the splines that a time block touches, all but the last block, or all but the first if `backwards`.

    Args:
        normal: its normal equations.
        damping: share by which their diagonal is raised.
        carried: contribution of the time blocks before it to the block with which this one begins.
        precision: of the border.
    """
    size, c, s = normal.border.shape
    # at the end of the trial one block more than just fits, so that six active splines always lie in two
    count = size // SPLINES_PER_BLOCK + (1 if time_block.is_last else 0)
    diagonal, below = _blocks(normal.band, count, damping, backwards)
    border = np.zeros((count * SPLINES_PER_BLOCK, c, s), precision)
    border[:size] = normal.border
    border = border.reshape(count, SPLINES_PER_BLOCK * c, s)
    border = np.ascontiguousarray(border[::-1]) if backwards else border
    if carried is not None:
        diagonal[0] += carried.diagonal
        border[0] += carried.border
    band = BlockBand.factor(diagonal[:-1], below, in_place=True)
    same = band.as_precise(precision)
    solved = same.forward(border[:-1], in_place=True) if s else border[:-1]
    reach = band.below[-1]
    end = EndBlock(diagonal[-1] - reach @ reach.T, border[-1] - same.below[-1] @ solved[-1])
    return Factored(_eliminated(time_block, backwards), backwards, band, solved), end


def _eliminated(time_block: TimeBlock, backwards: bool) -> slice:
    """Return the splines of all blocks that a time block touches but the last, or but the first if `backwards`."""
    start, stop = time_block.touched.start, time_block.touched.stop
    if backwards:
        return slice(start + SPLINES_PER_BLOCK, stop)
    blocks = time_block.size // SPLINES_PER_BLOCK - (0 if time_block.is_last else 1)
    return slice(start, start + SPLINES_PER_BLOCK * blocks)


@compiled
def _blocks(band: Float4, count: int, damping: float, backwards: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return diagonal blocks (b, k, k), k = c SPLINES_PER_BLOCK, and the blocks below them (b - 1, k, k).

    They run from the first to the last or backwards; diagonal elements are one beyond the end of the band.
    """
    size, wide, c, _ = band.shape
    per_block = SPLINES_PER_BLOCK
    diagonal, below = (
        np.zeros((count, per_block * c, per_block * c)),
        np.zeros((count - 1, per_block * c, per_block * c)),
    )
    for spline in range(size):
        i, block = spline % per_block, count - 1 - spline // per_block if backwards else spline // per_block
        for offset in range(min(wide, size - spline)):
            j = i + offset
            for row in range(c):
                for column in range(c):
                    value = band[spline, offset, row, column]
                    if j >= per_block and backwards:
                        below[block - 1, i * c + row, (j - per_block) * c + column] = value
                    elif j >= per_block:
                        below[block, (j - per_block) * c + column, i * c + row] = value
                    else:
                        diagonal[block, i * c + row, j * c + column] = value
                        diagonal[block, j * c + column, i * c + row] = value
        for row in range(c):
            diagonal[block, i * c + row, i * c + row] *= 1.0 + damping
    for spline in range(size, count * per_block):
        for row in range(c):
            place = spline % per_block * c + row
            diagonal[0 if backwards else count - 1, place, place] = 1.0
    return diagonal, below
