"""Builds the built-in model of a person from landmarks of the static trial, adapted to the trials."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from kinertia.diagnostics.markers.swapped_markers import labels_by_model
from kinertia.diagnostics.result.residuals import TORSO_RAD
from kinertia.diagnostics.runner import blocking
from kinertia.diagnostics.subject.body_data import unobserved_segments
from kinertia.errors import BlockedError, MarkerSetError, SettingsError, TrialError
from kinertia.estimation.calibration import (
    Adaptation,
    AdaptationInputs,
    adapt,
    first_poses,
    lock_undetermined,
    turn_about,
    without_partly_shown,
)
from kinertia.estimation.model_adaptation import (
    elbow_rotations,
    show_knee_axes,
    shows_trunk,
    with_elbows_that_bend_forwards,
    with_rotating_arms,
    with_upright_trunk,
)
from kinertia.estimation.prepared import CALIBRATED_M, TotalMass, complete_subject, known
from kinertia.estimation.prior import literature_prior, population_prior
from kinertia.estimation.simultaneous.instruments.priors import (
    GAIT27_UNCERTAINTY,
    JOINT_AXIS_SD_RAD,
    MARKER_SD_M,
    WITHOUT_STATIC,
    ModelUncertainty,
)
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.gait27 import (
    ARM_COORDINATES,
    ARM_ROTATIONS,
    LEG_AXIS_TILTS,
    SHOULDER_OFFSETS,
    VIRTUAL_TRUNK,
    Gait27,
    build_gait27,
)
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Skeleton
from kinertia.model.upper_body import ARM_SEGMENTS, without_head
from kinertia.motion.kinematics import facing
from kinertia.motion.pose_fit import hidden_landmarks, stance_pose
from kinertia.motion.workload import one_blas_thread
from kinertia.settings import Settings
from kinertia.trial.data import Recording, Trial
from kinertia.workflow.person import (
    LOWER_BODY_SD_M,
    UPPER_BODY_SD_M,
    Person,
    PersonModel,
    RotatedTrial,
    with_stated_ranges,
)
from kinertia.workflow.screening import Screened, with_widths

_STAYS_M = 1e-4
"""SD (m) of markers that have been adapted already."""
_ARM_ROTATION_SD_RAD = 1.0
_ARMS = frozenset(f"{name}_{side}" for side in "rl" for name in ARM_SEGMENTS)


@dataclass(frozen=True, eq=False)
class Calibrated:
    """The adapted skeleton, and what the adaptation showed.

    Attributes:
        skeleton: skeleton adapted to the trials.
        findings: labels that contradict the static trial's model.
        adaptation: to the trials.
        elbow_rotations_rad: side -> rotation of the elbow axis, where it was rotated.
        torso_rotation_rad: rotation of the torso under its markers that was prevented.
        head: labels of the markers on the head, where they are left out.
        free_axes: whether axes of joints are uncertain.
    """

    skeleton: Skeleton
    findings: list[Finding]
    adaptation: Adaptation
    elbow_rotations_rad: Mapping[str, float]
    torso_rotation_rad: float | None
    head: tuple[str, ...]
    free_axes: bool


@one_blas_thread
def calibrate(
    model: Gait27, trials: Sequence[Trial], acromia: Sequence[str] = (), free_axes: bool | None = None
) -> Calibrated:
    """Adapt the skeleton of the 27-DOF model, as the static trial gives it, to the trials.

    Markers of pelvis, legs and feet are held to the static trial by a deviation of 10 mm, those of torso and arms and
    the shoulder centres by 40 mm, free axes of knees and ankles by 5 degrees; where `free_axes` is None, they are free
    if the trials show those of the knees. Axes are adapted to all trials, markers to those with forces: a squat draws
    skin, and with it ankles, 5 mm away from where a walk's joint moments need them.
    Where arms have turned the torso under its markers, since the model's shoulders lack an axis, upper arms may rotate
    about their own axes, and the rest of the body is adapted without them. Markers on the head are left out where three
    others show the trunk, which the acromia (labels), that move with the arms, do not.
    """
    skeleton, poses = with_elbows_that_bend_forwards(model.skeleton, trials)
    complete = without_partly_shown(skeleton, poses, ARM_COORDINATES)
    if complete.markers != skeleton.markers:
        skeleton, poses = with_elbows_that_bend_forwards(complete, trials)
    free_axes = show_knee_axes(poses) if free_axes is None else free_axes
    elbows = elbow_rotations(model.skeleton, skeleton)
    skeleton, _ = lock_undetermined(skeleton, trials, poses, dict.fromkeys(ARM_COORDINATES, 0.0))
    found = [found_labels for trial in trials for found_labels in labels_by_model(skeleton, trial)]
    everywhere = set(model.skeleton.labels).intersection(*(trial.markers.labels for trial in trials))
    skeleton, head = without_head(skeleton, acromia, everywhere)
    marker_sd = {s: UPPER_BODY_SD_M if s in _ARMS or s == "torso" else LOWER_BODY_SD_M for s in model.skeleton.segments}
    coordinate_sd = dict.fromkeys(SHOULDER_OFFSETS, UPPER_BODY_SD_M) | dict.fromkeys(
        ARM_ROTATIONS, _ARM_ROTATION_SD_RAD
    )
    given = AdaptationInputs(trials, poses, marker_sd, coordinate_sd)
    if free_axes:
        skeleton = _with_axes(skeleton, given)
    given = _of_forces(given)
    adapted = adapt(skeleton, given)
    torso_rad: float | None = turn_about("torso", skeleton.markers, adapted.skeleton.markers)
    if torso_rad is not None and torso_rad > TORSO_RAD:
        skeleton = with_rotating_arms(skeleton, trials)
        locked = {name: sd for name, sd in coordinate_sd.items() if name in skeleton.locked}
        given = replace(given, poses=first_poses(skeleton, given.trials), coordinate_sd=locked)
        adapted = _arms_last(skeleton, given)
    else:
        torso_rad = None
    return Calibrated(adapted.skeleton, found, adapted, elbows, torso_rad, head, free_axes)


def _with_axes(skeleton: Skeleton, given: AdaptationInputs) -> Skeleton:
    """Return the skeleton with axes of knees and ankles adapted to all trials, and nothing else changed."""
    free = {**given.coordinate_sd, **dict.fromkeys(LEG_AXIS_TILTS, JOINT_AXIS_SD_RAD)}
    found = adapt(skeleton, replace(given, coordinate_sd=free)).coordinates
    return skeleton.lock({name: found[name] for name in LEG_AXIS_TILTS})


def _of_forces(given: AdaptationInputs) -> AdaptationInputs:
    """Leave the trials whose forces are used, with their poses; all of them where there is none."""
    used = [k for k, trial in enumerate(given.trials) if trial.loads.plates] or range(len(given.trials))
    return replace(given, trials=[given.trials[k] for k in used], poses=[given.poses[k] for k in used])


def _arms_last(skeleton: Skeleton, given: AdaptationInputs) -> Adaptation:
    """Adapt the body without the markers of its arms, then the arms on a body that stays unchanged."""
    worn = [marker for marker in skeleton.markers if marker.segment in _ARMS]
    armless = skeleton.with_markers([marker for marker in skeleton.markers if marker.segment not in _ARMS])
    body = adapt(armless, replace(given, coordinate_sd={}))
    whole = body.skeleton.with_markers([*body.skeleton.markers, *worn])
    staying = {segment: sd if segment in _ARMS else _STAYS_M for segment, sd in given.marker_sd_m.items()}
    adapted = adapt(whole, replace(given, marker_sd_m=staying))
    return replace(adapted, moved_m={**adapted.moved_m, **body.moved_m})


@dataclass(frozen=True, eq=False)
class _Landmarks:
    """Where the built-in model's landmarks are from.

    Attributes:
        static: the static trial, or a pose of the walk in its place.
        marker_set: which label is which landmark, with the widths of joints that are known.
        of_walk: there is no static trial (S207): joint centres and markers are twice as uncertain.
    """

    static: Recording
    marker_set: MarkerSet
    of_walk: bool = False

    @property
    def acromia(self) -> list[str]:
        """Labels of the markers that move with the arms."""
        return [label for side in "rl" for label in self.marker_set.landmarks.get(f"acromion_{side}", ())]


def built_in_model(screened: Screened, trials: Sequence[RotatedTrial], settings: Settings) -> PersonModel:
    """Build the 27-DOF model of a person from landmarks, adapted to the trials, with the literature's prior.

    Args:
        screened: the person.
        trials: those that can be used, as recorded.
        settings: hip centres, tables, whether axes of joints move.

    Raises:
        BlockedError: labels that contradict the model leave no trial.
        KinertiaError: the subject cannot be used.
    """
    person, context = screened.person, screened.context
    if context.marker_set is None:
        raise SettingsError.of_entry("[model]", "expected the marker set of the built-in model (markers = ...)")
    static = None if context.static is None else _Landmarks(context.static.recording, known(context.static.marker_set))
    statics = [] if static is None else [static.static]
    subject = complete_subject(person.subject, [*statics, *person.recordings])
    height_m, sex = known(subject.height_m), known(subject.sex)
    facing_x = [_turned(trial, context.marker_set) for trial in trials]
    landmarks = static or _stance_of(person, facing_x, context.marker_set)
    model = build_gait27(
        landmarks.static, landmarks.marker_set, height_m, sex, settings.hip_centre, by_stature=landmarks.of_walk
    )
    model, facing_x = _with_trunk(model, facing_x)
    model = replace(model, skeleton=with_stated_ranges(model.skeleton, subject))
    stated_axes = _free_axes(facing_x, landmarks, settings)
    calibrated = calibrate(model, [rotated.trial for rotated in facing_x], landmarks.acromia, stated_axes)
    found = calibrated.findings
    left = _unblocked(facing_x, screened, [*screened.findings, *found])
    if len(left) < len(facing_x):  # the skeleton is adapted to those that are used
        calibrated = calibrate(model, [rotated.trial for rotated in left], landmarks.acromia, stated_axes)
    body_kg = TotalMass.of(known(subject.mass_kg), person.attached).body_kg
    literature = literature_bsp(body_kg, height_m, sex, model.geometry, settings.bsp)
    return PersonModel(
        subject=subject,
        note=f"marker set: {landmarks.marker_set.name}",
        trials=left,
        skeleton=calibrated.skeleton,
        prior=population_prior(literature_prior(literature), subject, body_kg).prior,
        uncertainty=_uncertainty(calibrated, landmarks, settings.joint_axes or _show_axes(landmarks, left, calibrated)),
        findings=(*found, *_adapted(calibrated), *unobserved_segments(calibrated.skeleton)),
        elbow_rotations_rad=calibrated.elbow_rotations_rad,
        torso_rotation_rad=calibrated.torso_rotation_rad,
    )


def _stance_of(person: Person, trials: Sequence[RotatedTrial], marker_set: MarkerSet) -> _Landmarks:
    """Return a pose of the first trial with forces in place of a static trial, with the widths that are known.

    Raises:
        TrialError: S208, it lacks landmarks of a leg that stands.
    """
    walk = next(trial.trial for trial in trials if trial.trial.loads.plates)
    pose = stance_pose(walk.markers, marker_set)
    if pose is None:
        hidden = ", ".join(hidden_landmarks(walk.markers, marker_set)) or "all of a leg in one frame"
        raise TrialError.found(walk.name, "S208", landmarks=Quantity(hidden))
    measured = next(recording for recording in person.recordings if recording.name == walk.name)
    static, named = with_widths(
        replace(measured, markers=pose, plates=None), person.recordings, marker_set, person.subject
    )
    return _Landmarks(static, named, of_walk=True)


def _free_axes(trials: Sequence[RotatedTrial], landmarks: _Landmarks, settings: Settings) -> bool | None:
    """Return whether joint axes are to be estimated; None where the trials decide, by whether they show them."""
    if settings.joint_axes is not None:
        return settings.joint_axes
    if landmarks.of_walk or any(not trial.trial.loads.plates for trial in trials):
        return True
    return None if settings.uses.joint_axes else False


def _show_axes(landmarks: _Landmarks, trials: Sequence[RotatedTrial], calibrated: Calibrated) -> bool:
    """Decide whether the trials show joint axes, if that is not decided by a static trial and them."""
    return not landmarks.of_walk or show_knee_axes(first_poses(calibrated.skeleton, [trial.trial for trial in trials]))


def _uncertainty(calibrated: Calibrated, landmarks: _Landmarks, shown: bool) -> ModelUncertainty:
    """Return the uncertainty of joint centres, axes and markers of the built-in model.

    Args:
        calibrated: the adapted skeleton.
        landmarks: where its landmarks are from.
        shown: whether the trials show joint axes. Where they do not, and there is no static trial, the axes of ankles
            stay as adapted: the estimate would tilt them by up to 64 degrees.
    """
    known_by = replace(GAIT27_UNCERTAINTY, moved_m=calibrated.adaptation.by_segment_m)
    if landmarks.of_walk:
        centres = {name: WITHOUT_STATIC * sd for name, sd in known_by.centres.items()}
        known_by = replace(known_by, centres=centres, marker_sd_m=WITHOUT_STATIC * MARKER_SD_M)
    if not calibrated.free_axes:
        return known_by.with_fixed_axes()
    axes = {name: sd for name, sd in known_by.with_axes().axes.items() if shown or not name.startswith("ankle")}
    before = {name: 0.0 for name in LEG_AXIS_TILTS if name in axes}
    return replace(known_by, axes=axes, before=before).with_fixed_axes()


def _with_trunk(model: Gait27, trials: Sequence[RotatedTrial]) -> tuple[Gait27, list[RotatedTrial]]:
    """Return the model and its trials, with an upright trunk in trials that show too few trunk markers."""
    lacking = [not shows_trunk(model.skeleton, trial.trial) for trial in trials]
    if any(lacking) and VIRTUAL_TRUNK[0] not in model.skeleton.markers:
        model = replace(model, skeleton=model.skeleton.with_markers([*model.skeleton.markers, *VIRTUAL_TRUNK]))
    return model, [
        replace(rotated, trial=with_upright_trunk(model.skeleton, rotated.trial)) if lacks else rotated
        for rotated, lacks in zip(trials, lacking, strict=True)
    ]


def _adapted(calibrated: Calibrated) -> Iterator[Finding]:
    """Report M173 and M174: markers far from their positions in the static trial, and markers on the head."""
    for label, distance_m in calibrated.adaptation.moved_m.items():
        if distance_m > CALIBRATED_M:
            yield finding("M173", Where(markers=(label,)), distance_m=Quantity(distance_m, "m", limit=CALIBRATED_M))
    if calibrated.head:
        yield finding("M174", Where(markers=calibrated.head))


def _unblocked(trials: Sequence[RotatedTrial], screened: Screened, found: Sequence[Finding]) -> list[RotatedTrial]:
    """Return the trials that remain usable after all findings.

    Raises:
        BlockedError: none can.
    """
    findings = screened.overruled(found)
    stopped = screened.stopped_by(findings)
    left = [trial for trial in trials if trial.trial.name not in stopped]
    if not any(rotated.trial.loads.plates for rotated in left):
        raise BlockedError(findings, blocking(findings))
    return left


def _turned(rotated: RotatedTrial, marker_set: MarkerSet) -> RotatedTrial:
    """Return the trial rotated to face +X."""
    try:
        rotation, angle = facing(rotated.trial.markers, marker_set)
    except MarkerSetError as error:
        raise TrialError(rotated.trial.name, str(error)) from error
    return replace(rotated, trial=rotated.trial if angle == 0.0 else rotated.trial.rotated(rotation), angle_deg=angle)
