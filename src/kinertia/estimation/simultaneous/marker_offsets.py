"""Lets markers sit a little elsewhere in each trial, as the posture of a motion draws the skin.

Squats carry the thigh's markers a centimetre from where a walk has them. Every trial therefore has its own displacement
of each marker from its place in the segment, with a prior deviation that is read from how much the trials differ
(`observation`). What a trial says of the places in it is said of the person's places less surely; a person with one
trial has no displacements.

A trial's normal equations are those of places in the trial; its displacements are eliminated from them here. They are
counted in their prior deviations, so that a deviation may be zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular


@dataclass(frozen=True, eq=False)
class Displaced:
    """What a trial says of the static unknowns of the person, its displacements eliminated.

    Attributes:
        information: (S, S).
        gain: (k, S) how far the displacements follow when the static unknowns step back.
        factor: (k, k) lower Cholesky factor of the information on the displacements; None where none may be displaced.
    """

    information: np.ndarray
    gain: np.ndarray
    factor: np.ndarray | None

    @classmethod
    def of(cls, information: np.ndarray, places: slice, sd_m: np.ndarray) -> Displaced:
        """Eliminate displacements.

        Args:
            information: of the trial on the static unknowns as they are in the trial.
            places: of the marker positions among them.
            sd_m: (k,) prior deviations of the displacements.
        """
        if not sd_m.any():
            return cls(information, np.zeros((len(sd_m), len(information))), None)
        border = information[places] * sd_m[:, None]
        factor = cholesky(border[:, places] * sd_m + np.eye(len(sd_m)), lower=True)
        half = solve_triangular(factor, border, lower=True)
        return cls(information - half.T @ half, solve_triangular(factor, half, lower=True, trans="T"), factor)

    def rest(self, right: np.ndarray) -> np.ndarray:
        """(k,) step of the displacements for this right-hand side (k,), while the static unknowns stay; they get
        `-right @ gain` of it.
        """
        if self.factor is None:
            return np.zeros_like(right)
        half = solve_triangular(self.factor, right, lower=True)
        result: np.ndarray = solve_triangular(self.factor, half, lower=True, trans="T")
        return result


def as_displaced(information: np.ndarray, places: slice, sd_m: np.ndarray) -> np.ndarray:
    """(S, S) what information on the static unknowns says of the same with the places displaced by unknown amounts: of
    a trial about the person, or of everything else about a trial. The arguments are those of `Displaced.of`.
    """
    return Displaced.of(information, places, sd_m).information
