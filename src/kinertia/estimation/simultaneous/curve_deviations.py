"""Computes standard deviations over time of joint angles, moments, powers and ground reactions.

They combine the uncertainty of motion, body segment parameters and calibration by the delta method: analytic
derivatives by spline coefficients and static unknowns, times their posterior covariance. Errors that recur in every
stride (`error_repetition`) do not make the motion less certain, only what many frames show of static unknowns: the
residual uncertainty of the motion, given these, is due to the errors alone. Only the blocks near the diagonal of the
coefficients' covariance are needed, since six splines are active in any frame; they come from the block-banded factor
(`BlockBand.inverse_blocks`) and the static unknowns. They are scaled by the observed size of the underlying errors
(`motion_noise`), in moments by more where skin motion is not observable (`skin_blocks`). The delay of the forces counts
with its whole distribution (`delayed_loads`): at foot contact they change within less than its uncertainty. The part of
the forces that is faster than the motion (`GroundReactions.impact`) is added as a moving mean square: whether it acts
on the joints or decelerates segments is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from kinertia.estimation.simultaneous.elimination import Branch, Eliminated, Factored
from kinertia.estimation.simultaneous.frame_blocks import TimeBlock
from kinertia.estimation.simultaneous.moment_derivatives import MomentDerivatives, moment_derivatives
from kinertia.estimation.simultaneous.motion_noise import motion_noise
from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK, by_splines
from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.estimation.simultaneous.skin_blocks import block_growth
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.moving_windows import even_mean
from kinertia.motion.two_threads import side_by_side

_FRAMES_AT_ONCE = 100
"""Number of frames processed at once; larger arrays would exceed the processor's cache."""
_LOST_KNOTS = 2.0
"""Half of the averaging interval, in knot intervals: one period of the cutoff."""


@dataclass(frozen=True, eq=False)
class CurveDeviations:
    """Posterior standard deviations of a trial's curves at its d dynamic frames.

    Attributes:
        coordinates: (d, c) rad, m.
        moments: (d, c) of the joint moments, N m, and of the forces of translations, N.
        powers: (d, c) of joint moment times speed, W.
        ground_forces: (d, 2, 3) of the ground reactions on right and left foot, N: from the instrument corrections and
            the plates' own noise.
    """

    coordinates: np.ndarray
    moments: np.ndarray
    powers: np.ndarray
    ground_forces: np.ndarray

    def and_of(self, other: CurveDeviations) -> CurveDeviations:
        """Combine with other, independent standard deviations."""
        return CurveDeviations(*(np.hypot(*pair) for pair in zip(self.curves, other.curves, strict=True)))

    @property
    def curves(self) -> tuple[np.ndarray, ...]:
        """The standard deviations of all curves, in the order of the attributes."""
        return tuple(getattr(self, field.name) for field in fields(self))

    @classmethod
    def filled(cls, d: int, c: int, value: float) -> CurveDeviations:
        """Return standard deviations of so many frames and coordinates that all have this value."""
        return cls(*(np.full(shape, value) for shape in ((d, c), (d, c), (d, c), (d, 2, 3))))


