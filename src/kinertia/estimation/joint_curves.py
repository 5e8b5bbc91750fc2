"""Holds motion and joint loads of a trial wherever they are known, whether plates measured all ground contact or not.

A joint's load needs only the loads distal to it: the moments of a leg on its plate, or in the air, are known whatever
the other leg does. What is not known is NaN, never zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self, TypeAlias

import numpy as np

from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.uncertainty.knee_geometry import with_drawn_knees
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.joint_moments import JointMoments, joint_moments
from kinertia.motion.joint_wrench import BodyJoint, body_joints
from kinertia.motion.kinematics import Kinematics

Stage: TypeAlias = tuple[Skeleton, BodySegmentParameters, Motion, GroundReactions]
"""What joint loads are computed from: motion at the frames of `Kinematics.course_time`."""


@dataclass(frozen=True, eq=False)
class JointCurves:
    """Motion and joint loads at the f frames of `Kinematics.course_time`.

    Attributes:
        time: (f,) s.
        known: (f, c) frames in which the generalised force of each coordinate is known.
        motion: estimated coordinates and derivatives, all frames.
        forces: (f, c) generalised forces per stage ("literature", "estimate"), N m and N; NaN where not known.
        joints: three-dimensional moments and forces per stage; NaN where not known.
        deviations: standard deviations (f, ...) of the estimate, with those of `joints` in the last field; NaN where
            not known; None for one draw.

    Examples:
        >>> curves = fit.trials[0].joint_curves  # fit = kinertia.fit_subject("subject.toml")
        >>> knee = curves.joints["estimate"].moments[:, curves.joints["estimate"].joints.index("knee_r")]
        >>> knee.shape[1], "knee_r_adduction" in curves.joints["estimate"].names
        (3, True)
    """

    time: np.ndarray
    known: np.ndarray
    motion: Motion
    forces: Mapping[str, np.ndarray]
    joints: Mapping[str, JointMoments]
    deviations: CurveDeviations | None

    @property
    def moment_sd(self) -> np.ndarray | None:
        """Standard deviations (f, j, 3) of `joints["estimate"].moments`, N m."""
        return None if self.deviations is None or self.deviations.joints is None else self.deviations.joints[:, :, 0]

    @property
    def force_sd(self) -> np.ndarray | None:
        """Standard deviations (f, j, 3) of `joints["estimate"].forces`, N."""
        return None if self.deviations is None or self.deviations.joints is None else self.deviations.joints[:, :, 1]

    @classmethod
    def of(
        cls,
        kinematics: Kinematics,
        motion: Motion,
        stages: Mapping[str, Stage],
        deviations: CurveDeviations | None,
    ) -> Self:
        """Compute the loads of every stage.

        Args:
            kinematics: of the trial.
            motion: estimated, at the frames of `course_time`.
            stages: skeleton, parameters, motion at these frames and ground reactions of each.
            deviations: standard deviations at these frames.
        """
        time, known = kinematics.course_time, kinematics.course_known
        forces, joints = {}, {}
        for name, (skeleton, bsp, moved, reactions) in stages.items():
            loads, own = reactions.at(time), known_joints(skeleton, known)
            forces[name] = np.where(known, inverse_dynamics(skeleton, bsp, moved, loads), np.nan)
            joints[name] = _only(joint_moments(skeleton, bsp, moved, loads), own)
        if deviations is not None:
            masked = {each: np.where(known, getattr(deviations, each), np.nan) for each in ("moments", "powers")}
            three = None if deviations.joints is None else np.where(own[:, :, None, None], deviations.joints, np.nan)
            deviations = replace(deviations, **masked, joints=three)
        return cls(time, known, motion, forces, joints, deviations)

    def drawn(self, kinematics: Kinematics, stage: Stage, random: np.random.Generator | None) -> JointCurves:
        """Return the curves of a draw of the estimate, with knee geometry drawn if `random` is given, without standard
        deviations."""
        own = type(self).of(kinematics, stage[2], {"estimate": stage}, None)
        loads = own.joints["estimate"]
        if random is not None:
            loads = with_drawn_knees(stage[0], body_joints(stage[0]), loads, random)
        return replace(own, forces={**self.forces, **own.forces}, joints={**self.joints, "estimate": loads})


def known_joints(skeleton: Skeleton, known: np.ndarray) -> np.ndarray:
    """Return the mask (f, j) of frames in which the loads of `body_joints` are known, from that of coordinates (f, c).

    A joint that does not move has the frames of the next ones distal to it.
    """
    joints = body_joints(skeleton)
    result = np.zeros((len(known), len(joints)), dtype=bool)
    for k, joint in enumerate(joints):
        columns = joint.columns(skeleton) or _beyond(skeleton, joint)
        result[:, k] = known[:, columns].all(axis=1) & bool(columns)
    return result


def _beyond(skeleton: Skeleton, joint: BodyJoint) -> list[int]:
    """Return the coordinates of joints distal to a joint."""
    child = skeleton.support[skeleton.segments.index(joint.child)]
    after = [own for own in skeleton.support if (own & child).sum() == child.sum()]
    axes = np.logical_or.reduce(after) & ~child
    return [int(column) for column in np.unique(skeleton.map.owner[axes])]


def _only(loads: JointMoments, known: np.ndarray) -> JointMoments:
    """Return the loads with NaN where they are not known (n, j)."""
    shown = known[:, :, None]
    return replace(loads, moments=np.where(shown, loads.moments, np.nan), forces=np.where(shown, loads.forces, np.nan))
