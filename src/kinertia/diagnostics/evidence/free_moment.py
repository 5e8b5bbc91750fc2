"""Does the ground turn a walking person ever further to one side? What can be said of the plates' vertical moments.

The body's angular momentum about the vertical through its centre of mass grows by the vertical moment of the ground
reactions about it. Gait repeats itself, so that over whole strides the mean is next to nothing: in symmetric gait the
free moments under the right and the left foot are mirror images and cancel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.evidence.strides import periods
from kinertia.trial.centre_of_pressure import free_moment
from kinertia.trial.data import FloatArray, FootLoads
from kinertia.trial.sampled_time import TIME_TOLERANCE_S, span_s, within

TURNING_LEVER_M = 0.002
"""A mean vertical moment above body weight times this contradicts gait.

For 70 kg it is 1.4 N m: about a body's 1.2 kg m2 it adds 80 degrees a second with every stride. Of the measured walks
two hold a whole stride: Rajagopal's has 0.5 mm (1.6 at most, were the stride taken elsewhere), gait2354, where a plate
is wrong, 5 mm.
"""


@dataclass(frozen=True)
class Turning:
    """Mean vertical moments (N m, positive turns to the left) over whole strides.

    Attributes:
        moment_nm: of all ground reactions about the body.
        free_nm: of the right and the left foot about its own centre of pressure: the free moments.
        allowed_nm: largest moment that does not contradict gait.
        start_s, end_s: the strides.
    """

    moment_nm: float
    free_nm: tuple[float, float]
    allowed_nm: float
    start_s: float
    end_s: float

    @property
    def contradicts(self) -> bool:
        """Whether nobody can walk like that."""
        return abs(self.moment_nm) > self.allowed_nm

    def sentence(self) -> str:
        """What was found and, where it contradicts gait, what to do."""
        mean = f"the mean vertical moment over whole strides ({self.start_s:.2f} to {self.end_s:.2f} s)"
        if not self.contradicts:
            return f"{mean} is near zero, as it should be ({self.moment_nm:+.1f} N m)"
        right, left = self.free_nm
        text = (
            f"{mean} is {abs(self.moment_nm):.1f} N m to the {'left' if self.moment_nm > 0 else 'right'}; it should "
            f"be near zero (within {self.allowed_nm:.1f})"
        )
        if (right + left) / self.moment_nm < 0.5:
            return f"{text}; check the places and axes of the plates, and that nothing else was touched"
        same = "have the same sign" if right * left > 0 else "do not cancel"
        return (
            f"{text}; the free moments under the feet {same} (right {right:+.1f}, left {left:+.1f} N m, opposite "
            f"signs expected): check zero, sign and calibration of the plates' vertical moments, and export them again"
        )


def mean_turning(loads: FootLoads, time: FloatArray, centre: FloatArray) -> Turning | None:
    """The mean vertical moments over as many whole strides as the middle of a measured window holds.

    Where the body is need not be known well: the horizontal forces of whole strides cancel, too.

    Args:
        loads: with landings or leavings that are whole strides apart.
        time: (n,) s, a window in which all ground contact is measured.
        centre: (n, 3) m, a point that moves with the trunk, such as the middle of the pelvis.

    Returns:
        None where the window holds no whole stride, or a foot was on no plate in it.
    """
    strides = [period for period in periods(loads)[0] if period <= span_s(time) + TIME_TOLERANCE_S]
    if not strides:
        return None
    first, last = ((time[0] + time[-1] + sign * max(strides)) / 2 for sign in (-1, 1))
    inside = within(loads.time, first, last)
    force, moment = loads.force[inside], loads.moment[inside]
    loaded = force[..., 1] > 0
    if not loaded.any(axis=0).all():
        return None
    body = np.stack([np.interp(loads.time[inside], time, centre[:, axis]) for axis in range(3)], axis=1)
    # the height of the floor cancels
    free = np.where(loaded, free_moment(loads.wrench[inside]), 0.0).mean(axis=0)
    return Turning(
        float(_vertical_moment(force, moment, body[:, None]).sum(axis=1).mean()),
        (float(free[0]), float(free[1])),
        TURNING_LEVER_M * float(force[..., 1].sum(axis=1).mean()),
        float(first),
        float(last),
    )


def _vertical_moment(force: FloatArray, moment: FloatArray, point: FloatArray) -> FloatArray:
    """(k, 2) N m about these points, of forces and their moments about the ground origin (k, 2, 3)."""
    return moment[..., 1] - (point[..., 2] * force[..., 0] - point[..., 0] * force[..., 2])
