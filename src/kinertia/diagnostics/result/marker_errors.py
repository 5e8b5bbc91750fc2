"""M14, M16 and M17, do markers stay where they were put, and loads act along the feet once plates are corrected?

Cameras that are tilted sideways displace the body relative to its loads, and so do displaced plates. The dynamics of
the whole body cannot distinguish the two; the feet can. On 31 recordings the loads of both feet, averaged, are within 7
mm of the lines from heel to toe. With plates displaced by 20 mm, on nine walks, they are 14 to 26 mm beside these
lines, and the correction moves them back; with cameras tilted by 1.5 degrees it moves them away.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.evidence.body_centre import owners_of
from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory, foot_trajectories
from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import equal, reported
from kinertia.diagnostics.runner import check
from kinertia.estimation.prepare.model_adaptation import BACKWARDS_RAD
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.calibration_entry import AXIS, POSITION, CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import JOINT_AXIS_SD_RAD
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Skeleton
from kinertia.model.upper_body import head_markers
from kinertia.trial.centre_of_pressure import FIRM_LOAD_N, centre_of_pressure
from kinertia.trial.data import FEET
from kinertia.trial.sampled_data import within

_MOVED_M = Limit(0.03, "m")
"""Skin moves markers up to some 30 mm."""
_SHOULDER_M, _CLAVICLE_M = 0.12, 0.045
_MOVED_AT_SHOULDER_M = Limit(_MOVED_M + _CLAVICLE_M, "m")
"""Markers so close to a shoulder joint move by as much more with the clavicle, while the arm is raised: its length
times 17 degrees."""
_DRIFTING = Limit(3.0)
"""Multiple of the usual SD from which a marker drifts, as in `marker_noise`."""
TORSO_RAD = Limit(0.25, "rad", usual=(np.radians(2.0), np.radians(6.0)))
"""The skin turns the markers about the torso by 2 to 6 degrees; shoulders without a third axis, in a run, by 38."""
_SIDES = {"r": "right", "l": "left"}
_ACROSS = "mediolateral"
_FARTHER_M = Limit(0.008, "m", usual=(-0.007, 0.007))
_CENTRE_HEIGHT = 0.55
"""Height of the body's centre of mass over stature."""


@check("M162", "M163", moved=_MOVED_M, at_shoulder=_MOVED_AT_SHOULDER_M, drifting=_DRIFTING)
def moved_markers(context: ResultContext) -> Iterator[Finding]:
    """Report markers that drift in a trial, and markers displaced in one trial compared with every other."""
    posterior = context.fit.posterior
    if posterior is None:
        return
    loose, shoulders = _loose(context.fit.skeleton), _at_shoulders(context.fit.skeleton)
    for trial, noise in zip(context.fit.trials, posterior.marker_noise, strict=True):
        usual_m = float(np.median(list(noise.sd_m.values())))
        for label in (one for one in noise.drifting if one not in loose):
            sd = Quantity(noise.sd_m[label], "m", limit=_DRIFTING * usual_m)
            yield finding("M163", Where(trial=trial.name, markers=(label,)), sd_m=sd, usual_sd_m=Quantity(usual_m, "m"))
    for trial, distances in zip(context.fit.trials, posterior.marker_distances_m, strict=False):
        for label, away_m in distances.items():
            limit_m = _MOVED_AT_SHOULDER_M if label in shoulders else _MOVED_M
            if away_m > limit_m:
                away = Quantity(away_m, "m", limit=limit_m)
                yield finding("M162", Where(trial=trial.name, markers=(label,)), difference_m=away)


def _loose(skeleton: Skeleton) -> set[str]:
    """Return labels of markers that move without being loose: on the head, and on forearms, whose skin turns."""
    forearms = {m.label for m in skeleton.markers if str(segment_of(m.segment)).startswith("forearm")}
    return forearms.union(head_markers(skeleton))


def _at_shoulders(skeleton: Skeleton) -> set[str]:
    """Return labels of the trunk's markers over the shoulder joints."""
    centres = [
        (joint.parent, joint.translation)
        for joint in skeleton.joints
        if str(segment_of(joint.child)).startswith("upper_arm")
    ]
    return {
        marker.label
        for marker in skeleton.markers
        for parent, centre in centres
        if marker.segment == parent and np.linalg.norm(np.subtract(marker.position, centre)) < _SHOULDER_M
    }


