"""Are the free moments right, going by the plates alone?

By definition the moment about the centre of pressure has no horizontal part: in eleven fault-free force files the
median lever arm is 0.0 mm, the 99th percentile at most 10 mm (where forces are smallest). Moments about the middle of
the plate have horizontal parts, with lever arms of some 20 mm and more.

Where the file has only the vertical moment, a fixed point may explain it: about a point other than the centre of
pressure, the horizontal forces also have a vertical moment. On 25 fault-free trials the free moment is at most 0.023 m
(0.033 m in synthetic laboratories) times the vertical force (95th percentile), or no point accounts for more than a
fifth of it. About the middle of the plate it is 0.037 to 0.086 m, and 1.9 to 11 times the residual about that point.
"""

from collections.abc import Container, Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.loaded_plates import carrying, loaded_wrenches
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.centre_of_pressure import centre_of_pressure, free_moment
from kinertia.trial.data import FloatArray, PlateLoads
from kinertia.trial.file_contents import TorqueColumns
from kinertia.trial.rms import rms

_ABSENT_NM = 0.005
"""Amplifiers have more noise than this. Feet twist against the ground by some N m."""
_COLUMNS_ARM_M, _USUAL_COLUMNS_ARM_M = 0.005, 0.001
"""A load displaced by this much changes joint moments by 2 to 4 N m."""
_LITTLE, _SOME_NM, _LARGEST_NM = 0.1, 0.2, 10.0
"""RMS of free moments of walks and runs: 0.8 to 6 N m."""
_LONG_ARM_M, _USUAL_PERCENT, _ACCOUNTED, _FEWEST = 0.034, 95.0, 1.8, 20


def free_moments(context: RecordingContext) -> Iterator[Finding]:
    """Report P261 to P264: free moments that contradict the forces of their plate."""
    plates = context.plates
    if plates is None:
        return
    columns = [*_columns(context, plates)]
    yield from columns
    yield from _about_fixed_point(context, plates, [one.where.plate for one in columns])
    yield from _exchanged(context, plates)
    for name, wrench in carrying(plates, context.adult_share):
        peak = float(np.abs(free_moment(wrench)).max())
        if peak < _ABSENT_NM:
            place, evidence = context.at(plate=name), Quantity(peak, "N m", limit=_ABSENT_NM)
            yield finding("P264", place, peak_nm=evidence, plates=Quantity(name))


def _columns(context: RecordingContext, plates: PlateLoads) -> Iterator[Finding]:
    """Report P261 and P262: moment columns that are not the free moments at their centres of pressure."""
    for name, one in zip(plates.names, plates.torques or (), strict=plates.torques is not None):
        x, _, z = one.rms_nm
        across = float(np.hypot(x, z))
        if _is_rotated(one, across):
            yield finding(
                "P262", context.at(plate=name, **context.along(2 if z > x else 0)), rms_nm=Quantity(one.rms_nm, "N m")
            )
        elif one.lever_arm_m > _COLUMNS_ARM_M:
            usual = (0.0, _USUAL_COLUMNS_ARM_M)
            yield finding(
                "P261",
                context.at(plate=name),
                lever_arm_m=Quantity(one.lever_arm_m, "m", limit=_COLUMNS_ARM_M, usual=usual),
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
    for a, one in enumerate(torques):
        b = one.belongs_to
        if b is not None and a < b:
            yield finding(
                "P263",
                context.at(),
                own_rms_nm=Quantity(tuple(each.rms_nm[1] for each in (one, torques[b])), "N m"),
                plate=Quantity(plates.names[a]),
                other=Quantity(plates.names[b]),
            )
