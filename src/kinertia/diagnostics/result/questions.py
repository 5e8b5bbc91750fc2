"""Lists the questions about an estimate, and about a result."""

from kinertia.diagnostics.result.basis import basis, filters
from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import delays, zero_offsets
from kinertia.diagnostics.result.marker_errors import corrected_joints, moved_markers
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
from kinertia.diagnostics.result.sideways_lean import sideways_lean
from kinertia.diagnostics.result.soundness import soundness
from kinertia.diagnostics.runner import Question, asked
from kinertia.findings.finding import Finding

ESTIMATE_QUESTIONS: tuple[Question[ResultContext], ...] = (
    Question("R10", forces_of_the_motion),
    Question("R20", soundness),
    Question("P21", zero_offsets),
    Question("P22", gains),
    Question("P28", missing_loads),
    Question("P23", plate_rotation),
    Question("P24", plate_positions),
    Question("P24", common_offset),
    Question("M14", sideways_lean),
    Question("P26", free_moments),
    Question("T21", delays),
    Question("M16", moved_markers),
    Question("M17", corrected_joints),
    Question("S11", total_mass),
    Question("S40", attached_items),
    Question("R11", filters),
)
RESULT_QUESTIONS: tuple[Question[ResultContext], ...] = (
    Question("R30", residuals),
    Question("R30", joint_angles),
    Question("R40", basis),
)


def judged(context: ResultContext) -> list[Finding]:
    """Return all findings about an estimate, before explanation by one another or by those of earlier stages."""
    return asked((*ESTIMATE_QUESTIONS, *RESULT_QUESTIONS), context)
