"""Keeps unlike tasks apart: strides of walks, turns and runs have means of their own."""

from dataclasses import replace

from kinertia.estimation.result import Fit


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
