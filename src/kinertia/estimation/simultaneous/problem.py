"""Terms of the simultaneous estimate: residuals, derivatives and normal equations of markers, root and priors.

All derivatives are analytic (`kinertia.motion.rigid_body`); root residuals are forces and moments about the pelvis
origin, ground axes. Frames are summed knot interval by knot interval: the normal matrix is banded in the motion and
bordered by what does not move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.elimination import Eliminated
from kinertia.estimation.simultaneous.layout import Layout
from kinertia.estimation.simultaneous.linearised import Linearised, Point, Slope
from kinertia.estimation.simultaneous.marker_terms import add_markers
from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.normal_equations import Gradient, NormalEquations, UsedAgain, add_root
from kinertia.estimation.simultaneous.observed_trial import CalibrationPrior, Observation
from kinertia.estimation.simultaneous.plate_loads import GAIN
from kinertia.estimation.simultaneous.plates import PLATE_ERRORS, ZERO_UNKNOWNS, plates_with_floor
from kinertia.estimation.simultaneous.range_terms import add_ranges
from kinertia.estimation.simultaneous.root_terms import RootFrames, columns_of
from kinertia.estimation.simultaneous.seen_markers import seen_markers
from kinertia.estimation.simultaneous.skin import SkinPatterns
from kinertia.estimation.simultaneous.start_terms import add_start
from kinertia.estimation.simultaneous.stretches import Stretch, halves, joined, stretches_of_trials
from kinertia.estimation.simultaneous.trunk_bending import BentTrunk, TrunkBending
from kinertia.model.bsp import BodySegmentParameters, block_diagonal
from kinertia.model.log_cholesky import (
    from_log_cholesky,
    nearest_consistent,
    table_jacobian,
    to_log_cholesky,
)
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.frames_at_once import pieces
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.two_threads import side_by_side

_Add = Callable[[Gradient, int, np.ndarray, np.ndarray, Stretch], None]
"""Adds terms of a stretch of a trial, given its coefficients and the static unknowns."""


class MapProblem:
    """Residuals and normal equations at a point."""

    def __init__(
        self,
        skeleton: Skeleton,
        prior: BspPrior,
        calibration: CalibrationPrior,
        trials: Sequence[Observation],
        phase: float = 0.0,
    ) -> None:
        self.skeleton, self.prior, self.calibration, self.trials = skeleton, prior, calibration, trials
        self.free = skeleton.free(calibration.coordinates)
        names = list(self.free.coordinates)
        self.moving = np.array([names.index(name) for name in skeleton.coordinates])
        self.still = np.array([names.index(name) for name in calibration.coordinates], dtype=int)
        self.segments = prior.mean.segments
        self.bases = [MotionBasis(trial.time, trial.spacing_s, phase) for trial in trials]
        self.start = [basis.fit(trial.q) for basis, trial in zip(self.bases, trials, strict=True)]
        self.plates = tuple(dict.fromkeys(name for trial in trials for name in trial.ground.plates))
        self.grounds = [trial.ground.among(self.plates) for trial in trials]
        self.to_plates = plates_with_floor(len(self.plates))
        count = len(skeleton.markers)
        self.skin = [trial.skin or SkinPatterns.none(len(trial.time), count) for trial in trials]
        self.own_plates = [[self.plates.index(name) for name in trial.ground.plates] for trial in trials]
        known = calibration.instruments
        # one trial of a session is one of several, and so may be one whose clock nobody has checked
        self.n_forces = sum(map(bool, self.own_plates))
        n_delays = self.n_forces if self.n_forces > 1 or known.session or known.clock_s.faulty_share > 0.0 else 0
        plates_of_trials = list(map(len, self.own_plates))
        unknowns = (len(self.still), count, len(self.plates), n_delays, plates_of_trials, self.skin[0].size)
        self.trunk = TrunkBending.of(prior.mean, prior.mass_kg)
        trunks = [self.trunk.prior] * len(trials) if self.trunk else []
        self.layout = Layout.of(10 * len(self.segments), *unknowns, len(trunks))
        self.columns = columns_of(self.free, self.segments, self.moving, self.still, self.layout)
        self.displacement_sd_m = [np.repeat(np.broadcast_to(trial.displacement_sd_m, count), 3) for trial in trials]
        self.information = np.linalg.inv(prior.covariance)
        self.start_static = np.zeros(self.layout.size)
        self.start_static[self.layout.theta] = to_log_cholesky(nearest_consistent(prior.mean))
        self.start_static[self.layout.coordinates] = [skeleton.locked[name] for name in calibration.coordinates]
        self.start_static[self.layout.locals] = skeleton.marker_locals.ravel()
        self._room = UsedAgain()
        self.stretches = stretches_of_trials(self.bases, len(self.moving), self.layout.size)
        deviation = np.full(self.layout.size, np.inf)
        deviation[self.layout.coordinates] = list(calibration.coordinates.values())
        deviation[self.layout.locals] = np.repeat(calibration.marker_sd_m, 3)
        n_zeros = self.layout.zeros.stop - self.layout.zeros.start
        self.instruments = calibration.instruments.of_unknowns(
            self.plates, n_delays, n_zeros, sum(plates_of_trials), trunks
        )
        self.session = calibration.instruments.of_session(self.plates)
        self.weight = 1.0 / np.square(deviation)
        self.skin_information = self.skin[0].information()

    def with_knots_moved(self, phase: float) -> MapProblem:
        """The same where splines have knots this share of an interval earlier."""
        return MapProblem(self.skeleton, self.prior, self.calibration, self.trials, phase)

    @property
    def beginning(self) -> Point:
        """Where the estimate starts: the observations' coordinates, the prior's mean, no displacements."""
        return Point(tuple(self.start), self.start_static, tuple(np.zeros_like(sd) for sd in self.displacement_sd_m))

    def bsp(self, static: np.ndarray) -> BodySegmentParameters:
        """Body segment parameters of the static unknowns."""
        return from_log_cholesky(self.segments, static[self.layout.theta])

    def placed(self, static: np.ndarray) -> Skeleton:
        """The freed skeleton with markers where the static unknowns put them."""
        return self.free.with_places(static[self.layout.locals].reshape(-1, 3))

    def shortened(self, point: Point, step: np.ndarray) -> np.ndarray:
        """A step of all unknowns from a point with no logarithm (mass, second moments) changing by more than one."""
        at, step = self.logs + sum(part.size for part in point.coefficients), step.copy()
        step[at] = np.clip(step[at], -1.0, 1.0)
        return step

    @property
    def logs(self) -> np.ndarray:
        """Where the static unknowns are logarithms: per segment of the mass, and three of square roots of second
        moments.
        """
        result: np.ndarray = np.arange(10 * len(self.segments)).reshape(-1, 10)[:, [0, 4, 5, 6]].ravel()
        return result

    def bends(self, right: np.ndarray) -> np.ndarray:
        """(S,) what Gauss-Newton leaves out of second derivatives by the logarithms, where the cost falls with them;
        from the right-hand side (S,).

        The data may ask for a mass or a second moment below zero. Towards zero the first derivatives vanish, and with
        them what holds a Gauss-Newton step back: it would promise much and keep nothing, again and again. A cost F of
        exp(x) has the second derivative F'' exp(2 x) + F' exp(x), and the last term is the slope by x; by the logarithm
        of a square root it is twice the slope.
        """
        slope = -right[self.logs].reshape(-1, 4)
        result = np.zeros(self.layout.size)
        result[self.logs] = (np.maximum(slope, 0.0) * [1.0, 2.0, 2.0, 2.0]).ravel()
        return result

    def full(self, parts: Sequence[np.ndarray], static: np.ndarray) -> list[np.ndarray]:
        """Coordinates and derivatives of the freed skeleton: the static ones do not move."""
        result = []
        for order, part in enumerate(parts):
            every = np.zeros((len(part), len(self.free.coordinates)))
            every[:, self.moving] = part
            if order == 0:
                every[:, self.still] = static[self.layout.coordinates]
            result.append(every)
        return result

    def prior_information(self, static: np.ndarray) -> np.ndarray:
        """(S, S) of all priors but the instruments'; of these, of what other people of the session have shown."""
        theta, skin, laboratory = self.layout.theta, self.layout.skin, self.layout.laboratory
        jacobian = block_diagonal(table_jacobian(static[theta]))
        mass_row = self.prior.on_scale @ jacobian[0::10] / self.prior.mass_sd_kg
        result = np.diag(self.weight)
        result[laboratory, laboratory] += self.session.information
        result[skin, skin] += self.skin_information
        result[theta, theta] += jacobian.T @ self.information @ jacobian + np.outer(mass_row, mass_row)
        return result

    def prior_slope(self, static: np.ndarray) -> tuple[np.ndarray, float]:
        """Minus the derivatives (S,) of half the sum of squares of the same priors, and that half."""
        theta, skin, laboratory = self.layout.theta, self.layout.skin, self.layout.laboratory
        bsp, by_own = self.bsp(static), table_jacobian(static[theta])
        gap = (bsp.table() - self.prior.mean.table()).ravel()
        mass_gap = (float(self.prior.on_scale @ bsp.mass_kg) - self.prior.mass_kg) / self.prior.mass_sd_kg
        pulls = (self.information @ gap).reshape(-1, 10)
        pulls[:, 0] += mass_gap / self.prior.mass_sd_kg * self.prior.on_scale
        right = -self.weight * (static - self.start_static)
        cost = float(np.sum(self.weight * np.square(static - self.start_static)))
        by_session = self.session.information @ static[laboratory]
        right[laboratory] += self.session.right - by_session
        cost += float(static[laboratory] @ (by_session - 2.0 * self.session.right))
        by_skin = self.skin_information @ static[skin]
        right[skin] -= by_skin
        cost += float(static[skin] @ by_skin)
        right[theta] -= np.einsum("bi,bij->bj", pulls, by_own).ravel()
        cost += float(gap @ self.information @ gap) + mass_gap**2
        return right, 0.5 * cost

    def at(self, point: Point, damping: float = 0.0) -> Linearised:
        """Normal equations at a point, motions eliminated with their diagonal raised by this share."""
        rows = enumerate(point.coefficients)
        trials = tuple(self.eliminated(k, part, self.in_trial(k, point), damping) for k, part in rows)
        slope = self._slope(point, [trial.gradient for trial in trials])
        return Linearised(slope, trials, self.prior_information(point.static))

    def slope(self, point: Point) -> Slope:
        """Cost and where it falls: what `at` has, in a tenth of the time."""
        rows = enumerate(point.coefficients)
        return self._slope(point, [self.gradient(k, part, self.in_trial(k, point)) for k, part in rows])

    def _slope(self, point: Point, gradients: Sequence[Gradient]) -> Slope:
        """With the priors."""
        right, cost = self.prior_slope(point.static)
        rows, motions, displaced = zip(gradients, self.displacement_sd_m, point.displaced, strict=True), [], []
        for gradient, sd, own in rows:
            right = right + gradient.static_right
            cost += gradient.cost + 0.5 * float(own @ own)
            motions.append(gradient.right)
            displaced.append(sd * gradient.static_right[self.layout.locals] - own)
        before, places = sum(motion.size for motion in motions), self.layout.instruments
        instruments = slice(before + places.start, before + places.stop)
        return Slope(point, cost, Point(tuple(motions), right, tuple(displaced)).vector, instruments)

    def in_trial(self, k: int, point: Point) -> np.ndarray:
        """(S,) static unknowns as they are in trial k: its markers displaced."""
        static = point.static.copy()
        static[self.layout.locals] += self.displacement_sd_m[k] * point.displaced[k]
        return static

    def plate_errors(self, static: np.ndarray) -> np.ndarray:
        """(p, 5) what is wrong with every plate in all trials, in the order of PLATE_ERRORS."""
        result: np.ndarray = (self.to_plates @ static[self.layout.plates]).reshape(-1, len(PLATE_ERRORS))
        return result

    def plate_sd(self, covariance: np.ndarray) -> np.ndarray:
        """(p, 5) deviations of `plate_errors` for this covariance (S, S) of the static unknowns."""
        own = covariance[self.layout.plates, self.layout.plates]
        return np.sqrt(np.diag(self.to_plates @ own @ self.to_plates.T)).reshape(-1, len(PLATE_ERRORS))

    def foot_loads(
        self, k: int, static: np.ndarray, derivative: int = 0, frames: slice | np.ndarray = slice(None)
    ) -> np.ndarray:
        """(n, 2, 6) loads on the feet at the frames of trial k, of instruments put right; or their time derivatives."""
        ground, at = self.grounds[k], self.trials[k].time[frames] + self.late_s(k, static)
        return ground.corrected(at, ground.carrier[frames], self.plates_in(k, static), derivative)

    def reactions(self, k: int, static: np.ndarray) -> GroundReactions:
        """The loads for the joint moments of trial k, of instruments put right."""
        return self.grounds[k].corrected_reactions(self.plates_in(k, static), self.late_s(k, static))

    def plates_in(self, k: int, static: np.ndarray) -> np.ndarray:
        """(p, 7) what is wrong with every plate in trial k: PLATE_ERRORS, ZERO_UNKNOWNS."""
        errors, zeros = self.plate_errors(static), np.zeros((len(self.plates), len(ZERO_UNKNOWNS)))
        errors[self.own_plates[k], GAIN] += static[self.layout.gains_of(k)]
        zeros[self.own_plates[k]] = static[self.layout.zeros_of(k)]
        return np.hstack([errors, zeros])

    def late_s(self, k: int, static: np.ndarray) -> float:
        """By how much the forces of trial k are late."""
        return float(static[self.layout.late(k)].sum())

    def eliminated(
        self,
        k: int,
        coefficients: np.ndarray,
        static: np.ndarray,
        damping: float = 0.0,
        bordered: bool = True,
    ) -> Eliminated:
        """Trial k with its motion eliminated; not `bordered`: of the motion alone, with all else held."""
        of = partial(self.normal, k, coefficients, static, bordered=bordered)
        return Eliminated.of(self.stretches[k], of, self._room.back, damping)

    def normal(
        self,
        k: int,
        coefficients: np.ndarray,
        static: np.ndarray,
        stretch: Stretch | None = None,
        bordered: bool = True,
    ) -> NormalEquations:
        """Normal equations of a stretch of trial k, or of all of it."""
        stretch = stretch or Stretch.whole(self.bases[k])
        result = self._room.zero(stretch.size, len(self.moving), self.layout.size, bordered)
        for add in self._terms:
            add(result, k, coefficients, static, stretch)
        return result

    def gradient(self, k: int, coefficients: np.ndarray, static: np.ndarray) -> Gradient:
        """Cost of trial k and where it falls."""

        def of_part(part: tuple[Sequence[Stretch], Sequence[_Add]]) -> Gradient:
            result = Gradient.zero(len(coefficients), len(self.moving), self.layout.size)
            for stretch in part[0]:
                own = Gradient.zero(stretch.size, len(self.moving), self.layout.size)
                for add in part[1]:
                    add(own, k, coefficients, static, stretch)
                result.add(own, stretch.touched)
            return result

        (of_markers, of_root), longer = self._terms, [joined(half) for half in halves(self.stretches[k]) if half]
        parts: list[tuple[Sequence[Stretch], Sequence[_Add]]] = [(half, self._terms) for half in longer]
        if sum(map(len, longer)) <= 2:  # too short for halves
            parts = [(joined(self.stretches[k]), [add]) for add in (of_markers, of_root)]
        result, *others = side_by_side(of_part, parts)
        for other in others:
            result.add(other, slice(None))
        return result

    @property
    def _terms(self) -> tuple[_Add, _Add]:
        """What adds the terms of a stretch of trial k."""
        return self._add_to_markers, self._add_to_root

    def _add_to_markers(
        self, into: Gradient, k: int, coefficients: np.ndarray, static: np.ndarray, stretch: Stretch
    ) -> None:
        """Add those of markers, ranges and the start."""
        trial, basis, layout = self.trials[k], self.bases[k], self.layout
        near = stretch.with_neighbours
        noise, skin = trial.marker_process, (self.skin[k].cut(near), static[layout.skin])
        q = self.full(basis.evaluate(coefficients, near), static)[0]
        markers = seen_markers(self.placed(static), trial.markers[near], q, noise, skin, self.moving, self.still)
        add_markers(into, layout.in_markers, basis, stretch, markers, len(self.still))
        inside = slice(stretch.frames.start - near.start, stretch.frames.stop - near.start)
        add_ranges(into, basis, stretch, self.skeleton.bounds, q[inside][:, self.moving])
        add_start(into, stretch, coefficients - self.start[k])

    def _add_to_root(
        self, into: Gradient, k: int, coefficients: np.ndarray, static: np.ndarray, stretch: Stretch
    ) -> None:
        """Add those of the root equations."""
        basis, start, skeleton = self.bases[k], stretch.splines.start, self.placed(static)
        dynamic = stretch.frames.start + np.flatnonzero(self.trials[k].dynamic[stretch.frames])
        for piece in pieces(len(dynamic)):
            root = self.root_frames(k, skeleton, coefficients, static, dynamic[piece])
            if isinstance(into, NormalEquations):
                add_root(into, self.layout.in_root, basis, start, root.terms(self.columns))
            else:
                root.add_gradient(into, self.columns, basis, start)

    def root_frames(
        self, k: int, skeleton: Skeleton, coefficients: np.ndarray, static: np.ndarray, frames: np.ndarray
    ) -> RootFrames:
        """The root equations of trial k at some of its dynamic frames."""
        trial, ground = self.trials[k], self.grounds[k]
        motion = Motion(*self.full(self.bases[k].evaluate(coefficients, frames), static))
        loads = self.foot_loads(k, static, 0, frames)
        loaded = ground.loaded(trial.time[frames] + self.late_s(k, static))
        by_plates = ground.by_plate(loads, loaded, ground.carrier[frames], self.plates_in(k, static)).sum(axis=1)
        result = RootFrames(
            skeleton,
            self.bsp(static),
            static[self.layout.theta],
            motion,
            loads.sum(axis=1),
            by_plates,
            self.foot_loads(k, static, 1, frames).sum(axis=1)[..., None],
            partial(self.add_by_ground, k),
            trial.root_sd(frames),
            frames,
            self.layout.in_root.stop,
        )
        if self.trunk is None:
            return result
        return result.bent(BentTrunk(self.trunk, static[self.layout.trunks][k], self.layout.trunks.start + k))

    def add_by_ground(self, k: int, by_static: np.ndarray, by_plates: np.ndarray, by_own: np.ndarray) -> None:
        """`add_by_plates`, and those by what trial k has of its own (n, r, 1 or 2): the time by which its forces are
        late, and how much the trunk bends.
        """
        self.add_by_plates(k, by_static, by_plates)
        by_static[:, :, self.layout.late(k)] += by_own[:, :, :1]
        by_static[:, :, self.layout.trunks.start + k : self.layout.trunks.stop][..., :1] += by_own[:, :, 1:]

    def add_by_plates(self, k: int, by_static: np.ndarray, by_plates: np.ndarray) -> None:
        """Add derivatives (n, r, p, 7) by what is wrong with the plates in trial k to those by the static unknowns that
        root equations depend on (n, r, s).
        """
        n, rows, *_ = by_plates.shape
        errors = len(PLATE_ERRORS)
        by_static[:, :, self.layout.plates] += by_plates[..., :errors].reshape(n, rows, -1) @ self.to_plates
        by_static[:, :, self.layout.zeros_of(k)] += by_plates[:, :, self.own_plates[k], errors:]
        by_static[:, :, self.layout.gains_of(k)] += by_plates[:, :, self.own_plates[k], GAIN]
