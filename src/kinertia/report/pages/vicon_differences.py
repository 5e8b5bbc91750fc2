"""Finds why Kinertia's joint moments differ from Plug-in Gait's in the file: frame by frame in stance on plates.

Moments are computed again with one thing at a time as Vicon has it: its joint centre, its axes of the segment below
the joint, forces as they were measured (no delay or error of a plate corrected), segments of the tables. What lowers
the mean square of a difference by more than half is its likely cause. So is filtering, where more than half of the
mean square is faster than the motion. Nothing is claimed of a difference within the error bars.

Each segment has four: its origin ("LFEO"), and one on each of its axes: anterior ("LFEA"), lateral ("LFEL") and
proximal ("LFEP").
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.leg_moments import outputs_of
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.instruments.instrument_errors import DELAY, GAIN
from kinertia.motion.ground_reactions import measured_reactions
from kinertia.motion.joint_moments import BodyJoint, component_signs, joint_wrenches, leg_joints
from kinertia.motion.smoothing import smooth
from kinertia.report.figures.figure import SIDES
from kinertia.report.pages.file_outputs import moment_divisor
from kinertia.report.wording import INTERVAL_SD
from kinertia.trial.data import FEET
from kinertia.trial.file_contents import FileOutputs
from kinertia.trial.sampled_data import nearest_samples, runs

COMPONENTS = ("flexion", "adduction", "rotation")
_LOADED_N = 20.0
_RIGHT_FORWARD_UP = [2, 0, 1]
_NM = 1e-3
_FEWEST = 10
"""Frames to compare."""
_MOST_OF_IT = 0.5
"""Share of a difference's mean square that a cause explains."""
_CLEAR_SD = 2.0
_SPLINE = 6
"""Samples that a spline needs."""
_SEGMENTS = {"Hip": "FE", "Knee": "TI", "Ankle": "FO"}
"""Vicon's name of the segment below each joint, in whose axes it gives the moment."""
_CENTRES = {"Hip": "FEP", "Knee": "FEO", "Ankle": "TIO"}
"""The point that is the joint's centre."""
_DIRECTIONS = "ALP"


@dataclass(frozen=True, eq=False)
class ViconPoints:
    """Points of a file at f frames, in ground axes, m; NaN where missing."""

    points: Mapping[str, np.ndarray]

    @classmethod
    def at(cls, outputs: FileOutputs, time: np.ndarray) -> Self:
        """Take the points at the frames nearest to these times (f,)."""
        rows = nearest_samples(outputs.time, time)
        return cls({name: points[rows] for name, points in outputs.points.items()})

    def centre(self, joint: BodyJoint) -> np.ndarray | None:
        """Return a joint's centre (f, 3); None if the file lacks it."""
        return self.points.get(joint.side.upper() + _CENTRES[joint.name])

    def axes(self, joint: BodyJoint, ours: np.ndarray) -> np.ndarray | None:
        """Return the axes (f, 3, 3) of the segment below a joint in columns, each nearest to ours; None if lacking.

        Args:
            joint: the joint.
            ours: (f, 3, 3) Kinertia's axes of the segment in columns.
        """
        segment = joint.side.upper() + _SEGMENTS[joint.name]
        corners = [self.points.get(segment + letter) for letter in "O" + _DIRECTIONS]
        if any(point is None for point in corners):
            return None
        origin, *ends = (np.asarray(point) for point in corners)
        found = np.stack([end - origin for end in ends], axis=2)
        found = found / np.linalg.norm(found, axis=1, keepdims=True)
        alike = np.nanmean(np.einsum("fki,fkj->fij", ours, found), axis=0)
        nearest = np.abs(alike).argmax(axis=1)
        if len(set(nearest)) < len(nearest):
            return None
        result: np.ndarray = found[:, :, nearest] * np.sign(alike[range(3), nearest])
        return result


