"""M11: are single trajectories intact? Spikes, jumps, frozen markers, filled gaps, and one marker with two labels."""

from collections.abc import Iterator

import numpy as np

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
from kinertia.trial.sampled_time import windows

_COINCIDING_M, _COINCIDING_S, _MOSTLY = 0.003, 0.1, 0.5
"""The centres of two markers are at least a diameter apart: 4 mm for the smallest."""


def trajectories(context: RecordingContext) -> Iterator[Finding]:
    """Report M111 to M115: faults of single trajectories, one finding per marker with spikes, per jump and per filled
    gap; and labels of one and the same marker.
    """
    yield from _coinciding(context)
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


def _coinciding(context: RecordingContext) -> Iterator[Finding]:
    """Report M115: pairs of labels of the marker set that coincide for a while."""
    markers = context.markers
    if len(markers.time) < 2:
        return
    used = [k for k, label in enumerate(markers.labels) if label in context.segment_of_label]
    every = max(1, int(_COINCIDING_S * markers.rate_hz / 2))
    some = markers.positions[::every, used]
    for k, one in enumerate(used):
        near = (np.linalg.norm(some[:, k + 1 :] - some[:, k, None], axis=2) < _COINCIDING_M).any(axis=0)
        for other in np.array(used)[k + 1 :][near].tolist():
            apart = np.linalg.norm(markers.positions[:, one] - markers.positions[:, other], axis=1)
            same = np.asarray(apart < _COINCIDING_M)
            span_s = windows(markers.time, same)[0]
            if span_s[1] - span_s[0] >= _COINCIDING_S:
                yield finding(
                    "M115",
                    context.at(markers=(markers.labels[one], markers.labels[other]), span_s=span_s),
                    Severity.ERROR if same.sum() > _MOSTLY * np.isfinite(apart).sum() else None,
                    distance_m=Quantity(float(np.median(apart[same])), "m", limit=_COINCIDING_M),
                )
