"""Terms of the simultaneous estimate: residuals, derivatives and normal equations of markers, root and priors.

All derivatives are analytic, and come from Pinocchio's Jacobian, RNEA derivatives and joint torque regressor. Frames
are summed knot interval by knot interval: the normal matrix is banded in the motion and bordered by what does not move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from kinertia.bsp import BodySegmentParameters
from kinertia.bsp_prior import BspPrior
from kinertia.ik import ancestor_of, normal_equations
from kinertia.log_cholesky import (
    dynamic_jacobian,
    from_log_cholesky,
    nearest_consistent,
    table_jacobian,
    to_log_cholesky,
)
from kinertia.motion_basis import MotionBasis
from kinertia.normal_equations import NormalEquations, assemble
from kinertia.skeleton import Marker, Skeleton
from kinertia.splines import SmoothedSpline

COEFFICIENT_SD = 1.0
"""Weak pull of every spline coefficient to its start (rad, m): the outermost splines hardly touch the data."""


@dataclass(frozen=True)
class Observation:
    """One trial as the estimator sees it.

    Attributes:
        time: (n,) s, uniform.
        markers: (n, m, 3) m in the order of the skeleton's markers; NaN where not seen.
        marker_sd: (m,) effective white deviation, m (inflated by the square root of the noise's correlation length).
        q: (n, c) start.
        dynamic: (n,) frames whose ground contacts are all measured.
        plates: time -> (6 p) smoothed force and moment about the ground origin of every plate.
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
class CalibrationPrior:
    """Prior deviations of the calibration; the skeleton as it stands is the mean.

    Attributes:
        coordinates: static coordinate (locked in the skeleton) -> deviation, rad or m.
        marker_sd_m: (m,) of each marker's position in its segment, each axis.
        plate_sd_m: of each plate's in-plane offset.
        clock_sd_s: of the time between forces and markers.
    """

    coordinates: Mapping[str, float]
    marker_sd_m: np.ndarray
    plate_sd_m: float
    clock_sd_s: float


@dataclass(frozen=True)
class Layout:
    """Where each kind of static unknown stands in the vector."""

    theta: slice
    coordinates: slice
    locals: slice
    plates: tuple[slice, ...]
    clocks: tuple[int, ...]
    size: int

    @classmethod
    def of(cls, n_bsp: int, n_coordinates: int, n_markers: int, n_plates: Sequence[int]) -> Layout:
        """The layout for these numbers of unknowns; plates per trial."""
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


class MapProblem:
    """Residuals and normal equations at a point."""

    def __init__(
        self,
        skeleton: Skeleton,
        prior: BspPrior,
        calibration: CalibrationPrior,
        trials: Sequence[Observation],
        spacing_s: float,
    ) -> None:
        self.skeleton, self.prior, self.calibration, self.trials = skeleton, prior, calibration, trials
        self.free = skeleton.free(calibration.coordinates)
        names = list(self.free.coordinates)
        self.moving = np.array([names.index(name) for name in skeleton.coordinates])
        self.still = np.array([names.index(name) for name in calibration.coordinates], dtype=int)
        self.segments = prior.mean.segments
        self.bases = [MotionBasis(trial.time, spacing_s) for trial in trials]
        self.start = [basis.fit(trial.q) for basis, trial in zip(self.bases, trials, strict=True)]
        self.layout = Layout.of(
            10 * len(self.segments), len(self.still), len(skeleton.markers), [trial.n_plates for trial in trials]
        )
        self.above = ancestor_of(self.free)
        self.information = np.linalg.inv(prior.covariance)
        self.start_static = np.zeros(self.layout.size)
        self.start_static[self.layout.theta] = to_log_cholesky(nearest_consistent(prior.mean))
        self.start_static[self.layout.coordinates] = [skeleton.locked[name] for name in calibration.coordinates]
        self.start_static[self.layout.locals] = skeleton.marker_locals.ravel()
        deviation = np.full(self.layout.size, np.inf)
        deviation[self.layout.coordinates] = list(calibration.coordinates.values())
        deviation[self.layout.locals] = np.repeat(calibration.marker_sd_m, 3)
        for plates, clock in zip(self.layout.plates, self.layout.clocks, strict=True):
            deviation[plates], deviation[clock] = calibration.plate_sd_m, calibration.clock_sd_s
        self.weight = 1.0 / np.square(deviation)

    def bsp(self, static: np.ndarray) -> BodySegmentParameters:
        """Body segment parameters of the static unknowns."""
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
        jacobian = block_diagonal(table_jacobian(static[self.layout.theta]))
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
        for part, start in zip(coefficients, self.start, strict=True):
            total += 0.5 * float(np.square(part - start).sum()) / COEFFICIENT_SD**2
        skeleton, bsp = self.placed(static), self.bsp(static)
        for k, trial in enumerate(self.trials):
            q, *rates = self.full(self.bases[k].evaluate(coefficients[k]), static)
            errors = trial.markers - skeleton.marker_positions(skeleton.pose(q))
            total += 0.5 * float(np.nansum(np.square(errors / trial.marker_sd[:, None])))
            frames = np.flatnonzero(trial.dynamic)
            model = skeleton.model_with(bsp)
            data = model.createData()
            x, v, a = skeleton.map.motion(q, *rates)
            tau = np.array([pin.rnea(model, data, x[i], v[i], a[i])[:6] for i in frames]).reshape(-1, 6)
            wrench, _ = self.wrench(k, static)
            ground = skeleton.root.ground_load_to_generalised(q[frames], wrench[frames])
            left = (tau - ground) / self.root_sd(trial)
            total += 0.5 * float(np.square(left).sum())
        return total

    def root_sd(self, trial: Observation) -> np.ndarray:
        """(6,) deviations of the root residual: N, N m."""
        return np.repeat([trial.force_sd, trial.moment_sd], 3)

    def wrench(self, k: int, static: np.ndarray, derivative: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Sum of plates (n, 6) about the ground origin at the corrected place and time, and each plate's force
        (n, p, 3); or their time derivatives.
        """
        trial = self.trials[k]
        at = trial.time + static[self.layout.clocks[k]]
        loads = trial.plates(at, derivative).reshape(len(trial.time), -1, 6)
        force = loads[:, :, :3]
        offset = np.zeros((trial.n_plates, 3))
        offset[:, [0, 2]] = static[self.layout.plates[k]].reshape(-1, 2)
        moment = loads[:, :, 3:] + np.cross(offset, force)
        return np.concatenate([force.sum(axis=1), moment.sum(axis=1)], axis=1), force

    def normal(self, k: int, coefficients: np.ndarray, static: np.ndarray) -> NormalEquations:
        """Normal equations of trial k."""
        trial, basis, layout = self.trials[k], self.bases[k], self.layout
        parts = self.full(basis.evaluate(coefficients), static)
        skeleton = self.placed(static)
        c = len(self.moving)
        normal = NormalEquations(
            np.zeros((basis.size, 6, c, c)),
            np.zeros((basis.size, c, layout.size)),
            np.zeros((layout.size, layout.size)),
            np.zeros((basis.size, c)),
            np.zeros(layout.size),
        )
        marker = self._marker_terms(trial, skeleton, parts[0])
        root = self._root_terms(k, skeleton, parts, static)
        shared = slice(layout.coordinates.start, layout.locals.stop)
        assemble(normal, basis, marker, root, shared)
        normal.band[:, 0] += np.eye(c) / COEFFICIENT_SD**2
        normal.right -= (coefficients - self.start[k]) / COEFFICIENT_SD**2
        return normal

    def _marker_terms(self, trial: Observation, skeleton: Skeleton, q: np.ndarray) -> tuple[np.ndarray, ...]:
        """Per frame J^T J (n, c, c), J^T S (n, c, k), J^T r (n, c); and S^T S (k, k), S^T r (k,).

        S holds the static coordinates and the marker positions, which stand side by side in the layout.
        """
        n, m = trial.markers.shape[:2]
        still, moving = self.still, self.moving
        pose = skeleton.pose(q)
        weight = 1.0 / np.square(trial.marker_sd)
        normal, gradient, _ = normal_equations(skeleton, self.above, trial.markers, pose, weight)
        positions = skeleton.marker_positions(pose)
        error = trial.markers - positions
        weights = np.isfinite(error).all(axis=-1) * weight
        turned = pose.rotation[:, skeleton.marker_segments]
        twist = (
            np.concatenate([turned, np.cross(positions[..., None], turned, axis=2)], axis=2) * weights[..., None, None]
        )
        by_marker = pose.jacobian.transpose(0, 2, 1) @ twist.transpose(0, 2, 1, 3).reshape(n, 6, 3 * m)
        by_marker *= np.repeat(skeleton.support[skeleton.marker_segments].T, 3, axis=1)
        by_marker = skeleton.map.to_coordinates(by_marker.transpose(0, 2, 1), pose.slopes).transpose(0, 2, 1)
        across = np.concatenate([normal[:, moving[:, None], still], by_marker[:, moving]], axis=-1)
        k = len(still)
        static = np.zeros((k + 3 * m, k + 3 * m))
        static[:k, :k] = normal[:, still[:, None], still].sum(axis=0)
        static[:k, k:] = by_marker[:, still].sum(axis=0)
        static[k:, :k] = static[:k, k:].T
        static[range(k, k + 3 * m), range(k, k + 3 * m)] = np.repeat(weights.sum(axis=0), 3)
        pulled = np.nan_to_num(error) * weights[..., None]
        right = np.concatenate([gradient[:, still].sum(axis=0), np.einsum("nmij,nmi->mj", turned, pulled).ravel()])
        return normal[:, moving[:, None], moving], across, gradient[:, moving], static, right

    def _root_terms(
        self, k: int, skeleton: Skeleton, parts: Sequence[np.ndarray], static: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """At the dynamic frames: indices, rows by q, qd, qdd (each d, 6, c), by static unknowns (d, 6, S), residual."""
        trial, layout = self.trials[k], self.layout
        frames = np.flatnonzero(trial.dynamic)
        q, qd, qdd = (part[frames] for part in parts)
        bsp = self.bsp(static)
        model = skeleton.model_with(bsp)
        data = model.createData()
        # the regressor needs no static coordinates: a model without them is smaller
        names = list(self.calibration.coordinates)
        smaller = skeleton.lock(dict(zip(names, static[layout.coordinates].tolist(), strict=True)))
        bare, bare_data = smaller.model, smaller.model.createData()
        joints, place = smaller.placement_of_parameters(self.segments)
        columns = (10 * (joints - 1)[:, None] + np.arange(10)).ravel()
        x, v, a = skeleton.map.motion(q, qd, qdd)
        few = np.stack(smaller.map.motion(*(part[:, self.moving] for part in (q, qd, qdd))))
        d, axes = x.shape
        dq, dv, da = np.empty((d, 6, axes)), np.empty((d, 6, axes)), np.empty((d, 6, axes))
        tau, regressor = np.empty((d, 6)), np.empty((d, 6, len(columns)))
        for i in range(d):
            pin.computeRNEADerivatives(model, data, x[i], v[i], a[i])
            tau[i] = data.tau[:6]
            dq[i], dv[i], da[i] = data.dtau_dq[:6], data.dtau_dv[:6], data.M[:6]
            regressor[i] = pin.computeJointTorqueRegressor(bare, bare_data, *few[:, i])[:6, columns]
        square = da[:, :, :6]
        da[:, :, :6] = np.triu(square) + np.triu(square, 1).transpose(0, 2, 1)
        dq, dv, da = skeleton.map.derivatives_to_coordinates((dq, dv, da), q, qd, qdd)
        root = skeleton.root
        wrench, force = (part[frames] for part in self.wrench(k, static))
        dq[:, :, :6] -= root.ground_load_derivative(q, wrench)
        by_segment = (regressor.reshape(d, 6, len(joints), 1, 10) @ place).reshape(d, 6, len(joints), 10)
        by_static = np.zeros((d, 6, layout.size))
        chain = dynamic_jacobian(static[layout.theta])
        by_static[:, :, layout.theta] = np.einsum("drsi,sij->drsj", by_segment, chain).reshape(d, 6, 10 * len(joints))
        by_static[:, :, layout.coordinates] = dq[:, :, self.still]
        for plate in range(trial.n_plates):
            for j, axis in enumerate(np.eye(3)[[0, 2]]):
                moment = np.concatenate([np.zeros((d, 3)), np.cross(axis, force[:, plate])], axis=1)
                by_static[:, :, layout.plates[k].start + 2 * plate + j] = -root.generalised(q, moment)
        rates = self.wrench(k, static, 1)[0][frames]
        by_static[:, :, layout.clocks[k]] = -root.ground_load_to_generalised(q, rates)
        sd = self.root_sd(trial)[None, :, None]
        left = (tau - root.ground_load_to_generalised(q, wrench)) / sd[..., 0]
        return (
            frames,
            dq[..., self.moving] / sd,
            dv[..., self.moving] / sd,
            da[..., self.moving] / sd,
            by_static / sd,
            left,
        )


def block_diagonal(blocks: np.ndarray) -> np.ndarray:
    """(s k, s k) matrix of the blocks (s, k, k)."""
    s, k, _ = blocks.shape
    result = np.zeros((s, k, s, k))
    result[np.arange(s), :, np.arange(s), :] = blocks
    return result.reshape(s * k, s * k)
