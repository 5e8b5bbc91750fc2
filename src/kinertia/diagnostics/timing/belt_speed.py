"""Does the stated belt speed fit? Feet in stance move with the belt."""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.foot_trajectories import LEAST_BELT_M_S, standing_speeds
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.trial.plate_assignment import FOOT_NAMES

_APART = Limit(0.25)
"""Share by which a stated speed may differ from the one of standing feet, which roll."""
_KM_H = 3.6


@check("T301", apart=_APART, slow=Limit(LEAST_BELT_M_S, "m/s"))
def belt_speed(context: RecordingContext) -> Iterator[Finding]:
    """Report T301: a stated belt speed that differs from the speed of feet in stance; of two feet, the larger error."""
    belt, time = context.recording.belt, context.all_markers.time
    if belt is None or context.feet is None:
        return
    speeds = standing_speeds(context.all_markers, context.feet)
    if speeds is None:
        return
    stated = [belt.under(foot).distance_m(*time[[0, -1]]) / float(np.ptp(time)) for foot in range(2)]
    pairs = list(zip(stated, speeds, strict=True))
    excess = [abs(one - other) / max(_APART * max(one, other), LEAST_BELT_M_S) for one, other in pairs]
    worst = int(np.argmax(excess))
    if excess[worst] <= 1.0:
        return
    causes: tuple[str, ...] = ()
    if belt.speed_m_s.ndim == 2 and np.abs(np.subtract(stated, speeds[::-1])).max() < LEAST_BELT_M_S:
        causes = ("right and left belt interchanged",)
    elif abs(stated[worst] / max(speeds[worst], 1e-9) / _KM_H - 1) < _APART:
        causes = ("a speed in km/h",)
    yield finding(
        "T301",
        context.at(),
        causes=causes,
        stated_m_s=Quantity(stated[worst], "m/s"),
        feet_m_s=Quantity(speeds[worst], "m/s"),
        foot=Quantity(FOOT_NAMES[worst] if belt.speed_m_s.ndim == 2 else "either"),
    )