def curve_deviations(
    problem: MapProblem,
    k: int,
    coefficients: np.ndarray,
    static: np.ndarray,
    eliminated: Eliminated,
    root: np.ndarray,
) -> CurveDeviations:
    """Compute the posterior standard deviations of the curves of trial k.

    Args:
        problem: of the estimate.
        k: the trial.
        coefficients, static: the estimate.
        eliminated: the trial's normal equations there, undamped.
        root: (S, S) root of the posterior covariance of the static unknowns, as in `StaticInformation`: the rows of
            unknowns in the root equations, which come first, have only as many nonzero columns as there are such
            unknowns.
    """
    basis, frames = problem.bases[k], np.flatnonzero(problem.trials[k].dynamic)
    size = (len(frames), coefficients.shape[1])
    delay_sd_s = float(np.linalg.norm(root[problem.loads.delay_unknowns(k)].sum(axis=0)))
    curves = _Curves(
        problem,
        k,
        coefficients,
        static,
        problem.loads.reactions(k, static),
        # errors that recur count more often only for what does not move
        np.sqrt(motion_noise(problem, k, coefficients, static) / problem.trials[k].repeats),
        frames,
        delay_sd_s,
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
        problem, k, coefficients, static: as in `curve_deviations`.
        reactions: loads for the joint moments.
        shares: as in `_Seen`.
        frames: (d,) indices of the dynamic frames.
        delay_sd_s: standard deviation of the delay of the forces.
        grown: (d, c) factors on the corresponding standard deviations of the moments (`skin_blocks.block_growth`).
        variance: of the curves.
        impact: (d, c) as in `MomentDerivatives`.
        speed: (d, c) of the coordinates.
    """

    problem: MapProblem
    k: int
    coefficients: np.ndarray
    static: np.ndarray
    reactions: GroundReactions
    shares: np.ndarray
    frames: np.ndarray
    delay_sd_s: float
    grown: np.ndarray
    variance: CurveDeviations
    impact: np.ndarray
    speed: np.ndarray

    def add(self, branch: Branch, root: np.ndarray, end: _EndSpread) -> None:
        """Write the variances in the frames of a branch, given the uncertainty of the block in which it ends."""
        for part, time_block in zip(branch.outwards(), reversed(branch.time_blocks), strict=True):
            spread, end = _MotionSpread.of(part, time_block, root, end)
            begin, stop = np.searchsorted(self.frames, [time_block.frames.start, time_block.frames.stop])
            for start in range(begin, stop, _FRAMES_AT_ONCE):
                self._write(spread, root, slice(start, min(start + _FRAMES_AT_ONCE, stop)))

    def _write(self, spread: _MotionSpread, root: np.ndarray, rows: slice) -> None:
        problem, basis, chosen = self.problem, self.problem.bases[self.k], self.frames[rows]
        in_root = problem.layout.in_root
        motion = problem.model.full(basis.evaluate(self.coefficients, chosen), self.static)
        by = moment_derivatives(problem, self.k, motion, self.static, self.reactions, chosen, self.delay_sd_s)
        self.impact[rows], self.speed[rows] = by.impact, motion[1][:, problem.moving]
        values = basis.values[:, chosen]
        seen = _Seen.of(by, self.speed[rows], basis.first[chosen], values, self.shares, self.grown[rows])
        spread.variances(seen, root[in_root, in_root], self.variance, rows)
        loaded = self.reactions.at(problem.trials[self.k].time[chosen])[..., :3] != 0.0
        self.variance.ground_forces[rows] += np.square(self.reactions.noise_n * loaded)
        self.variance.ground_forces[rows] += by.ground_delay_squares.reshape(-1, 2, 3)
        self.variance.moments[rows] += by.delay_squares
        self.variance.powers[rows] += by.delay_squares * np.square(self.speed[rows])


@dataclass(frozen=True)
class _Seen:
    """Dependence of the curves on the unknowns in some frames.

    Attributes:
        by: derivatives of the moments (d, c).
        speed: (d, c) of the coordinates.
        first: (d,) the first active spline.
        values: (3, d, 6) of the active splines and their first two derivatives.
        shares: (3,) standard deviations of positions, rates and accelerations due to the markers' errors alone,
            relative to those that the estimate expects.
        shaken: (d, c, 6 c) derivatives of the moments by the coefficients of the active splines, for the effect of the
            markers' errors on the motion alone; larger where skin motion is not observable
            (`skin_blocks.block_growth`).
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
    """Uncertainty of the splines of one block, as in `_MotionSpread`: (k, k) and (k, S)."""

    diagonal: np.ndarray
    carried: np.ndarray

    @classmethod
    def of_middle(cls, middle: Factored, root: np.ndarray) -> _EndSpread:
        """Compute the uncertainty of the block in the middle of a trial."""
        (diagonal,), _ = middle.band.inverse_blocks()
        return cls(diagonal, _carried(middle, root)[0])


@dataclass(frozen=True)
class _MotionSpread:
    """Uncertainty of the spline coefficients that a time block touches, and their dependence on the static unknowns.

    Attributes:
        start: the first of the splines.
        diagonal, below: blocks of SPLINES_PER_BLOCK splines (b, k, k), (b - 1, k, k) of their covariance given the
            static unknowns.
        carried: (splines, c, S) their change with one standard deviation of each independent part of the static
            unknowns.
    """

    start: int
    diagonal: np.ndarray
    below: np.ndarray
    carried: np.ndarray

    @classmethod
    def of(
        cls, part: Factored, time_block: TimeBlock, root: np.ndarray, end: _EndSpread
    ) -> tuple[_MotionSpread, _EndSpread]:
        """Compute the uncertainty of a time block, and of the block of splines with which the next time block ends.

        `root` (S, S) is the root of the static unknowns' covariance; `end` belongs to the block's own end.
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
        return cls(time_block.touched.start, every, below, all_carried.reshape(-1, c, size)), other

    def variances(self, seen: _Seen, root: np.ndarray, into: CurveDeviations, rows: slice) -> None:
        """Write the variances of some frames into rows of `into`.

        `root` (n, n) belongs to the static unknowns that root equations depend on.
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
            # how positions, rates and accelerations change with the static unknowns, and the moments with these
            along = values[:, own].transpose(1, 0, 2).reshape(-1, 6) @ carried.reshape(6, -1)
            along = along.reshape(len(own), 3 * c, -1)
            moment = orders[own] @ along
            moment[..., : len(root)] -= still[own]
            q, qd = along[:, :c], along[:, c : 2 * c]
            each = np.arange(c)
            blocks = covariance.reshape(6, c, 6, c)[:, each, :, each]  # (c, 6, 6) of each coordinate by itself
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
        """Return covariance (6 c, 6 c) and dependence (6 c, S) of the six splines from `first` on."""
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
    """Return the change (b, k, S) of these splines with one SD of each independent part of the static unknowns.

    Blocks are in the order of elimination; `after` (k, S) belongs to the block eliminated next.
    """
    precision = part.border.dtype
    blocks = part.border @ root.astype(precision)
    return part.band.as_precise(precision).backward(blocks, after, in_place=True)
