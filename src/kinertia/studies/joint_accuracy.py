"""Joint moments and joint angles of synthetic people against the truth, joint by joint, beside the usual pipeline's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.joint_names import JOINTS
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.ground_reactions import GroundReactions, measured_reactions
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.smoothing import smooth
from kinertia.synthetic.walk import SyntheticTrial

USUAL_HZ = (6.0, 10.0, 12.0)
"""Cutoffs of the coordinates in the usual pipeline: OpenSim's own and two more."""
WITHIN = 1.959964
"""Half width of a 95 % interval in deviations."""


@dataclass(frozen=True)
class JointErrors:
    """Mean squares over the frames of one person's walk, left and right side, for one joint.

    Attributes:
        moment: error of the estimate's joint moments, (N m)^2.
        moment_variance: what the estimate says of it.
        moment_coverage: share of frames within the 95 % intervals.
        usual: error of the usual pipeline's joint moments, by USUAL_HZ.
        angle, angle_ik: errors of the joint angles, rad^2, by the estimate and by inverse kinematics.
        change, change_ik: the same after taking off each angle's mean error: what varies in time.
    """

    moment: float
    moment_variance: float
    moment_coverage: float
    usual: tuple[float, ...]
    angle: float
    angle_ik: float
    change: float
    change_ik: float


@dataclass(frozen=True)
class JointAccuracy:
    """One joint over all people: RMS errors.

    Attributes:
        moment_nm, moment_sd_nm: of the joint moments, and their posterior deviation.
        coverage: of the joint moments by 95 % intervals.
        usual_nm: of the usual pipeline's joint moments, at the best of USUAL_HZ.
        angle_rad, angle_ik_rad: of joint angles by the estimate and by inverse kinematics.
        change_rad, change_ik_rad: the same without each angle's mean error.
    """

    moment_nm: float
    moment_sd_nm: float
    coverage: float
    usual_nm: float
    angle_rad: float
    angle_ik_rad: float
    change_rad: float
    change_ik_rad: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """What joint moments are computed from."""

    skeleton: Skeleton
    bsp: BodySegmentParameters
    motion: Motion
    reactions: GroundReactions

    def moments(self, time: np.ndarray) -> np.ndarray:
        """(w, c) N m at these times, those of the motion."""
        return inverse_dynamics(self.skeleton, self.bsp, self.motion, self.reactions.at(time))


@dataclass(frozen=True, eq=False)
class Before:
    """What the laboratory believes in before the estimate, and what the usual pipeline works with: inverse kinematics,
    low-passed; literature BSPs; forces as measured.
    """

    skeleton: Skeleton
    literature: BodySegmentParameters
    kinematics: Kinematics


def joint_errors(
    truth: SyntheticTrial, before: Before, after: Outcome, moment_sd: np.ndarray
) -> dict[str, JointErrors]:
    """Errors of the estimate and of the usual pipeline against the truth.

    Args:
        truth: what the person did.
        before, after: what the estimate started from, and its outcome.
        moment_sd: (w, c) N m, posterior deviations of its joint moments.
    """
    kinematics, time = before.kinematics, before.kinematics.time
    at = np.searchsorted(truth.time, time - 1e-9)
    true = truth.motion.cut(at)
    expected = inverse_dynamics(truth.skeleton, truth.bsp, true, truth.foot_loads[at])
    wrong = after.moments(time) - expected
    ik, measured = kinematics.ik, measured_reactions(kinematics)
    usual = []
    for hz in USUAL_HZ:
        spline = smooth(ik.time, ik.q, hz)
        motion = Motion(*(spline(time, order) for order in range(3)))
        usual.append(Outcome(before.skeleton, before.literature, motion, measured).moments(time) - expected)
    off = [q - true.q for q in (after.motion.q, ik.q[kinematics.frames])]
    changes = [each - each.mean(axis=0) for each in off]
    result = {}
    for joint, begins in JOINTS.items():
        own = [name.startswith(begins) for name in truth.skeleton.coordinates]
        result[joint] = JointErrors(
            moment=_square(wrong[:, own]),
            moment_variance=_square(moment_sd[:, own]),
            moment_coverage=float(np.mean(np.abs(wrong[:, own]) < WITHIN * moment_sd[:, own])),
            usual=tuple(_square(each[:, own]) for each in usual),
            angle=_square(off[0][:, own]),
            angle_ik=_square(off[1][:, own]),
            change=_square(changes[0][:, own]),
            change_ik=_square(changes[1][:, own]),
        )
    return result


def _square(values: np.ndarray) -> float:
    return float(np.square(values).mean())


def joint_accuracy(people: Sequence[JointErrors]) -> JointAccuracy:
    """One joint of all people together."""

    def rms(name: str) -> float:
        return float(np.sqrt(np.mean([getattr(one, name) for one in people])))

    return JointAccuracy(
        moment_nm=rms("moment"),
        moment_sd_nm=rms("moment_variance"),
        coverage=float(np.mean([one.moment_coverage for one in people])),
        usual_nm=float(np.sqrt(np.mean([one.usual for one in people], axis=0).min())),
        angle_rad=rms("angle"),
        angle_ik_rad=rms("angle_ik"),
        change_rad=rms("change"),
        change_ik_rad=rms("change_ik"),
    )
