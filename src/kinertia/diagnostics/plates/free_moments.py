"""Are the free moments right, going by the plates alone and by a walker who turns to no side?

By definition the moment about the centre of pressure has no horizontal part: in eleven fault-free force files the
median lever arm is 0.0 mm, the 99th percentile at most 10 mm (where forces are smallest). Moments about the middle of
the plate have horizontal parts, with lever arms of some 20 mm and more.

Where the file has only the vertical moment, a fixed point may explain it: about a point other than the centre of
pressure, the horizontal forces also have a vertical moment. On 25 fault-free trials the free moment is at most 0.023 m
(0.033 m in synthetic laboratories) times the vertical force (95th percentile), or no point accounts for more than a
fifth of it. About the middle of the plate it is 0.037 to 0.086 m, and 1.9 to 11 times the residual about that point.

The body's angular momentum about the vertical through its centre of mass grows by the vertical moment of the ground
reactions about it. Gait is periodic, so the mean over whole strides is nearly zero: in symmetric gait the free moments
under the right and the left foot are mirror images and cancel.
"""

from collections.abc import Container, Iterator
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.foot_trajectories import periods
from kinertia.diagnostics.evidence.force_mass import carrying, loaded_wrenches
from kinertia.diagnostics.runner import NEEDS_VELOCITY, NEEDS_VERTICAL_FORCE, check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity
from kinertia.findings.rule import rule
from kinertia.trial.data import FloatArray, FootLoads, PlateLoads
from kinertia.trial.file_contents import TorqueColumns
from kinertia.trial.ground_contact import centre_of_pressure, free_moment
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, rms, span_s, within

_ABSENT_NM = Limit(0.005, "N m")
"""Amplifiers have more noise than this. Feet twist against the ground by some N m."""
_COLUMNS_ARM_M = Limit(0.005, "m", usual=(0.0, 0.001))
"""A load displaced by this much changes joint moments by 2 to 4 N m."""
_LITTLE, _SOME_NM, _LARGEST_NM = 0.1, 0.2, 10.0
"""RMS of free moments of walks and runs: 0.8 to 6 N m."""
_LONG_ARM_M, _USUAL_PERCENT, _ACCOUNTED, _FEWEST = 0.034, 95.0, 1.8, 20
VERTICAL_MOMENT_LEVER_M = Limit(0.002, "m")
"""A mean vertical moment above body weight times this contradicts gait.

For 70 kg it is 1.4 N m: about a body's 1.2 kg m2 it adds 80 degrees a second with every stride. Of the measured walks
two hold a whole stride: Rajagopal's has 0.5 mm (1.6 at most, were the stride taken elsewhere), gait2354, where a plate
is wrong, 5 mm.
"""
_FREE_SHARE = 0.5
"""Share of the mean vertical moment from which on the free moments under the feet are its likeliest cause."""


@check("P261", "P262", "P263", "P264", unless=NEEDS_VERTICAL_FORCE, lever_arm=_COLUMNS_ARM_M, absent=_ABSENT_NM)
def free_moments(context: RecordingContext) -> Iterator[Finding]:
    """Report P261 to P264: free moments that contradict the forces of their plate."""
    plates = context.plates
    if plates is None:
        return
    columns = [*_columns(context, plates)]
    yield from columns
    yield from _about_fixed_point(context, plates, [column.where.plate for column in columns])
    yield from _exchanged(context, plates)
    for name, wrench in carrying(plates, context.adult_share):
        peak = float(np.abs(free_moment(wrench)).max())
        if peak < _ABSENT_NM:
            place, evidence = context.at(plate=name), Quantity(peak, "N m", limit=_ABSENT_NM)
            yield finding("P264", place, peak_nm=evidence, plates=Quantity(name))


