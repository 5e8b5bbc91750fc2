"""Standard deviations of joint angles, moments, powers and ground reactions over time, from motion, body segment
parameters and calibration together.

Delta method: analytic derivatives by spline coefficients and static unknowns, times their posterior covariance. Errors
that come back (`repetition`) make the motion no vaguer, only what many frames say of what does not move: what is left
of the motion if that were known is that of the errors alone. Of the coefficients' covariance only the blocks near the
diagonal are needed, since six splines are active in any frame; they come from the block-banded factor
(`BlockBand.inverse_blocks`) and the static unknowns. They count by what is seen of the errors that they are from
(`motion_noise`). Added is what of the forces is faster than the motion (`GroundReactions.impact`), as a moving mean
square: whether it acts on the joints or is spent on segments that slow down is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from scipy.ndimage import uniform_filter1d

from kinertia.estimation.simultaneous.elimination import Eliminated, Factored
from kinertia.estimation.simultaneous.moment_derivatives import MomentDerivatives, moment_derivatives
from kinertia.estimation.simultaneous.motion_noise import motion_noise
from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK, by_splines
from kinertia.estimation.simultaneous.problem import MapProblem

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
    in_root = problem.layout.in_root
    size = (len(frames), coefficients.shape[1])
    variance, impact, speed = CurveDeviations.filled(*size, 0.0), np.empty(size), np.empty(size)
    reactions, spread = problem.reactions(k, static), None
    # errors that come back count more often only for what does not move
    shares = np.sqrt(motion_noise(problem, k, coefficients, static) / problem.trials[k].repeats)
    for part in eliminated.backwards():
        spread = _MotionSpread.of(part, coefficients.shape[1], root, spread)
        begin, end = np.searchsorted(frames, [part.stretch.frames.start, part.stretch.frames.stop])
        for start in range(begin, end, _FRAMES_AT_ONCE):
            rows = slice(start, min(start + _FRAMES_AT_ONCE, end))
            chosen = frames[rows]
            motion = problem.full(basis.evaluate(coefficients, chosen), static)
            by = moment_derivatives(problem, k, motion, static, reactions, chosen)
            impact[rows], speed[rows] = by.impact, motion[1][:, problem.moving]
            seen = _Seen.of(by, speed[rows], basis.first[chosen], basis.values[:, chosen], shares)
            spread.variances(seen, root[in_root, in_root], variance, rows)
            loaded = reactions.at(problem.trials[k].time[chosen])[..., :3] != 0.0
            variance.ground_forces[rows] += np.square(reactions.noise_n * loaded)
    around = 1 + 2 * round(_LOST_KNOTS * len(basis.first) / (basis.size - 5))
    lost = uniform_filter1d(np.square(impact), around, axis=0, mode="nearest")
    parts = (
        variance.coordinates,
        variance.moments + lost,
        variance.powers + lost * np.square(speed),
        variance.ground_forces,
    )
    return CurveDeviations(*(np.sqrt(np.maximum(part, 0.0)) for part in parts))


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
            errors make of the motion alone.
    """

    by: MomentDerivatives
    speed: np.ndarray
    first: np.ndarray
    values: np.ndarray
    shares: np.ndarray
    shaken: np.ndarray

    @classmethod
    def of(
        cls, by: MomentDerivatives, speed: np.ndarray, first: np.ndarray, values: np.ndarray, shares: np.ndarray
    ) -> _Seen:
        orders = (by.q, by.qd, by.qdd)
        shaken = by_splines(values, *(share * each for share, each in zip(shares, orders, strict=True)))
        return cls(by, speed, first, values, shares, shaken.reshape(*by.q.shape[:2], -1))


@dataclass(frozen=True)
class _MotionSpread:
    """How uncertain neighbouring spline coefficients of a stretch are, and how they go with the static unknowns.

    Attributes:
        start: the first of the splines.
        diagonal, below: blocks of SPLINES_PER_BLOCK splines (b, k, k), (b - 1, k, k) of their covariance if the static
            unknowns were known; with the first block after the stretch.
        carried: (splines, c, S) how far one deviation of each independent part of the static unknowns carries them.
    """

    start: int
    diagonal: np.ndarray
    below: np.ndarray
    carried: np.ndarray

    @classmethod
    def of(cls, part: Factored, c: int, root: np.ndarray, after: _MotionSpread | None) -> _MotionSpread:
        """Of a stretch, with this root (S, S) of the static unknowns' covariance; `after` is the next stretch's."""
        start, size, precision = part.stretch.splines.start, len(root), part.border.dtype
        band, blocks = part.band.as_precise(precision), part.border @ root.astype(precision)
        if after is None:
            carried = band.backward(blocks, in_place=True)
            return cls(start, *part.band.inverse_blocks(), carried.reshape(-1, c, size))
        block, first = after.diagonal[:1], after.carried[:SPLINES_PER_BLOCK]
        carried = band.backward(blocks, first.reshape(-1, size), in_place=True).reshape(-1, c, size)
        diagonal, below = part.band.inverse_blocks(block[0])
        return cls(start, np.append(diagonal, block, axis=0), below, np.append(carried, first, axis=0))

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
