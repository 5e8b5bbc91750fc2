"""Compares estimated masses with stated ones and with the forces: S11, S40 and R10."""

from collections.abc import Iterator

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.runner import check
from kinertia.estimation.prepare.prepared import mass_by_force_kg
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.bsp import BodySegmentParameters

_MOTION = Limit(0.05)
"""Masses by force may differ by this share between inverse kinematics and the marker-based centre of mass."""
_TOTAL = Limit(0.03)
"""Share by which the estimated total mass may differ from the stated one."""
_IDENTIFIED_SD = Limit(2.0)
"""SDs of its mass from which on an attached item differs from nothing."""


def mass_from_force_kg(literature: BodySegmentParameters, trial: TrialFit) -> float:
    """Compute body mass (kg) from the vertical ground reaction of a fitted trial and its inverse kinematics."""
    return mass_by_force_kg(literature, trial.kinematics.foot_loads, trial.residuals["literature"])


@check("R107", share=_MOTION)
def forces_of_the_motion(context: ResultContext) -> Iterator[Finding]:
    """Report R107: trials whose forces give another body mass with the motion of inverse kinematics than with the
    markers'."""
    for trial in context.fit.trials:
        by_markers = context.force_masses.get(trial.name)
        if by_markers is None:
            continue
        by_motion_kg = mass_from_force_kg(context.ready.literature, trial)
        limit = _MOTION * by_markers.mass_kg + 2.0 * by_markers.sd_kg
        if abs(by_motion_kg - by_markers.mass_kg) > limit:
            yield finding(
                "R107",
                Where(trial=trial.name),
                by_motion_kg=Quantity(by_motion_kg, "kg", limit=limit),
                by_markers_kg=Quantity(by_markers.mass_kg, "kg", sd=by_markers.sd_kg),
            )


@check("S113", share=_TOTAL)
def total_mass(context: ResultContext) -> Iterator[Finding]:
    """Report S113: an estimated total mass that follows the plates more than the stated mass."""
    total_kg, stated = context.fit.estimate.total_mass_kg, context.ready.total_mass
    limit = _TOTAL * stated.total_kg + 2.0 * stated.sd_kg
    if abs(total_kg - stated.total_kg) > limit:
        yield finding(
            "S113",
            estimate_kg=Quantity(total_kg, "kg", limit=limit),
            stated_kg=Quantity(stated.total_kg, "kg", sd=stated.sd_kg),
        )


@check("S407", distance=_IDENTIFIED_SD)
def attached_items(context: ResultContext) -> Iterator[Finding]:
    """Report S407: attached items of unknown mass that the trials cannot distinguish from zero."""
    estimate, posterior = context.fit.estimate, context.fit.posterior
    for item in () if posterior is None else context.ready.attached:
        row = estimate.segments.index(item.name)
        mass_kg, sd_kg = float(estimate.mass_kg[row]), float(posterior.sd[row, 0]) if posterior else 0.0
        if item.mass_kg is None and mass_kg < _IDENTIFIED_SD * sd_kg:
            mass = Quantity(mass_kg, "kg", limit=_IDENTIFIED_SD * sd_kg, sd=sd_kg)
            yield finding(
                "S407", Where(part=item.name), mass_kg=mass, sd=Quantity(sd_kg, "kg"), name=Quantity(item.name)
            )