def _columns(context: RecordingContext, plates: PlateLoads) -> Iterator[Finding]:
    """Report P261 and P262: moment columns that are not the free moments at their centres of pressure."""
    for name, torque in zip(plates.names, plates.torques or (), strict=plates.torques is not None):
        x, _, z = torque.rms_nm
        across = float(np.hypot(x, z))
        if _is_rotated(torque, across):
            yield finding(
                "P262",
                context.at(plate=name, **context.along(2 if z > x else 0)),
                rms_nm=Quantity(torque.rms_nm, "N m"),
            )
        elif torque.lever_arm_m > _COLUMNS_ARM_M:
            yield finding(
                "P261",
                context.at(plate=name),
                lever_arm_m=Quantity(torque.lever_arm_m, "m", limit=_COLUMNS_ARM_M, usual=_COLUMNS_ARM_M.usual),
                horizontal_rms_nm=Quantity(across, "N m"),
                method=Quantity("columns"),
            )


def _is_rotated(columns: TorqueColumns, across_nm: float) -> bool:
    """Return whether a free moment is in the column of a horizontal axis: the columns have its size."""
    some = columns.lever_arm_m > 0.0 and _SOME_NM < across_nm < _LARGEST_NM
    return bool(some and columns.rms_nm[1] < _LITTLE * across_nm)


def _about_fixed_point(
    context: RecordingContext, plates: PlateLoads, explained: Container[str | None]
) -> Iterator[Finding]:
    """Report P261: vertical moments about a fixed point, the plate's middle or the origin (Mz for Tz), not free
    moments. Beside one plate whose moments are too large, smaller ones that a point explains are of the same kind,
    in force files, whose export made all of them alike.
    """
    found, too_large = [], False
    for name, wrench in loaded_wrenches(plates, _FEWEST):
        if name in explained:
            continue
        torque = free_moment(wrench)
        lever_arm_m = float(np.percentile(np.abs(torque) / wrench[:, 1], _USUAL_PERCENT))
        point, left = _fixed_point(wrench, torque)
        if rms(torque) > _ACCOUNTED * rms(left) and (lever_arm_m > _LONG_ARM_M or plates.corners is None):
            too_large |= lever_arm_m > _LONG_ARM_M
            found.append(
                finding(
                    "P261",
                    context.at(plate=name),
                    lever_arm_m=Quantity(lever_arm_m, "m", limit=_LONG_ARM_M, usual=(0.0, 0.023)),
                    rms_nm=Quantity(rms(torque), "N m"),
                    left_rms_nm=Quantity(rms(left), "N m", limit=rms(torque) / _ACCOUNTED),
                    point_m=Quantity((float(point[0]), float(point[1])), "m"),
                    method=Quantity("fixed point"),
                )
            )
    if too_large:
        yield from found


def _fixed_point(wrench: FloatArray, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find the point (x, z) m about which torques (k,) N m would be moments of wrenches (k, 6), and the residual."""
    acts = centre_of_pressure(wrench)
    forces = wrench[:, [0, 2]]
    about_origin = acts[:, 2] * forces[:, 0] - acts[:, 0] * forces[:, 1]
    (along_z, along_x), *_ = np.linalg.lstsq(forces * [-1.0, 1.0], torque - about_origin, rcond=None)
    point = np.array([along_x, along_z])
    left: FloatArray = torque - about_origin - forces @ np.array([-along_z, along_x])
    return point, left


def _exchanged(context: RecordingContext, plates: PlateLoads) -> Iterator[Finding]:
    """Report P263: moment columns of two plates interchanged, by the residuals of each plate while it is loaded."""
    torques = plates.torques or ()
    for a, torque in enumerate(torques):
        b = torque.belongs_to
        if b is not None and a < b:
            yield finding(
                "P263",
                context.at(),
                own_rms_nm=Quantity(tuple(exchanged.rms_nm[1] for exchanged in (torque, torques[b])), "N m"),
                plate=Quantity(plates.names[a]),
                other=Quantity(plates.names[b]),
            )


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


@check("P266", unless=NEEDS_VELOCITY, lever_arm=VERTICAL_MOMENT_LEVER_M)
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
