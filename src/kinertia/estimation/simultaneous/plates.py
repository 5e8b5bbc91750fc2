"""What force plates and clock may have wrong, and the ground reactions once that is put right.

Each plate may stand off its recorded place in the floor's plane, have a wrong gain, and read a vertical moment that is
not there, in proportion to the vertical force (crosstalk of its channels); forces may be recorded late. The plates are
the laboratory's: their offsets are in its axes and are shared by all trials, as is the clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.smoothing import SmoothedSpline

PLATE_UNKNOWNS = {"x": "m", "z": "m", "gain": "1", "free moment": "N m/N"}
"""Of each plate, and its unit: offsets in the floor's plane, relative error of the gain, and what the vertical moment
lacks per vertical force."""
FLOOR_UNKNOWNS = {"x": "m", "z": "m"}
"""Of all plates together: where the floor is that the cameras were calibrated to."""


def plates_with_floor(count: int) -> np.ndarray:
    """(4 p, 4 p + 2) matrix that adds the floor's offsets to those of each of p plates."""
    floor = np.array([[name == unknown for name in FLOOR_UNKNOWNS] for unknown in PLATE_UNKNOWNS], dtype=float)
    return np.hstack([np.eye(len(PLATE_UNKNOWNS) * count), np.tile(floor, (count, 1))])


@dataclass(frozen=True)
class FootPlates:
    """Ground reactions of one trial over time, and which plate measured them.

    Attributes:
        loads: time -> (12) force and moment about the ground origin under the right foot, then the left, of the
        motion's
            bandwidth: what the root equations take.
        reactions: what joint moments take, by the plates' clock; its `carrier` counts the same `plates`.
        plates: names.
        carrier: (n, 2) index into `plates` of the plate that each foot stands on, at the frames of the trial.
        turn: (3, 3) from the laboratory's axes to the trial's.
    """

    loads: SmoothedSpline
    reactions: GroundReactions
    plates: tuple[str, ...]
    carrier: np.ndarray
    turn: np.ndarray

    @classmethod
    def one_per_foot(cls, loads: SmoothedSpline, n_frames: int) -> FootPlates:
        """A plate of its own under each foot, recorded in the trial's axes; nothing is faster than the smoothed
        loads."""
        wrench = loads(loads.time).reshape(-1, 2, 6)
        on = [np.tile([0, 1], (count, 1)) for count in (len(wrench), n_frames)]
        reactions = GroundReactions(loads.time, wrench, on[0], np.zeros_like(wrench), None)
        return cls(loads, reactions, ("right foot", "left foot"), on[1], np.eye(3))

    def among(self, plates: Sequence[str]) -> np.ndarray:
        """Place in `plates` (a session's) of each of these plates."""
        return np.array([plates.index(name) for name in self.plates])

    def corrected(self, time: np.ndarray, carrier: np.ndarray, plates: np.ndarray, derivative: int = 0) -> np.ndarray:
        """(n, 2, 6) loads on the feet at these times, of plates put right, or their time derivatives.

        Args:
            time: (n,) by the plates' clock.
            carrier: (n, 2) row of `plates` under each foot.
            plates: (p, 4) what is wrong with the plates.
        """
        return self._put_right(self.loads(time, derivative).reshape(len(time), 2, 6), plates[carrier])

    def corrected_reactions(self, plates: np.ndarray, late_s: float) -> GroundReactions:
        """The loads for the joint moments, of plates (p, 4) put right, by the clock of the markers.

        Args:
            plates: what is wrong with each of `self.plates`.
            late_s: by how much forces are recorded late.
        """
        raw = self.reactions
        wrench, impact = (self._put_right(part, plates[raw.carrier]) for part in (raw.wrench, raw.impact))
        return replace(raw, time=raw.time - late_s, wrench=wrench, impact=impact)

    def _put_right(self, loads: np.ndarray, here: np.ndarray) -> np.ndarray:
        """Loads (k, 2, 6) of plates with these errors (k, 2, 4)."""
        moment = loads[..., 3:] + np.cross(self._ground_offset(here), loads[..., :3])
        moment[..., 1] += here[..., 3] * loads[..., 1]
        result: np.ndarray = (1.0 + here[..., 2:3]) * np.concatenate([loads[..., :3], moment], axis=-1)
        return result

    def by_plate(self, loads: np.ndarray, carrier: np.ndarray, plates: np.ndarray) -> np.ndarray:
        """(n, 6, 4 p) derivative of the sum of corrected loads (n, 2, 6) with respect to the plates (p, 4)."""
        result = np.zeros((len(loads), 6, *plates.shape))
        raw = loads / (1.0 + plates[carrier][..., 2:3])
        for foot in range(2):
            under = carrier[:, foot, None] == np.arange(len(plates))
            for j, axis in enumerate((0, 2)):
                moment = np.cross(self.turn[:, axis], loads[:, foot, :3])
                result[:, 3:, :, j] += moment[:, :, None] * under[:, None, :]
            result[..., 2] += raw[:, foot, :, None] * under[:, None, :]
            result[:, 4, :, 3] += loads[:, foot, 1, None] * under
        return result.reshape(len(loads), 6, plates.size)

    def _ground_offset(self, plates: np.ndarray) -> np.ndarray:
        """(..., 3) m: offsets of plates (..., 4) in the trial's axes."""
        result: np.ndarray = plates[..., :1] * self.turn[:, 0] + plates[..., 1:2] * self.turn[:, 2]
        return result
