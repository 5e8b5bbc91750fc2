"""Averages a person's curves over the gait cycle, per quantity and side, for norms and gait scores.

Angles are those of inverse kinematics, which knows the whole cycle; moments, powers and ground reactions are the
estimate's. Quantities of pelvis and trunk that are opposite on the two sides (obliquity, rotation, lateral bending) are
mirrored on the left, so that one norm stands for both. The pelvis's rotation and the foot's progression are against the
direction of the stride, internal rotation of the side positive.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinertia.estimation.cycles import coordinates_at, cycle_curves, mean_of_measured
from kinertia.estimation.gait_scores import FOOT_PROGRESSION, PELVIS_ROTATION
from kinertia.estimation.result import Fit, TrialFit
from kinertia.model.sides import by_side
from kinertia.model.skeleton import Skeleton
from kinertia.motion.gait_cycle import Stride, feet_under_pelvis
from kinertia.motion.spatiotemporal import travelled
from kinertia.trial.data import FEET

_BUILT_IN = "gait27"
_FORE = np.array([1.0, 0.0, 0.0])
"""Of a foot, from heel to toes."""

MeanCurves = Mapping[tuple[str, str], np.ndarray]
"""By quantity and side (101,), in the units of `cycles.csv`; NaN where nothing was measured."""


def convention_of(fit: Fit) -> str:
    """What a fit's coordinates mean, in words; norms of another convention do not fit."""
    if fit.file is None:
        return f"Kinertia {_BUILT_IN}"
    return "OpenSim model with " + " ".join(sorted(by_side(fit.skeleton.coordinates)))


def opposite_on_left(skeleton: Skeleton) -> frozenset[str]:
    """Coordinates of pelvis and trunk that turn about an axis in the plane of symmetry."""
    sideless = {name for name, columns in by_side(skeleton.coordinates).items() if "" in columns}
    axes = [axis for joint in skeleton.joints for axis in joint.axes if axis.kind == "rotation"]
    return frozenset(
        axis.coordinate for axis in axes if axis.coordinate in sideless and abs(axis.direction[2]) < np.sqrt(0.5)
    )


def mean_curves(fit: Fit) -> MeanCurves:
    """Mean over all strides of a fit; none without strides."""
    found: dict[tuple[str, str], list[np.ndarray]] = {}
    flipped = {f"{name}_{kind}" for name in opposite_on_left(fit.skeleton) for kind in ("angle", "moment")}
    for trial in fit.trials:
        if not trial.strides:
            continue
        for quantity, stride, value in _angles(trial, fit.mass_kg):
            sign = -1.0 if quantity in flipped and stride.side == "l" else 1.0
            found.setdefault((quantity, stride.side), []).append(sign * value)
        for one in cycle_curves(trial, fit.mass_kg, "estimate"):
            if one.kind != "angle":
                sign = -1.0 if one.quantity in flipped and one.stride.side == "l" else 1.0
                found.setdefault((one.quantity, one.stride.side), []).append(sign * one.value)
    return {name: mean_of_measured(np.array(curves)) for name, curves in found.items()}


def _angles(trial: TrialFit, mass_kg: float) -> list[tuple[str, Stride, np.ndarray]]:
    """Quantity, stride and values of a trial's angles."""
    paths = travelled(feet_under_pelvis(trial.skeleton, trial.kinematics), trial.strides, trial.kinematics.trial.belt)
    headings = {id(stride): _heading_deg(path) for stride, path in zip(trial.strides, paths, strict=True)}
    rows = []
    for one in cycle_curves(trial, mass_kg, "literature"):
        if one.kind == "angle":
            turned = one.quantity == PELVIS_ROTATION
            value = _within_half_a_turn(one.value - headings[id(one.stride)]) if turned else one.value
            rows.append((one.quantity, one.stride, value))
    rows += [(FOOT_PROGRESSION, stride, _progression(trial, stride, headings[id(stride)])) for stride in trial.strides]
    return rows


def _progression(trial: TrialFit, stride: Stride, heading_deg: np.ndarray) -> np.ndarray:
    """(101,) deg: the foot's long axis on the floor against the stride's direction, toes inward positive."""
    q = coordinates_at(trial, "literature", stride.time)
    known = np.isfinite(q).all(axis=1)
    skeleton, side = trial.skeleton, FEET.index(stride.side)
    rotation = skeleton.pose(np.where(known[:, None], q, 0.0)).rotation
    fore = rotation[:, skeleton.segments.index(skeleton.feet[side])] @ _FORE
    outward = _within_half_a_turn(_heading_deg(fore) - heading_deg)
    return np.where(known, outward if stride.side == "r" else -outward, np.nan)


def _heading_deg(direction: np.ndarray) -> np.ndarray:
    """Of vectors (..., 3): their turn about the vertical from the first axis, to the left positive."""
    result: np.ndarray = np.degrees(np.arctan2(-direction[..., 2], direction[..., 0]))
    return result


def _within_half_a_turn(angle_deg: np.ndarray) -> np.ndarray:
    """The same with whole turns taken off, by the mean: curves stay without jumps."""
    known = angle_deg[np.isfinite(angle_deg)]
    middle = np.degrees(np.angle(np.exp(1j * np.radians(known)).mean())) if known.size else 0.0
    result: np.ndarray = middle + (angle_deg - middle + 180.0) % 360.0 - 180.0
    return result
