"""Standard deviations of joint angles, moments, powers and ground reactions over time, from motion, body segment
parameters and calibration together.

Delta method: analytic derivatives by spline coefficients and static unknowns, times their posterior covariance. Errors
that come back (`repetition`) make the motion no vaguer, only what many frames say of what does not move: what is left
of the motion if that were known is that of the errors alone. Of the coefficients' covariance only the blocks near the
diagonal are needed, since six splines are active in any frame; they come from the block-banded factor
(`BlockBand.inverse_blocks`) and the static unknowns. They count by what is seen of the errors that they are from
(`motion_noise`), and in moments by more where skin moves unseen (`skin_blocks`). Of the delay of the forces the whole
distribution counts (`late_loads`): where a foot lands they change faster than it is known. Added is what of the forces
is faster than the motion (`GroundReactions.impact`), as a moving mean square: whether it acts on the joints or is spent
on segments that slow down is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from kinertia.estimation.simultaneous.elimination import Branch, Eliminated, Factored
from kinertia.estimation.simultaneous.moment_derivatives import MomentDerivatives, moment_derivatives
from kinertia.estimation.simultaneous.motion_noise import motion_noise
from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK, by_splines
from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.estimation.simultaneous.skin_blocks import block_growth
from kinertia.estimation.simultaneous.stretches import Stretch
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.moving_windows import even_mean
from kinertia.motion.two_threads import side_by_side

_FRAMES_AT_ONCE = 100
"""Larger arrays would leave the processor's cache."""
_LOST_KNOTS = 2.0
"""Half of the stretch over which it is averaged, in knot intervals: one period of the cutoff."""


@dataclass(frozen=True, eq=False)
class CurveDeviations:
    """Posterior standard deviations of a trial's curves at its d dynamic frames.

    Attributes:
        coordinates: (d, c) rad, m.
        moments: (d, c) of the joint moments, N m, and of the forces of translations, N.
        powers: (d, c) of joint moment times speed, W.
        ground_forces: (d, 2, 3) of the ground reactions on right and left foot, N: of instruments put right, and of the
            plates' own noise.
    """

    coordinates: np.ndarray
    moments: np.ndarray
    powers: np.ndarray
    ground_forces: np.ndarray

    def and_of(self, other: CurveDeviations) -> CurveDeviations:
        """With what is independent of it."""
        return CurveDeviations(*(np.hypot(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)))

    @classmethod
    def filled(cls, d: int, c: int, value: float) -> CurveDeviations:
        """Of so many frames and coordinates, with this value."""
        return cls(*(np.full(shape, value) for shape in ((d, c), (d, c), (d, c), (d, 2, 3))))


def curve_deviations(
    problem: MapProblem,
    k: int,
    coefficients: np.ndarray,
    static: np.ndarray,
    eliminated: Eliminated,
    root: np.ndarray,
) -> CurveDeviations:
    """Posterior deviations of the curves of trial k.

    Args:
        problem: of the estimate.
        k: the trial.
        coefficients, static: the estimate.
        eliminated: the trial's normal equations there, undamped.
        root: (S, S) root of the posterior covariance of the static unknowns, as `StaticInformation` has it: rows of
            those that root equations depend on, which come first, have as many columns that are not zero.
    """
    basis, frames = problem.bases[k], np.flatnonzero(problem.trials[k].dynamic)
    size = (len(frames), coefficients.shape[1])
    late_sd_s = float(np.linalg.norm(root[problem.loads.late(k)].sum(axis=0)))
    curves = _Curves(
        problem,
        k,
        coefficients,
        static,
        problem.loads.reactions(k, static),
        # errors that come back count more often only for what does not move
        np.sqrt(motion_noise(problem, k, coefficients, static) / problem.trials[k].repeats),
        frames,
        late_sd_s,
        block_growth(problem, k, static, problem.trials[k].time[frames]),
        CurveDeviations.filled(*size, 0.0),
        np.empty(size),
        np.empty(size),
    )
    middle = _EndSpread.of_middle(eliminated.middle, root)
    side_by_side(lambda branch: curves.add(branch, root, middle), eliminated.branches)
    variance, impact, speed = curves.variance, curves.impact, curves.speed
    around = 1 + 2 * round(_LOST_KNOTS * len(basis.first) / (basis.size - 5))
    lost = even_mean(np.square(impact), around)
    parts = (
        variance.coordinates,
        variance.moments + lost,
        variance.powers + lost * np.square(speed),
        variance.ground_forces,
    )
    return CurveDeviations(*(np.sqrt(np.maximum(part, 0.0)) for part in parts))


