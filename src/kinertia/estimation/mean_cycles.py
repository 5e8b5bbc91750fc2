"""Averages a person's curves over the gait cycle, per quantity and side, for norms and gait scores.

Angles come from inverse kinematics, which covers the whole cycle; moments, powers and ground reactions from the
estimate. Coordinates of pelvis and trunk that are opposite on the two sides (obliquity, rotation, lateral bending) are
mirrored on the left, so that one norm applies to both.
"""

from collections.abc import Mapping

import numpy as np

from kinertia.estimation.common_strides import mean_of_common
from kinertia.estimation.curve_source import Stage
from kinertia.estimation.cycles import cycle_curves
from kinertia.estimation.result import Fit
from kinertia.estimation.tasks import main_task
from kinertia.model.shared_coordinates import by_side, opposite_on_left

_BUILT_IN = "gait27"
_KINDS: Mapping[Stage, tuple[str, ...]] = {
    "literature": ("angle",),
    "estimate": ("clinical", "moment", "power", "force"),
}

MeanCurves = Mapping[tuple[str, str], np.ndarray]
"""Mean curves (101,) by quantity and side, in the units of `cycles.csv`; NaN where nothing was measured."""


def convention_of(fit: Fit) -> str:
    """Describe the model that a fit's curves belong to; even clinical angles differ by degrees between models."""
    if fit.file is None:
        return f"Kinertia {_BUILT_IN}"
    return "OpenSim model with " + " ".join(sorted(by_side(fit.skeleton.coordinates)))


def mean_curves(fit: Fit) -> MeanCurves:
    """Average the curves of a fit over the strides of its main task (`main_task`); empty without strides."""
    found: dict[tuple[str, str], list[np.ndarray]] = {}
    flipped = {f"{name}_{kind}" for name in opposite_on_left(fit.skeleton) for kind in ("angle", "moment")}
    for stage, kinds in _KINDS.items():
        for one in (curve for trial in main_task(fit).trials for curve in cycle_curves(trial, fit.mass_kg, stage)):
            if one.kind in kinds:
                sign = -1.0 if one.quantity in flipped and one.stride.side == "l" else 1.0
                found.setdefault((one.quantity, one.stride.side), []).append(sign * one.value)
    return {name: mean_of_common(np.array(curves)) for name, curves in found.items()}
