"""Motion, body segment parameters and calibration in one maximum-a-posteriori estimate (DESIGN section 6).

Unknowns: quintic spline coefficients of every coordinate (uniform knots; their spacing follows the cutoff); log-Cholesky
parameters of every segment; static coordinates (joint-centre offsets), marker positions in their segments, each plate's
in-plane offset and each trial's time offset. Minimised is the sum of squares, each over its deviation, of: marker errors, root
residuals, and departures from the priors. Gauss-Newton with Levenberg damping, all derivatives analytic. The normal matrix
is block tridiagonal in time with a border of static unknowns (`block_band`); its Schur complement is the information on
them, and its inverse their covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from kinertia.block_band import BlockBand
from kinertia.bsp import BodySegmentParameters
from kinertia.calibration import marker_jacobian
from kinertia.dynamics import Motion, root_axes
from kinertia.log_cholesky import (
    dynamic_jacobian,
    from_log_cholesky,
    nearest_consistent,
    table_jacobian,
    to_log_cholesky,
)
from kinertia.motion_basis import MotionBasis
from kinertia.skeleton import Marker, Skeleton
from kinertia.splines import SmoothedSpline


@dataclass(frozen=True)
class Prior:
    """Gaussian prior of body segment parameters, and what symmetry and the scale say.

    Attributes:
        mean: need not be physically consistent (a start off by 50 % is not); the estimate always is.
        covariance: (10 s, 10 s) of the table rows (mass, CoM, moments, products), segment after segment.
        symmetry_sd: (10,) deviation of right minus mirrored left, per parameter kind, relative to nothing (kg, m, kg m2).
        mass_kg, mass_sd_kg: the scale's total mass.
    """

    mean: BodySegmentParameters
    covariance: np.ndarray
    mass_kg: float
    mass_sd_kg: float


@dataclass(frozen=True)
class Observation:
    """One trial as the estimator sees it.

    Attributes:
        time: (n,) s, uniform.
        markers: (n, m, 3) m in the order of the skeleton's markers; NaN where not seen.
        marker_sd: (m,) effective white deviation, m (inflated by the square root of the noise's correlation length).
        q: (n, c) start.
        dynamic: (n,) frames whose ground contacts are all measured.
        plates: (time -> 6 p) smoothed force and moment about the ground origin of every plate; evaluated at `time` + offset.
        force_sd, moment_sd: effective deviations of the root residual, N and N m.
    """

    time: np.ndarray
    markers: np.ndarray
    marker_sd: np.ndarray
    q: np.ndarray
    dynamic: np.ndarray
    plates: SmoothedSpline
    force_sd: float
    moment_sd: float

    @property
    def n_plates(self) -> int:
        """Number of force plates."""
        return len(self.plates.p) // 6


@dataclass(frozen=True)
class Static:
    """Unknowns that do not move, with the deviations of their priors."""

    coordinates: dict[str, float]
    marker_sd_m: np.ndarray
    plate_sd_m: float
    clock_sd_s: float


@dataclass(frozen=True)
class _Layout:
    """Where each kind of static unknown stands in the vector."""

    theta: slice
    coordinates: slice
    locals: slice
    plates: tuple[slice, ...]
    clocks: tuple[int, ...]
    size: int

    @classmethod
    def of(cls, n_bsp: int, n_coordinates: int, n_markers: int, n_plates: Sequence[int]) -> _Layout:
        at = n_bsp + n_coordinates + 3 * n_markers
        plates, clocks = [], []
        for count in n_plates:
            plates.append(slice(at, at + 2 * count))
            clocks.append(at + 2 * count)
            at += 2 * count + 1
        return cls(
            slice(0, n_bsp),
            slice(n_bsp, n_bsp + n_coordinates),
            slice(n_bsp + n_coordinates, n_bsp + n_coordinates + 3 * n_markers),
            tuple(plates),
            tuple(clocks),
            at,
        )


@dataclass
class _Normal:
    """Normal equations of one trial: banded (size, 6, c, c), border (size, c, S), static (S, S) and right-hand sides."""

    band: np.ndarray
    border: np.ndarray
    static: np.ndarray
    right: np.ndarray
    static_right: np.ndarray
    cost: float


class _Problem:
    """Residuals and normal equations at a point."""

    def __init__(
        self, skeleton: Skeleton, prior: Prior, static: Static, trials: Sequence[Observation], spacing_s: float
    ) -> None:
        self.skeleton, self.prior, self.static, self.trials = skeleton, prior, static, trials
        self.free = skeleton.free(static.coordinates)
        names = list(self.free.coordinates)
        self.moving = np.array([names.index(name) for name in skeleton.coordinates])
        self.still = np.array([names.index(name) for name in static.coordinates], dtype=int)
        self.segments = prior.mean.segments
        self.bases = [MotionBasis(trial.time, spacing_s) for trial in trials]
        self.layout = _Layout.of(
            10 * len(self.segments), len(self.still), len(skeleton.markers), [trial.n_plates for trial in trials]
        )
        self.information = np.linalg.inv(prior.covariance)
        self.start_static = np.zeros(self.layout.size)
        self.start_static[self.layout.theta] = to_log_cholesky(nearest_consistent(prior.mean))
        self.start_static[self.layout.coordinates] = [skeleton.locked[name] for name in static.coordinates]
        self.start_static[self.layout.locals] = skeleton.marker_locals.ravel()
        deviation = np.full(self.layout.size, np.inf)
        deviation[self.layout.coordinates] = list(static.coordinates.values())
        deviation[self.layout.locals] = static.marker_sd_m
        for plates, clock in zip(self.layout.plates, self.layout.clocks, strict=True):
            deviation[plates], deviation[clock] = static.plate_sd_m, static.clock_sd_s
        self.weight = 1.0 / np.square(deviation)

    def bsp(self, static: np.ndarray) -> BodySegmentParameters:
        return from_log_cholesky(self.segments, static[self.layout.theta])

    def placed(self, static: np.ndarray) -> Skeleton:
        """The freed skeleton with markers where the static unknowns put them."""
        positions = static[self.layout.locals].reshape(-1, 3)
        markers = [Marker(m.label, m.segment, p) for m, p in zip(self.skeleton.markers, positions, strict=True)]
        return self.free.with_markers(markers)

    def shortened(self, step: np.ndarray) -> np.ndarray:
        """The step with no logarithm (mass, second moments) changing by more than one."""
        logs = np.arange(10 * len(self.segments)).reshape(-1, 10)[:, [0, 4, 5, 6]].ravel()
        step = step.copy()
        step[logs] = np.clip(step[logs], -1.0, 1.0)
        return step

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

    def prior_terms(self, static: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Information (S, S), right-hand side (S,) and cost of all priors."""
        bsp = self.bsp(static)
        jacobian = _block_diagonal(table_jacobian(static[self.layout.theta]))
        gap = (bsp.table() - self.prior.mean.table()).ravel()
        mass_row = jacobian[0::10].sum(axis=0) / self.prior.mass_sd_kg
        mass_gap = (bsp.total_mass_kg - self.prior.mass_kg) / self.prior.mass_sd_kg
        information = np.diag(self.weight)
        right = -self.weight * (static - self.start_static)
        cost = float(np.sum(self.weight * np.square(static - self.start_static)))
        theta = self.layout.theta
        information[theta, theta] += jacobian.T @ self.information @ jacobian + np.outer(mass_row, mass_row)
        right[theta] -= jacobian.T @ (self.information @ gap) + mass_row * mass_gap
        return information, right, 0.5 * (cost + float(gap @ self.information @ gap) + mass_gap**2)

    def cost(self, coefficients: Sequence[np.ndarray], static: np.ndarray) -> float:
        """Half the sum of squares."""
        total = self.prior_terms(static)[2]
        skeleton, bsp = self.placed(static), self.bsp(static)
        for k, trial in enumerate(self.trials):
            q, qd, qdd = self.full(self.bases[k].evaluate(coefficients[k]), static)
            errors = trial.markers - skeleton.marker_positions(skeleton.pose(q))
            total += 0.5 * float(np.nansum(np.square(errors / trial.marker_sd[:, None])))
            frames = np.flatnonzero(trial.dynamic)
            model = skeleton.model_with(bsp)
            data = model.createData()
            tau = np.array([pin.rnea(model, data, q[i], qd[i], qdd[i])[:6] for i in frames])
            wrench, _ = self.wrench(k, static)
            left = (tau - _generalised(q[frames, :6], wrench[frames])) / self.root_sd(trial)
            total += 0.5 * float(np.square(left).sum())
        return total

    def root_sd(self, trial: Observation) -> np.ndarray:
        return np.repeat([trial.force_sd, trial.moment_sd], 3)

    def wrench(self, k: int, static: np.ndarray, derivative: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Sum of plates (n, 6) about the ground origin at the corrected place and time, and each plate's force (n, p, 3);
        or their time derivatives.
        """
        trial = self.trials[k]
        at = trial.time + static[self.layout.clocks[k]]
        loads = trial.plates(at, derivative).reshape(len(trial.time), -1, 6)
        force = loads[:, :, :3]
        offset = np.zeros((trial.n_plates, 3))
        offset[:, [0, 2]] = static[self.layout.plates[k]].reshape(-1, 2)
        moment = loads[:, :, 3:] + np.cross(offset, force)
        return np.concatenate([force.sum(axis=1), moment.sum(axis=1)], axis=1), force

    def normal(self, k: int, coefficients: np.ndarray, static: np.ndarray) -> _Normal:
        """Normal equations of trial k."""
        trial, basis, layout = self.trials[k], self.bases[k], self.layout
        parts = self.full(basis.evaluate(coefficients), static)
        skeleton = self.placed(static)
        c = len(self.moving)
        normal = _Normal(
            np.zeros((basis.size, 6, c, c)),
            np.zeros((basis.size, c, layout.size)),
            np.zeros((layout.size, layout.size)),
            np.zeros((basis.size, c)),
            np.zeros(layout.size),
            0.0,
        )
        marker = self._marker_terms(trial, skeleton, parts[0])
        root = self._root_terms(k, skeleton, parts, static)
        _assemble(normal, basis, marker, root)
        return normal

    def _marker_terms(self, trial: Observation, skeleton: Skeleton, q: np.ndarray) -> tuple[np.ndarray, ...]:
        """Per frame J^T J (n, c, c), J^T S (n, c, S), J^T r (n, c); and S^T S (S, S), S^T r (S,), r^T r."""
        n, m = trial.markers.shape[:2]
        pose = skeleton.pose(q)
        weight = 1.0 / trial.marker_sd[None, :, None]
        error = (trial.markers - skeleton.marker_positions(pose)) * weight
        seen = np.isfinite(error)
        error = np.where(seen, error, 0.0)
        jacobian = marker_jacobian(skeleton, pose) * (weight * seen)[..., None]
        turned = pose.rotation[:, skeleton.marker_segments] * (weight * seen)[..., None]
        moving = jacobian[..., self.moving].reshape(n, 3 * m, -1)
        still = jacobian[..., self.still].reshape(n, 3 * m, -1)
        transposed = moving.transpose(0, 2, 1)
        across = np.zeros((n, moving.shape[-1], self.layout.size))
        across[:, :, self.layout.coordinates] = transposed @ still
        by_marker = jacobian[..., self.moving].transpose(0, 1, 3, 2) @ turned
        across[:, :, self.layout.locals] = by_marker.transpose(0, 2, 1, 3).reshape(n, -1, 3 * m)
        gradient = (transposed @ error.reshape(n, -1, 1))[..., 0]
        static = np.zeros((self.layout.size, self.layout.size))
        at, of = self.layout.locals, self.layout.coordinates
        flat = still.reshape(n * 3 * m, -1) if still.size else np.zeros((n * 3 * m, 0))
        static[of, of] = flat.T @ flat
        own = np.einsum("nmij,nmik->mjk", turned, turned)
        for i in range(m):
            block = slice(at.start + 3 * i, at.start + 3 * i + 3)
            static[block, block] = own[i]
        mixed = np.einsum("nmik,nmij->kmj", jacobian[..., self.still], turned).reshape(-1, 3 * m)
        static[of, at], static[at, of] = mixed, mixed.T
        right = np.zeros(self.layout.size)
        right[of] = flat.T @ error.ravel()
        right[at] = np.einsum("nmij,nmi->mj", turned, error).ravel()
        return transposed @ moving, across, gradient, static, right, float(np.square(error).sum())

    def _root_terms(
        self, k: int, skeleton: Skeleton, parts: Sequence[np.ndarray], static: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """At the dynamic frames: indices, rows by q, qd, qdd (each d, 6, c), by static unknowns (d, 6, S), residual (d, 6)."""
        trial, layout = self.trials[k], self.layout
        frames = np.flatnonzero(trial.dynamic)
        q, qd, qdd = (part[frames] for part in parts)
        bsp = self.bsp(static)
        model = skeleton.model_with(bsp)
        data, bare, bare_data = model.createData(), skeleton.model, skeleton.model.createData()
        joints, place = skeleton.placement_of_parameters(self.segments)
        columns = (10 * (joints - 1)[:, None] + np.arange(10)).ravel()
        d, cf = len(frames), q.shape[1]
        dq, dv, da = np.empty((d, 6, cf)), np.empty((d, 6, cf)), np.empty((d, 6, cf))
        tau, regressor = np.empty((d, 6)), np.empty((d, 6, len(columns)))
        for i in range(d):
            pin.computeRNEADerivatives(model, data, q[i], qd[i], qdd[i])
            tau[i] = data.tau[:6]
            dq[i], dv[i], da[i] = data.dtau_dq[:6], data.dtau_dv[:6], data.M[:6]
            regressor[i] = pin.computeJointTorqueRegressor(bare, bare_data, q[i], qd[i], qdd[i])[:6, columns]
        square = da[:, :, :6]
        da[:, :, :6] = np.triu(square) + np.triu(square, 1).transpose(0, 2, 1)
        wrench, force = (part[frames] for part in self.wrench(k, static))
        dq[:, :, :6] -= _generalised_derivative(q[:, :6], wrench)
        by_segment = (regressor.reshape(d, 6, len(joints), 1, 10) @ place).reshape(d, 6, len(joints), 10)
        by_static = np.zeros((d, 6, layout.size))
        chain = dynamic_jacobian(static[layout.theta])
        by_static[:, :, layout.theta] = np.einsum("drsi,sij->drsj", by_segment, chain).reshape(d, 6, -1)
        by_static[:, :, layout.coordinates] = dq[:, :, self.still]
        for plate in range(trial.n_plates):
            for j, axis in enumerate(np.eye(3)[[0, 2]]):
                moment = np.concatenate([np.zeros((d, 3)), np.cross(axis, force[:, plate])], axis=1)
                by_static[:, :, layout.plates[k].start + 2 * plate + j] = -_generalised(
                    np.hstack([np.zeros((d, 3)), q[:, 3:6]]), moment
                )
        rates = self.wrench(k, static, 1)[0][frames]
        by_static[:, :, layout.clocks[k]] = -_generalised(q[:, :6], rates)
        sd = self.root_sd(trial)[None, :, None]
        left = (tau - _generalised(q[:, :6], wrench)) / sd[..., 0]
        return frames, dq[..., self.moving] / sd, dv[..., self.moving] / sd, da[..., self.moving] / sd, by_static / sd, left


def _block_diagonal(blocks: np.ndarray) -> np.ndarray:
    s, k, _ = blocks.shape
    result = np.zeros((s, k, s, k))
    result[np.arange(s), :, np.arange(s), :] = blocks
    return result.reshape(s * k, s * k)


def _generalised(root: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Root generalised force (n, 6) of a wrench about the ground origin."""
    moment = wrench[:, 3:] - np.cross(root[:, :3], wrench[:, :3])
    return np.concatenate([wrench[:, :3], np.einsum("nij,ni->nj", root_axes(root), moment)], axis=1)


def _generalised_derivative(root: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """(n, 6, 6) derivative of `_generalised` with respect to the root coordinates."""
    axes = root_axes(root)
    moment = wrench[:, 3:] - np.cross(root[:, :3], wrench[:, :3])
    result = np.zeros((len(root), 6, 6))
    for i, unit in enumerate(np.eye(3)):
        result[:, 3:, i] = -np.einsum("nij,ni->nj", axes, np.cross(unit, wrench[:, :3]))
    for later in range(3):
        for earlier in range(later):
            turned = np.cross(axes[:, :, earlier], axes[:, :, later])
            result[:, 3 + later, 3 + earlier] = np.einsum("ni,ni->n", turned, moment)
    return result


def _assemble(normal: _Normal, basis: MotionBasis, marker: tuple[np.ndarray, ...], root: tuple[np.ndarray, ...]) -> None:
    """Sum the terms of all frames into the normal equations, one knot interval at a time."""
    per_frame, across, gradient, static, right, square = marker
    frames, dq, dv, da, by_static, left = root
    c, size = per_frame.shape[1], normal.static.shape[0]
    flat = by_static.reshape(-1, size)
    normal.static += static + flat.T @ flat
    normal.static_right += right - flat.T @ left.ravel()
    normal.cost = 0.5 * (square + float(np.square(left).sum()))
    values = basis.values
    for first in np.unique(basis.first):
        here = np.flatnonzero(basis.first == first)
        weight = values[0, here]
        pairs = (weight[:, :, None] * weight[:, None]).reshape(len(here), 36)
        block = (pairs.T @ per_frame[here].reshape(len(here), -1)).reshape(6, 6, c, c)
        border = (weight.T @ across[here].reshape(len(here), -1)).reshape(6, c, size)
        up = weight.T @ gradient[here]
        rows = np.flatnonzero(np.isin(frames, here, assume_unique=True))
        if rows.size:
            at = frames[rows]
            x = sum(values[order, at][:, None, :, None] * part[rows][:, :, None] for order, part in enumerate((dq, dv, da)))
            x = x.reshape(len(rows) * 6, 6 * c)
            block += (x.T @ x).reshape(6, c, 6, c).transpose(0, 2, 1, 3)
            border += (x.T @ by_static[rows].reshape(-1, size)).reshape(6, c, size)
            up -= (x.T @ left[rows].ravel()).reshape(6, c)
        normal.border[first : first + 6] += border
        normal.right[first : first + 6] += up
        for a in range(6):
            normal.band[first + a, : 6 - a] += block[a, a:]


@dataclass(frozen=True)
class SimultaneousResult:
    """Outcome of `estimate_simultaneous`.

    Attributes:
        bsp: the estimate, physically consistent.
        bsp_covariance: (10 s, 10 s) posterior covariance of its table rows, segment after segment.
        skeleton: with the estimated marker positions and static coordinates.
        coordinates: static coordinate -> (value, posterior deviation), rad or m.
        plate_offsets_m: per trial (p, 2) x and z, and their posterior deviations (p, 2).
        clock_s: per trial the time offset and its posterior deviation, s.
        motions: per trial q, qd, qdd at its frames.
        residuals: per trial (n, 6) root residual at the dynamic frames' rows, NaN elsewhere; force N, moment N m in ground axes.
        converged: the last step lowered the cost by less than a share of CONVERGED.
        iterations: Gauss-Newton steps taken.
        cost: half the sum of squares, at the start and at the end.
    """

    bsp: BodySegmentParameters
    bsp_covariance: np.ndarray
    skeleton: Skeleton
    coordinates: dict[str, tuple[float, float]]
    plate_offsets_m: tuple[tuple[np.ndarray, np.ndarray], ...]
    clock_s: tuple[tuple[float, float], ...]
    motions: tuple[Motion, ...]
    converged: bool
    iterations: int
    cost: tuple[float, float]


CONVERGED = 1e-5
_MAX_ITERATIONS = 40


def estimate_simultaneous(
    skeleton: Skeleton, prior: Prior, static: Static, trials: Sequence[Observation], spacing_s: float
) -> SimultaneousResult:
    """Maximum-a-posteriori motion, BSPs and calibration of one person from one or more trials."""
    problem = _Problem(skeleton, prior, static, trials, spacing_s)
    coefficients = [basis.fit(trial.q) for basis, trial in zip(problem.bases, trials, strict=True)]
    values = problem.start_static.copy()
    begin = current = problem.cost(coefficients, values)
    damping, iterations, converged = 1e-3, 0, False
    scale = np.zeros(len(values))
    while iterations < _MAX_ITERATIONS and not converged:
        normals = [problem.normal(k, part, values) for k, part in enumerate(coefficients)]
        prior_terms = problem.prior_terms(values)
        iterations += 1
        scale = np.maximum(scale, np.diag(prior_terms[0]) + sum(np.diag(normal.static) for normal in normals))
        for _ in range(12):
            step, moves = _step(normals, prior_terms, damping, scale)
            step = problem.shortened(step)
            trial_values = values + step
            trial_coefficients = [old + move for old, move in zip(coefficients, moves, strict=True)]
            new = problem.cost(trial_coefficients, trial_values)
            if new < current:
                break
            damping *= 10.0
        else:
            break
        converged = current - new < CONVERGED * current and damping <= 1e-3
        values, coefficients, current = trial_values, trial_coefficients, new
        damping = max(damping * 0.1, 1e-9)
    normals = [problem.normal(k, part, values) for k, part in enumerate(coefficients)]
    information = problem.prior_terms(values)[0] + sum(_reduced(normal, 0.0)[0] for normal in normals)
    return _result(problem, coefficients, values, np.linalg.inv(information), converged, iterations, (begin, current))


def _step(
    normals: Sequence[_Normal], prior: tuple[np.ndarray, np.ndarray, float], damping: float, scale: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    information, right = prior[0].copy(), prior[1].copy()
    reduced = [_reduced(normal, damping) for normal in normals]
    for schur, reduced_right, *_ in reduced:
        information += schur
        right += reduced_right
    information[np.diag_indices_from(information)] += damping * scale
    step = np.linalg.solve(information, right)
    moves = []
    for (_, _, band, border, motion), normal in zip(reduced, normals, strict=True):
        size, c = normal.right.shape
        move = band.backward(motion - border @ step[:, None])
        moves.append(move.reshape(-1, c)[:size])
    return step, moves


def _reduced(normal: _Normal, damping: float) -> tuple[np.ndarray, np.ndarray, BlockBand, np.ndarray, np.ndarray]:
    """Schur complement (S, S) and right-hand side (S,) of the static unknowns, with what back-substitution needs."""
    diagonal, below = _blocks(normal.band, damping)
    band = BlockBand.factor(diagonal, below)
    b, k, _ = diagonal.shape
    size, c, s = normal.border.shape
    right = np.zeros((b * 5, c, s + 1))
    right[:size, :, :s], right[:size, :, s] = normal.border, normal.right
    solved = band.forward(right.reshape(b, k, s + 1))
    border, motion = solved[..., :s], solved[..., s:]
    flat = border.reshape(-1, s)
    return normal.static - flat.T @ flat, normal.static_right - flat.T @ motion.ravel(), band, border, motion


def _blocks(band: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """Blocks of five splines: diagonal (b, 5 c, 5 c) and below it (b - 1, 5 c, 5 c)."""
    size, _, c, _ = band.shape
    b = -(-size // 5)
    padded = np.zeros((5 * b + 5, 6, c, c))
    padded[:size] = band
    diagonal, below = np.zeros((b, 5, c, 5, c)), np.zeros((b, 5, c, 5, c))
    for i in range(5):
        rows = padded[i : 5 * b : 5]
        for offset in range(6):
            j = i + offset
            if j < 5:
                diagonal[:, i, :, j, :] += rows[:, offset]
                if offset:
                    diagonal[:, j, :, i, :] += rows[:, offset].transpose(0, 2, 1)
            else:
                below[:, j - 5, :, i, :] = rows[:, offset].transpose(0, 2, 1)
    diagonal = diagonal.reshape(b, 5 * c, 5 * c)
    inside = np.arange(5 * b * c) < size * c
    entries = np.einsum("bii->bi", diagonal)
    entries *= 1.0 + damping
    entries += np.where(inside, 1e-6, 1.0).reshape(b, -1)
    return diagonal, below.reshape(b, 5 * c, 5 * c)[:-1]


def _result(
    problem: _Problem,
    coefficients: Sequence[np.ndarray],
    values: np.ndarray,
    covariance: np.ndarray,
    converged: bool,
    iterations: int,
    cost: tuple[float, float],
) -> SimultaneousResult:
    layout = problem.layout
    bsp = problem.bsp(values)
    chain = _block_diagonal(table_jacobian(values[layout.theta]))
    sd = np.sqrt(np.diag(covariance))
    names = list(problem.static.coordinates)
    found = {
        name: (float(value), float(dev))
        for name, value, dev in zip(names, values[layout.coordinates], sd[layout.coordinates], strict=True)
    }
    markers = problem.placed(values).markers
    skeleton = problem.skeleton.with_markers(markers).lock({name: value for name, (value, _) in found.items()})
    return SimultaneousResult(
        bsp,
        chain @ covariance[layout.theta, layout.theta] @ chain.T,
        skeleton,
        found,
        tuple((values[p].reshape(-1, 2), sd[p].reshape(-1, 2)) for p in layout.plates),
        tuple((float(values[i]), float(sd[i])) for i in layout.clocks),
        tuple(Motion(*basis.evaluate(part)) for basis, part in zip(problem.bases, coefficients, strict=True)),
        converged,
        iterations,
        cost,
    )