@dataclass(frozen=True)
class _Curves:
    """The curves of a trial, whose variances are written branch by branch.

    Attributes:
        problem, k, coefficients, static: as `curve_deviations` has them.
        reactions: loads for the joint moments.
        shares: as `_Seen` has them.
        frames: (d,) those that are dynamic.
        late_sd_s: deviation of the delay of the forces.
        grown: (d, c) times the deviations of the moments by these (`skin_blocks.block_growth`).
        variance: of the curves.
        impact: (d, c) as `MomentDerivatives` has it.
        speed: (d, c) of the coordinates.
    """

    problem: MapProblem
    k: int
    coefficients: np.ndarray
    static: np.ndarray
    reactions: GroundReactions
    shares: np.ndarray
    frames: np.ndarray
    late_sd_s: float
    grown: np.ndarray
    variance: CurveDeviations
    impact: np.ndarray
    speed: np.ndarray

    def add(self, branch: Branch, root: np.ndarray, end: _EndSpread) -> None:
        """Write what the frames of a branch have, whose splines end in a block that is this uncertain."""
        for part, stretch in zip(branch.outwards(), reversed(branch.stretches), strict=True):
            spread, end = _MotionSpread.of(part, stretch, root, end)
            begin, stop = np.searchsorted(self.frames, [stretch.frames.start, stretch.frames.stop])
            for start in range(begin, stop, _FRAMES_AT_ONCE):
                self._write(spread, root, slice(start, min(start + _FRAMES_AT_ONCE, stop)))

    def _write(self, spread: _MotionSpread, root: np.ndarray, rows: slice) -> None:
        problem, basis, chosen = self.problem, self.problem.bases[self.k], self.frames[rows]
        in_root = problem.layout.in_root
        motion = problem.model.full(basis.evaluate(self.coefficients, chosen), self.static)
        by = moment_derivatives(problem, self.k, motion, self.static, self.reactions, chosen, self.late_sd_s)
        self.impact[rows], self.speed[rows] = by.impact, motion[1][:, problem.moving]
        values = basis.values[:, chosen]
        seen = _Seen.of(by, self.speed[rows], basis.first[chosen], values, self.shares, self.grown[rows])
        spread.variances(seen, root[in_root, in_root], self.variance, rows)
        loaded = self.reactions.at(problem.trials[self.k].time[chosen])[..., :3] != 0.0
        self.variance.ground_forces[rows] += np.square(self.reactions.noise_n * loaded)
        self.variance.ground_forces[rows] += by.ground_left.reshape(-1, 2, 3)
        self.variance.moments[rows] += by.left
        self.variance.powers[rows] += by.left * np.square(self.speed[rows])


@dataclass(frozen=True)
class _Seen:
    """What the curves of some frames depend on.

    Attributes:
        by: derivatives of the moments (d, c).
        speed: (d, c) of the coordinates.
        first: (d,) the first active spline.
        values: (3, d, 6) of the active splines and their first two derivatives.
        shares: (3,) deviations of places, rates and accelerations by the markers' errors alone, over what the estimate
            expects of them.
        shaken: (d, c, 6 c) derivatives of the moments by the coefficients of the active splines, for what the markers'
            errors make of the motion alone; longer where skin moves unseen (`skin_blocks.block_growth`).
    """

    by: MomentDerivatives
    speed: np.ndarray
    first: np.ndarray
    values: np.ndarray
    shares: np.ndarray
    shaken: np.ndarray

    @classmethod
    def of(
        cls,
        by: MomentDerivatives,
        speed: np.ndarray,
        first: np.ndarray,
        values: np.ndarray,
        shares: np.ndarray,
        grown: np.ndarray,
    ) -> _Seen:
        orders = (by.q, by.qd, by.qdd)
        own = (share * each * grown[..., None] for share, each in zip(shares, orders, strict=True))
        shaken = by_splines(values, *own)
        return cls(by, speed, first, values, shares, shaken.reshape(*by.q.shape[:2], -1))


@dataclass(frozen=True)
class _EndSpread:
    """How uncertain the splines of one block are: as `_MotionSpread` has it, (k, k) and (k, S)."""

    diagonal: np.ndarray
    carried: np.ndarray

    @classmethod
    def of_middle(cls, middle: Factored, root: np.ndarray) -> _EndSpread:
        """Of the block in the middle of a trial."""
        (diagonal,), _ = middle.band.inverse_blocks()
        return cls(diagonal, _carried(middle, root)[0])


