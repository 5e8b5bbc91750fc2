"""R30, may the result be used? Residuals and markers by OpenSim's guideline, and joint angles by ranges of motion.

The guideline for residual reduction ("Simulation with OpenSim - Best Practices" and Hicks et al. 2015, J Biomech Eng
137:020905) also wants the peak force below 5 % of the largest external force. OpenSim judges each axis on its own; here
it is the length of the vector, as in `fit.json`, which is stricter. Residuals with forces at the motion's bandwidth are
judged, since no motion of the model can follow faster forces. Residuals with forces at full bandwidth, which OpenSim's
tools find, are reported with them; if only these exceed the guideline, the finding is an INFO.

A residual force that is acceptable by the guideline, but not good, is a WARNING only if the joint moments may be wrong
by what matters clinically: 0.17 N m/kg, the smallest detectable change of a person's knee adduction moment (1.0 % of
body weight times height; from the standard error of measurement by Birmingham et al. 2007, Arthritis Rheum 57:1012).
Synthetic walks whose plates read random forces below 3 Hz that are not there, the worst case: all of it is an error of
the moments, stay below this in 95 % of the frames up to a residual of 0.11 N RMS per kg (0.12 to 0.16 N m/kg at 0.074
to 0.086 N/kg, 0.17 to 0.19 at 0.12 to 0.14). Error bars do not include such forces: they hold 73 to 83 % there.

Cameras that are tilted sideways displace the body relative to its loads, and so do displaced plates. The dynamics of
the whole body cannot distinguish the two; the feet can. On 31 recordings the loads of both feet, averaged, are within 7
mm of the lines from heel to toe. With plates displaced by 20 mm, on nine walks, they are 14 to 26 mm beside these
lines, and the correction moves them back; with cameras tilted by 1.5 degrees it moves them away.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory, foot_trajectories
from kinertia.diagnostics.evidence.landmarks import owners_of
from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import equal, reported
from kinertia.diagnostics.runner import check
from kinertia.estimation.model_adaptation import BACKWARDS_RAD
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.instruments.instrument_errors import AXIS, POSITION, CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import JOINT_AXIS_SD_RAD
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.anatomy import segment_of
from kinertia.model.coordinate_range import TOLERANCE_DEG, UNKNOWN
from kinertia.model.imported_model import centre_offsets
from kinertia.model.marker_set import SIDE_NAMES
from kinertia.model.skeleton import Skeleton
from kinertia.model.upper_body import head_markers
from kinertia.trial.data import FEET
from kinertia.trial.ground_contact import FIRM_LOAD_N, centre_of_pressure
from kinertia.trial.sampled_data import rms, rms_by_marker, within

_IMPOSSIBLE_RAD = Limit(np.radians(TOLERANCE_DEG), "rad")
"""Excess beyond the range of any person."""
_SURE = 2.0
"""SDs of an estimated angle."""
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
_ACROSS = "mediolateral"
_FARTHER_M = Limit(0.008, "m", usual=(-0.007, 0.007))
_CENTRE_HEIGHT = 0.55
"""Height of the body's centre of mass over stature."""


def _limits(unit: str, rms_: float, peak: float) -> tuple[Limit, Limit]:
    return Limit(rms_, unit, source=_GUIDELINE), Limit(peak, unit, source=_GUIDELINE)


class Guideline(NamedTuple):
    """OpenSim's limits of RMS and peak: an ERROR beyond `acceptable`, an INFO or WARNING beyond `good`."""

    code: str
    unit: str
    good: tuple[Limit, Limit]
    acceptable: tuple[Limit, Limit]


_GUIDELINE = "OpenSim's guideline (Hicks et al. 2015)"
FORCE = Guideline("R301", "N", _limits("N", 5.0, 10.0), _limits("N", 10.0, 25.0))
MOMENT = Guideline("R302", "N m", _limits("N m", 30.0, 50.0), _limits("N m", 50.0, 75.0))
HARMLESS_N_PER_KG = Limit(0.11, "N")
"""RMS residual force per body mass up to which joint moments are right within what matters clinically."""
PEAK_FORCE_SHARE = Limit(0.05, source=_GUIDELINE)
"""Largest share of the peak external force that the peak residual force may have."""
GOOD_MARKERS_M, ACCEPTABLE_MARKERS_M = Limit(0.012, "m"), Limit(0.020, "m", source=_GUIDELINE)
"""RMS distance of the markers: OpenSim's guideline for inverse kinematics is 20 mm."""
_LEGS = ("pelvis", "thigh", "shank", "foot")
_WORST_MARKERS = 3
_WRONG_MODEL_M = 0.045
"""RMS distance that markers of a fault-free model exceed on no person, wherever they are attached."""


