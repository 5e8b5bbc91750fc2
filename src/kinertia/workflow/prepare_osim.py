"""From recordings and a user's own OpenSim model to what the simultaneous estimate needs.

The model's scaling, markers and joints stay as they are unless calibration is asked for, and so does the laboratory's
frame: the trial is not turned. The prior is around the model's own body segment parameters, at the mass on the scale.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.doubts import motion_doubts, trial_doubts, uneven_scales, warnings_of
from kinertia.diagnostics.model.density import points
from kinertia.diagnostics.model.model_doubts import model_doubts
from kinertia.diagnostics.model.model_on_person import moved_doubts
from kinertia.diagnostics.model.person_size import size_trouble
from kinertia.diagnostics.subject.force_mass import check_force_masses
from kinertia.diagnostics.subject.repeated_trials import repeated_trials
from kinertia.diagnostics.timing.exchanged_forces import exchanged_forces
from kinertia.diagnostics.timing.trial_delays import uneven_delays
from kinertia.errors import OsimError, TrialError
from kinertia.estimation.calibration import adapt, first_poses, hold_uninformed
from kinertia.estimation.carried_mass import CarriedMass
from kinertia.estimation.input_checks import check_trials, complete_subject, known
from kinertia.estimation.population import population_prior
from kinertia.estimation.prepared import Prepared, Progress
from kinertia.estimation.prior import SCALE_SD, BspPrior, literature_prior
from kinertia.estimation.simultaneous.model_uncertainty import JOINT_CENTRE_SD_M, MARKER_SD_M, ModelUncertainty
from kinertia.model.anatomy import segment_of
from kinertia.model.bsp import BodySegmentParameters, impossible_segments
from kinertia.model.imported import OsimModel
from kinertia.model.model_markers import markers_of_model
from kinertia.model.skeleton import Axis, Skeleton
from kinertia.motion.kinematics import solve_kinematics
from kinertia.motion.one_thread import one_blas_thread
from kinertia.motion.range_ends import clamped_doubts
from kinertia.settings import Attached, Settings, Subject
from kinertia.trial.data import Trial
from kinertia.trial.plate_assignment import build_trial
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.prepare import LOWER_BODY_SD_M, UPPER_BODY_SD_M

LIGHT_KG = 0.5
"""Bodies that weigh less together than this move with their joints, but are not estimated."""
_MASS_TOLERANCE = 0.002


@one_blas_thread
def prepare_osim(
    subject: Subject,
    model: OsimModel,
    inputs: Sequence[TrialInput],
    settings: Settings | None = None,
    calibrate: bool = False,
    progress: Progress = lambda stage, share: None,
    attached: Sequence[Attached] = (),
) -> Prepared:
    """The model fitted to all trials; the arguments are `estimate_bsp_of_model`'s.

    Raises:
        KinertiaError: the subject, the model or a trial cannot be used.
    """
    settings = settings or Settings()
    recordings = [item.recording for item in inputs]
    check_trials(recordings)
    subject, warnings = complete_subject(subject, recordings, mass_only=True)
    warnings += repeated_trials(recordings, [item.window_s for item in inputs])
    warnings += _doubted(model)
    feet = _feet(model)
    progress("calibration", 0.0)
    started = time.perf_counter()
    trials = []
    for item in inputs:
        trial, doubts = _looked_at(model, item, feet)
        warnings += doubts
        trials.append(trial)
    marker_set = markers_of_model(model)
    warnings += exchanged_forces(trials, marker_set.segments) or uneven_delays(trials, marker_set.segments)
    warnings += uneven_scales(trials, marker_set)
    may_hold = {c.name: c.default for c in model.coordinates if c.name not in model.skeleton.coordinates[:6]}
    skeleton = replace(model.skeleton, feet=(feet["r"][0], feet["l"][0]))
    carried = CarriedMass.of(known(subject.mass_kg), attached)
    check_force_masses(skeleton, carried, trials)
    poses = first_poses(skeleton, trials)
    skeleton, idle = hold_uninformed(skeleton, trials, poses, may_hold)
    if calibrate:
        skeleton = adapt(with_centre_offsets(model, skeleton), trials, poses, _marker_sd(skeleton), {}).skeleton
        warnings += moved_doubts(model.skeleton, skeleton, [trial.markers for trial in trials])
    calibration_s = (time.perf_counter() - started) / len(inputs)
    own, factor = at_mass(model.bsp, carried.body_kg)
    _check_inertias(model, _split(skeleton, own)[0])
    prior, held = parted(skeleton, own)
    expected = population_prior(prior, subject.model_copy(update={"sex": None}), carried.body_kg)
    prior = expected.prior
    centres = {name: JOINT_CENTRE_SD_M for name in skeleton.locked if "/offset_" in name}
    uncertainty = ModelUncertainty(centres, MARKER_SD_M if calibrate else None, held, "the model's own values")

    kinematics, seconds = [], []
    for k, trial in enumerate(trials):
        progress("inverse kinematics", k / len(trials))
        started = time.perf_counter()
        kinematics.append(solve_kinematics(skeleton, trial, 0.0, settings.cutoff_hz))
        warnings += [f"{trial.name}: {one}" for one in clamped_doubts(skeleton, kinematics[k].ik)]
        ik_s = time.perf_counter() - started
        seconds.append({"read": inputs[k].read_seconds, "calibration": calibration_s, "ik": ik_s})
    notes = [
        f"OpenSim model: {model.path.name}",
        *expected.notes,
        *_mass_note(model, own, factor),
        *_idle_note(model, idle),
        *_held_note(skeleton, held),
        *([] if held is None else _impossible_note(model, held)),
        *_marker_notes(model, trials),
        *(note for k in kinematics for note in k.notes),
    ]
    return Prepared(
        subject=subject,
        settings=settings,
        skeleton=skeleton,
        literature=uncertainty.whole(prior.mean),
        prior=prior,
        uncertainty=uncertainty,
        file=model,
        kinematics=tuple(kinematics),
        seconds=tuple(seconds),
        warnings=(*warnings, *expected.warnings, *_impossible_warning(model, prior.mean)),
        notes=tuple(dict.fromkeys(notes)),
        attached=tuple(attached),
    )


def _doubted(model: OsimModel) -> list[str]:
    """Warnings of the model by itself.

    Raises:
        OsimError: it has no markers, or lengths in another unit.
    """
    if not model.skeleton.markers:
        raise OsimError(model.path, "no markers in it; scale the model with OpenSim's Scale tool, which places them")
    if trouble := size_trouble(model.skeleton, model.bsp):
        raise OsimError(model.path, trouble)
    return [f"{model.path.name}: {sentence}" for sentence in model_doubts(model.skeleton, model.bsp)]


def _impossible_warning(model: OsimModel, estimated: BodySegmentParameters) -> list[str]:
    told = _impossible(model, estimated)
    return [f"{each}; the estimate starts from them, so correct them first ({_what_is_wrong(model)})" for each in told]


def _impossible_note(model: OsimModel, held: BodySegmentParameters) -> list[str]:
    told = _impossible(model, held)
    return [
        f"{each}, which are kept as they are: too light to change the results ({_what_is_wrong(model)})"
        for each in told
    ]


def _impossible(model: OsimModel, bsp: BodySegmentParameters) -> list[str]:
    own = [name for name in impossible_segments(model.bsp) if name in bsp.segments]
    if not own:
        return []
    return [f"{model.path.name}: the model's own mass properties are physically impossible for {', '.join(own)}"]


def _what_is_wrong(model: OsimModel) -> str:
    return f"kinertia check {model.path.name} says what is wrong"


def _feet(model: OsimModel) -> dict[str, list[str]]:
    """The bodies of each foot by their names, the heaviest first: it carries the ground reactions.

    Raises:
        OsimError: there is none.
    """
    mass = dict(zip(model.bsp.segments, model.bsp.mass_kg.tolist(), strict=True))
    feet = {}
    for side, name in zip("rl", ("right", "left"), strict=True):
        bodies = [body for body in model.skeleton.segments if segment_of(body) == f"foot_{side}"]
        if not bodies:
            raise OsimError(
                model.path, f"no body of the {name} foot; expected one named calcn_{side}, foot_{side} or the like"
            )
        feet[side] = sorted(bodies, key=lambda body: -mass[body])
    return feet


def _looked_at(model: OsimModel, item: TrialInput, feet: Mapping[str, Sequence[str]]) -> tuple[Trial, list[str]]:
    """The trial with its loads sorted by foot, and warnings."""
    recording = item.recording.without_empty_markers()
    labels = {}
    for (side, bodies), name in zip(feet.items(), ("right", "left"), strict=True):
        worn = [marker.label for marker in model.skeleton.markers if marker.segment in bodies]
        labels[side] = [label for label in worn if label in recording.markers.labels]
        if not labels[side]:
            raise TrialError(
                recording.name,
                f"no marker of the {name} foot is in the file (the model has {', '.join(worn) or 'none'} there); it "
                f"takes one to tell which plate the foot stands on",
            )
    marker_set = markers_of_model(model)
    warnings = warnings_of(recording.name, trial_doubts(recording, marker_set, None, labels))
    trial = build_trial(recording, labels, item.window_s)
    return trial, [*warnings, *warnings_of(trial.name, motion_doubts(recording, trial, marker_set))]


def with_centre_offsets(model: OsimModel, skeleton: Skeleton) -> Skeleton:
    """The skeleton with three more locked translations in front of every joint that turns about three axes.

    They are `<joint>/offset_x` to `_z`, along the parent's axes. Joints that the file gives no frame of their own, or
    one that hangs on another frame, do not get them: the file could not be changed accordingly.
    """
    joints = list(skeleton.joints)
    locked: dict[str, float] = {}
    for i, (joint, osim_joint) in enumerate(zip(joints, model.joints, strict=True)):
        turns = [a for a in joint.axes if a.kind == "rotation" and a.coordinate not in skeleton.locked]
        if i == 0 or osim_joint.offset is None or len({a.coordinate for a in turns}) < 3:
            continue
        columns = np.asarray(joint.rotation).T @ np.eye(3)
        names = [f"{osim_joint.name}/offset_{axis}" for axis in "xyz"]
        offsets = [
            Axis(name, "translation", tuple(map(float, column)))  # type: ignore[arg-type]
            for name, column in zip(names, columns.T, strict=True)
        ]
        joints[i] = replace(joint, axes=(*offsets, *joint.axes))
        locked |= dict.fromkeys(names, 0.0)
    return replace(skeleton, joints=tuple(joints), locked={**skeleton.locked, **locked})


def _marker_sd(skeleton: Skeleton) -> dict[str, float]:
    """Per segment, how far its markers may be from where the model has them."""
    upper = ("torso", "upper_arm", "forearm")
    return {s: UPPER_BODY_SD_M if kind_of(s) in upper else LOWER_BODY_SD_M for s in skeleton.segments}


def kind_of(body: str) -> str:
    """The segment of the prior's table that a body is part of by its name, without its side; else its own name."""
    return (segment_of(body) or body).removesuffix("_r").removesuffix("_l")


