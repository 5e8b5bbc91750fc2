"""Makes curves of a trial in several posterior draws at once, without all else of `drawn_fit`.

What is equal in all these draws, as motion and forces are where only the body differs, is computed once.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Self, TypeAlias

import numpy as np

from kinertia.estimation.result.curve_source import Gapped, through_angles, through_loads
from kinertia.estimation.result.drawn_fit import (
    drawn_bodies,
    drawn_joints,
    drawn_knees,
    drawn_motions,
    drawn_reactions,
    kept_draws,
)
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import JointCurves, TrialFit, known_joints
from kinertia.estimation.simultaneous.uncertainty.model_errors import with_drawn_knees
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import TrialDraws
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.joint_moments import body_joints, joint_loads
from kinertia.motion.workload import pieces

Model: TypeAlias = tuple[Skeleton, BodySegmentParameters]
AT_ONCE = 10
"""Draws whose curves are computed together: more take memory."""


@dataclass(frozen=True, eq=False)
class DrawnCurves:
    """Curves of d draws, as `CurveSource` has them of one trial.

    Attributes:
        angle: (n, c, d) coordinates at n times, rad and m.
        joint_moment: (n, j, 3, d) N m.
    """

    angle: Gapped
    joint_moment: Gapped

    @classmethod
    def of(
        cls, trial: TrialFit, draws: TrialDraws, numbers: Sequence[int], models: Sequence[Model], knees: bool
    ) -> Self:
        """Make the curves of the draws with these numbers, each with a model; with drawn geometry of knees if wanted.

        Of the models' markers no curve depends.
        """
        k, curves = trial.kinematics, trial.joint_curves
        time, motions = drawn_motions(trial, draws, numbers)
        angles = np.stack([drawn_motion.q for drawn_motion in motions], axis=2)
        through = partial(through_angles, derivative=0)
        if curves is None:
            nothing = np.empty((len(time), 0, 3, len(numbers)))
            return cls(Gapped.of(time, angles, through), Gapped.of(time, nothing, through_loads))
        joints, same = body_joints(trial.skeleton), _same_loads(draws, numbers)
        moments = np.empty((len(time), len(joints), 3, len(numbers)))
        for place, (number, motion, (skeleton, bsp)) in enumerate(zip(numbers, motions, models, strict=True)):
            if place == 0 or not same:
                foot_loads = drawn_reactions(trial.reactions, draws, number).at(time)
            moments_and_forces = joint_loads(skeleton, bsp, motion, foot_loads, joints)
            loads = replace(curves.joints["estimate"], moments=moments_and_forces[0], forces=moments_and_forces[1])
            if knees:
                loads = with_drawn_knees(skeleton, joints, loads, drawn_knees(number))
            moments[..., place] = loads.moments
        moments[~known_joints(trial.skeleton, k.trajectory_known)] = np.nan
        return cls(
            Gapped.of(time, np.where(_shown(curves)[..., None], angles, np.nan), through),
            Gapped.of(time, moments, through_loads),
        )


def drawn_forces(
    fit: Fit, trial: TrialFit, draws: TrialDraws, numbers: Sequence[int]
) -> Iterator[tuple[Motion, np.ndarray]]:
    """Yield motion and generalised forces (f, c) of the draws with these numbers, as `JointCurves` has them.

    Without joint curves they are those of the measured windows.
    """
    kept, known = kept_draws(fit), True if trial.joint_curves is None else trial.joint_curves.known
    for some in pieces(len(numbers), AT_ONCE):
        time, motions = drawn_motions(trial, draws, numbers[some])
        for number, motion in zip(numbers[some], motions, strict=True):
            skeleton, bsp = drawn_joints(fit.skeleton, kept, number), drawn_bodies(fit.estimate, kept, number)
            foot_loads = drawn_reactions(trial.reactions, draws, number).at(time)
            yield motion, np.where(known, inverse_dynamics(skeleton, bsp, motion, foot_loads), np.nan)


def _shown(curves: JointCurves) -> np.ndarray:
    """Return the mask (f, 1) of frames in which any joint's load is known."""
    result: np.ndarray = np.logical_or.reduce(curves.known, axis=1, keepdims=True)
    return result


def _same_loads(draws: TrialDraws, numbers: Sequence[int]) -> bool:
    """Return whether ground reactions are the same in all these draws."""
    departures = (draws.plates, draws.delay_s, draws.impact)
    return not any(departure[list(numbers)].any() for departure in departures)
