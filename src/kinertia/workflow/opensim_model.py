"""Adapts a user's own OpenSim model to a person and the trials.

The model's scaling, markers and joints stay as they are unless calibration is asked for, and so does the laboratory's
frame: the trial is not rotated. The prior is around the model's own body segment parameters, at the mass on the scale.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.model.model_on_person import moved_markers
from kinertia.estimation.calibration import AdaptationInputs, adapt, first_poses, lock_undetermined
from kinertia.estimation.prepared import MODEL_MASS_SHARE, TotalMass, complete_subject, estimated_bodies, known
from kinertia.estimation.prior import SCALE_SD, BspPrior, literature_prior, population_prior
from kinertia.estimation.simultaneous.instruments.priors import (
    JOINT_CENTRE_SD_M,
    MARKER_SD_M,
    ModelUncertainty,
)
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.model.anatomy import segment_of
from kinertia.model.bsp import BodySegmentParameters, impossible_segments
from kinertia.model.imported_model import OsimModel
from kinertia.model.skeleton import Axis, Skeleton
from kinertia.workflow.person import (
    LOWER_BODY_SD_M,
    UPPER_BODY_SD_M,
    PersonModel,
    RotatedTrial,
    with_stated_ranges,
)
from kinertia.workflow.screening import Screened


def opensim_model(screened: Screened, trials: Sequence[RotatedTrial], model: OsimModel) -> PersonModel:
    """Adapt a user's model to a person and the trials.

    Args:
        screened: the person.
        trials: those that can be used, as recorded.
        model: the person's.

    Raises:
        KinertiaError: the subject cannot be used.
    """
    person = screened.person
    subject = complete_subject(person.subject, person.recordings, mass_only=True)
    measured = [trial.trial for trial in trials]
    may_lock = {c.name: c.default for c in model.coordinates if c.name not in model.skeleton.coordinates[:6]}
    skeleton = with_stated_ranges(replace(model.skeleton, feet=_feet(model)), subject)
    poses = first_poses(skeleton, measured)
    skeleton, idle = lock_undetermined(skeleton, measured, poses, may_lock)
    moved: list[Finding] = []
    moved_m: dict[str, float] = {}
    if person.calibrate:
        given = AdaptationInputs(measured, poses, _marker_sd(skeleton), {})
        adapted = adapt(with_centre_offsets(model, skeleton), given)
        skeleton, moved_m = adapted.skeleton, adapted.by_segment_m
        moved = list(moved_markers(model.skeleton, skeleton, [trial.markers for trial in measured]))
    body_kg = TotalMass.of(known(subject.mass_kg), person.attached).body_kg
    filed, factor = at_mass(model.bsp, body_kg)
    prior, held = partition(skeleton, filed)
    centres = {name: JOINT_CENTRE_SD_M for name in skeleton.locked if "/offset_" in name}
    return PersonModel(
        subject=subject,
        note=f"OpenSim model: {model.path.name}",
        trials=trials,
        skeleton=skeleton,
        prior=population_prior(prior, subject.model_copy(update={"sex": None}), body_kg).prior,
        uncertainty=ModelUncertainty(
            centres, MARKER_SD_M if person.calibrate else None, held, "the model's own values", moved_m=moved_m
        ),
        findings=moved,
        assumed=_assumed(model, factor, filed, idle, held),
    )


def _feet(model: OsimModel) -> tuple[str, str]:
    """Return the heaviest body of each foot by name, which carries the ground reactions; there is one (O107)."""
    mass = dict(zip(model.bsp.segments, model.bsp.mass_kg.tolist(), strict=True))
    bodies = ([body for body in model.skeleton.segments if segment_of(body) == f"foot_{side}"] for side in "rl")
    right, left = (max(feet_of_side, key=mass.__getitem__) for feet_of_side in bodies)
    return right, left


def _assumed(
    model: OsimModel,
    factor: float,
    filed: BodySegmentParameters,
    idle: Sequence[str],
    held: BodySegmentParameters | None,
) -> list[Finding]:
    """List assumptions made about the model: masses scaled, coordinates locked, bodies fixed."""
    file = Where(file=model.path.name)
    assumed = []
    if abs(factor - 1.0) >= MODEL_MASS_SHARE:
        model_kg, stated_kg = (Quantity(body.total_mass_kg, "kg") for body in (model.bsp, filed))
        by = Quantity(factor, "1", limit=MODEL_MASS_SHARE)
        assumed.append(finding("O411", file, factor=by, model_kg=model_kg, stated_kg=stated_kg))
    values = {c.name: c.default for c in model.coordinates}
    angles = {c.name for c in model.coordinates if c.angle}
    for name in idle:
        value = Quantity(values[name], "rad" if name in angles else "m")
        assumed.append(finding("O412", replace(file, part=name), value=value))
    if held is not None:
        impossible = set(impossible_segments(model.bsp))
        for name in held.segments:
            mass_kg = float(held.mass_kg[held.segments.index(name)])
            possible = Quantity("impossible, but too light to matter" if name in impossible else "possible")
            assumed.append(finding("O413", replace(file, part=name), mass_kg=Quantity(mass_kg, "kg"), physics=possible))
    return assumed


def with_centre_offsets(model: OsimModel, skeleton: Skeleton) -> Skeleton:
    """Add three locked translations in front of every joint of the skeleton that rotates about three axes.

    They are `<joint>/offset_x` to `_z`, along the parent's axes. Joints without their own frame in the file, or with
    one attached to another frame, do not get them: the file could not be changed accordingly.
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
    """Return by segment the SD (m) of its markers' positions from those in the model."""
    upper = ("torso", "upper_arm", "forearm")
    return {s: UPPER_BODY_SD_M if kind_of(s) in upper else LOWER_BODY_SD_M for s in skeleton.segments}


def kind_of(body: str) -> str:
    """Return the segment of the prior's table that a body belongs to by its name, without side; else its own name."""
    return (segment_of(body) or body).removesuffix("_r").removesuffix("_l")


def at_mass(bsp: BodySegmentParameters, mass_kg: float) -> tuple[BodySegmentParameters, float]:
    """Scale masses and inertias to this total mass; return the parameters and the factor."""
    factor = mass_kg / bsp.total_mass_kg
    scaled = BodySegmentParameters(bsp.segments, bsp.mass_kg * factor, bsp.com_m, bsp.inertia_kgm2 * factor)
    return scaled, factor


def partition(skeleton: Skeleton, filed: BodySegmentParameters) -> tuple[BspPrior, BodySegmentParameters | None]:
    """Return a prior around the model's own parameters of bodies to be estimated, and the parameters of all others."""
    estimated, rest = _split(skeleton, filed)
    prior = literature_prior(estimated, [kind_of(name) for name in estimated.segments])
    prior = replace(prior, mass_sd_kg=SCALE_SD * filed.total_mass_kg)
    return prior, rest if rest.segments else None


def _split(skeleton: Skeleton, filed: BodySegmentParameters) -> tuple[BodySegmentParameters, BodySegmentParameters]:
    """Split the parameters into bodies to be estimated, and all others."""
    chosen = estimated_bodies(skeleton, filed)
    estimated, rest = (_part(filed, [n for n in filed.segments if (n in chosen) == taken]) for taken in (True, False))
    return estimated, rest


def _part(bsp: BodySegmentParameters, names: Sequence[str]) -> BodySegmentParameters:
    rows = [bsp.segments.index(name) for name in names]
    return BodySegmentParameters(tuple(names), bsp.mass_kg[rows], bsp.com_m[rows], bsp.inertia_kgm2[rows])
