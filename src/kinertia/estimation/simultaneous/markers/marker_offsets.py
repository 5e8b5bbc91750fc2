"""Allows small marker offsets in each trial, as the posture of a motion displaces the skin.

In squats the thigh markers are displaced by a centimetre from their positions in walking. Every trial therefore has its
own displacement of each marker from its position in the segment, with a prior standard deviation derived from the
differences between trials (`observation`). A trial's information on marker positions thus becomes weaker information on
the person's marker positions; a person with one trial has no displacements.

A trial's normal equations are for positions in the trial; its displacements are eliminated from them here. Their unit
is the prior standard deviation, so that it may be zero.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.linalg import cholesky, solve_triangular


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
