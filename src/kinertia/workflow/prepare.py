"""From recordings to what an estimator needs: calibrated skeleton, literature BSPs, smoothed kinematics."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from kinertia.diagnostics.doubts import motion_doubts, static_doubts, trial_doubts, uneven_scales, warnings_of
from kinertia.diagnostics.labels.swapped_markers import check_labels
from kinertia.diagnostics.subject.force_mass import check_force_masses
from kinertia.diagnostics.subject.repeated_trials import repeated_trials
from kinertia.diagnostics.subject.unseen_body import unseen_body
from kinertia.diagnostics.timing.exchanged_forces import exchanged_forces
from kinertia.diagnostics.timing.trial_delays import uneven_delays
from kinertia.errors import MarkerSetError, SettingsError, TrialError
from kinertia.estimation.arm_branch import with_elbows_that_bend_forwards
from kinertia.estimation.calibration import adapt, first_poses, hold_uninformed, sampled, turn_about
from kinertia.estimation.carried_mass import CarriedMass
from kinertia.estimation.input_checks import (
    check_same_person,
    check_trials,
    check_visible,
    complete_subject,
    known,
)
from kinertia.estimation.population import population_prior
from kinertia.estimation.prepared import Prepared, Progress
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.model_uncertainty import GAIT27_UNCERTAINTY
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.gait27 import (
    ARM_COORDINATES,
    ARM_ROTATIONS,
    SHOULDER_OFFSETS,
    VIRTUAL_TRUNK,
    Gait27,
    build_gait27,
)
from kinertia.model.marker_set import MarkerSet, check_marker_set
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import facing, solve_kinematics
from kinertia.motion.one_thread import one_blas_thread
from kinertia.motion.upright_trunk import with_upright_trunk
from kinertia.settings import Attached, Settings, Subject
from kinertia.trial.data import Recording, Trial
from kinertia.trial.plate_assignment import build_trial
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.joint_widths import with_widths

LOWER_BODY_SD_M = 0.01
UPPER_BODY_SD_M = 0.04
"""How far markers may sit from where the model has them."""
_ARM_ROTATION_SD_RAD = 1.0
_TURNED_RAD = 0.25
"""The skin turns the markers about the torso by 2 to 6 degrees; shoulders without a third axis, in a run, by 38."""


@one_blas_thread
def calibrate(model: Gait27, trials: Sequence[Trial], carried: CarriedMass) -> tuple[Skeleton, list[str]]:
    """The skeleton of the 27-DOF model as the static trial gives it, adapted to the trials, and notes.

    Markers of pelvis, legs and feet are held to the static trial by a deviation of 10 mm, those of torso and arms and
    the shoulder centres by 40 mm. Where arms have turned the torso under its markers, since the model's shoulders lack
    an axis, its markers and the pelvis' may not turn as a whole.
    """
    for trial in trials:
        check_visible(model.skeleton, trial)
    check_force_masses(model.skeleton, carried, trials)
    check_same_person(model.skeleton, trials)
    skeleton, poses = with_elbows_that_bend_forwards(model.skeleton, trials, first_poses(model.skeleton, trials))
    skeleton, _ = hold_uninformed(skeleton, trials, poses, dict.fromkeys(ARM_COORDINATES, 0.0))
    for trial in trials:
        check_labels(skeleton.free(ARM_ROTATIONS), trial.name, sampled(trial.markers))
    upper = {"torso", *(f"{name}_{side}" for side in "rl" for name in ("upper_arm", "forearm"))}
    marker_sd = {s: UPPER_BODY_SD_M if s in upper else LOWER_BODY_SD_M for s in model.skeleton.segments}
    coordinate_sd = dict.fromkeys(SHOULDER_OFFSETS, UPPER_BODY_SD_M) | dict.fromkeys(
        ARM_ROTATIONS, _ARM_ROTATION_SD_RAD
    )
    adapted = adapt(skeleton, trials, poses, marker_sd, coordinate_sd)
    if turn_about("torso", skeleton.markers, adapted.skeleton.markers) > _TURNED_RAD:
        adapted = adapt(skeleton, trials, poses, marker_sd, coordinate_sd, unturned=("pelvis", "torso"))
    far = {label: moved for label, moved in adapted.moved_m.items() if moved > 0.03}
    notes = []
    if far:
        listed = ", ".join(f"{label} {moved * 1e3:.0f} mm" for label, moved in sorted(far.items(), key=lambda i: -i[1]))
        notes.append(f"markers that sit elsewhere in the trials than in the static trial (adapted): {listed}")
    return adapted.skeleton, notes


@one_blas_thread
def prepare(
    subject: Subject,
    static: Recording,
    inputs: Sequence[TrialInput],
    settings: Settings | None = None,
    marker_set: MarkerSet | None = None,
    progress: Progress = lambda stage, share: None,
    attached: Sequence[Attached] = (),
) -> Prepared:
    """Calibrated skeleton, literature BSPs and smoothed kinematics of all trials; the arguments are `estimate_bsp`'s.

    Raises:
        KinertiaError: the subject, a marker set or a trial cannot be used.
    """
    settings = settings or Settings()
    if attached and settings.method == "two-level":
        raise SettingsError("two-level knows the body only; where something is attached, use the default method")
    recordings = [item.recording for item in inputs]
    check_trials(recordings)
    subject, warnings = complete_subject(subject, [static, *recordings])
    warnings += repeated_trials(recordings, [item.window_s for item in inputs])
    if marker_set is None:
        marker_set = choose_marker_set(static.markers.labels)
    else:
        check_marker_set(marker_set, static.markers.labels)

    static, marker_set, width_notes = with_widths(static, recordings, marker_set, subject)
    progress("calibration", 0.0)
    started = time.perf_counter()
    warnings += warnings_of(static.name, static_doubts(static, marker_set, subject.height_m))
    turned = []
    for item in inputs:
        trial, doubts = _looked_at(item, static, marker_set)
        warnings += doubts
        turned.append(_turned(trial, marker_set))
    height_m, sex = known(subject.height_m), known(subject.sex)
    model = build_gait27(static, marker_set, height_m, sex, settings.hip_centre)
    if VIRTUAL_TRUNK[0] in model.skeleton.markers:
        turned = [(with_upright_trunk(model.skeleton, trial), angle) for trial, angle in turned]
    trials = [trial for trial, _ in turned]
    warnings += exchanged_forces(trials, marker_set.segments) or uneven_delays(trials, marker_set.segments)
    warnings += uneven_scales(trials, marker_set)
    carried = CarriedMass.of(known(subject.mass_kg), attached)
    skeleton, notes = calibrate(model, trials, carried)
    warnings += unseen_body(skeleton)
    literature = literature_bsp(
        carried.body_kg, known(subject.height_m), known(subject.sex), model.geometry, settings.bsp
    )
    expected = population_prior(literature_prior(literature), subject, carried.body_kg)
    calibration_s = (time.perf_counter() - started) / len(inputs)

    kinematics, seconds = [], []
    for k, (trial, angle) in enumerate(turned):
        progress("inverse kinematics", k / len(turned))
        started = time.perf_counter()
        kinematics.append(solve_kinematics(skeleton, trial, angle, settings.cutoff_hz))
        ik_s = time.perf_counter() - started
        seconds.append({"read": inputs[k].read_seconds, "calibration": calibration_s, "ik": ik_s})

    notes = [f"marker set: {marker_set.name}", *static.notes, *width_notes, *notes]
    for trial, _ in turned:
        absent = [label for label in skeleton.labels if label not in trial.markers.labels]
        if absent:
            notes.append(f"{trial.name}: markers of the static trial that it does not have: {', '.join(absent)}")
    notes += [*expected.notes, *(note for k in kinematics for note in k.notes)]
    return Prepared(
        subject=subject,
        settings=settings,
        skeleton=skeleton,
        literature=expected.prior.mean,
        prior=expected.prior,
        uncertainty=GAIT27_UNCERTAINTY.with_axes() if settings.joint_axes else GAIT27_UNCERTAINTY,
        file=None,
        kinematics=tuple(kinematics),
        seconds=tuple(seconds),
        warnings=(*warnings, *expected.warnings),
        notes=tuple(dict.fromkeys(notes)),
        attached=tuple(attached),
    )


def _looked_at(item: TrialInput, static: Recording, marker_set: MarkerSet) -> tuple[Trial, list[str]]:
    """The trial with its loads sorted by foot, in the laboratory's axes, and warnings."""
    recording = item.recording.without_empty_markers()
    for side in "rl":
        label = marker_set.landmarks[f"asis_{side}"][0]
        if label not in recording.markers.labels:
            raise TrialError(recording.name, f"the marker {label} is missing; it shows which way the person faces")
    present = set(recording.markers.labels)
    feet = {side: [label for label in labels if label in present] for side, labels in marker_set.foot_labels().items()}
    for side, labels in feet.items():
        if not labels:
            raise TrialError(
                recording.name, f"no marker of the {'right' if side == 'r' else 'left'} foot is in the file"
            )
    warnings = warnings_of(recording.name, trial_doubts(recording, marker_set, static, feet))
    trial = build_trial(recording, feet, item.window_s)
    return trial, [*warnings, *warnings_of(trial.name, motion_doubts(recording, trial, marker_set))]


def _turned(trial: Trial, marker_set: MarkerSet) -> tuple[Trial, float]:
    """The trial facing +X, and the angle (deg) it was turned by."""
    try:
        rotation, angle = facing(trial.markers, marker_set)
    except MarkerSetError as error:
        raise TrialError(trial.name, str(error)) from error
    if angle == 0.0:
        return trial, 0.0
    note = f"{trial.name}: turned by {angle:g} degrees about the vertical so that the person faces +X"
    return replace(trial.rotated(rotation), notes=(*trial.notes, note)), angle
