"""Adds body segment parameters with masses that depend on the task, and what calibrates the model.

In squats the thigh markers are displaced by a centimetre from their positions in walking. Every trial therefore has its
own displacement of each marker from its position in the segment, with a prior standard deviation derived from the
differences between trials (`observation`). A trial's information on marker positions thus becomes weaker information on
the person's marker positions; a person with one trial has no displacements.

A trial's normal equations are for positions in the trial; its displacements are eliminated from them here. Their unit
is the prior standard deviation, so that it may be zero.

Part of a thigh's mass follows the pelvis when the hip flexes (buttock, hamstrings), and some soft tissue follows
neither. Trials of one person agreed on the mass of a thigh within a task but not between tasks: 8.8 +- 0.7 kg walking,
7.5 jumping, 5.5 squatting, with the difference at the pelvis. Nothing that was tried explains it; it is part of the
uncertainty of an estimate from one task, the more the farther that task flexes the hips.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from scipy.linalg import block_diag, cholesky, solve_triangular

from kinertia.estimation.simultaneous.inputs import BSP, PLACES, SKIN, STILL, FreedModel, Given, Unknowns
from kinertia.estimation.simultaneous.instruments.instrument_errors import AXIS, CENTRE, CalibrationEntry
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import LEAST_INFORMATION
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, Solution
from kinertia.model.anatomy import segment_of
from kinertia.model.imported_model import joint_and_axis
from kinertia.model.log_cholesky import nearest_consistent, table_jacobian, to_log_cholesky
from kinertia.model.skeleton import Skeleton

LEAST_TASK_SD, TASK_SD_PER_RAD = 0.1, 0.095
"""Standard deviation of the mass that moves with a thigh, as a share of it: least value, and increase with hip flexion.
Walks, jumps and squats of that person differ by 0.2 (SD). Hips are flexed by 0.4 rad in its walks, 1.7 in jumps and 1.9
in squats; with a standard deviation proportional to that, the tasks agree."""
_MOST_OF_TIME = 95
"""Percentage of the frames in which hips are flexed by less."""
_MOST_FRAMES = 1000
"""Number of frames used, evenly spaced."""


class MarkerPositions(CostTerm):
    """Positions of the markers in their segments; with several trials each has displacements of its own."""

    order: ClassVar[int] = 40

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return three unknowns per marker, normal about its position in the skeleton."""
        count = len(given.skeleton.markers)
        return (
            Unknowns(
                name=PLACES,
                unit="m",
                start=given.skeleton.marker_locals.ravel(),
                prior=np.broadcast_to(np.repeat(given.calibration.marker_sd_m, 3), 3 * count),
                seen_by="markers",
                displaced_sd=tuple(
                    np.repeat(np.broadcast_to(trial.displacement_sd_m, count), 3) for trial in given.trials
                ),
            ),
        )

    def read(self, solution: Solution) -> dict[str, Any]:
        """Return the displacements of the markers of each trial from their positions."""
        return {"marker_offsets_m": tuple(offsets.reshape(-1, 3) for offsets in solution.displaced)}


class StaticCoordinates(CostTerm):
    """Coordinates of the skeleton that do not move in time."""

    order: ClassVar[int] = 0

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return one unknown per coordinate, normal about the value at which the skeleton has it locked."""
        known = given.calibration.coordinates
        start = np.array([given.skeleton.locked[name] for name in known])
        sd = np.array(list(known.values()))
        return (Unknowns(name=STILL, unit="m or rad", start=start, prior=sd, seen_by="both"),)

    def read(self, solution: Solution) -> dict[str, Any]:
        """Return values with their standard deviations, and entries of their changes from the skeleton's values."""
        known = self.given.calibration.coordinates
        before = {**self.given.skeleton.locked, **self.given.calibration.before}
        turned = self.given.free.rotational[self.given.still]
        pairs = dict(zip(known, solution.pairs(self.layout[STILL]), strict=True))
        entries = [
            CalibrationEntry(
                kind="joint",
                joint=joint,
                quantity=AXIS if tilted else CENTRE,
                axis=axis,
                value=value - float(before[name]),
                prior_sd=known[name],
                sd=sd,
                unit="rad" if tilted else "m",
            )
            for (name, (value, sd)), tilted in zip(pairs.items(), turned, strict=True)
            for joint, axis in [joint_and_axis(name)]
        ]
        return {"coordinates": pairs, "calibration": tuple(entries)}


