"""Defines the errors of force plates and synchronisation, and corrects ground reactions for them.

Each plate may be displaced from its recorded position in the floor's plane, rotated about the vertical, have a wrong
gain, read a false vertical moment in proportion to the vertical force (crosstalk of its channels), and have a zero
offset of its horizontal forces, which acts at its middle while somebody stands on it. All plates may be displaced or
rotated together relative to the cameras; forces may be delayed, in all trials or in one. The plates belong to the
laboratory: their displacements are in its axes and are shared by all trials; their zero offsets are not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.instruments import plate_loads
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.smoothing import SmoothedSpline
from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import LOAD_THRESHOLD_N, FootLoads

PLATE_UNKNOWNS = {"x": "m", "z": "m", "gain": "1", "free moment": "N m/N", "turn": "rad"}
"""Errors of each plate, with units: displacement in the floor's plane, relative error of the gain, missing vertical
moment per vertical force, and rotation about the vertical through its middle."""
FLOOR_UNKNOWNS = {"x": "m", "z": "m", "turn": "rad"}
"""Common errors of all plates: displacement relative to the floor that the cameras were calibrated to, and rotation
relative to its axes about the vertical, each plate about its middle. The cameras' axes are laid out by hand."""
PLATE_ERRORS = {**PLATE_UNKNOWNS, **FLOOR_UNKNOWNS}
"""All errors of a plate in all trials: its own and the common ones."""
ZERO_UNKNOWNS = {"zero x": "N", "zero z": "N"}
"""Errors of each plate in one trial, with units: excess horizontal force while somebody stands on it. Amplifiers drift
and are reset, so that the next trial has other zero offsets."""
_UP = np.array([0.0, 1.0, 0.0])
_FIRM_N = 5 * LOAD_THRESHOLD_N


def plates_with_floor(count: int) -> np.ndarray:
    """Return the matrix (5 p, 5 p + 3) from the plates' own and common unknowns to PLATE_ERRORS of p plates."""
    own, floor = (
        np.array([[name == unknown for name in names] for unknown in PLATE_ERRORS], dtype=float)
        for names in (PLATE_UNKNOWNS, FLOOR_UNKNOWNS)
    )
    return np.hstack([np.kron(np.eye(count), own), np.tile(floor, (count, 1))])


def plate_middles(loads: FootLoads, used: np.ndarray) -> np.ndarray:
    """Return the mean centre of pressure (p, 3) m on each of these plates of a trial."""
    point, vertical = centre_of_pressure(loads.wrench), loads.force[..., 1]
    firm = np.where(vertical > _FIRM_N, vertical, 0.0)
    result = np.zeros((len(used), 3))
    for k, plate in enumerate(used):
        weight = np.where(loads.carrier == plate, firm, 0.0)
        if weight.any():
            result[k] = np.average(point[weight > 0.0], axis=0, weights=weight[weight > 0.0])
    return result


def turned_loads(loads: np.ndarray, middle: np.ndarray, angle_rad: np.ndarray | float) -> np.ndarray:
    """Rotate loads (..., 6) about the vertical through points (..., 3) m by angles (...) rad."""
    cosine, sine = (np.asarray(each)[..., None] for each in (np.cos(angle_rad), np.sin(angle_rad)))
    force, moment = loads[..., :3], loads[..., 3:] - np.cross(middle, loads[..., :3])
    force, moment = (_UP * each + cosine * (each - _UP * each) + sine * np.cross(_UP, each) for each in (force, moment))
    return np.concatenate([force, moment + np.cross(middle, force)], axis=-1)


@dataclass(frozen=True)
class FootPlates:
    """Ground reactions of one trial over time, and the plates that measured them.

    Attributes:
        loads: time -> (12) force and moment about the ground origin under the right foot, then the left, at the
            motion's bandwidth: for the root equations.
        loaded: time -> (2) whether the right foot, then the left, stands on a plate, at the same bandwidth.
        reactions: for joint moments, on the time base of the plates; its `carrier` refers to the same `plates`.
        plates: names.
        carrier: (n, 2) index into `plates` of the plate that each foot stands on, at the frames of the trial.
        turn: (3, 3) from the laboratory's axes to the trial's.
        middles: (p, 3) m, points about which the plates are rotated.
    """

    loads: SmoothedSpline
    loaded: SmoothedSpline
    reactions: GroundReactions
    plates: tuple[str, ...]
    carrier: np.ndarray
    turn: np.ndarray
    middles: np.ndarray

    def among(self, plates: Sequence[str]) -> Self:
        """Return the reactions with these plates (a session's), which include its own."""
        if not self.plates:  # a trial without forces: nobody stands on the first
            return replace(self, plates=tuple(plates), middles=np.zeros((len(plates), 3)))
        own = np.array([plates.index(name) for name in self.plates])
        middles = np.zeros((len(plates), 3))
        middles[own] = self.middles
        reactions = replace(self.reactions, carrier=own[self.reactions.carrier])
        return replace(self, plates=tuple(plates), carrier=own[self.carrier], reactions=reactions, middles=middles)

    def by_plate(self, loads: np.ndarray, loaded: np.ndarray, carrier: np.ndarray, plates: np.ndarray) -> np.ndarray:
        """Compute the derivatives (n, 2, 6, p, 7) of corrected loads (n, 2, 6) by the errors of the plates (p, 7).

        `loaded` (n, 2) is 1 where the foot stands.
        """
        return plate_loads.by_plate(*self._as_compiled(loads, loaded, carrier, plates))

    def corrected_loads(
        self, loads: np.ndarray, loaded: np.ndarray, carrier: np.ndarray, plates: np.ndarray
    ) -> np.ndarray:
        """Correct loads (k, 2, 6) on plates (k, 2) with errors (p, 7), with zero offsets where `loaded` (k, 2)."""
        return plate_loads.corrected_loads(*self._as_compiled(loads, loaded, carrier, plates))

    def _as_compiled(self, *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the arguments of `plate_loads`: these, the middles and the rotation, all contiguous."""
        return tuple(map(np.ascontiguousarray, (*arrays, self.middles, self.turn)))
