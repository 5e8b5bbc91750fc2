"""Are axes, signs and units of forces right? Rotated and reversed forces compete to explain contradictions.

Forces integrated over time are the changes of the velocity of the centre of mass. The pelvis moves nearly like it in
walking, and so does the marker-based centre when limbs swing (running), but not when the trunk bends (squats). Along
each horizontal axis the mean of both correlations with the force-derived velocity is at least 0.5 on fault-free walks
and runs, 0.2 in squats.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.body_motion import (
    CLEARLY_BEST,
    DISTINGUISHABLE,
    HORIZONTAL,
    LEAST_CHANGE_M_S,
    ForceVelocity,
    VelocityChanges,
    VelocityResidual,
    misread_plate_residuals,
    push_share,
    rotated_residual,
)
from kinertia.diagnostics.evidence.force_mass import loaded_wrenches
from kinertia.diagnostics.plates.steps import AWAY, MUCH_SMALLER, forces_of_steps, moment_reversed
from kinertia.diagnostics.runner import NEEDS_VELOCITY, NEEDS_VERTICAL_FORCE, check
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity
from kinertia.findings.rule import rule
from kinertia.trial.data import LOAD_THRESHOLD_N, PlateLoads, Trial
from kinertia.trial.ground_contact import free_moment
from kinertia.trial.sampled_data import span_s

_OPPOSED = Limit(-0.4, usual=(0.5, 1.0))
_SHORTEST_S = 0.5
_CLEAR, _CLEAR_ROTATION, _ROTATED_DEG = 0.7, 0.35, 60.0
_ONE_REVERSED, _LEAST_REVERSED_M_S, _LONG_WINDOW_S = Limit(0.65), 0.08, 1.0
"""Where one plate's sign is wrong, reversing it leaves 0.04 to 0.57 of the residual on five trials; on nine fault-free
ones 0.9 (squats), 1.4 (runs) and more."""
_ONE_MISREAD = Limit(0.8)
"""Where one plate's axes are exchanged or rotated, undoing it leaves 0.06 to 0.78 on 19 walks, on fault-free ones 1 and
more."""
_LEAST_PUSH, _USUAL_PUSH = 0.02, (0.08, 0.3)
_VERTICAL_SHARE = 0.7
"""Share of the largest force; a foot pushes sideways and backwards by less."""
_WEAKEST_N = Limit(0.3)
"""Smallest peak of a load in kN, or in multiples of body weight."""
_LONGEST_ARM_M, _FEWEST = Limit(0.15, "m", usual=(0.0, 0.04)), 10
"""Free moment over vertical force; so many samples under load, at least."""


@dataclass(frozen=True)
class _Hypothesis:
    """A supposed fault, and the residual (m/s) of the velocities once it is undone."""

    found: Finding
    residual_m_s: float


@check(
    "P231",
    "P232",
    "P233",
    "P236",
    unless=NEEDS_VELOCITY,
    opposed=_OPPOSED,
    away=AWAY,
    moment=MUCH_SMALLER,
    reversed_share=_ONE_REVERSED,
    misread=_ONE_MISREAD,
    best=CLEARLY_BEST,
)
def force_directions(context: RecordingContext) -> Iterator[Finding]:
    """Report P231 to P233 and P236: the hypothesis with the smallest residual; other sufficient ones are among its
    causes.

    One about both axes is weighed against the best of each axis. Without strides the trunk bends: then pelvis and
    marker-based centre must both oppose the forces, and only a wrong sign of all forces is considered. Without
    velocities the forces of steps must point to the body.
    """
    if max((span_s(part.time) for part in context.velocities), default=0.0) < _SHORTEST_S:
        yield from forces_of_steps(context)
        return
    trial, plates, parts, changes = context.trial, context.plates, context.velocities, context.velocity_changes
    if trial is None or plates is None or changes is None:
        return
    residuals = {axis: _best_explained(plates, parts, axis) for axis in HORIZONTAL}
    correlations = _correlations(changes, context.has_strides)
    against = [axis for axis in HORIZONTAL if correlations[axis] < _OPPOSED and not _one_zero_off(trial, parts, axis)]
    best, others, both = [], [], []
    for axis in HORIZONTAL:
        explanations = [*_reversed_plate(context, plates, residuals[axis], axis)] if context.has_strides else []
        if axis in against:
            explanations.append(_reversed_axis(context, residuals[axis], correlations[axis], axis))
        explanations.sort(key=lambda explanation: explanation.residual_m_s)
        best += explanations[:1]
        others += explanations[1:]
        both.append(explanations[0].residual_m_s if explanations else residuals[axis].as_read)
    of_both = _rotated(context, changes, residuals, correlations, against), _misread_plate(context, plates, residuals)
    about_both = sorted(filter(None, of_both), key=lambda explanation: explanation.residual_m_s)
    if about_both and (not best or about_both[0].residual_m_s <= float(np.linalg.norm(both))):
        best, others = about_both[:1], [*about_both[1:], *best, *others]
    else:
        others += about_both
    for explanation in best:
        causes = explanation.found.causes or rule(explanation.found.code).causes
        rivals = tuple(f"{other.found.code} {other.found.message}" for other in others)
        yield replace(explanation.found, causes=(*causes, *rivals))


def _rotated(
    context: RecordingContext,
    changes: VelocityChanges,
    residuals: dict[int, VelocityResidual],
    correlations: dict[int, float],
    against: Sequence[int],
) -> _Hypothesis | None:
    """Report P231: rotated by 180 degrees where both axes oppose the motion, else by the angle at which forces follow
    it."""
    angle_deg, strength = _angle(changes)
    if len(against) == len(HORIZONTAL):
        angle, residual = np.pi, float(np.linalg.norm([of_axis.all_reversed for of_axis in residuals.values()]))
    elif context.has_strides and strength > _CLEAR_ROTATION and abs(angle_deg) > _ROTATED_DEG:
        angle = float(np.radians(90 * round(angle_deg / 90)))
        residual = rotated_residual(context.velocities, angle)
        # beside an opposed axis, one that agrees with the markers mostly shows that the forces are not rotated
        enough = -_OPPOSED if against else _CLEAR
        by_signs = np.linalg.norm([min(of_axis.as_read, of_axis.all_reversed) for of_axis in residuals.values()])
        if any(correlation > enough for correlation in correlations.values()) and residual > CLEARLY_BEST * by_signs:
            return None
    else:
        return None
    found = finding(
        "P231",
        context.at(),
        angle_rad=Quantity(angle, "rad", limit=float(np.radians(_ROTATED_DEG))),
        correlation=Quantity(tuple(correlations[axis] for axis in HORIZONTAL), "1", usual=_OPPOSED.usual),
        correlation_undone=Quantity(strength, "1", limit=_CLEAR_ROTATION),
    )
    return _Hypothesis(found, residual)


def _reversed_axis(context: RecordingContext, residual: VelocityResidual, correlation: float, axis: int) -> _Hypothesis:
    """Report P232: all plates have the wrong sign."""
    found = finding(
        "P232",
        context.at(**context.along(axis)),
        correlation=Quantity(correlation, "1", limit=_OPPOSED, usual=_OPPOSED.usual),
        velocity_residual_m_s=residual.evidence(residual.all_reversed, residual.as_read),
        beside=Quantity(" and the vertical moment" if moment_reversed(context.plates, axis) else ""),
    )
    return _Hypothesis(found, residual.all_reversed)


@check("P238", unless=NEEDS_VERTICAL_FORCE)
def vertical_signs(context: RecordingContext) -> Iterator[Finding]:
    """Report P238: a plate that was reversed when it was read, since its vertical force pointed down, unlike others',
    and that pushes first and brakes later since."""
    plates, reversed_ = (
        context.plates,
        {reported.where.plate for reported in context.recording.findings if reported.code == "F157"},
    )
    if plates is None or context.is_static:
        return
    pushes = {name: push_share(plates, p, context.travel) for p, name in enumerate(plates.names)}
    others = [share for name, share in pushes.items() if name not in reversed_ and share is not None]
    for name, share in pushes.items():
        if name in reversed_ and share is not None and share < -_LEAST_PUSH < 0.0 < min(others, default=-1.0):
            yield finding("P238", context.at(plate=name), push_share=Quantity(share, "1", usual=_USUAL_PUSH))


def _reversed_plate(
    context: RecordingContext, plates: PlateLoads, residual: VelocityResidual, axis: int
) -> Iterator[_Hypothesis]:
    """Report P233: one plate has the wrong sign, where others have it right.

    With its sign reversed, the forces must agree with the markers much better, and better than with the sign of any
    other plate or of all plates reversed, or with another zero.
    """
    best = int(np.argmin(residual.plate_reversed))
    left = float(residual.plate_reversed[best])
    rivals = [residual.all_reversed, residual.without_trend, *np.delete(residual.plate_reversed, best).tolist()]
    limit = min(_ONE_REVERSED * residual.as_read, CLEARLY_BEST * min(rivals))
    zero = int(np.argmin(residual.plate_zeroed))
    zeroed = float(residual.plate_zeroed[zero])
    if (
        len(plates.names) < 2
        or left > limit
        or residual.as_read < _LEAST_REVERSED_M_S
        or zeroed < DISTINGUISHABLE * left
    ):
        return
    evidence = {
        "velocity_residual_m_s": residual.evidence(left, limit),
        "rivals_m_s": Quantity((*rivals, zeroed), "m/s"),
    }
    sign, corners, _ = causes = rule("P233").causes
    if left < DISTINGUISHABLE * zeroed:
        causes = (sign, corners)
    else:  # a foot that pushes to one side all the time looks the same with another zero
        evidence |= {
            "zero_offset_n": Quantity(float(residual.zero_offset_n[zero]), "N"),
            "zero_of": Quantity(plates.names[zero]),
        }
    where = context.at(plate=plates.names[best], **context.along(axis))
    yield _Hypothesis(with_evidence("P233", where, evidence, causes=causes), left)


def _misread_plate(
    context: RecordingContext, plates: PlateLoads, residuals: dict[int, VelocityResidual]
) -> _Hypothesis | None:
    """Report P236: the axes of one plate are rotated by 90 degrees or exchanged, where others are right.

    With this undone, the forces must agree with the markers much better, and better than if any sign or zero is
    corrected.
    """
    as_read = float(np.linalg.norm([of_axis.as_read for of_axis in residuals.values()]))
    if len(plates.names) < 2 or not context.has_strides or as_read < _LEAST_REVERSED_M_S:
        return None
    shown = (context.velocities, _by_centre(context.velocities))
    left = min((misread_plate_residuals(plates.time, plates.force, parts) for parts in shown), key=np.min)
    best = int(np.argmin(left.min(axis=1)))
    signs = [
        min(of_axis.all_reversed, of_axis.without_trend, *of_axis.plate_reversed, of_axis.as_read)
        for of_axis in residuals.values()
    ]
    zeros = [min(sign, *of_axis.plate_zeroed) for sign, of_axis in zip(signs, residuals.values(), strict=True)]
    rivals = float(np.linalg.norm(signs)), float(np.linalg.norm(zeros))
    limit = min(_ONE_MISREAD * as_read, CLEARLY_BEST * rivals[0], rivals[1])
    residual = float(left.min())
    if residual > limit:
        return None
    found = finding(
        "P236",
        context.at(),
        plate=Quantity(plates.names[best]),
        velocity_residual_m_s=Quantity((as_read, residual), "m/s", limit=limit),
        rivals_m_s=Quantity(rivals, "m/s"),
    )
    return _Hypothesis(found, residual)


def _best_explained(plates: PlateLoads, parts: Sequence[ForceVelocity], axis: int) -> VelocityResidual:
    """Return the residual by pelvis and marker-based centre, or by the centre alone where that leaves less of long
    windows: the pelvis of runners sways along the direction of travel.
    """
    shown = [parts]
    if max(span_s(part.time) for part in parts) >= _LONG_WINDOW_S:
        shown.append(_by_centre(parts))
    found = [VelocityResidual.of(plates.time, plates.force, velocity, axis) for velocity in shown]
    return min(found, key=lambda candidate: min(candidate.as_read, float(candidate.plate_reversed.min())))


def _by_centre(parts: Sequence[ForceVelocity]) -> Sequence[ForceVelocity]:
    """Return the windows with the pelvis replaced by the marker-based centre."""
    return [replace(part, pelvis=part.centre) for part in parts]


def _one_zero_off(trial: Trial, parts: Sequence[ForceVelocity], axis: int) -> bool:
    """Return whether a zero offset under one foot explains more than reversing the sign of all plates."""
    residual = VelocityResidual.of(trial.loads.time, trial.loads.force, parts, axis)
    return bool(residual.plate_zeroed.min() < DISTINGUISHABLE * residual.all_reversed)


def _correlations(changes: VelocityChanges, strides: bool) -> dict[int, float]:
    """Return along each axis the correlation of force-derived velocities with pelvis and marker-based centre: in
    strides the mean of both, else the larger one; NaN where hardly anything moves.
    """
    result = {}
    for axis in HORIZONTAL:
        by_forces, *shown = (part[:, axis] for part in (changes.by_forces, changes.pelvis, changes.centre))
        still = min(part.std() for part in (by_forces, *shown)) < LEAST_CHANGE_M_S
        both = [] if still else [np.corrcoef(by_forces, part)[0, 1] for part in shown]
        result[axis] = float(np.mean(both) if strides else np.max(both)) if both else np.nan
    return result


def _angle(changes: VelocityChanges) -> tuple[float, float]:
    """Return the angle (deg) about the vertical from the markers' to the force-derived velocities, and their
    correlation once it is undone: of the mean over pelvis and marker-based centre.
    """
    # from Z to X is a positive rotation about Y
    by_forces, *shown = (part[:, 2] + 1j * part[:, 0] for part in (changes.by_forces, changes.pelvis, changes.centre))
    sizes = [max(float(np.linalg.norm(by_forces) * np.linalg.norm(part)), 1e-12) for part in shown]
    turn = sum(complex(np.vdot(part, by_forces)) / size for part, size in zip(shown, sizes, strict=True)) / len(shown)
    return float(np.degrees(np.angle(turn))), abs(turn)


@check("P201", "P202", "P203", weakest=_WEAKEST_N, threshold=Limit(LOAD_THRESHOLD_N), lever_arm=_LONGEST_ARM_M)
def axes_and_units(context: RecordingContext) -> Iterator[Finding]:
    """Report P201 to P203: forces in other axes or other units, going by the plates alone."""
    plates = context.plates
    if plates is None:
        return
    x, y, z = (float(value) for value in np.abs(plates.force).max(axis=(0, 1), initial=0.0))
    if y < _VERTICAL_SHARE * max(x, z):
        yield finding(
            "P201",
            context.at(**context.along(0 if x > z else 2)),
            peak_n=Quantity((x, y, z), "N"),
            vertical=Quantity(context.recording.vertical),
        )
    peak = _peak_of_weak_loads(plates)
    if peak is not None:
        yield finding(
            "P202",
            context.at(),
            peak_n=Quantity(peak, "N", limit=LOAD_THRESHOLD_N),
            unit=Quantity("kN or multiples of body weight"),
        )
    for name, wrench in loaded_wrenches(plates, _FEWEST):
        lever_arm_m = float(np.median(np.abs(free_moment(wrench)) / wrench[:, 1]))
        if lever_arm_m > _LONGEST_ARM_M:
            yield finding(
                "P203",
                context.at(plate=name),
                lever_arm_m=Quantity(lever_arm_m, "m", limit=_LONGEST_ARM_M, usual=_LONGEST_ARM_M.usual),
            )


def _peak_of_weak_loads(plates: PlateLoads) -> float | None:
    """Return the peak (N) where all loads are too small for a person and yet come and go as loads do; else None.

    A plate that no one steps on shows noise of up to some newtons, and perhaps an offset or a drift.
    """
    unloaded = plates.unloaded or ()
    peak = max((reading.peak_n for reading in unloaded), default=0.0)
    if plates.force.any() or not _WEAKEST_N < peak < LOAD_THRESHOLD_N:
        return None
    return peak if any(reading.like_steps and reading.peak_n > _WEAKEST_N for reading in unloaded) else None
