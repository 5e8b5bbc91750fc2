"""Draws motion, body segment parameters and calibration together from the posterior.

A draw of the static unknowns is a root of their covariance times independent normal numbers. The motion follows it
through the border of the normal equations, and differs from it by what the markers leave undetermined:
`Eliminated.motion_step` does both at once. The motion's own part is then reduced according to the observed marker
errors, as `curve_deviations` reduces its derivatives (`motion_noise`): by a filter, since positions, rates and
accelerations each have a share of their own and a draw is one motion. Knot positions (`marginal_posterior`), thigh
masses in other tasks (`model_terms`) and impact transients each add an independent number.

Draws are made once, with a fixed seed, and stored with the result: a few hundred take less memory than the factors from
which more could be made.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.fft import dct, idct
from scipy.optimize import least_squares

from kinertia.estimation.simultaneous.inputs import BSP, PLACES, STILL
from kinertia.estimation.simultaneous.instruments.plates import GAIN
from kinertia.estimation.simultaneous.linear_algebra.elimination import Eliminated, Factored
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import SPLINES_PER_BLOCK
from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.problem import MapProblem, Point
from kinertia.estimation.simultaneous.terms.instrument_term import InstrumentErrors
from kinertia.estimation.simultaneous.uncertainty.marginal_posterior import OfPhases, followed
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.log_cholesky import dynamic_jacobian, nearest_consistent

MOST_DRAWS = 200
"""Number of draws stored per estimate. The standard deviation of 200 numbers is known to 5 %."""
MOST_BYTES = 8_000_000
"""Size of the stored motions of all trials together; for long trials fewer draws are stored."""
FEWEST_DRAWS = 20
_SEED = 20090
_ALIKE = 1e-3
"""Relative difference between shares that is negligible."""
_LOOSE_ENDS = 5
"""Splines at either end of a trial that few frames determine: they are not representative of the others."""
_AT_ONCE = 1_000_000
"""Numbers of curves that are filtered at once."""
_LEAST_MASS = 0.05
"""Least share of a segment's estimated mass in a draw."""


@dataclass(frozen=True, eq=False)
class TrialDraws:
    """Differences of n draws from the estimate in one trial.

    Attributes:
        knots: (k + 6,) s, of quintic splines.
        coefficients: (n, k, c) of the coordinates' differences, rad and m.
        plates: (n, p, 7) differences of the plates' errors: PLATE_ERRORS, ZERO_UNKNOWNS.
        plate_gain: (p,) the estimated gains.
        middles: (p, 3) m, about which plates are rotated.
        turn: (3, 3) from the laboratory's axes to the trial's.
        delay_s: (n,) additional delay of the forces, s.
        impact: (n,) share of `GroundReactions.uncertain`, impact transients among it, that is added.
    """

    knots: np.ndarray
    coefficients: np.ndarray
    plates: np.ndarray
    plate_gain: np.ndarray
    middles: np.ndarray
    turn: np.ndarray
    delay_s: np.ndarray
    impact: np.ndarray


@dataclass(frozen=True, eq=False)
class PosteriorDraws:
    """n draws from the posterior of an estimate.

    Attributes:
        segments: names of the segments whose parameters are drawn.
        bsp: (n, s, 10) tables of their body segment parameters, each physically consistent.
        coordinates: names of the static coordinates.
        coordinate_values: (n, h) their values, rad or m.
        places: (n, m, 3) m, differences of the markers' positions in their segments.
        trials: one per trial.
    """

    segments: tuple[str, ...]
    bsp: np.ndarray
    coordinates: tuple[str, ...]
    coordinate_values: np.ndarray
    places: np.ndarray
    trials: tuple[TrialDraws, ...]

    @property
    def count(self) -> int:
        """Number of draws."""
        return len(self.bsp)

    def without_places(self) -> Self:
        """Return the draws with marker positions as estimated."""
        return replace(self, places=np.zeros_like(self.places))

    def of_first(self, count: int) -> Self:
        """Return the draws with the motions of the first `count` trials only."""
        return replace(self, trials=self.trials[:count])


@dataclass(frozen=True, eq=False)
class Mode:
    """Effect of one SD of an independent quantity on static unknowns (S,) and each trial's motion (k, c)."""

    static: np.ndarray
    motions: tuple[np.ndarray, ...]


def of_knots(phases: OfPhases) -> Mode:
    """Return the mode of the knot positions, from the first estimate to the second.

    Its standard deviation is their distance over the square root of two.
    """
    (problem, other), (point, there) = phases.problems[:2], phases.points[:2]
    rows = zip(problem.bases, other.bases, point.coefficients, there.coefficients, strict=True)
    motions = tuple(basis.fit(new.evaluate(b)[0]) - basis.fit(basis.evaluate(a)[0]) for basis, new, a, b in rows)
    scale = np.sqrt(0.5)
    return Mode(scale * (there.static - point.static), tuple(scale * motion for motion in motions))