@dataclass(frozen=True, eq=False)
class MomentDifference:
    """A component of a joint's moment over n frames of stance on plates, N m/kg, with Vicon's signs.

    Attributes:
        trial, joint, side, component: which: "Knee", "r", "adduction".
        time: (n,) s.
        inside: (n,) whether all ground contact is on plates.
        vicon: (n,) of the file.
        ours, sd: (n,) Kinertia's with its standard deviation; NaN where the leg's load is not known.
        others: (n,) Kinertia's, by what is as Vicon has it: "centre", "axes", "forces", "tables"; "centre and axes";
            "all" of the first three. Those that need points which the file lacks are NaN.
        slow: (n,) difference from Vicon's, ours minus theirs, without what is faster than the motion.
        apart_mm, apart_deg: distance of the joint's centre and angle of the segment's axes from Vicon's, RMS.
    """

    trial: str
    joint: str
    side: str
    component: str
    time: np.ndarray
    inside: np.ndarray
    vicon: np.ndarray
    ours: np.ndarray
    sd: np.ndarray
    others: Mapping[str, np.ndarray]
    slow: np.ndarray
    apart_mm: float
    apart_deg: float


def moment_differences(fit: Fit, trial: TrialFit) -> Iterator[MomentDifference]:
    """Yield the differences of every joint, side and component that the file of a trial has; none without outputs."""
    curve, stated = trial.joint_curves, trial.kinematics.trial.outputs
    if curve is None or stated is None:
        return
    outputs = outputs_of(fit, trial, "plug-in-gait", correlated=False)
    found = {(output.joint, output.side): output for output in outputs if output.kind == "MOMENTS"}
    force_n = measured_reactions(trial.kinematics).at(curve.time)[:, :, 1]
    inside = np.isin(np.round(curve.time, 6), np.round(trial.time, 6))
    others, apart = _as_vicon(fit, trial, ViconPoints.at(stated, curve.time))
    for (joint, side), output in found.items():
        if output.name not in stated.values:
            continue
        theirs = stated.values[output.name] / moment_divisor(stated, output.kind, fit.mass_kg)
        theirs = theirs[nearest_samples(stated.time, curve.time)]
        stance = force_n[:, FEET.index(side)] > _LOADED_N
        for row, component in enumerate(COMPONENTS):
            seen, ours = stance & np.isfinite(theirs[:, row]), _NM * output.values[:, row]
            yield MomentDifference(
                trial.name,
                joint,
                side,
                component,
                curve.time[seen],
                inside[seen],
                theirs[seen, row],
                ours[seen],
                _NM * output.sd[seen, row],
                {name: values[joint, side][seen, row] for name, values in others.items()},
                _slow(curve.time, ours - theirs[:, row], trial.motion_hz)[seen],
                *apart[joint, side],
            )


def _as_vicon(
    fit: Fit, trial: TrialFit, points: ViconPoints
) -> tuple[dict[str, dict[tuple[str, str], np.ndarray]], dict[tuple[str, str], tuple[float, float]]]:
    """Return moments (f, 3) N m/kg by what is Vicon's, joint and side; and how far centres (mm) and axes (deg) are."""
    curve, skeleton = trial.joint_curves, trial.skeleton
    assert curve is not None
    corrected, measured = (
        reactions.at(curve.time) for reactions in (trial.reactions, measured_reactions(trial.kinematics))
    )
    joints = leg_joints(skeleton)
    whole, raw, tables = (
        joint_wrenches(skeleton, body, curve.motion, loads, joints)
        for body, loads in ((fit.estimate, corrected), (fit.estimate, measured), (fit.literature, corrected))
    )
    pose, apart = skeleton.pose(curve.motion.q), {}
    result: dict[str, dict[tuple[str, str], np.ndarray]] = {}
    for joint in joints:
        ours, at = pose.rotation[:, skeleton.segments.index(joint.child)], joint.centre(skeleton, pose)
        centre, axes = _or_nan(points.centre(joint), at), _or_nan(points.axes(joint, ours), ours)
        for name, wrenches, about, along in (
            ("centre", whole, centre, ours),
            ("axes", whole, at, axes),
            ("forces", raw, at, ours),
            ("tables", tables, at, ours),
            ("centre and axes", whole, centre, axes),
            ("all", raw, centre, axes),
        ):
            wrench = wrenches[joint]
            moment = wrench[:, 3:] + np.cross(at - about, wrench[:, :3])
            moment = np.einsum("nka,nk->na", along[:, :, _RIGHT_FORWARD_UP], moment)
            moments = result.setdefault(name, {})
            moments[joint.name, joint.side] = -component_signs(joint) * moment / fit.mass_kg
        apart[joint.name, joint.side] = _apart(at - centre, ours, axes)
    return result, apart


