"""Markers that sit a little elsewhere in each trial: skin is drawn along by the posture of a motion.

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
from scipy.linalg import cho_factor, cho_solve


@dataclass(frozen=True, eq=False)
class Displaced:
    """What a trial says of the static unknowns of the person, its displacements eliminated.

    Attributes:
        information: (S, S).
        right: (S,) its right-hand side.
        gain: (k, S) how far the displacements follow a step of the static unknowns, ...
        rest: (k,) ... and how far they step if those stay; in prior deviations.
    """

    information: np.ndarray
    right: np.ndarray
    gain: np.ndarray
    rest: np.ndarray

    @classmethod
    def of(
        cls, information: np.ndarray, right: np.ndarray, places: slice, sd_m: np.ndarray, own: np.ndarray
    ) -> Displaced:
        """Eliminate displacements.

        Args:
            information, right: of the trial on the static unknowns as they are in the trial.
            places: of the marker positions among them.
            sd_m: (k,) prior deviations of the displacements.
            own: (k,) where the displacements are, in prior deviations.
        """
        if not sd_m.any():
            return cls(information, right, np.zeros((len(sd_m), len(right))), np.zeros(len(sd_m)))
        border = information[places] * sd_m[:, None]
        inner = cho_factor(border[:, places] * sd_m + np.eye(len(sd_m)))
        gain, rest = cho_solve(inner, border), cho_solve(inner, sd_m * right[places] - own)
        return cls(information - border.T @ gain, right - border.T @ rest, -gain, rest)

    def step(self, step: np.ndarray) -> np.ndarray:
        """(k,) step of the displacements that goes with a step (S,) of the static unknowns."""
        result: np.ndarray = self.rest + self.gain @ step
        return result


def as_displaced(information: np.ndarray, places: slice, sd_m: np.ndarray) -> np.ndarray:
    """(S, S) what information on the static unknowns says of the same with the places displaced by unknown amounts: of
    a trial about the person, or of everything else about a trial. The arguments are those of `Displaced.of`.
    """
    return Displaced.of(information, np.zeros(len(information)), places, sd_m, np.zeros_like(sd_m)).information
