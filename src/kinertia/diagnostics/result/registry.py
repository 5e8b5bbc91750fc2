"""Lists the checks of an estimate, and of a result, as a list."""

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import delays, zero_offsets
from kinertia.diagnostics.result.plate_errors import (
    common_offset,
    free_moments,
    gains,
    missing_loads,
    plate_positions,
    plate_rotation,
)
from kinertia.diagnostics.result.residuals import (
    corrected_joints,
    joint_angles,
    moved_markers,
    residuals,
    sideways_lean,
)
from kinertia.diagnostics.result.soundness import attached_items, forces_of_the_motion, soundness, total_mass
from kinertia.diagnostics.result.suitability import basis, filters
from kinertia.diagnostics.runner import Check, asked
from kinertia.findings.finding import Finding

ESTIMATE_CHECKS: tuple[Check[ResultContext], ...] = (
    forces_of_the_motion,
    soundness,
    zero_offsets,
    gains,
    missing_loads,
    plate_rotation,
    plate_positions,
    common_offset,
    sideways_lean,
    free_moments,
    delays,
    moved_markers,
    corrected_joints,
    total_mass,
    attached_items,
    filters,
)
RESULT_CHECKS: tuple[Check[ResultContext], ...] = (
    residuals,
    joint_angles,
    basis,
)


def judged(context: ResultContext) -> list[Finding]:
    """Return all findings about an estimate, before explanation by one another or by those of earlier stages."""
    return asked((*ESTIMATE_CHECKS, *RESULT_CHECKS), context)
