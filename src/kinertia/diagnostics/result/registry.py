"""Lists the checks of an estimate, and of a result, in the order in which they run."""

from kinertia.diagnostics.result.basis import basis, filters
from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import delays, zero_offsets
from kinertia.diagnostics.result.marker_errors import corrected_joints, moved_markers, sideways_lean
from kinertia.diagnostics.result.masses import attached_items, forces_of_the_motion, total_mass
from kinertia.diagnostics.result.plate_errors import (
    common_offset,
    free_moments,
    gains,
    missing_loads,
    plate_positions,
    plate_rotation,
)
from kinertia.diagnostics.result.residuals import joint_angles, residuals
from kinertia.diagnostics.result.soundness import soundness
from kinertia.diagnostics.runner import Check, asked
from kinertia.findings.finding import Finding

ESTIMATE_CHECKS: tuple[Check[ResultContext], ...] = (
    Check("R10", forces_of_the_motion),
    Check("R20", soundness),
    Check("P21", zero_offsets),
    Check("P22", gains),
    Check("P28", missing_loads),
    Check("P23", plate_rotation),
    Check("P24", plate_positions),
    Check("P24", common_offset),
    Check("M14", sideways_lean),
    Check("P26", free_moments),
    Check("T21", delays),
    Check("M16", moved_markers),
    Check("M17", corrected_joints),
    Check("S11", total_mass),
    Check("S40", attached_items),
    Check("R11", filters),
)
RESULT_CHECKS: tuple[Check[ResultContext], ...] = (
    Check("R30", residuals),
    Check("R30", joint_angles),
    Check("R40", basis),
)


def judged(context: ResultContext) -> list[Finding]:
    """Return all findings about an estimate, before explanation by one another or by those of earlier stages."""
    return asked((*ESTIMATE_CHECKS, *RESULT_CHECKS), context)
