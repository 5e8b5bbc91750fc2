"""Finds which part of each leg's stances and strides has joint moments, trial by trial and task by task."""

from collections.abc import Mapping, Sequence

import numpy as np

from kinertia.estimation.curve_source import Estimated
from kinertia.trial.leg_coverage import LegCoverage, joined_coverage, leg_coverage


def moment_coverage(trial: Estimated) -> tuple[LegCoverage, ...]:
    """Return the part of stance and stride of the right and the left leg in which all its joint moments are known.

    Empty where the trial has no strides, or it is unknown when the feet are on the ground.
    """
    if not trial.strides:
        return ()
    return leg_coverage(trial.kinematics.trial, known_legs(trial))


def known_legs(trial: Estimated) -> np.ndarray:
    """Return the mask (n, 2) of marker frames in which all joint moments of the right, left leg are known."""
    k, skeleton = trial.kinematics, trial.skeleton
    known = np.repeat((k.inside(k.trial.markers.time) & k.complete)[:, None], 2, axis=1)
    if k.known is not None and trial.joint_curves is not None:
        for foot, segment in enumerate(skeleton.feet):
            own = np.unique(skeleton.map.owner[skeleton.support[skeleton.segments.index(segment)]])
            known[:, foot] |= k.known[:, own[own >= len(skeleton.joints[0].axes)]].all(axis=1)
    return known


def coverage_by_task(trials: Sequence[Estimated]) -> Mapping[str, tuple[LegCoverage, ...]]:
    """Return what is known of each leg in any of the trials of a task, by task."""
    by_task: dict[str, list[tuple[LegCoverage, ...]]] = {}
    for trial in trials:
        if legs := moment_coverage(trial):
            by_task.setdefault(trial.kinematics.trial.task, []).append(legs)
    return {task: joined_coverage(legs) for task, legs in by_task.items()}


def coverage_sentence(trials: Sequence[Estimated]) -> str:
    """Describe what is known: "right: whole stride; left: 0 to 48 % of the stride, no push-off"; empty without strides.

    With several tasks: "walk (right: ...; left: ...); turn (...)".
    """
    parts = coverage_by_task(trials)
    texts = {task: "; ".join(leg.sentence for leg in legs) for task, legs in parts.items()}
    return "; ".join(f"{task} ({text})" if len(texts) > 1 and task else text for task, text in texts.items())
