"""Joint moments and joint angles of synthetic people against the truth, joint by joint, beside the usual pipeline's."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.ground_reactions import GroundReactions, measured_reactions
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.smoothing import smooth
from kinertia.report.pages.truth_comparison import JOINTS
from kinertia.synthetic.walk import SyntheticTrial

USUAL_HZ = (6.0, 10.0, 12.0)
"""Cutoffs of the coordinates in the usual pipeline: OpenSim's own and two more."""
WITHIN = 1.959964
"""Half width of a 95 % interval in SDs."""


@dataclass(frozen=True)
class JointErrors:
    """Mean squared errors over the frames of one person's walk, left and right side, for one joint.

    Attributes:
        moment: error of the estimate's joint moments, (N m)^2.
        moment_variance: its variance according to the estimate.
        moment_coverage: share of frames within the 95 % intervals.
        usual: error of the joint moments by IK + ID, by USUAL_HZ.
        power_coverage: the same of joint powers.
        angle, angle_ik: errors of the joint angles, rad^2, by the estimate and by inverse kinematics.
        angle_variance, angle_coverage: their variance by the estimate, and share of frames within its intervals.
        change, change_ik: the same after taking off each angle's mean error: what varies in time.
    """

    moment: float
    moment_variance: float
    moment_coverage: float
    power_coverage: float
    usual: tuple[float, ...]
    angle: float
    angle_variance: float
    angle_coverage: float
    angle_ik: float
    change: float
    change_ik: float


@dataclass(frozen=True)
class JointAccuracy:
    """RMS errors of one joint over all people.

    Attributes:
        moment_nm, moment_sd_nm: error of the joint moments, and their posterior SD.
        coverage, power_coverage: coverage of the joint moments and powers by 95 % intervals.
        usual_nm: error of the joint moments by IK + ID, at the best of USUAL_HZ.
        angle_rad, angle_ik_rad: errors of joint angles by the estimate and by inverse kinematics.
        angle_sd_rad, angle_coverage: posterior SD of the estimate's, and coverage by 95 % intervals.
        change_rad, change_ik_rad: the same without each angle's mean error.
    """

    moment_nm: float
    moment_sd_nm: float
    coverage: float
    power_coverage: float
    usual_nm: float
    angle_rad: float
    angle_sd_rad: float
    angle_coverage: float
    angle_ik_rad: float
    change_rad: float
    change_ik_rad: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """Quantities from which joint moments are computed."""

    skeleton: Skeleton
    bsp: BodySegmentParameters
    motion: Motion
    reactions: GroundReactions

    def moments(self, time: np.ndarray) -> np.ndarray:
        """Compute joint moments (w, c) N m at these times, which are the motion's."""
        return inverse_dynamics(self.skeleton, self.bsp, self.motion, self.reactions.at(time))


@dataclass(frozen=True, eq=False)
class Before:
    """Inputs before the estimate, and of IK + ID: low-passed inverse kinematics, literature BSPs, measured forces."""

    skeleton: Skeleton
    literature: BodySegmentParameters
    kinematics: Kinematics


def joint_errors(
    truth: SyntheticTrial, before: Before, after: Outcome, deviations: CurveDeviations
) -> dict[str, JointErrors]:
    """Compute errors of the estimate and of IK + ID against the truth.

    Args:
        truth: true motion and loads of the person.
        before, after: starting point and outcome of the estimate.
        deviations: SDs of its curves.
    """
    kinematics, time = before.kinematics, before.kinematics.time
    at = np.searchsorted(truth.time, time - 1e-9)
    true = truth.motion.cut(at)
    expected = inverse_dynamics(truth.skeleton, truth.bsp, true, truth.foot_loads[at])
    found = after.moments(time)
    wrong, power_wrong = found - expected, found * after.motion.qd - expected * true.qd
    ik, measured = kinematics.ik, measured_reactions(kinematics)
    usual = []
    for hz in USUAL_HZ:
        spline = smooth(ik.time, ik.q, hz)
        motion = Motion(*(spline(time, order) for order in range(3)))
        usual.append(Outcome(before.skeleton, before.literature, motion, measured).moments(time) - expected)
    off = [q - true.q for q in (after.motion.q, ik.q[kinematics.frames])]
    changes = [change - change.mean(axis=0) for change in off]
    result = {}
    for joint, begins in JOINTS.items():
        of_joint = [name.startswith(begins) for name in truth.skeleton.coordinates]
        result[joint] = JointErrors(
            moment=_square(wrong[:, of_joint]),
            moment_variance=_square(deviations.moments[:, of_joint]),
            moment_coverage=_covered(wrong[:, of_joint], deviations.moments[:, of_joint]),
            power_coverage=_covered(power_wrong[:, of_joint], deviations.powers[:, of_joint]),
            usual=tuple(_square(moments[:, of_joint]) for moments in usual),
            angle=_square(off[0][:, of_joint]),
            angle_variance=_square(deviations.coordinates[:, of_joint]),
            angle_coverage=_covered(off[0][:, of_joint], deviations.coordinates[:, of_joint]),
            angle_ik=_square(off[1][:, of_joint]),
            change=_square(changes[0][:, of_joint]),
            change_ik=_square(changes[1][:, of_joint]),
        )
    return result


def _covered(wrong: np.ndarray, sd: np.ndarray) -> float:
    return float(np.mean(np.abs(wrong) < WITHIN * sd))


def _square(values: np.ndarray) -> float:
    return float(np.square(values).mean())


def joint_accuracy(people: Sequence[JointErrors]) -> JointAccuracy:
    """Summarise one joint over all people."""

    def mean(name: str) -> float:
        return float(np.mean([getattr(person, name) for person in people]))

    def rms(name: str) -> float:
        return float(np.sqrt(mean(name)))

    return JointAccuracy(
        moment_nm=rms("moment"),
        moment_sd_nm=rms("moment_variance"),
        coverage=mean("moment_coverage"),
        power_coverage=mean("power_coverage"),
        usual_nm=float(np.sqrt(np.mean([person.usual for person in people], axis=0).min())),
        angle_rad=rms("angle"),
        angle_sd_rad=rms("angle_variance"),
        angle_coverage=mean("angle_coverage"),
        angle_ik_rad=rms("angle_ik"),
        change_rad=rms("change"),
        change_ik_rad=rms("change_ik"),
    )