class Skin(CostTerm):
    """Coefficients of skin motion (`skin`), the same in all trials."""

    order: ClassVar[int] = 45

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return three unknowns per marker and pattern; those of a segment are correlated."""
        size = given.skin[0].size
        return (Unknowns(name=SKIN, unit="1", start=np.zeros(size), prior=None, seen_by="markers"),)

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        self._information = self.given.skin[0].information()

    def add_information(self, into: np.ndarray, static: np.ndarray) -> None:
        """Add the information of the coefficients' prior."""
        at = self.layout[SKIN]
        into[at, at] += self._information

    def add_pull(self, rhs: np.ndarray, static: np.ndarray) -> float:
        """Add the right-hand side of the coefficients' prior, and return its sum of squares."""
        coefficients = static[self.layout[SKIN]]
        pull = self._information @ coefficients
        rhs[self.layout[SKIN]] -= pull
        return float(coefficients @ pull)


@dataclass(frozen=True, eq=False)
class Displaced:
    """Information of a trial on the static unknowns of the person, with its displacements eliminated.

    Attributes:
        information: (S, S).
        gain: (k, S) step of the displacements per backward step of the static unknowns.
        factor: (k, k) lower Cholesky factor of the information on the displacements; None where none may be displaced.
    """

    information: np.ndarray
    gain: np.ndarray
    factor: np.ndarray | None

    @classmethod
    def of(cls, information: np.ndarray, places: slice, sd_m: np.ndarray) -> Self:
        """Eliminate the displacements of a trial.

        Args:
            information: of the trial on the static unknowns as they are in the trial.
            places: slice of the marker positions among them.
            sd_m: (k,) prior standard deviations of the displacements.
        """
        if not sd_m.any():
            return cls(information, np.zeros((len(sd_m), len(information))), None)
        border = information[places] * sd_m[:, None]
        factor = cholesky(border[:, places] * sd_m + np.eye(len(sd_m)), lower=True)
        half = solve_triangular(factor, border, lower=True)
        return cls(information - half.T @ half, solve_triangular(factor, half, lower=True, trans="T"), factor)

    def rest(self, rhs: np.ndarray) -> np.ndarray:
        """Return the step (k,) of the displacements for this right-hand side (k,), with the static unknowns constant.

        The static unknowns receive `-right @ gain` of it.
        """
        if self.factor is None:
            return np.zeros_like(rhs)
        half = solve_triangular(self.factor, rhs, lower=True)
        result: np.ndarray = solve_triangular(self.factor, half, lower=True, trans="T")
        return result


def as_displaced(information: np.ndarray, places: slice, sd_m: np.ndarray) -> np.ndarray:
    """Return the information (S, S) after the positions have been displaced by unknown amounts.

    It converts information of a trial into information on the person, or of everything else into information on a
    trial. The arguments are those of `Displaced.of`.
    """
    return Displaced.of(information, places, sd_m).information


class BodySegments(CostTerm):
    """Ten log-Cholesky parameters of every segment, which are physically consistent for any values."""

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return the parameters of all segments; the prior applies to their table."""
        start = to_log_cholesky(nearest_consistent(given.prior.mean))
        return (Unknowns(name=BSP, unit="log-Cholesky of kg, m", start=start, prior=None),)

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        self._at = self.layout[BSP]
        self._information = np.linalg.inv(self.given.prior.covariance)

    @property
    def _logs(self) -> np.ndarray:
        """Indices of unknowns that are logarithms: per segment its mass, and three square roots of second moments."""
        every = np.arange(self._at.start, self._at.stop).reshape(-1, 10)
        return every[:, [0, 4, 5, 6]].ravel()

    def add_information(self, into: np.ndarray, static: np.ndarray) -> None:
        """Add the information of the table's prior and of the total mass by the scale."""
        prior, theta = self.given.prior, self._at
        jacobian = block_diag(*table_jacobian(static[theta]))
        mass_row = prior.on_scale @ jacobian[0::10] / prior.mass_sd_kg
        into[theta, theta] += jacobian.T @ self._information @ jacobian + np.outer(mass_row, mass_row)
        into[theta, theta] += LEAST_INFORMATION * np.eye(theta.stop - theta.start)

    def add_pull(self, rhs: np.ndarray, static: np.ndarray) -> float:
        """Add the right-hand side of the table's prior and of the scale's total mass; return their sum of squares."""
        prior, theta = self.given.prior, self._at
        bsp, by_own = self.model.bsp(static), table_jacobian(static[theta])
        gap = (bsp.table() - prior.mean.table()).ravel()
        mass_gap = (float(prior.on_scale @ bsp.mass_kg) - prior.mass_kg) / prior.mass_sd_kg
        pulls = (self._information @ gap).reshape(-1, 10)
        pulls[:, 0] += mass_gap / prior.mass_sd_kg * prior.on_scale
        rhs[theta] -= np.einsum("bi,bij->bj", pulls, by_own).ravel()
        return float(gap @ self._information @ gap) + mass_gap**2

    def shorten(self, step: np.ndarray) -> None:
        """Limit the change of every logarithm to one."""
        step[self._logs] = np.clip(step[self._logs], -1.0, 1.0)

    def add_second_derivatives(self, into: np.ndarray, rhs: np.ndarray) -> None:
        """Add second derivatives by logarithms that Gauss-Newton leaves out, where the cost falls with the logarithm.

        The data may favour a mass or a second moment below zero. Towards zero the first derivatives vanish, and with
        them the curvature that limits a Gauss-Newton step: it would again and again predict a large gain and achieve
        none. A cost F of exp(x) has the second derivative F'' exp(2 x) + F' exp(x), and the last term is the slope by
        x; by the logarithm of a square root it is twice the slope.
        """
        slope = -rhs[self._logs].reshape(-1, 4)
        into[self._logs] += (np.maximum(slope, 0.0) * [1.0, 2.0, 2.0, 2.0]).ravel()

    def read(self, solution: Solution) -> dict[str, Any]:
        """Return physically consistent parameters, and the covariance of their table, at most the prior's."""
        chain = block_diag(*table_jacobian(solution.there[self._at]))
        covariance = chain @ solution.covariance[self._at, self._at] @ chain.T
        return {
            "bsp": self.model.bsp(solution.static),
            "bsp_covariance": _at_most(covariance, self.given.prior.covariance),
        }