def of_root(model: GaussNewton, point: Point, root: np.ndarray) -> list[Mode]:
    """Return a mode for each column of a covariance's root (S, u), with the motions that follow."""
    result = []
    for column in root.T:
        static = column * np.sign(column[np.argmax(np.abs(column))])  # the root's sign is arbitrary
        there = followed(model, point, point.static + static)
        rows = zip(there.coefficients, point.coefficients, strict=True)
        result.append(Mode(static, tuple(after - before for after, before in rows)))
    return result


def posterior_draws(
    model: GaussNewton,
    point: Point,
    roots_in_trials: Sequence[np.ndarray],
    noises: Sequence[np.ndarray],
    modes: Sequence[Mode],
) -> PosteriorDraws:
    """Draw from the posterior around an estimate.

    Args:
        model: of the estimate's normal equations, with the instruments' priors.
        point: the estimate.
        roots_in_trials: per trial (S, S) root of the posterior covariance of the static unknowns as they are in it,
            block lower triangular: those that root equations depend on come first.
        noises: per trial (3,) as in `curve_deviations`.
        modes: other uncertain quantities.
    """
    problem, trials, root = model.problem, model.here.trials, model.static.root_of_covariance()
    random, count = np.random.default_rng(_SEED), _kept(sum(coefficient.size for coefficient in point.coefficients))
    normal, extra = random.standard_normal((count, len(root))), random.standard_normal((count, len(modes)))
    drawn = normal @ root.T
    static = point.static + drawn + extra @ np.array([mode.static for mode in modes])
    of_trials = []
    for k, (trial, root_in_trial) in enumerate(zip(trials, roots_in_trials, strict=True)):
        in_trial = (
            drawn if root_in_trial is root else _in_trial(drawn, normal, root_in_trial, problem.layout.in_root.stop)
        )
        motions = _motions(problem.bases[k], trial, in_trial, noises[k], random)
        for motion, shares in zip(motions, extra.astype(motions.dtype), strict=True):  # together they take memory
            for mode, share in zip(modes, shares, strict=True):
                motion += share * mode.motions[k]
        of_trials.append(_trial_draws(problem, k, point.static, static, motions, random))
    layout = problem.layout
    return PosteriorDraws(
        tuple(problem.model.segments),
        _bodies(problem, point, (static - point.static)[:, layout[BSP]]),
        tuple(problem.calibration.coordinates),
        static[:, layout[STILL]],
        (static - point.static)[:, layout[PLACES]].reshape(count, -1, 3).astype(np.float32),
        tuple(of_trials),
    )