def at_mass(bsp: BodySegmentParameters, mass_kg: float) -> tuple[BodySegmentParameters, float]:
    """The same parameters with masses and inertias scaled to this total, and the factor."""
    factor = mass_kg / bsp.total_mass_kg
    scaled = BodySegmentParameters(bsp.segments, bsp.mass_kg * factor, bsp.com_m, bsp.inertia_kgm2 * factor)
    return scaled, factor


def parted(skeleton: Skeleton, own: BodySegmentParameters) -> tuple[BspPrior, BodySegmentParameters | None]:
    """Prior around the model's own parameters of the bodies to be estimated, and the parameters of all others."""
    estimated, rest = _split(skeleton, own)
    prior = literature_prior(estimated, [kind_of(name) for name in estimated.segments])
    prior = replace(prior, mass_sd_kg=SCALE_SD * own.total_mass_kg)
    return prior, rest if rest.segments else None


def _split(skeleton: Skeleton, own: BodySegmentParameters) -> tuple[BodySegmentParameters, BodySegmentParameters]:
    """The bodies to be estimated, and all others.

    Of every group of bodies that move as one the heaviest is estimated; none of a group that is light altogether.
    """
    mass = dict(zip(own.segments, own.mass_kg, strict=True))
    groups: dict[int, list[str]] = {}
    carrier_of = dict(zip(skeleton.segments, skeleton.tree.carrier.tolist(), strict=True))
    for name in own.segments:
        groups.setdefault(carrier_of[name], []).append(name)
    heavy = [names for names in groups.values() if sum(mass[name] for name in names) >= LIGHT_KG]
    chosen = {max(names, key=mass.__getitem__) for names in heavy}
    estimated, rest = (_part(own, [n for n in own.segments if (n in chosen) == taken]) for taken in (True, False))
    return estimated, rest


