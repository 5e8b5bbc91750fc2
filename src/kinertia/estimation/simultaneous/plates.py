"""What force plates and clock may have wrong, and the ground reactions once that is put right.

Each plate may stand off its recorded place in the floor's plane, have a wrong gain, and read a vertical moment that is
not there, in proportion to the vertical force (crosstalk of its channels); forces may be recorded late. The plates are
the laboratory's: their offsets are in its axes and are shared by all trials, as is the clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.motion.smoothing import SmoothedSpline

PLATE_UNKNOWNS = {"x": "m", "z": "m", "gain": "1", "free moment": "N m/N"}
"""Of each plate, and its unit: offsets in the floor's plane, relative error of the gain, and what the vertical moment
lacks per vertical force."""


@dataclass(frozen=True)
class FootPlates:
    """Ground reactions of one trial over time, and which plate measured them.

    Attributes:
        loads: time -> (12) smoothed force and moment about the ground origin under the right foot, then the left.
        lost: (n, 2, 6) what smoothing took off the loads on each foot at the frames of the trial.
        plates: names.
        carrier: (n, 2) index into `plates` of the plate that each foot stands on, at the frames of the trial.
        turn: (3, 3) from the laboratory's axes to the trial's.
    """

    loads: SmoothedSpline
    lost: np.ndarray
    plates: tuple[str, ...]
    carrier: np.ndarray
    turn: np.ndarray

    @classmethod
    def one_per_foot(cls, loads: SmoothedSpline, n_frames: int) -> FootPlates:
        """A plate of its own under each foot, recorded in the trial's axes; smoothing took nothing off."""
        lost = np.zeros((n_frames, 2, 6))
        return cls(loads, lost, ("right foot", "left foot"), np.tile([0, 1], (n_frames, 1)), np.eye(3))

    def columns(self, plates: Sequence[str]) -> np.ndarray:
        """(n, 2) index into these plates (a session's) of the plate that each foot stands on."""
        result: np.ndarray = np.array([plates.index(name) for name in self.plates])[self.carrier]
        return result

    def corrected(self, time: np.ndarray, carrier: np.ndarray, plates: np.ndarray, derivative: int = 0) -> np.ndarray:
        """(n, 2, 6) loads on the feet at these times, of plates put right, or their time derivatives.

        Args:
            time: (n,) by the plates' clock.
            carrier: (n, 2) row of `plates` under each foot.
            plates: (p, 4) what is wrong with the plates.
        """
        loads = self.loads(time, derivative).reshape(len(time), 2, 6)
        here = plates[carrier]
        loads[..., 3:] += np.cross(self._ground_offset(here), loads[..., :3])
        loads[..., 4] += here[..., 3] * loads[..., 1]
        result: np.ndarray = (1.0 + here[..., 2:3]) * loads
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