@dataclass(frozen=True)
class _MotionSpread:
    """How uncertain the coefficients of the splines that a stretch touches are, and how they go with the static
    unknowns.

    Attributes:
        start: the first of the splines.
        diagonal, below: blocks of SPLINES_PER_BLOCK splines (b, k, k), (b - 1, k, k) of their covariance if the static
            unknowns were known.
        carried: (splines, c, S) how far one deviation of each independent part of the static unknowns carries them.
    """

    start: int
    diagonal: np.ndarray
    below: np.ndarray
    carried: np.ndarray

    @classmethod
    def of(
        cls, part: Factored, stretch: Stretch, root: np.ndarray, end: _EndSpread
    ) -> tuple[_MotionSpread, _EndSpread]:
        """Of a stretch, with this root (S, S) of the static unknowns' covariance, and of the block with which the next
        one ends; `end` is that of its own.
        """
        carried, size = _carried(part, root, end.carried), len(root)
        diagonal, below = part.band.inverse_blocks(end.diagonal)
        other = _EndSpread(diagonal[0], carried[0])
        every, all_carried = (
            np.append(diagonal, end.diagonal[None], axis=0),
            np.append(carried, end.carried[None], axis=0),
        )
        if part.backwards:
            every, all_carried, below = every[::-1], all_carried[::-1], below[::-1].transpose(0, 2, 1)
        c = every.shape[1] // SPLINES_PER_BLOCK
        return cls(stretch.touched.start, every, below, all_carried.reshape(-1, c, size)), other

    def variances(self, seen: _Seen, root: np.ndarray, into: CurveDeviations, rows: slice) -> None:
        """Write the variances of some frames into rows of `into`; `root` (n, n) is of the static unknowns that root
        equations depend on.
        """
        by, c, precision = seen.by, self.carried.shape[1], self.carried.dtype
        still = by.static @ root
        into.ground_forces[rows] = np.square(by.ground @ root).sum(axis=-1).reshape(-1, 2, 3)
        moved = np.empty((3, *still.shape[:2]))  # variances of moments and speeds, and covariance, of these frames
        orders = np.concatenate([by.q, by.qd, by.qdd], axis=2).astype(precision)
        values, shaken = seen.values.astype(precision), seen.shaken.astype(precision)
        still = still.astype(precision)
        for spline in np.unique(seen.first):
            own = np.flatnonzero(seen.first == spline)
            covariance, carried = self._active(int(spline) - self.start)
            by_errors = shaken[own] @ covariance.astype(precision)
            # how the static unknowns carry places, rates and accelerations along, and these the moments
            along = values[:, own].transpose(1, 0, 2).reshape(-1, 6) @ carried.reshape(6, -1)
            along = along.reshape(len(own), 3 * c, -1)
            moment = orders[own] @ along
            moment[..., : len(root)] -= still[own]
            q, qd = along[:, :c], along[:, c : 2 * c]
            each = np.arange(c)
            blocks = covariance.reshape(6, c, 6, c)[:, each, :, each]  # (c, 6, 6) of every coordinate alone
            place, rate = (share * value for share, value in zip(seen.shares[:2], seen.values[:2, own], strict=True))
            alone = [((one @ blocks) * one).sum(axis=-1).T for one in (place, rate)]
            together = by_errors.reshape(len(own), c, 6, c)[:, each, :, each].transpose(1, 0, 2)
            into.coordinates[rows][own] = alone[0] + np.einsum("ncs,ncs->nc", q, q)
            moved[0, own] = np.einsum("ncs,ncs->nc", by_errors, shaken[own]) + np.einsum("ncs,ncs->nc", moment, moment)
            moved[1, own] = alone[1] + np.einsum("ncs,ncs->nc", qd, qd)
            moved[2, own] = (together * rate[:, None]).sum(axis=-1) + np.einsum("ncs,ncs->nc", moment, qd)
        into.moments[rows] = moved[0]
        speed, value = seen.speed, by.value
        into.powers[rows] = speed**2 * moved[0] + value**2 * moved[1] + 2.0 * speed * value * moved[2]

    def _active(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """(6 c, 6 c) covariance and (6 c, S) of the six splines from `first` on."""
        block, offset = divmod(first, SPLINES_PER_BLOCK)
        pair = np.block(
            [
                [self.diagonal[block], self.below[block].T],
                [self.below[block], self.diagonal[block + 1]],
            ]
        )
        c = self.carried.shape[1]
        here = slice(offset * c, (offset + 6) * c)
        return pair[here, here], self.carried[first : first + 6].reshape(6 * c, -1)


def _carried(part: Factored, root: np.ndarray, after: np.ndarray | None = None) -> np.ndarray:
    """(b, k, S) how far one deviation of each independent part of the static unknowns carries these splines, in the
    order of elimination; `after` (k, S) is that of the block eliminated next.
    """
    precision = part.border.dtype
    blocks = part.border @ root.astype(precision)
    return part.band.as_precise(precision).backward(blocks, after, in_place=True)