def _check_inertias(model: OsimModel, estimated: BodySegmentParameters) -> None:
    """The prior is around the model's own inertias: without any there is none.

    Raises:
        OsimError: a body has mass and no inertia.
    """
    if without := points(estimated):
        masses = dict(zip(model.bsp.segments, model.bsp.mass_kg, strict=True))
        listed = ", ".join(f"{name} ({masses[name]:.3g} kg)" for name in without)
        raise OsimError(
            model.path,
            f"moments of inertia of zero or less for bodies that have mass: {listed}; expected positive ones (kg m2), "
            f"around which the fit estimates; most likely they were left out: give them, or scale the model from one "
            f"that has them",
            element=without[0],
        )


def _part(bsp: BodySegmentParameters, names: Sequence[str]) -> BodySegmentParameters:
    rows = [bsp.segments.index(name) for name in names]
    return BodySegmentParameters(tuple(names), bsp.mass_kg[rows], bsp.com_m[rows], bsp.inertia_kgm2[rows])


def _mass_note(model: OsimModel, own: BodySegmentParameters, factor: float) -> list[str]:
    if abs(factor - 1.0) < _MASS_TOLERANCE:
        return []
    return [
        f"the model weighs {model.bsp.total_mass_kg:.1f} kg, the person {own.total_mass_kg:.1f} kg: all its masses and "
        f"inertias are multiplied by {factor:.3f} before the estimate"
    ]


