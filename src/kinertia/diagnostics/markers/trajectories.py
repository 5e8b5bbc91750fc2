"""M11: are single trajectories intact? Spikes, jumps, frozen markers and gaps filled with straight lines."""

from __future__ import annotations

from collections.abc import Iterator

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.trajectory_faults import (
    BODY_M,
    MOST_SPIKES,
    OFF_M,
    USUAL_STEP_M,
    spike_limit_m,
    step_limit_m,
)
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity


def trajectories(context: RecordingContext) -> Iterator[Finding]:
    """M111 to M114: faults of single trajectories, one finding per marker with spikes, per jump and per filled gap."""
    faults, rate_hz = context.trajectory_faults, context.markers.rate_hz
    for spikes in faults.spikes:
        yield finding(
            "M111",
            context.at(markers=(spikes.label,), span_s=spikes.span_s),
            Severity.ERROR if spikes.far_frames > MOST_SPIKES else None,
            distance_m=Quantity(spikes.distance_m, "m", limit=spike_limit_m(rate_hz), usual=(0.0, BODY_M)),
            frames=Quantity(float(spikes.frames), "1"),
            first_s=Quantity(spikes.span_s[0], "s"),
        )
    for jump in faults.jumps:
        yield finding(
            "M112",
            context.at(markers=(jump.label,), span_s=jump.span_s),
            step_m=Quantity(jump.step_m, "m", limit=step_limit_m(rate_hz), usual=USUAL_STEP_M),
            time_s=Quantity(jump.span_s[1], "s"),
        )
    for filled in faults.filled:
        yield finding(
            "M113" if filled.frozen else "M114",
            context.at(markers=(filled.label,), span_s=filled.span_s),
            span_s=Quantity(filled.span_s[1] - filled.span_s[0], "s"),
            relative_motion_m=Quantity(filled.relative_motion_m, "m", limit=OFF_M),
        )