def _or_nan(values: np.ndarray | None, like: np.ndarray) -> np.ndarray:
    return np.full_like(like, np.nan) if values is None else values


def _apart(centre: np.ndarray, ours: np.ndarray, axes: np.ndarray) -> tuple[float, float]:
    """Return RMS distance (mm) and angle (deg) over the frames that show them; NaN where none does."""
    near, seen = np.isfinite(centre).all(axis=1), np.isfinite(axes).all(axis=(1, 2))
    if not near.any() or not seen.any():
        return np.nan, np.nan
    turn = Rotation.from_matrix(ours[seen].swapaxes(1, 2) @ axes[seen]).magnitude()
    return 1e3 * _rms(np.linalg.norm(centre[near], axis=1)), float(np.degrees(_rms(turn)))


def _slow(time: np.ndarray, values: np.ndarray, motion_hz: float) -> np.ndarray:
    """Return values (f,) without what is faster than the motion; NaN where they are, and in intervals too short."""
    result = np.full_like(values, np.nan)
    for first, last in runs(np.isfinite(values)):
        if last - first >= _SPLINE:
            part = slice(first, last + 1)
            result[part] = smooth(time[part], values[part], motion_hz)(time[part])
    return result


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@dataclass(frozen=True)
class CurveDifference:
    """How far a component of a side's joint moment is from Vicon's over all trials, N m/kg, and why.

    Attributes:
        joint, side, component: which.
        rms: of the difference.
        bars: `rms` in error bars: over 1.96 times the RMS standard deviation; NaN without any.
        cause: "centre", "axes", "forces", "tables", "filter"; "together" if only centre, axes and forces together
            explain it; "within" the error bars; "" if nothing that was tried does.
        explained: share of the mean square that goes with the cause; NaN without one.
        tried: whether the file holds the points that centre and axes need.
        apart_mm, apart_deg: of centre and axes from Vicon's, RMS.
    """

    joint: str
    side: str
    component: str
    rms: float
    bars: float
    cause: str
    explained: float
    tried: bool
    apart_mm: float
    apart_deg: float

    @classmethod
    def of(cls, parts: Sequence[MomentDifference]) -> "CurveDifference | None":
        """Judge one component over the trials that show it; None with fewer than ten frames."""
        first = parts[0]
        ours, theirs, sd, slow = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("ours", "vicon", "sd", "slow")
        )
        known = np.isfinite(ours) & np.isfinite(slow)
        if known.sum() < _FEWEST:
            return None
        rms = _rms((ours - theirs)[known])
        bars = rms / (INTERVAL_SD * _rms(sd[known])) if np.isfinite(sd[known]).all() else np.nan
        shares = {"filter": 1.0 - (_rms(slow[known]) / max(rms, 1e-12)) ** 2}
        for name in ("centre", "axes", "forces", "tables", "all"):
            other = np.concatenate([part.others[name] for part in parts])
            both = known & np.isfinite(other)
            if both.sum() >= _FEWEST:
                shares[name] = 1.0 - (_rms((other - theirs)[both]) / max(_rms((ours - theirs)[both]), 1e-12)) ** 2
        together = shares.pop("all", -np.inf)
        best = max(shares, key=lambda name: shares[name])
        cause, explained = "", np.nan
        if bars <= 1.0:
            cause = "within"
        elif shares[best] > _MOST_OF_IT:
            cause, explained = best, shares[best]
        elif together > _MOST_OF_IT:
            cause, explained = "together", together
        apart = (_rms(np.array([getattr(part, name) for part in parts])) for name in ("apart_mm", "apart_deg"))
        return cls(first.joint, first.side, first.component, rms, bars, cause, explained, "centre" in shares, *apart)


