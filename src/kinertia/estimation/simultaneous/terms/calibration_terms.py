"""Adds what calibrates the model: marker positions with offsets in each trial, joint centres and axes, skin.

In squats the thigh markers are displaced by a centimetre from their positions in walking. Every trial therefore has its
own displacement of each marker from its position in the segment, with a prior standard deviation derived from the
differences between trials (`observation`). A trial's information on marker positions thus becomes weaker information on
the person's marker positions; a person with one trial has no displacements.

A trial's normal equations are for positions in the trial; its displacements are eliminated from them here. Their unit
is the prior standard deviation, so that it may be zero.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from kinertia.estimation.simultaneous.calibration_entry import AXIS, CENTRE, CalibrationEntry
from kinertia.estimation.simultaneous.inputs import PLACES, SKIN, STILL, FreedModel, Given, Unknowns
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, Solution
from kinertia.model.neutral_joints import joint_and_axis


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
        return {"marker_offsets_m": tuple(own.reshape(-1, 3) for own in solution.displaced)}


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
        own = static[self.layout[SKIN]]
        pull = self._information @ own
        rhs[self.layout[SKIN]] -= pull
        return float(own @ pull)


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
