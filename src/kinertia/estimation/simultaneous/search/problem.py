"""Sums the cost of all terms, its normal equations and gradient at a point, and holds the cost linearised there.

The cost is the sum of its terms (`terms.TERMS`), each of which adds unknowns, its cost and what it reads from the
solution. All derivatives are analytic. Frames are summed knot interval by knot interval: the normal matrix is banded in
the motion and bordered by what does not move.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.inputs import FreedModel, Given, Layout
from kinertia.estimation.simultaneous.linear_algebra.elimination import Eliminated
from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import (
    TimeBlock,
    halves,
    joined,
    time_blocks_of_trials,
)
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import EquationsPool, Gradient, NormalEquations
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observation
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, GroundLoads, InTrial, Solution, in_order
from kinertia.estimation.simultaneous.terms.instrument_term import InstrumentErrors, MissingLoads
from kinertia.estimation.simultaneous.terms.marker_terms import Markers
from kinertia.estimation.simultaneous.terms.model_terms import (
    BodySegments,
    MarkerPositions,
    Skin,
    StaticCoordinates,
    TaskMasses,
)
from kinertia.estimation.simultaneous.terms.motion_terms import JointRanges, RootLoads, Start, TrunkBending
from kinertia.model.skeleton import Skeleton
from kinertia.motion.workload import side_by_side

TERMS: tuple[type[CostTerm], ...] = (
    StaticCoordinates,
    InstrumentErrors,
    MissingLoads,
    TrunkBending,
    MarkerPositions,
    Skin,
    BodySegments,
    TaskMasses,
    Markers,
    JointRanges,
    Start,
    RootLoads,
)
"""Sorted by their `order`. The last takes about as long as all others together, so that two threads can share the work
of short trials.
"""
T = TypeVar("T", bound=CostTerm)


@dataclass(frozen=True)
class Point:
    """Values of all unknowns.

    Attributes:
        coefficients: per trial the spline coefficients of its motion.
        static: (S,) unknowns that do not move.
        displaced: per trial (3 m,) displacements of its markers (`displacement`), in prior standard deviations.
    """

    coefficients: tuple[np.ndarray, ...]
    static: np.ndarray
    displaced: tuple[np.ndarray, ...]

    @property
    def vector(self) -> np.ndarray:
        """All unknowns in one vector."""
        return np.concatenate(
            [*(coefficient.ravel() for coefficient in self.coefficients), self.static, *self.displaced]
        )

    def like(self, vector: np.ndarray) -> "Point":
        """Return the point whose `vector` this is."""
        ends = np.cumsum([part.size for part in (*self.coefficients, self.static, *self.displaced)])
        parts = np.split(vector, ends[:-1])
        motions = zip(parts, self.coefficients, strict=False)
        count = len(self.coefficients)
        return Point(tuple(p.reshape(c.shape) for p, c in motions), parts[count], tuple(parts[count + 1 :]))


@dataclass(frozen=True)
class Slope:
    """Half the sum of squares at a point, and minus its gradient.

    The instruments' priors are not Gaussian: they are included only by `under`.

    Attributes:
        point: the point.
        cost: half the sum of squares of everything.
        rhs: minus its derivatives by all unknowns, as `Point.vector` has them.
        instruments: slice of the instruments' unknowns in the vector.
    """

    point: Point
    cost: float
    rhs: np.ndarray
    instruments: slice

    def under(self, prior: GaussianPrior) -> tuple[float, np.ndarray]:
        """Return cost and right-hand side with this Gaussian for the instruments."""
        values, rhs = self.point.vector[self.instruments], self.rhs.copy()
        rhs[self.instruments] += prior.pull - prior.precision @ values
        return self.cost + prior.cost(values), rhs


@dataclass(frozen=True)
class Linearised:
    """Normal equations at a point, with the motions eliminated.

    Attributes:
        slope: cost and gradient there.
        trials: each trial's equations, for the static unknowns as they are in it.
        information: (S, S) of all priors but the instruments'.
    """

    slope: Slope
    trials: tuple[Eliminated, ...]
    information: np.ndarray

    @property
    def point(self) -> Point:
        """The point of linearisation."""
        return self.slope.point


class MapProblem:
    """Cost of the maximum-a-posteriori estimate: residuals and normal equations at a point.

    Attributes:
        given: input of the estimate.
        layout: of the unknowns that do not move (S of them).
        model: of the person, as a function of these.
        terms: of the cost.
        loads: on the feet, corrected by the terms.
        precise: whether all of it is in double precision (`elimination`).
    """

    def __init__(
        self,
        skeleton: Skeleton,
        prior: BspPrior,
        calibration: CalibrationPrior,
        trials: Sequence[Observation],
        phase: float = 0.0,
        terms: Sequence[type[CostTerm]] = TERMS,
        precise: bool = False,
        pool: EquationsPool | None = None,
    ) -> None:
        self.precise = precise
        self.skeleton, self.prior, self.calibration, self.trials = skeleton, prior, calibration, trials
        self.given = Given(skeleton, prior, calibration, trials, phase)
        self.bases, self.start, self.moving = self.given.bases, self.given.start, self.given.moving
        kinds = in_order(terms)
        self.layout = Layout.of(unknown for term in kinds for unknown in term.unknowns(self.given))
        self.model = FreedModel(self.given, self.layout)
        self.terms = tuple(term(self.model) for term in kinds)
        self.loads = GroundLoads(self.given, self.terms)
        self.time_blocks = time_blocks_of_trials(self.bases, len(self.moving), self.layout.size)
        self._adding = [term for term in self.terms if type(term).add is not CostTerm.add]
        self._pool = pool or EquationsPool()

    def of(self, trials: Sequence[Observation], phase: float = 0.0) -> "MapProblem":
        """Return the same problem with other observations, and with knots this share of an interval earlier."""
        kinds = [type(term) for term in self.terms]
        same = self.skeleton, self.prior, self.calibration
        return MapProblem(*same, trials, phase, kinds, self.precise, self._pool)

    def term(self, kind: type[T]) -> T:
        """Return the term of this kind."""
        (result,) = (term for term in self.terms if isinstance(term, kind))
        return result

    @property
    def beginning(self) -> Point:
        """Point from which the estimate starts: the observations' coordinates, the prior's mean, no displacements."""
        return Point(self.start, self.layout.start, tuple(np.zeros_like(sd) for sd in self.displaced_sd))

    @property
    def displaced_sd(self) -> tuple[np.ndarray, ...]:
        """Prior standard deviations of the unknowns that have an offset in each trial, per trial."""
        (result,) = (unknown.displaced_sd for unknown in self.layout.unknowns if unknown.displaced_sd)
        return result

    def shortened(self, point: Point, step: np.ndarray) -> np.ndarray:
        """Shorten a step of all unknowns from a point to what the terms allow."""
        before = sum(part.size for part in point.coefficients)
        static = slice(before, before + self.layout.size)
        return np.concatenate([step[:before], self.shortened_static(step[static]), step[static.stop :]])

    def shortened_static(self, step: np.ndarray) -> np.ndarray:
        """Shorten a step (S,) of the static unknowns to what the terms allow."""
        step = step.copy()
        for term in self.terms:
            term.shorten(step)
        return step

    def second_derivatives(self, rhs: np.ndarray) -> np.ndarray:
        """Return what Gauss-Newton leaves out of the information's diagonal (S,), from the right-hand side (S,)."""
        result = np.zeros(self.layout.size)
        for term in self.terms:
            term.add_second_derivatives(result, rhs)
        return result

    def prior_information(self, static: np.ndarray) -> np.ndarray:
        """Return the information (S, S) of the priors, except those of errors, and of the terms: what other people of
        the session and the person's steps show."""
        result = np.diag(self.layout.weight)
        for term in self.terms:
            term.add_information(result, static)
        return result

    def prior_slope(self, static: np.ndarray) -> tuple[np.ndarray, float]:
        """Return minus the derivatives (S,) of half the sum of squares of the same priors, and that half."""
        away, weight = static - self.layout.start, self.layout.weight
        rhs = -weight * away
        cost = float(np.sum(weight * np.square(away)))
        for term in self.terms:
            cost += term.add_pull(rhs, static)
        return rhs, 0.5 * cost

    def left_out(self, static: np.ndarray) -> np.ndarray:
        """Return the displacements (S, u) of the unknowns by unknowns of unit SD that are left out of the vector."""
        every = [outside for term in self.terms if (outside := term.left_out(static)) is not None]
        return np.column_stack(every) if every else np.zeros((self.layout.size, 0))

    def profiled(self) -> list[int]:
        """Return the indices of errors whose sum gets its posterior from the profile of the cost; it may be empty."""
        return [at for term in self.terms for at in term.profiled()]

    def imitated(self) -> tuple[float, float]:
        """Return mean and SD of the part of that sum that is apparent only: the data show it, but it is no error."""
        means, deviations = zip(*(term.imitated() for term in self.terms), strict=True)
        return sum(means), float(np.hypot.reduce(deviations))

    def read(self, solution: Solution) -> list[dict[str, Any]]:
        """Return what each term reads from the solution."""
        return [term.read(solution) for term in self.terms]

    def at(self, point: Point, damping: float = 0.0, bordered: bool = True) -> Linearised:
        """Build normal equations at a point, and eliminate motions with their diagonal raised by this share.

        Not `bordered`: for the motions alone, with all else fixed.
        """
        rows = enumerate(point.coefficients)
        trials = tuple(self.eliminated(k, part, self.in_trial(k, point), damping, bordered) for k, part in rows)
        slope = self._slope(point, [trial.gradient for trial in trials])
        return Linearised(slope, trials, self.prior_information(point.static))

    def slope(self, point: Point) -> Slope:
        """Return cost and gradient as in `at`, in a tenth of the time."""
        rows = enumerate(point.coefficients)
        return self._slope(point, [self.gradient(k, part, self.in_trial(k, point)) for k, part in rows])

    def _slope(self, point: Point, gradients: Sequence[Gradient]) -> Slope:
        """Add the priors to the trials' gradients."""
        rhs, cost = self.prior_slope(point.static)
        rows, motions, displaced = zip(gradients, self.displaced_sd, point.displaced, strict=True), [], []
        for gradient, sd, scaled in rows:
            rhs = rhs + gradient.static_rhs
            cost += gradient.cost + 0.5 * float(scaled @ scaled)
            motions.append(gradient.rhs)
            displaced.append(sd * gradient.static_rhs[self.layout.displaced] - scaled)
        before, places = sum(motion.size for motion in motions), self.layout.errors
        errors = slice(before + places.start, before + places.stop)
        return Slope(point, cost, Point(tuple(motions), rhs, tuple(displaced)).vector, errors)

    def in_trial(self, k: int, point: Point) -> np.ndarray:
        """Return the static unknowns (S,) as they are in trial k, with its displacements."""
        static = point.static.copy()
        static[self.layout.displaced] += self.displaced_sd[k] * point.displaced[k]
        return static

    def eliminated(
        self,
        k: int,
        coefficients: np.ndarray,
        static: np.ndarray,
        damping: float = 0.0,
        bordered: bool = True,
    ) -> Eliminated:
        """Return trial k with its motion eliminated; not `bordered`: for the motion alone, with all else fixed."""
        equations_of = partial(self.normal, k, coefficients, static, bordered=bordered)
        return Eliminated.of(self.time_blocks[k], equations_of, self._pool.back, damping, self.precise)

    def normal(
        self,
        k: int,
        coefficients: np.ndarray,
        static: np.ndarray,
        time_block: TimeBlock | None = None,
        bordered: bool = True,
    ) -> NormalEquations:
        """Build the normal equations of a time block of trial k, or of the whole trial."""
        time_block = time_block or TimeBlock.whole(self.bases[k])
        result = self._pool.zero(time_block.size, len(self.moving), self.layout.size, bordered)
        here = self._here(k, coefficients, static, time_block)
        for term in self._adding:
            term.add(result, here)
        return result

    def gradient(self, k: int, coefficients: np.ndarray, static: np.ndarray) -> Gradient:
        """Return the cost of trial k and minus its gradient."""

        def of_part(part: tuple[Sequence[TimeBlock], Sequence[CostTerm]]) -> Gradient:
            result = Gradient.zero(len(coefficients), len(self.moving), self.layout.size)
            for time_block in part[0]:
                gradient = Gradient.zero(time_block.size, len(self.moving), self.layout.size)
                here = self._here(k, coefficients, static, time_block)
                for term in part[1]:
                    term.add(gradient, here)
                result.add(gradient, time_block.touched)
            return result

        longer = [joined(half) for half in halves(self.time_blocks[k]) if half]
        parts: list[tuple[Sequence[TimeBlock], Sequence[CostTerm]]] = [(half, self._adding) for half in longer]
        if sum(map(len, longer)) <= 2:  # too short for halves
            parts = [(joined(self.time_blocks[k]), some) for some in (self._adding[:-1], self._adding[-1:])]
        result, *others = side_by_side(of_part, parts)
        for other in others:
            result.add(other, slice(None))
        return result

    def _here(self, k: int, coefficients: np.ndarray, static: np.ndarray, time_block: TimeBlock) -> InTrial:
        return InTrial(self.model, self.loads, self.terms, k, coefficients, static, time_block)
