"""R30, are the joint angles possible, going by anatomical ranges of motion or those that the user states?"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.coordinate_range import TOLERANCE_DEG, UNKNOWN

_IMPOSSIBLE_RAD = float(np.radians(TOLERANCE_DEG))
"""Excess beyond the range of any person."""
_SURE = 2.0
"""SDs of an estimated angle."""


def joint_angles(context: ResultContext) -> Iterator[Finding]:
    """Report R305: every coordinate that leaves its range in a trial, with its most extreme angle.

    Angles beyond the range by less than two of their own SDs are not reported.
    """
    for trial in context.fit.trials:
        for column, name in enumerate(trial.kinematics.ik.coordinates):
            known = trial.skeleton.ranges.get(name, UNKNOWN).anatomical(name)
            if known is None:
                continue
            low, high = known.of_anybody
            angles = trial.motion.q[:, column]
            beyond = np.maximum(low - angles, angles - high)
            worst = int(np.argmax(beyond))
            sd = 0.0 if trial.deviations is None else float(trial.deviations.coordinates[worst, column])
            if beyond[worst] > min(_SURE * sd, _IMPOSSIBLE_RAD):
                yield finding(
                    "R305",
                    Where(trial=trial.name, part=name),
                    Severity.ERROR if beyond[worst] > _IMPOSSIBLE_RAD else None,
                    angle_rad=Quantity(float(angles[worst]), "rad", sd=sd),
                    range_rad=Quantity((low, high), "rad"),
                )
