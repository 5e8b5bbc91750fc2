"""Averages a person's curves over strides that are the same for the whole cycle; walks, turns and runs apart.

Angles come from inverse kinematics, which covers the whole cycle; moments, powers and ground reactions from the
estimate. Coordinates of pelvis and trunk that are opposite on the two sides (obliquity, rotation, lateral bending) are
mirrored on the left, so that one norm applies to both.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kinertia.estimation.result.curve_source import Stage
from kinertia.estimation.result.cycles import cycle_curves
from kinertia.estimation.result.fit import Fit
from kinertia.model.coordinate_pairs import by_side, opposite_on_left

_BUILT_IN = "gait27"
_KINDS: Mapping[Stage, tuple[str, ...]] = {
    "literature": ("angle",),
    "estimate": ("clinical", "moment", "power", "force"),
}
MeanCurves = Mapping[tuple[str, str], np.ndarray]
"""Mean curves (101,) by quantity and side, in the units of `cycles.csv`; NaN where nothing was measured."""
_AS_LONG = 0.9
"""Least length of the common part, relative to the longest curve: so much of the cycle may be given up for more
strides."""


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


def common_strides(values: np.ndarray) -> np.ndarray:
    """Select the curves (n, 101), NaN where not measured, that are to be averaged: returns (n,) bool.

    Complete curves are used if there are any. Otherwise those are chosen that together have the most measured frames,
    provided that their common part covers at least nine tenths of the longest curve.

    >>> common_strides(np.array([[1.0, 2.0, 3.0], [4.0, np.nan, np.nan], [3.0, 2.0, 1.0]])).tolist()
    [True, False, True]
    """
    known = np.isfinite(values)
    length = known.sum(axis=1)
    chosen: np.ndarray = known.all(axis=1)
    if chosen.any() or not length.any():
        return chosen
    order = np.argsort(-length, kind="stable")
    together = np.logical_and.accumulate(known[order], axis=0).sum(axis=1)
    worth = np.where(together >= _AS_LONG * length.max(), together * np.arange(1, len(values) + 1), 0)
    chosen[order[: int(np.argmax(worth)) + 1]] = True
    return chosen


def mean_of(values: np.ndarray) -> np.ndarray:
    """Return the mean (101,) of curves (n, 101): NaN where one was not measured, and throughout without curves."""
    return values.mean(axis=0) if len(values) else np.full(values.shape[1], np.nan)


def mean_of_common(values: np.ndarray) -> np.ndarray:
    """Return the mean (101,) of the curves (n, 101) that `common_strides` selects.

    >>> mean_of_common(np.array([[1.0, 2.0, 3.0], [4.0, np.nan, np.nan], [3.0, 2.0, 1.0]])).tolist()
    [2.0, 2.0, 2.0]
    """
    return mean_of(values[common_strides(values)])


def fits_by_task(fit: Fit) -> dict[str, Fit]:
    """Return the fit with the trials of each task that has strides: walks first, then the task with most strides.

    A result of a version that knew no tasks has one, with an empty name.
    """
    trials: dict[str, list[int]] = {}
    for k, trial in enumerate(fit.trials):
        if trial.strides:
            trials.setdefault(trial.kinematics.trial.task, []).append(k)
    strides = {task: sum(len(fit.trials[k].strides) for k in own) for task, own in trials.items()}
    order = sorted(trials, key=lambda task: (task != "walk", -strides[task]))
    return {task: replace(fit, trials=tuple(fit.trials[k] for k in trials[task])) for task in order}


def main_task(fit: Fit) -> Fit:
    """Return the fit with the trials of the first of `fits_by_task` alone; as it is without strides."""
    return next(iter(fits_by_task(fit).values()), fit)
