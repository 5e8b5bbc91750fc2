"""Do the plates' vertical free moments have the sign that the motion wants?

The vertical moment that the ground reactions have about the body must be what its segments need to turn as they do.
The measured motion with the literature's body says that to some N m, noise of a size that a sign does not know. Free
moments with the wrong sign are off by twice themselves: turned, they leave less. Of 14 trials from six laboratories,
among them runs, those with sound signs leave 1.1 to 2 times as much once they are turned; spoilt ones, and all those of
one public data set, walks and squats alike, 0.5 to 0.75 times. A run at 4 m/s leaves 0.8 times as much with one model
and 1.1 times with another: there the motion is too noisy to say.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from kinertia.estimation.result import TrialFit
from kinertia.trial.centre_of_pressure import FIRM_LOAD_N, free_moment

_LESS = 0.8
"""Share of what is left as measured, below which what is left with the sign turned speaks against the sign."""
_LARGE = 0.5
"""Share of what is left, below which twice the free moments are too small to be judged."""
VERTICAL = 4
"""Moment about the upward axis, among force and moment."""


def free_moment_sign_warnings(trials: Iterable[TrialFit]) -> Iterator[str]:
    """A sentence for each trial whose free moments go with the motion once their sign is turned."""
    for trial in trials:
        as_is, turned = left_moments_nm(trial.residuals["literature"][:, VERTICAL], trial.kinematics.foot_loads)
        if turned < _LESS * as_is:
            yield (
                f"{trial.name}: the plates' free moments (about the vertical, under each foot) seem to have the wrong "
                f"sign: with it turned, {turned:.1f} N m (RMS) are left between forces and motion in place of "
                f"{as_is:.1f}; check the sign of the vertical moment (Mz of a C3D file, the torque about the upward "
                f"axis of a force file), and export the forces again"
            )


def left_moments_nm(left: np.ndarray, foot_loads: np.ndarray) -> tuple[float, float]:
    """RMS about its mean of what forces and motion leave of the vertical moment, N m: as measured, and with the free
    moments' sign turned. Both alike where the free moments are too small to tell.

    Args:
        left: (w,) N m, as measured.
        foot_loads: (w, 2, 6) on both feet.
    """
    firm = foot_loads[..., 1] >= FIRM_LOAD_N
    free = free_moment(np.where(firm[..., None], foot_loads, 0.0)).sum(axis=1)
    as_is = float(np.std(left))
    if 2.0 * np.std(free) < _LARGE * as_is:
        return as_is, as_is
    return as_is, float(np.std(left + 2.0 * free))