def _idle_note(model: OsimModel, idle: Sequence[str]) -> list[str]:
    if not idle:
        return []
    values = {c.name: c.default for c in model.coordinates}
    angles = {c.name for c in model.coordinates if c.angle}
    listed = ", ".join(
        f"{name} ({np.degrees(values[name]):.0f} deg)" if name in angles else f"{name} ({values[name]:.3f} m)"
        for name in idle
    )
    return [f"no marker shows these coordinates, which are locked at their defaults: {listed}"]


def _held_note(skeleton: Skeleton, held: BodySegmentParameters | None) -> list[str]:
    if held is None:
        return []
    parents = {joint.child: joint.parent for joint in skeleton.joints}
    listed = ", ".join(f"{name} ({parents[name]})" for name in held.segments)
    return [
        f"bodies that weigh less than {LIGHT_KG:g} kg or move as one with another are estimated as one with it: they "
        f"keep the model's own parameters, and what the data say of them goes to the neighbour (in brackets the "
        f"parent): {listed}"
    ]


def _marker_notes(model: OsimModel, trials: Sequence[Trial]) -> list[str]:
    notes = []
    known_labels = set(model.skeleton.labels)
    for trial in trials:
        extra = [label for label in trial.markers.labels if label not in known_labels]
        absent = [label for label in model.skeleton.labels if label not in trial.markers.labels]
        if extra:
            notes.append(f"{trial.name}: markers that the model does not have, left out: {', '.join(extra)}")
        if absent:
            notes.append(f"{trial.name}: markers of the model that it does not have: {', '.join(absent)}")
    return notes
