"""L211: do two markers take each other's labels during the trial?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.trajectory_faults import step_limit_m, steps
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity

_NEAR_M = 0.04
"""Each is this near to where the other was a frame before."""


def label_swaps(context: RecordingContext) -> Iterator[Finding]:
    """L211, one per swap: where labels go back to their own markers there is another."""
    markers = context.measured_markers
    if len(markers.time) < 5:
        return
    jumps = np.nan_to_num(np.linalg.norm(steps(markers.positions), axis=-1)) > step_limit_m(markers.rate_hz)
    for frame in np.flatnonzero(jumps.sum(axis=1) >= 2):
        jumping = np.flatnonzero(jumps[frame])
        before, after = markers.positions[frame + 1, jumping], markers.positions[frame + 2, jumping]
        apart = np.linalg.norm(before[:, None] - before, axis=-1)
        landed = np.linalg.norm(after[:, None] - before, axis=-1)
        swapped = np.maximum(landed, landed.T) < np.minimum(_NEAR_M, 0.5 * apart)
        span = (float(markers.time[frame + 1]), float(markers.time[frame + 2]))
        for a, b in np.argwhere(np.triu(swapped, 1)):
            yield finding(
                "L211",
                context.at(markers=(markers.labels[jumping[a]], markers.labels[jumping[b]]), span_s=span),
                distance_m=Quantity(float(apart[a, b]), "m"),
                time_s=Quantity(span[1], "s"),
            )
