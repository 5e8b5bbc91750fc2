"""Selects the bandwidth of a trial's motion and of its forces.

The knot spacing of the motion's splines limits the bandwidth: they have no accelerations above it. The required
bandwidth follows from the ground reactions, whose sum is the body's mass times the acceleration of its centre of mass,
free of marker noise: the motion must leave no larger residual of this sum than rigid segments leave anyway. A slow walk
needs 10 Hz, a brisk one 12, impacts more than markers can resolve. Each trial of a session has its own bandwidth: at
that of a brisk walk, the accelerations of a slow one would be noise. For trials synthesised with OpenSim from walks at
1.3 m/s, hip moments err by 2.0 N m with 10 Hz, 1.7 with 12, 1.8 with 15, 2.9 with 20; body segment parameters do not
depend on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from kinertia.motion.kinematics import Kinematics
from kinertia.settings import ForceCutoff

LADDER_HZ = (10.0, 12.0, 15.0)
LEFT_SHARE_OF_WEIGHT = 0.005
"""Largest RMS residual of the ground reactions that the motion may leave, as a share of their mean vertical force."""
_FRAMES_PER_CYCLE = 5.0
"""Frames per cycle that markers need: they resolve nothing faster than the frame rate over this."""


@dataclass(frozen=True)
class Bandwidth:
    """Bandwidths of a trial's motion and forces.

    Attributes:
        motion_hz: half the knot rate of its splines, and low-pass cutoff of the forces in the root equations.
        force: bandwidth of the forces in joint moments.
    """

    motion_hz: float
    force: ForceCutoff = "auto"

    @property
    def spacing_s(self) -> float:
        """Knot spacing of the splines, s."""
        return 1.0 / (2.0 * self.motion_hz)

    @classmethod
    def of(
        cls, trials: Sequence[Kinematics], cutoff_hz: float | Literal["gcv"] = "gcv", force: ForceCutoff = "auto"
    ) -> tuple[Self, ...]:
        """Select the bandwidth that each of these trials needs, unless the user set one for all.

        Args:
            trials: of one estimate.
            cutoff_hz, force: as in `Settings`.
        """
        if not isinstance(cutoff_hz, str):
            return (cls(cutoff_hz, force),) * len(trials)
        return tuple(cls(_needed_hz(kinematics), force) for kinematics in trials)


def _needed_hz(kinematics: Kinematics) -> float:
    """Return the narrowest bandwidth (Hz) that leaves little residual force and that the markers can resolve."""
    loads = kinematics.trial.loads
    inside = kinematics.inside(loads.time)
    force = loads.force[inside].sum(axis=1)
    limit = LEFT_SHARE_OF_WEIGHT * force[:, 1].mean()
    most = kinematics.trial.markers.rate_hz / _FRAMES_PER_CYCLE
    steps = [step for step in LADDER_HZ if step <= most] or [LADDER_HZ[0]]
    for cutoff_hz in steps:
        smoothed = kinematics.smoothed_loads(cutoff_hz)(loads.time[inside]).reshape(-1, 2, 6)[..., :3].sum(axis=1)
        if np.sqrt(np.square(force - smoothed).sum(axis=1).mean()) <= limit:
            return cutoff_hz
    return steps[-1]
