"""Tests the timing of forces by the body's vertical acceleration; it decides where nobody takes strides.

Who lands on the toes, sways or holds a foot in the air has markers of the feet that are slow, or quick, at other times
than plates are loaded. But a landing changes the body's velocity by metres a second, so that a delay shows.
"""

from __future__ import annotations

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.vertical_acceleration import MOST_LEFT, vertical_match_of

_DELAY_S = 0.03
"""Pelvis and markers' centre follow the forces of fault-free trials within this."""


def forces_keep_time(context: RecordingContext) -> bool:
    """Whether a recording without strides shows, by vertical velocities, that its forces are neither late nor early."""
    if context.has_strides:
        return False
    found = [one for part in context.velocities for one in vertical_match_of(part) if one.left <= MOST_LEFT]
    return bool(found) and max(abs(one.delay_s) for one in found) < _DELAY_S
