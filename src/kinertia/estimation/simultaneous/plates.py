"""Defines the errors of force plates and synchronisation, and corrects ground reactions for them.

Each plate may stand off its recorded place in the floor's plane, have a wrong gain, read a vertical moment that is not
there, in proportion to the vertical force (crosstalk of its channels), and have a zero of its horizontal forces that is
off: whoever stands on it is pushed as much more, at its middle. All plates may be turned about the vertical against the
cameras; forces may be recorded late, those of all trials or of one. The plates are the laboratory's: their offsets are
in its axes and are shared by all trials; their zeros are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.simultaneous import plate_loads
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.smoothing import SmoothedSpline, smooth
from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import LOAD_THRESHOLD_N, FootLoads

PLATE_UNKNOWNS = {"x": "m", "z": "m", "gain": "1", "free moment": "N m/N"}
"""Of each plate, and its unit: offsets in the floor's plane, relative error of the gain, and what the vertical moment
lacks per vertical force."""
FLOOR_UNKNOWNS = {"x": "m", "z": "m", "turn": "rad"}
"""Of all plates together: where the floor is that the cameras were calibrated to, and by how much the plates are turned
against its axes about the vertical, each through its middle. Single plates are mounted square; the cameras' axes are
laid out by hand."""
PLATE_ERRORS = {**PLATE_UNKNOWNS, **FLOOR_UNKNOWNS}
"""All that is wrong with a plate in all trials: its own and the floor's."""
ZERO_UNKNOWNS = {"zero x": "N", "zero z": "N"}
"""Of each plate in one trial, and its unit: what it reads too much of horizontal force while somebody stands on it.
Amplifiers drift and are reset, so that the next trial has other zeros."""
_UP = np.array([0.0, 1.0, 0.0])
_FIRM_N = 5 * LOAD_THRESHOLD_N


def plates_with_floor(count: int) -> np.ndarray:
    """(5 p, 4 p + 3) matrix that makes PLATE_ERRORS of p plates from their own unknowns and the floor's."""
    own, floor = (
        np.array([[name == unknown for name in names] for unknown in PLATE_ERRORS], dtype=float)
        for names in (PLATE_UNKNOWNS, FLOOR_UNKNOWNS)
    )
    return np.hstack([np.kron(np.eye(count), own), np.tile(floor, (count, 1))])


def plate_middles(loads: FootLoads, used: np.ndarray) -> np.ndarray:
    """(p, 3) m: for each of these plates of a trial, where it is loaded on average."""
    point, vertical = centre_of_pressure(loads.wrench), loads.force[..., 1]
    firm = np.where(vertical > _FIRM_N, vertical, 0.0)
    result = np.zeros((len(used), 3))
    for k, plate in enumerate(used):
        weight = np.where(loads.carrier == plate, firm, 0.0)
        if weight.any():
            result[k] = np.average(point[weight > 0.0], axis=0, weights=weight[weight > 0.0])
    return result


def turned_loads(loads: np.ndarray, middle: np.ndarray, angle_rad: np.ndarray | float) -> np.ndarray:
    """Loads (..., 6) turned about the vertical through places (..., 3) m by angles (...)."""
    cosine, sine = (np.asarray(each)[..., None] for each in (np.cos(angle_rad), np.sin(angle_rad)))
    force, moment = loads[..., :3], loads[..., 3:] - np.cross(middle, loads[..., :3])
    force, moment = (_UP * each + cosine * (each - _UP * each) + sine * np.cross(_UP, each) for each in (force, moment))
    return np.concatenate([force, moment + np.cross(middle, force)], axis=-1)


@dataclass(frozen=True)
class FootPlates:
    """Ground reactions of one trial over time, and which plate measured them.

    Attributes:
        loads: time -> (12) force and moment about the ground origin under the right foot, then the left, of the
            motion's bandwidth: what the root equations take.
        loaded: time -> (2) whether somebody stands under the right foot, then the left, of the same bandwidth.
        reactions: what joint moments take, by the plates' clock; its `carrier` counts the same `plates`.
        plates: names.
        carrier: (n, 2) index into `plates` of the plate that each foot stands on, at the frames of the trial.
        turn: (3, 3) from the laboratory's axes to the trial's.
        middles: (p, 3) m, places of the plates about which they are turned.
    """

    loads: SmoothedSpline
    loaded: SmoothedSpline
    reactions: GroundReactions
    plates: tuple[str, ...]
    carrier: np.ndarray
    turn: np.ndarray
    middles: np.ndarray

    @classmethod
    def one_per_foot(cls, loads: SmoothedSpline, n_frames: int) -> FootPlates:
        """A plate of its own under each foot, recorded in the trial's axes; nothing is faster than the smoothed
        loads."""
        wrench = loads(loads.time).reshape(-1, 2, 6)
        on = [np.tile([0, 1], (count, 1)) for count in (len(wrench), n_frames)]
        reactions = GroundReactions(loads.time, wrench, on[0], np.zeros_like(wrench), None)
        middles = plate_middles(FootLoads(loads.time, wrench[..., :3], wrench[..., 3:]), np.arange(2))
        loaded = smooth(loads.time, reactions.loaded, float(np.median(loads.cutoff_hz)))
        return cls(loads, loaded, reactions, ("right foot", "left foot"), on[1], np.eye(3), middles)

    def among(self, plates: Sequence[str]) -> FootPlates:
        """The same with these plates (a session's), of which its own are some."""
        if not self.plates:  # of a trial without forces; nobody stands on the first
            return replace(self, plates=tuple(plates), middles=np.zeros((len(plates), 3)))
        own = np.array([plates.index(name) for name in self.plates])
        middles = np.zeros((len(plates), 3))
        middles[own] = self.middles
        reactions = replace(self.reactions, carrier=own[self.reactions.carrier])
        return replace(self, plates=tuple(plates), carrier=own[self.carrier], reactions=reactions, middles=middles)

    def by_plate(self, loads: np.ndarray, loaded: np.ndarray, carrier: np.ndarray, plates: np.ndarray) -> np.ndarray:
        """(n, 2, 6, p, 7) derivative of the corrected loads (n, 2, 6), where somebody stands (n, 2), by what is wrong
        with the plates (p, 7).
        """
        return plate_loads.by_plate(*self._as_compiled(loads, loaded, carrier, plates))

    def put_right(self, loads: np.ndarray, loaded: np.ndarray, carrier: np.ndarray, plates: np.ndarray) -> np.ndarray:
        """Loads (k, 2, 6) of plates (k, 2) with errors (p, 7), without their zeros where somebody stands (k, 2)."""
        return plate_loads.put_right(*self._as_compiled(loads, loaded, carrier, plates))

    def _as_compiled(self, *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
        """The arguments of `plate_loads`: these, the middles and the turn, all contiguous."""
        return tuple(map(np.ascontiguousarray, (*arrays, self.middles, self.turn)))
