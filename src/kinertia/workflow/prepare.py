"""Prepares screened recordings for an estimator, with the built-in model or the user's own.

There is one road: the usable trials, a model adapted to them, and their kinematics. The two sources of a model
(`built_in_model`, `opensim_model`) take the same and return the same, a `PersonModel`.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.plates.steps import positions_by_feet
from kinertia.diagnostics.subject.body_data import stated_ranges
from kinertia.errors import SettingsError
from kinertia.estimation.prepared import Prepared, Progress, check_trials
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.instruments.priors import ModelUncertainty
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.workload import one_blas_thread
from kinertia.settings import Settings
from kinertia.workflow.masses import with_attached, with_doubted_mass
from kinertia.workflow.person import Person, PersonModel, RotatedTrial, expect_forces, solved_trials, usable_trial
from kinertia.workflow.screening import Screened, screen

if TYPE_CHECKING:
    from kinertia.workflow.known_body import KnownBody


@one_blas_thread
def prepare(
    person: Person,
    settings: Settings | None = None,
    progress: Progress = lambda stage, share: None,
    prior: BspPrior | None = None,
) -> Prepared:
    """Return calibrated skeleton, prior and smoothed kinematics of all trials; arguments are as in `estimate_bsp`.

    Raises:
        BlockedError: findings leave no trial, with all of them.
        KinertiaError: the subject, a marker set or the model cannot be used.
    """
    return prepared(screen(person), settings or Settings(), progress, prior)


@one_blas_thread
def prepared(
    screened: Screened,
    settings: Settings,
    progress: Progress = lambda stage, share: None,
    prior: BspPrior | None = None,
    known: KnownBody | None = None,
) -> Prepared:
    """Prepare a screened person: a model on all trials that can be used, and all that is known of the body.

    Args:
        screened: the person.
        settings: as wanted.
        progress: called as the work goes on.
        prior: of the body's parameters; the model's if None.
        known: what is known of the body besides.

    Raises:
        BlockedError: findings leave no trial, with all of them.
        KinertiaError: the subject cannot be used, what is known of the body, or what the method does not use.
    """
    person = screened.person
    _expect_used(settings, person, prior)
    check_trials(person.recordings)
    usable = screened.usable
    progress("calibration", 0.0)
    started = time.perf_counter()
    read_s = {item.recording.name: item.read_seconds for item in person.trials}
    trials = [RotatedTrial(usable_trial(trial), 0.0, read_s[trial.name]) for trial in usable]
    expect_forces([trial.trial for trial in trials])
    model = _model(screened, trials, settings)
    calibration_s = (time.perf_counter() - started) / len(model.trials)
    solved = solved_trials(model.skeleton, model.trials, settings.cutoff_hz, calibration_s, progress)
    found = [*model.findings, *stated_ranges(model.subject), *solved.findings, *model.assumed]
    findings = screened.overruled([*screened.findings, *found])
    ready = Prepared(
        subject=model.subject,
        settings=settings,
        skeleton=model.skeleton,
        literature=model.uncertainty.whole(model.prior.mean),
        prior=with_doubted_mass(model.prior, screened.findings) if prior is None else prior,
        uncertainty=_with_feet(model.uncertainty, usable, solved.with_forces.kinematics),
        file=person.model,
        kinematics=solved.with_forces.kinematics,
        seconds=solved.with_forces.seconds,
        findings=tuple(findings),
        notes=(model.note, *(note for k in solved.kinematics for note in k.notes)),
        attached=tuple(person.attached),
        overrule=person.overrule,
        overrule_of=person.overrule_of,
        left_out=screened.left_out_by(findings),
        rules=screened.rules,
        elbow_rotations_rad=model.elbow_rotations_rad,
        torso_rotation_rad=model.torso_rotation_rad,
        functional=solved.without_forces,
    )
    ready, by_itself = (ready, ()) if known is None else known.leaned_on(ready)
    ready = with_attached(ready, by_itself)
    return ready if known is None else known.measured_on(ready)


def _with_feet(
    uncertainty: ModelUncertainty, contexts: Sequence[RecordingContext], solved: Sequence[Kinematics]
) -> ModelUncertainty:
    """Return the uncertainty, including the information from the steps of these trials on plate positions."""
    plates = tuple(dict.fromkeys(plate for k in solved for plate in k.trial.loads.plates))
    names = {k.trial.name for k in solved}
    feet = positions_by_feet([context for context in contexts if context.name in names], plates)
    return replace(uncertainty, instruments=replace(uncertainty.instruments, feet=feet))


def _expect_used(settings: Settings, person: Person, prior: BspPrior | None) -> None:
    """Raise a SettingsError for what is given of a person and not used by the method."""
    unused = {
        "OpenSim models": person.model is not None and not settings.uses.opensim_models,
        "[[attached]]": bool(person.attached) and not settings.uses.attached,
        "priors": prior is not None and not settings.uses.priors,
    }
    if given := [name for name, is_given in unused.items() if is_given]:
        problem = f"{settings.method} does not use {' or '.join(given)}; use the default method"
        raise SettingsError.of_entry("method", problem)


def _model(screened: Screened, trials: Sequence[RotatedTrial], settings: Settings) -> PersonModel:
    """Return the person's model by its source; the only place that distinguishes the two."""
    if screened.person.model is None:
        from kinertia.workflow.built_in_model import built_in_model

        return built_in_model(screened, trials, settings)
    from kinertia.workflow.opensim_model import opensim_model

    return opensim_model(screened, trials, screened.person.model)
