"""What it costs that markers do not show the upper body.

The figures are differences of the joint moments (RMS over the window) with and without the markers of arms and head, or
of all of the upper body, in the walks of gait2354 and of Rajagopal's model: 1 to 7 N m in the legs and 3 to 11 N m at
the lumbar joint without trunk markers, 0.1 to 5 and 1 to 8 N m without those of the arms; all within their error bars.
"""

from __future__ import annotations

from collections.abc import Iterator

from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.gait27 import ARM_COORDINATES, VIRTUAL_TRUNK
from kinertia.model.skeleton import Skeleton


def unobserved_segments(skeleton: Skeleton) -> Iterator[Finding]:
    """R401 of a 27-DOF model that was adapted to its trials: trunk or arms without a marker."""
    locked = [name for name in ARM_COORDINATES if name in skeleton.locked]
    joined = len(locked) == len(ARM_COORDINATES)
    if VIRTUAL_TRUNK[0].label in skeleton.labels:
        part = "trunk, arms and head" if joined else "trunk and head"
        change = (1.0, 7.0)
    elif joined:
        part, change = "arms", (0.1, 5.0)
    elif locked:
        part, change = ", ".join(locked), (0.0, 5.0)
    else:
        return
    yield finding("R401", Where(part=part), moment_change_nm=Quantity(change, "N m"))
