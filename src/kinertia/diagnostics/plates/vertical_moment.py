"""Do the plates' vertical moments rotate a walking person ever further to one side?

The body's angular momentum about the vertical through its centre of mass grows by the vertical moment of the ground
reactions about it. Gait is periodic, so the mean over whole strides is nearly zero: in symmetric gait the free moments
under the right and the left foot are mirror images and cancel.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.strides import periods
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.rule import rule
from kinertia.trial.centre_of_pressure import free_moment
from kinertia.trial.data import FloatArray, FootLoads
from kinertia.trial.sampled_time import TIME_TOLERANCE_S, span_s, within

VERTICAL_MOMENT_LEVER_M = 0.002
"""A mean vertical moment above body weight times this contradicts gait.

For 70 kg it is 1.4 N m: about a body's 1.2 kg m2 it adds 80 degrees a second with every stride. Of the measured walks
two hold a whole stride: Rajagopal's has 0.5 mm (1.6 at most, were the stride taken elsewhere), gait2354, where a plate
is wrong, 5 mm.
"""
_FREE_SHARE = 0.5
"""Share of the mean vertical moment from which on the free moments under the feet are its likeliest cause."""


@dataclass(frozen=True)
class MeanVerticalMoment:
    """Mean vertical moments (N m, positive rotates the body to the left) over whole strides.

    Attributes:
        moment_nm: moment of all ground reactions about the body.
        free_nm: free moments of the right and the left foot, each about its own centre of pressure.
        allowed_nm: largest moment that does not contradict gait.
        span_s: start and end of the strides, s.
    """

    moment_nm: float
    free_nm: tuple[float, float]
    allowed_nm: float
    span_s: tuple[float, float]

    @property
    def contradicts(self) -> bool:
        """Whether this moment is impossible in walking."""
        return abs(self.moment_nm) > self.allowed_nm

    @property
    def by_free_moments(self) -> bool:
        """Whether most of the moment is from free moments that have the same sign, or do not cancel."""
        return sum(self.free_nm) / self.moment_nm >= _FREE_SHARE


def vertical_moment(context: RecordingContext) -> Iterator[Finding]:
    """Report P266: a mean vertical moment about the middle of the pelvis markers, in the longest measured window; not
    in turns."""
    trial = context.trial
    if trial is None or not trial.windows() or not context.has_strides or context.turns:
        return
    markers = trial.markers.cut(*trial.windows()[0])
    pelvis = [label for label in markers.labels if context.segment_of_label.get(label) == "pelvis"]
    positions = markers.select(pelvis).positions
    seen = np.isfinite(positions).all(axis=(1, 2))
    if not pelvis or not seen.any():
        return
    mean = mean_vertical_moment(trial.loads, markers.time[seen], positions[seen].mean(axis=1))
    if mean is None or not mean.contradicts:
        return
    causes = rule("P266").causes
    if not mean.by_free_moments:
        causes = (*causes[1:], causes[0])
    yield finding(
        "P266",
        context.at(span_s=mean.span_s),
        causes=causes,
        moment_nm=Quantity(mean.moment_nm, "N m", limit=mean.allowed_nm),
        free_right_nm=Quantity(mean.free_nm[0], "N m"),
        free_left_nm=Quantity(mean.free_nm[1], "N m"),
    )


def mean_vertical_moment(loads: FootLoads, time: FloatArray, centre: FloatArray) -> MeanVerticalMoment | None:
    """Compute mean vertical moments over as many whole strides as the middle of a measured window holds.

    The position of the body need not be accurate, since the horizontal forces of whole strides cancel as well.

    Args:
        loads: loads with foot contacts or foot-offs that are whole strides apart.
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
    return MeanVerticalMoment(
        float(_vertical_moment(force, moment, body[:, None]).sum(axis=1).mean()),
        (float(free[0]), float(free[1])),
        VERTICAL_MOMENT_LEVER_M * float(force[..., 1].sum(axis=1).mean()),
        (float(first), float(last)),
    )


def _vertical_moment(force: FloatArray, moment: FloatArray, point: FloatArray) -> FloatArray:
    """Compute moments (k, 2) N m about these points from forces and moments about the ground origin (k, 2, 3)."""
    return moment[..., 1] - (point[..., 2] * force[..., 0] - point[..., 0] * force[..., 2])