def curve_differences(fit: Fit) -> list[CurveDifference]:
    """Return how far each moment curve is from Vicon's, over all trials whose files hold them."""
    found: dict[tuple[str, str, str], list[MomentDifference]] = {}
    for trial in fit.trials:
        for difference in moment_differences(fit, trial):
            found.setdefault((difference.joint, difference.component, difference.side), []).append(difference)
    judged = (CurveDifference.of(parts) for parts in found.values())
    return [difference for difference in judged if difference is not None]


def corrections(fit: Fit) -> str:
    """List the clear gains and delays that the fit has corrected, which Vicon has not; empty if there are none."""
    found = []
    for entry in () if fit.posterior is None else fit.posterior.calibration:
        if entry.sd and abs(entry.value) > _CLEAR_SD * entry.sd:
            if entry.quantity == GAIN:
                found.append(f"{entry.plate} {100.0 * entry.value:+.1f} %")
            elif entry.quantity == DELAY and entry.trial is not None:  # the clock's own part is in it
                found.append(f"delay {1e3 * entry.value:.1f} ms")
    return ", ".join(dict.fromkeys(found))


_AXES = {"Hip": "knee axis", "Knee": "shank axes", "Ankle": "foot axes"}
"""What decides the axes of the segment below a joint: those of the thigh come from the knee's."""
_WORDS = {
    "forces": "corrected forces",
    "tables": "segment masses",
    "filter": "filter",
    "together": "joint centre, axes and forces together",
    "": "not explained",
}


def differences_view(fit: Fit) -> dict[str, Any] | None:
    """Return the content of the report's table: a row per component of each joint's moment; None without curves."""
    found = curve_differences(fit)
    rows = []
    for joint, component in dict.fromkeys((difference.joint, difference.component) for difference in found):
        of_curve = [
            difference for difference in found if (difference.joint, difference.component) == (joint, component)
        ]
        row = {"curve": f"{joint} {component}", "cause": _causes(of_curve)}
        for difference in of_curve:
            row[difference.side] = f"{difference.rms:.2f}" + (
                f" ({difference.bars:.1f})" if np.isfinite(difference.bars) else ""
            )
        rows.append(row)
    tried = all(difference.tried for difference in found)
    return {"rows": rows, "tried": tried, "corrected": corrections(fit)} if found else None


def _causes(sides: Sequence[CurveDifference]) -> str:
    """State the likely causes on both sides, with the size of what differs."""
    beyond = [difference for difference in sides if difference.cause != "within"]
    texts = []
    for cause in dict.fromkeys(difference.cause for difference in beyond):
        of_cause = [difference for difference in beyond if difference.cause == cause]
        whose = "" if len(of_cause) == len(sides) else f"{SIDES[of_cause[0].side][0]}: "
        texts.append(whose + _cause(cause, of_cause))
    return "; ".join(texts) or "within the error bars"


def _cause(cause: str, sides: Sequence[CurveDifference]) -> str:
    joint = sides[0].joint
    if cause == "centre":
        return f"{joint.lower()} centre, {' and '.join(f'{difference.apart_mm:.0f}' for difference in sides)} mm apart"
    if cause == "axes":
        return f"{_AXES[joint]}, {' and '.join(f'{difference.apart_deg:.0f}' for difference in sides)}° apart"
    return _WORDS[cause]