def _kept(size: int) -> int:
    """Return the number of draws of so many coefficients that are stored."""
    return int(np.clip(MOST_BYTES // (4 * size), FEWEST_DRAWS, MOST_DRAWS))


def _in_trial(drawn: np.ndarray, normal: np.ndarray, root: np.ndarray, first: int) -> np.ndarray:
    """Return draws (n, S) as they are in a trial: the first unknowns are the same in all."""
    in_trial = normal.copy()
    in_trial[:, :first] = np.linalg.solve(root[:first, :first], drawn[:, :first].T).T
    result: np.ndarray = in_trial @ root.T
    return result


def _motions(
    basis: MotionBasis, trial: Eliminated, static: np.ndarray, noise: np.ndarray, random: np.random.Generator
) -> np.ndarray:
    """Draw differences (n, k, c) of a motion's coefficients, given these (n, S) of the static unknowns.

    They are in single precision, as they are stored.
    """
    columns = trial.middle.band.diagonal.shape[1] // SPLINES_PER_BLOCK
    size = (2 * len(static), basis.size, columns)
    steps = _Steps(static.T, random, np.empty(size, np.float32))
    after = steps.write(trial.middle)
    for branch in trial.branches:
        block = after
        for part in branch.outwards():  # each is read once
            block = steps.write(part, block)
    follow, alone = np.split(steps.into, 2)
    _narrow(alone, noise, basis)
    drawn: np.ndarray = follow + alone
    return drawn


@dataclass(frozen=True, eq=False)
class _Steps:
    """Steps of a motion for n draws of the static unknowns, and n draws of what they leave undetermined.

    Attributes:
        static: (S, n) steps of the static unknowns.
        random: generator for the latter.
        into: (2 n, k, c) both, one after the other.
    """

    static: np.ndarray
    random: np.random.Generator
    into: np.ndarray

    def write(self, part: Factored, after: np.ndarray | None = None) -> np.ndarray:
        """Write the steps of some splines, as `elimination.write_step` does, and return their first block (k, 2 n).

        The first in the order of elimination, it is `after` of the part eliminated before.
        """
        follow = -(part.border @ self.static.astype(part.border.dtype)).astype(float)
        rhs = np.concatenate([follow, self.random.standard_normal(follow.shape)], axis=2)
        blocks = part.band.backward(np.ascontiguousarray(rhs), after, in_place=True)
        flat = part.in_order(blocks).reshape(-1, rhs.shape[2]).T
        count, _, c = self.into.shape
        target = self.into[:, part.splines]
        target[:] = flat.reshape(count, -1, c)[:, : target.shape[1]]
        first: np.ndarray = blocks[0]
        return first


def _narrow(alone: np.ndarray, shares: np.ndarray, basis: MotionBasis) -> None:
    """Filter curves, given as spline coefficients (n, k, c), so that their power is multiplied by shares (3,).

    The shares apply to the power of the curves, of their rates and of their accelerations. The logarithm of the
    filter's power is a parabola in the square of the frequency, the same for all columns, so that relations between
    them are kept. Curves are filtered and not their coefficients: those of splines that few frames determine, at either
    end of a trial, are hundreds of times larger than the others, and would leak into these. Cosine transforms mirror
    the curves at their ends, which avoids jumps.
    """
    if np.ptp(shares) < _ALIKE * shares.max():
        alone *= np.sqrt(shares.mean())
        return
    size, frames = basis.size, len(basis.first)
    ends = min(_LOOSE_ENDS, (size - _LOOSE_ENDS) // 2) * frames // size
    power = np.zeros((frames - 2 * ends, alone.shape[2]))
    # a few draws at a time: of long trials the spectra of all would be most of the memory
    some = max(1, _AT_ONCE // (frames * alone.shape[2]))
    for start in range(0, len(alone), some):
        curves = basis.evaluate(_side_by_side(alone[start : start + some]), derivatives=0)[0]
        spectra = dct(curves[ends : frames - ends], axis=0).reshape(len(power), -1, alone.shape[2])
        power += np.square(spectra).sum(axis=1)
    squares = _squares(len(power), basis)
    weights = (power / power.sum(axis=0)).mean(axis=1) * squares ** np.arange(3)[:, None]
    weights /= weights.sum(axis=1, keepdims=True)
    shape = squares ** np.arange(3)[:, None]

    def missing(bend: np.ndarray) -> np.ndarray:
        gap: np.ndarray = np.log(weights @ np.exp(bend @ shape) / shares)
        return gap

    found = least_squares(missing, [np.log(shares.mean()), 0.0, 0.0], bounds=([-20.0] * 3, [20.0] * 3))
    gain = np.exp(0.5 * found.x @ _squares(frames, basis) ** np.arange(3)[:, None])
    for start in range(0, len(alone), some):
        chunk = alone[start : start + some]
        curves = basis.evaluate(_side_by_side(chunk), derivatives=0)[0]
        narrowed = basis.fit(idct(dct(curves, axis=0) * gain[:, None], axis=0, overwrite_x=True))
        chunk[:] = narrowed.reshape(size, len(chunk), -1).transpose(1, 0, 2)


def _side_by_side(series: np.ndarray) -> np.ndarray:
    """Return series (n, k, c) as columns (k, n c)."""
    result: np.ndarray = series.transpose(1, 0, 2).reshape(series.shape[1], -1)
    return result


def _squares(frames: int, basis: MotionBasis) -> np.ndarray:
    """Return squares (f,) of the frequencies of a cosine transform, relative to half a cycle per knot interval.

    Beyond it splines have no power, and all frequencies count as this one.
    """
    intervals = basis.intervals * frames / len(basis.first)
    return np.minimum(np.square(np.arange(frames) / intervals), 1.0)


def _bodies(problem: MapProblem, point: Point, departures: np.ndarray) -> np.ndarray:
    """Return tables (n, s, 10) of drawn body segment parameters, from differences (n, 10 s) of the unknowns.

    Forces are linear in masses, first and second moments, not in logarithms: the differences are applied to the former
    to first order. Impossible bodies are replaced by the nearest possible ones.
    """
    theta, estimate = point.static[problem.layout[BSP]], problem.model.bsp(point.static)
    dynamic, departed = estimate.dynamic_parameters().reshape(-1, 10), departures.reshape(len(departures), -1, 10)
    moved = np.einsum("sij,nsj->nsi", dynamic_jacobian(theta), departed)
    least = np.maximum(moved[..., 0], (_LEAST_MASS - 1.0) * dynamic[:, 0])
    moved *= (least / np.where(moved[..., 0] == 0.0, 1.0, moved[..., 0]))[..., None]
    names = tuple(f"{name} {k}" for k in range(len(departed)) for name in estimate.segments)
    drawn = BodySegmentParameters.from_dynamic_parameters(names, (dynamic + moved).reshape(-1, 10))
    return nearest_consistent(drawn).table().reshape(departed.shape)


def _trial_draws(
    problem: MapProblem,
    k: int,
    estimate: np.ndarray,
    static: np.ndarray,
    motions: np.ndarray,
    random: np.random.Generator,
) -> TrialDraws:
    ground, instruments, loads = problem.given.grounds[k], problem.term(InstrumentErrors), problem.loads
    plates = instruments.plates_in(k, estimate)
    return TrialDraws(
        problem.bases[k].knots,
        motions,
        instruments.plates_in(k, static) - plates,
        plates[:, GAIN],
        ground.middles,
        ground.turn,
        (static - estimate)[:, loads.delay_unknowns(k)].sum(axis=1),
        random.standard_normal(len(static)),
    )