@check(
    "R301",
    "R302",
    "R303",
    "R304",
    rms_force=FORCE.good[0],
    peak_force=FORCE.good[1],
    acceptable_rms_force=FORCE.acceptable[0],
    acceptable_peak_force=FORCE.acceptable[1],
    harmless=HARMLESS_N_PER_KG,
    rms_moment=MOMENT.good[0],
    peak_moment=MOMENT.good[1],
    acceptable_rms_moment=MOMENT.acceptable[0],
    acceptable_peak_moment=MOMENT.acceptable[1],
    share=PEAK_FORCE_SHARE,
    markers=GOOD_MARKERS_M,
    acceptable_markers=ACCEPTABLE_MARKERS_M,
)
def residuals(context: ResultContext) -> Iterator[Finding]:
    """Check the residual force and moment of every trial, and the distance of its markers."""
    for trial in context.fit.trials:
        yield from residuals_of(trial, context.fit.mass_kg)
        yield from _markers(context, trial)


def residuals_of(trial: TrialFit, mass_kg: float) -> Iterator[Finding]:
    """Report R301, R302 and R303: residual forces and moments of one trial of a body of this mass."""
    if not trial.kinematics.complete:
        return
    narrow, full = (_lengths(loads["estimate"]) for loads in (trial.residuals, trial.full_residuals))
    for guideline, judged, whole in zip((FORCE, MOMENT), narrow, full, strict=True):
        harmless = guideline is FORCE and rms(judged) <= HARMLESS_N_PER_KG * mass_kg
        yield from _by_guideline(trial, guideline, judged, whole, harmless)
    external_n = float(np.linalg.norm(trial.kinematics.foot_loads[:, :, :3].sum(axis=1), axis=1).max())
    share = float(narrow[0].max()) / external_n
    if share > PEAK_FORCE_SHARE:
        evidence = Quantity(share, "1", limit=PEAK_FORCE_SHARE), Quantity(external_n, "N")
        yield finding("R303", Where(trial=trial.name), share=evidence[0], external_n=evidence[1])


def _lengths(residual: np.ndarray) -> list[np.ndarray]:
    """Return lengths (w,) of force and moment of a residual (w, 6)."""
    return [np.linalg.norm(part, axis=1) for part in np.hsplit(residual, 2)]


def _by_guideline(
    trial: TrialFit, guideline: Guideline, judged: np.ndarray, whole: np.ndarray, harmless: bool
) -> Iterator[Finding]:
    """Check vector lengths (w,) at the bandwidths of motion and forces against a guideline; what is acceptable by it is
    an INFO where it is harmless.
    """
    code, unit, good, acceptable = guideline
    typical, peak = rms(judged), float(judged.max())
    suffix = unit.replace(" ", "").lower()
    evidence = {
        f"rms_{suffix}": Quantity(typical, unit, limit=good[0]),
        f"peak_{suffix}": Quantity(peak, unit, limit=good[1]),
        f"full_rms_{suffix}": Quantity(rms(whole), unit),
        f"full_peak_{suffix}": Quantity(float(whole.max()), unit),
        "motion_hz": Quantity(trial.motion_hz, "Hz"),
    }

    def beyond(limits: tuple[float, float], typical: float = typical, peak: float = peak) -> bool:
        return typical > limits[0] or peak > limits[1]

    if beyond(acceptable):
        severity = Severity.ERROR
    elif beyond(good) and not harmless:
        severity = Severity.WARNING
    elif beyond(good) or beyond(good, rms(whole), float(whole.max())):
        severity = Severity.INFO
    else:
        return
    yield with_evidence(code, Where(trial=trial.name), evidence, severity)


def _markers(context: ResultContext, trial: TrialFit) -> Iterator[Finding]:
    """Report R304: markers far from the model. Calibrating hides gross errors, and helps no further once it has been
    done.

    Arms and trunk move in ways that the model's shoulders cannot follow, so only markers of pelvis and legs can cause
    an ERROR.
    """
    errors_m, labels = trial.marker_errors_m["final"], trial.kinematics.ik.labels
    segments = {marker.label: str(segment_of(marker.segment)) for marker in trial.skeleton.markers}
    of_legs = np.array([segments[label].startswith(_LEGS) for label in labels])
    apart_m = rms(errors_m)
    legs_m = rms(errors_m[:, of_legs]) if of_legs.any() else apart_m
    if apart_m <= GOOD_MARKERS_M:
        return
    worst = np.argsort(-np.nan_to_num(rms_by_marker(errors_m)))[:_WORST_MARKERS]
    far = "Joint angles" if legs_m > GOOD_MARKERS_M else "Joint angles of trunk and arms"
    wrong = apart_m > _WRONG_MODEL_M or bool(centre_offsets(context.fit.skeleton))
    calibrate = context.fit.file is not None and not wrong
    check = "check that the model was scaled to this person, and all labels"
    advice = "let markers and joint centres move (--calibrate)" if calibrate else check
    yield finding(
        "R304",
        Where(trial=trial.name, markers=tuple(labels[i] for i in worst)),
        Severity.ERROR if legs_m > ACCEPTABLE_MARKERS_M else None,
        rms_m=Quantity(apart_m, "m", limit=GOOD_MARKERS_M),
        legs_m=Quantity(legs_m, "m", limit=ACCEPTABLE_MARKERS_M),
        angles=Quantity(far),
        advice=Quantity(advice[0].upper() + advice[1:]),
    )


