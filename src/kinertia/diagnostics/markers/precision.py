"""M131 and M132: how precise are the coordinates of the markers? Rounded or noisy ones are found."""

from collections.abc import Iterator

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.marker_precision import COARSE_M, USUAL_NOISE_M, USUAL_STEP_M
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity


def precision(context: RecordingContext) -> Iterator[Finding]:
    """Report M131 and M132: coarsely rounded coordinates, and noisy ones."""
    precise = context.marker_precision
    if precise.rounded:
        step = Quantity(precise.step_m, "m", limit=COARSE_M, usual=USUAL_STEP_M)
        yield finding("M131", context.at(), step_m=step)
    if precise.noisy:
        noise = Quantity(precise.noise_m, "m", limit=precise.noise_limit_m, usual=USUAL_NOISE_M)
        yield finding("M132", context.at(), noise_m=noise)
