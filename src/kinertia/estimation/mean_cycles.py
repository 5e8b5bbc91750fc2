"""Averages a person's curves over the gait cycle, per quantity and side, for norms and gait scores.

Angles are those of inverse kinematics, which knows the whole cycle; moments, powers and ground reactions are the
estimate's. Coordinates of pelvis and trunk that are opposite on the two sides (obliquity, rotation, lateral bending)
are mirrored on the left, so that one norm stands for both.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinertia.estimation.common_strides import mean_of_common
from kinertia.estimation.cycles import Stage, cycle_curves
from kinertia.estimation.result import Fit
from kinertia.model.shared_coordinates import by_side, opposite_on_left

_BUILT_IN = "gait27"
_KINDS: Mapping[Stage, tuple[str, ...]] = {
    "literature": ("angle",),
    "estimate": ("clinical", "moment", "power", "force"),
}

MeanCurves = Mapping[tuple[str, str], np.ndarray]
"""By quantity and side (101,), in the units of `cycles.csv`; NaN where nothing was measured."""


def convention_of(fit: Fit) -> str:
    """Which model a fit's curves are of, in words; those of another are off by degrees, clinical angles as well."""
    if fit.file is None:
        return f"Kinertia {_BUILT_IN}"
    return "OpenSim model with " + " ".join(sorted(by_side(fit.skeleton.coordinates)))


def mean_curves(fit: Fit) -> MeanCurves:
    """Mean over the strides of a fit; none without strides."""
    found: dict[tuple[str, str], list[np.ndarray]] = {}
    flipped = {f"{name}_{kind}" for name in opposite_on_left(fit.skeleton) for kind in ("angle", "moment")}
    for stage, kinds in _KINDS.items():
        for one in (curve for trial in fit.trials for curve in cycle_curves(trial, fit.mass_kg, stage)):
            if one.kind in kinds:
                sign = -1.0 if one.quantity in flipped and one.stride.side == "l" else 1.0
                found.setdefault((one.quantity, one.stride.side), []).append(sign * one.value)
    return {name: mean_of_common(np.array(curves)) for name, curves in found.items()}