@check("R305", impossible=_IMPOSSIBLE_RAD)
def joint_angles(context: ResultContext) -> Iterator[Finding]:
    """Report R305: every coordinate that leaves its range in a trial, with its most extreme angle.

    Angles beyond the range by less than two of their own SDs are not reported.
    """
    for trial in context.fit.trials:
        for column, name in enumerate(trial.kinematics.ik.coordinates):
            known = trial.skeleton.ranges.get(name, UNKNOWN).anatomical(name)
            if known is None:
                continue
            low, high = known.of_anybody
            angles = trial.motion.q[:, column]
            beyond = np.maximum(low - angles, angles - high)
            worst = int(np.argmax(beyond))
            sd = 0.0 if trial.deviations is None else float(trial.deviations.coordinates[worst, column])
            if beyond[worst] > min(_SURE * sd, _IMPOSSIBLE_RAD):
                yield finding(
                    "R305",
                    Where(trial=trial.name, part=name),
                    Severity.ERROR if beyond[worst] > _IMPOSSIBLE_RAD else None,
                    angle_rad=Quantity(float(angles[worst]), "rad", sd=sd),
                    range_rad=Quantity((low, high), "rad"),
                )


@check("M162", "M163", moved=_MOVED_M, at_shoulder=_MOVED_AT_SHOULDER_M, drifting=_DRIFTING)
def moved_markers(context: ResultContext) -> Iterator[Finding]:
    """Report markers that drift in a trial, and markers displaced in one trial compared with every other."""
    posterior = context.fit.posterior
    if posterior is None:
        return
    loose, shoulders = _loose(context.fit.skeleton), _at_shoulders(context.fit.skeleton)
    for trial, noise in zip(context.fit.trials, posterior.marker_noise, strict=True):
        usual_m = float(np.median(list(noise.sd_m.values())))
        for label in (drifting for drifting in noise.drifting if drifting not in loose):
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
        yield finding("M171", Where(part=f"{SIDE_NAMES[side]} elbow"), rotation_rad=rotation)
    if (torso_rad := context.ready.torso_rotation_rad) is not None:
        yield finding("M172", Where(part="torso"), rotation_rad=Quantity(torso_rad, "rad", limit=TORSO_RAD))
    yield from _knee_axes(context)


def _knee_axes(context: ResultContext) -> Iterator[Finding]:
    """Report M175: knees whose axis the trials show elsewhere than the static trial, by either of its two angles."""
    for side, name in SIDE_NAMES.items():
        angles = [entry for entry in _calibrated(context) if entry.joint == f"knee_{side}" and entry.quantity == AXIS]
        if any(angle.found for angle in angles):
            worst = max(angles, key=lambda angle: abs(angle.value))
            rotation_rad = float(np.linalg.norm([angle.value for angle in angles]))
            rotation = Quantity(rotation_rad, "rad", limit=2.0 * worst.prior_sd, sd=worst.sd)
            yield finding("M175", Where(part=f"{name} knee"), rotation_rad=rotation)


def _calibrated(context: ResultContext) -> Sequence[CalibrationEntry]:
    posterior = context.fit.posterior
    return () if posterior is None else posterior.calibration


@check("M145", farther=_FARTHER_M)
def sideways_lean(context: ResultContext) -> Iterator[Finding]:
    """Report M145: an equal correction of all plates takes the loads away from both feet to one side."""
    across = [axis for axis in "xz" if context.along(axis, None).axis == _ACROSS]
    errors = [error for error in context.errors if error.quantity == POSITION and error.axis in across]
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
    labels = {side: [label for label in markers.labels if owners.get(label) == f"foot_{side}"] for side in FEET}
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
        reaction = wrench[:, foot]
        firm = (reaction[:, 1] > FIRM_LOAD_N) & trajectory.seen(time)
        place = centre_of_pressure(reaction[firm])[:, [0, 2]]
        offset = trajectory.offset_m(time[firm], place)[:, 1]
        beside.append(float(reaction[firm, 1] @ offset / reaction[firm, 1].sum()) if firm.any() else np.nan)
    return float(np.mean(beside))
