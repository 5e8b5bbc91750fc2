"""M13: how precise are the markers? Rounded, noisy, or smoothed until the motion is gone.

A filter that is too strong leaves a file looking tidy. But a foot that swings and lands is quick, and the body goes up
and down as the forces make it, whatever the laboratory: on 20 measured and synthetic walks and runs, 0.8 to 6 % of the
energy of the feet's motion is above 4 Hz (0.4 % once filtered at 6 Hz, 0.02 % and less at 2 Hz), and forces move the
body 0.8 to 1.05 times as fast as its markers show.
"""

from __future__ import annotations

from collections.abc import Iterator

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.marker_precision import COARSE_M, USUAL_NOISE_M, USUAL_STEP_M
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity

_QUICK_HZ, _LEAST_QUICK, _USUAL_QUICK, _LEAST_SWING_M_S = 4.0, 0.002, (0.008, 0.06), 1.0
_MOST_TIMES_UP, _USUAL_TIMES_UP, _OF_A_RATE = 1.15, (0.7, 1.0), 1.8
_RIGID_M = 0.0115
"""Distances between markers of a shank change by up to 10 mm (median over pairs, 2 to 98 %). A filter shortens whatever
rotates quickly; a wrong rate does not."""
_MOSTLY_SEEN = 0.9


def precision(context: RecordingContext) -> Iterator[Finding]:
    """M131 and M132."""
    precise = context.marker_precision
    if precise.rounded:
        step = Quantity(precise.step_m, "m", limit=COARSE_M, usual=USUAL_STEP_M)
        yield finding("M131", context.at(), step_m=step)
    if precise.noisy:
        noise = Quantity(precise.noise_m, "m", limit=precise.noise_limit_m, usual=USUAL_NOISE_M)
        yield finding("M132", context.at(), noise_m=noise)