def _at_most(covariance: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Limit the covariance so that no combination is more uncertain than in the prior: data never add uncertainty."""
    root = np.linalg.cholesky(prior)
    left = np.linalg.solve(root, np.linalg.solve(root, covariance).T)
    shares, along = np.linalg.eigh(0.5 * (left + left.T))
    along = root @ along
    result: np.ndarray = (along * np.minimum(shares, 1.0)) @ along.T
    return result


def task_sd(bent_rad: float) -> float:
    """Return the SD of the mass that moves with a thigh, as a share of it, in a task that flexes the hips this far.

    >>> round(task_sd(0.4), 3), round(task_sd(1.9), 3)
    (0.1, 0.18)
    """
    return max(LEAST_TASK_SD, TASK_SD_PER_RAD * bent_rad)


def hips_bent_rad(skeleton: Skeleton, q: np.ndarray) -> float:
    """Return how far a thigh is rotated to the pelvis in coordinates (n, c), from the model's zero pose, rad.

    It is 0 if the model has no thigh or no pelvis.
    """
    of_segment = [segment_of(name) or "" for name in skeleton.segments]
    thighs = [k for k, name in enumerate(of_segment) if name.startswith("thigh")]
    if not thighs or "pelvis" not in of_segment:
        return 0.0
    rotation = skeleton.pose(np.concatenate([np.zeros((1, q.shape[1])), q])).rotation
    pelvis = rotation[:, of_segment.index("pelvis")].transpose(0, 2, 1)
    turned = [pelvis @ rotation[:, k] for k in thighs]
    cosine = [0.5 * (np.einsum("ij,nij->n", rotations[0], rotations[1:]) - 1.0) for rotations in turned]
    return float(np.percentile(np.arccos(np.clip(cosine, -1.0, 1.0)), _MOST_OF_TIME))


def task_direction(segments: Sequence[str], mass_kg: np.ndarray, sd: float) -> np.ndarray:
    """Return the change (10 s,) of the segments' unknowns with one SD of the task's effect on masses.

    The first unknown of each segment is the logarithm of its mass (s,). The pelvis gains what the thighs lose, `sd` of
    their mass.
    """
    of_segment = [segment_of(name) or "" for name in segments]
    thighs, pelvis = (np.array([name.startswith(wanted) for name in of_segment]) for wanted in ("thigh", "pelvis"))
    gained = np.where(thighs, sd * mass_kg, 0.0)
    if pelvis.any():
        gained -= np.where(pelvis, gained.sum() * mass_kg / mass_kg[pelvis].sum(), 0.0)
    moved = np.zeros(10 * len(segments))
    moved[::10] = gained / mass_kg
    return moved


def _some(frames: int) -> np.ndarray:
    """Return at most _MOST_FRAMES evenly spaced frame indices."""
    return np.unique(np.linspace(0, frames - 1, min(frames, _MOST_FRAMES)).astype(int))


class TaskMasses(CostTerm):
    """Dependence of the masses on the task: one more unknown, left out of the vector.

    With several trials it is one, too: that of the trial that flexes the hips least, which determines thighs best.
    """

    def left_out(self, static: np.ndarray) -> np.ndarray:
        """Return the displacement of the masses as seen by the data."""
        given, result = self.given, np.zeros(len(static))
        bent = [
            hips_bent_rad(given.skeleton, basis.evaluate(start, _some(len(basis.first)), derivatives=0)[0])
            for basis, start in zip(given.bases, given.start, strict=True)
        ]
        sd = task_sd(min(bent))
        result[self.layout[BSP]] = task_direction(self.model.segments, self.model.bsp(static).mass_kg, sd)
        return result