@check(
    "M171",
    "M172",
    "M175",
    backwards=Limit(BACKWARDS_RAD, "rad"),
    torso=TORSO_RAD,
    knee=reported(JOINT_AXIS_SD_RAD, "rad"),
)
def corrected_joints(context: ResultContext) -> Iterator[Finding]:
    """Report elbows that the static trial would bend backwards, a torso that arms would turn, and knees whose axis is
    elsewhere than in the static trial.
    """
    for side, rotation_rad in context.ready.elbow_rotations_rad.items():
        rotation = Quantity(rotation_rad, "rad")
        yield finding("M171", Where(part=f"{_SIDES[side]} elbow"), rotation_rad=rotation)
    if (torso_rad := context.ready.torso_rotation_rad) is not None:
        yield finding("M172", Where(part="torso"), rotation_rad=Quantity(torso_rad, "rad", limit=TORSO_RAD))
    yield from _knee_axes(context)


def _knee_axes(context: ResultContext) -> Iterator[Finding]:
    """Report M175: knees whose axis the trials show elsewhere than the static trial, by either of its two angles."""
    for side, name in _SIDES.items():
        angles = [one for one in _calibrated(context) if one.joint == f"knee_{side}" and one.quantity == AXIS]
        if any(one.found for one in angles):
            worst = max(angles, key=lambda one: abs(one.value))
            rotation_rad = float(np.linalg.norm([one.value for one in angles]))
            rotation = Quantity(rotation_rad, "rad", limit=2.0 * worst.prior_sd, sd=worst.sd)
            yield finding("M175", Where(part=f"{name} knee"), rotation_rad=rotation)


def _calibrated(context: ResultContext) -> Sequence[CalibrationEntry]:
    posterior = context.fit.posterior
    return () if posterior is None else posterior.calibration


@check("M145", farther=_FARTHER_M)
def sideways_lean(context: ResultContext) -> Iterator[Finding]:
    """Report M145: an equal correction of all plates takes the loads away from both feet to one side."""
    across = [axis for axis in "xz" if context.along(axis, None).axis == _ACROSS]
    errors = [one for one in context.errors if one.quantity == POSITION and one.axis in across]
    if len(across) != 1 or not equal(errors):
        return
    beside = [found for trial in context.fit.trials if (found := _beside_feet_m(context, trial)) is not None]
    if not beside:
        return
    before, after = np.mean(np.abs(beside), axis=0)
    if after - before <= _FARTHER_M:
        return
    lean_m = float(np.mean([abs(corrected - recorded) for recorded, corrected in beside]))
    height_m = context.ready.subject.height_m
    evidence = {
        "lean_m": Quantity(lean_m, "m", usual=_FARTHER_M.usual),
        "beside_m": Quantity((float(before), float(after)), "m", limit=_FARTHER_M, usual=_FARTHER_M.usual),
    }
    if height_m is not None:
        evidence["tilt_rad"] = Quantity(lean_m / (_CENTRE_HEIGHT * height_m), "rad")
    yield with_evidence("M145", context.along(across[0], None), evidence)


def _beside_feet_m(context: ResultContext, trial: TrialFit) -> tuple[float, float] | None:
    """Return how far (m) the loads act to the right of the feet, both feet averaged, as recorded and as corrected; None
    where a foot or its loads are hardly visible.
    """
    recorded, markers = trial.kinematics.trial, trial.kinematics.trial.markers
    owners = owners_of(context.fit.skeleton)
    labels = {side: [one for one in markers.labels if owners.get(one) == f"foot_{side}"] for side in FEET}
    feet = foot_trajectories(markers, labels, recorded.belt) if all(labels.values()) else None
    if feet is None:
        return None
    time, loads = trial.reactions.time, recorded.loads
    used = within(loads.time, time[0], time[-1])
    before = _beside_m(feet, loads.time[used], loads.wrench[used])
    after = _beside_m(feet, time, trial.reactions.wrench)
    return None if np.isnan(before + after) else (before, after)


def _beside_m(feet: tuple[FootTrajectory, FootTrajectory], time: np.ndarray, wrench: np.ndarray) -> float:
    """Return how far (m) the loads (k, 2, 6) act to the right of the feet, each foot's mean weighted by its force."""
    beside = []
    for foot, trajectory in enumerate(feet):
        own = wrench[:, foot]
        firm = (own[:, 1] > FIRM_LOAD_N) & trajectory.seen(time)
        place = centre_of_pressure(own[firm])[:, [0, 2]]
        offset = trajectory.offset_m(time[firm], place)[:, 1]
        beside.append(float(own[firm, 1] @ offset / own[firm, 1].sum()) if firm.any() else np.nan)
    return float(np.mean(beside))
