"""Runs the whole way from recordings to body segment parameters: `estimate_bsp` and its steps."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.registry import ESTIMATE_CHECKS, RESULT_CHECKS, judged
from kinertia.diagnostics.runner import explained, overruled, rules_of
from kinertia.errors import SettingsError
from kinertia.estimation.free_moment_sign import Signed, with_likelier_sign
from kinertia.estimation.prepared import Prepared, Progress
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import JointCurves, TrialFit, known_with_forces
from kinertia.estimation.simultaneous.fit import Posterior, SimultaneousFit, fit_simultaneous
from kinertia.estimation.simultaneous.instruments.instrument_errors import GAIN, INTERVAL_SD, CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import ModelUncertainty
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.estimation.two_level import Window, correct_pelvis, estimate_two_level, intervals
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.gait27 import VIRTUAL_TRUNK
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics, joined, residual
from kinertia.motion.ground_reactions import GroundReactions, ground_reactions, measured_reactions
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.smoothing import interpolate
from kinertia.motion.workload import one_blas_thread
from kinertia.settings import Settings
from kinertia.workflow.masses import at_mass_of_plates
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare

_BEYOND_EDGE = "P282"


@one_blas_thread
def estimate_bsp(
    person: Person,
    settings: Settings | None = None,
    progress: Progress = lambda stage, share: None,
    prior: BspPrior | None = None,
    terms: Sequence[type[CostTerm]] = (),
) -> Fit:
    """Estimate a person's body segment parameters from one or more trials, with the built-in model or the user's own.

    Args:
        person: the recordings, and what is stated; `read_person` reads them, too.
        settings: defaults if None.
        progress: called as the work goes on.
        prior: of the body segment parameters, for the simultaneous estimate; the literature's, or around the OpenSim
            model's, if None.
        terms: as in `fit_subject`.

    Raises:
        KinertiaError: the subject, a marker set, the model or a trial cannot be used; the message states why and what
            to do.
    """
    return estimate(prepare(person, settings, progress, prior), progress, terms)


@one_blas_thread
def estimate(
    ready: Prepared, progress: Progress = lambda stage, share: None, terms: Sequence[type[CostTerm]] = ()
) -> Fit:
    """Estimate the parameters of a prepared person: the last step of `estimate_bsp`, with the settings of the others.

    Args:
        ready: as `prepare` makes it.
        progress: called as the work goes on.
        terms: as in `fit_subject`.

    Raises:
        KinertiaError: the trials contradict each other, or the scale.
    """
    settings, started = ready.settings, time.perf_counter()
    outcome = _ESTIMATORS[settings.method](ready, settings, started, progress, terms)
    fit = Fit(
        subject=ready.subject,
        settings=settings,
        skeleton=outcome.skeleton,
        literature=ready.literature,
        estimate=outcome.bsp,
        trials=outcome.trials,
        converged=outcome.converged,
        posterior=outcome.posterior,
        findings=ready.findings,
        notes=ready.notes,
        file=ready.file,
        left_out=ready.left_out,
        rules=ready.rules + rules_of(*ESTIMATE_CHECKS, *RESULT_CHECKS),
        evaluations=outcome.evaluations,
    )
    found = explained([*ready.findings, *judged(ResultContext(fit, ready))], ready.left_out)
    return replace(fit, findings=tuple(overruled(found, ready.overrule, ready.overrule_of)))


@dataclass(frozen=True, eq=False)
class _Outcome:
    """Result of an estimator for a prepared person."""

    skeleton: Skeleton
    bsp: BodySegmentParameters
    trials: tuple[TrialFit, ...]
    converged: bool
    posterior: Posterior | None
    evaluations: int = 0


def _two_level(
    ready: Prepared, settings: Settings, started: float, progress: Progress, terms: Sequence[type[CostTerm]]
) -> _Outcome:
    if terms:
        raise SettingsError.of_entry("method", 'expected "simultaneous": only this estimate has cost terms')
    for k in ready.kinematics:
        if not k.complete:
            problem = f'expected "simultaneous": in {k.trial.name}, all ground contact is never measured together'
            raise SettingsError.of_entry("method", problem)
    cut = [_windows(k) for k in ready.kinematics]
    result = estimate_two_level(
        ready.skeleton,
        ready.literature,
        [part for parts in cut for part in parts],
        symmetric=settings.symmetry,
        progress=lambda share: progress("estimate", share),
    )
    motions = iter(result.motions)
    estimates = []
    for k, parts in zip(ready.kinematics, cut, strict=True):
        smoothed = ground_reactions(k, k.cutoff_hz, k.cutoff_hz)
        motion = joined([next(motions) for _ in parts])
        estimates.append(_Estimated(ready.skeleton, motion, None, k.cutoff_hz, k.foot_loads, smoothed, smoothed, None))
    trials = _trial_fits(ready, result.bsp, estimates, started)
    return _Outcome(ready.skeleton, result.bsp, trials, result.converged, None, result.evaluations)


def named_by_source(ready: Prepared) -> ModelUncertainty:
    """Return the uncertainty with its source renamed to "the prior" where that differs from the starting values."""
    expected = ready.uncertainty.whole(ready.prior.mean).table()
    known = not np.array_equal(expected, ready.literature.table())
    return replace(ready.uncertainty, source="the prior") if known else ready.uncertainty


def _simultaneous(
    ready: Prepared, settings: Settings, started: float, progress: Progress, terms: Sequence[type[CostTerm]]
) -> _Outcome:
    progress("estimate", 0.0)
    bandwidths = Bandwidth.of(ready.kinematics, settings.cutoff_hz, settings.force_cutoff_hz)

    def fit(prepared: Prepared, otherwise: Sequence[Kinematics]) -> SimultaneousFit:
        return fit_simultaneous(
            prepared.skeleton,
            prepared.prior,
            prepared.kinematics,
            bandwidths,
            named_by_source(prepared),
            lambda share: progress("estimate", share),
            otherwise,
            prepared.functional,
            terms,
        )

    signed = with_likelier_sign(ready, fit)
    reweighed = at_mass_of_plates(signed.ready, signed.fitted)
    if reweighed is not None:
        signed = Signed(fit(reweighed, ()), reweighed)
    incomplete = without_gains_of_missing_loads(signed.ready, signed.fitted)
    if incomplete is not None:
        again, first = fit(incomplete, ()), signed.fitted.posterior
        posterior = replace(again.posterior, missing_loads=first.missing_loads, free_moment_sign=first.free_moment_sign)
        signed = Signed(replace(again, posterior=posterior), incomplete)
    fitted, ready = signed.fitted, signed.ready
    result = fitted.result
    parts = (
        fitted.skeletons,
        fitted.motions,
        fitted.trajectories,
        bandwidths,
        fitted.foot_loads,
        result.reactions,
        fitted.deviations,
    )
    estimates = [
        _Estimated(skeleton, motion, trajectory, bandwidth.motion_hz, loads, reactions, measured_reactions(k), sd)
        for skeleton, motion, trajectory, bandwidth, loads, reactions, sd, k in zip(
            *parts, ready.kinematics, strict=True
        )
    ]
    trials = _trial_fits(ready, fitted.bsp, estimates, started)
    return _Outcome(fitted.skeleton, fitted.bsp, trials, result.converged, fitted.posterior)


_ESTIMATORS = {"simultaneous": _simultaneous, "two-level": _two_level}


@dataclass(frozen=True, eq=False)
class _Estimated:
    """One trial with its estimated motion and loads.

    Attributes:
        skeleton: skeleton with the markers at their positions in this trial.
        motion: motion in the measured frames.
        trajectory: (f, c) coordinates, as in `TrialFit`; None after two-level.
        motion_hz: bandwidth of the motion.
        foot_loads: (w, 2, 6) at the motion's bandwidth.
        reactions, before: ground reactions for the joint moments after and before the estimate.
        deviations: SDs of the curves at the frames of `trajectory`, or None.
    """

    skeleton: Skeleton
    motion: Motion
    trajectory: np.ndarray | None
    motion_hz: float
    foot_loads: np.ndarray
    reactions: GroundReactions
    before: GroundReactions
    deviations: CurveDeviations | None


def _trial_fits(
    ready: Prepared, bsp: BodySegmentParameters, estimates: Sequence[_Estimated], started: float
) -> tuple[TrialFit, ...]:
    """Return every trial before and after the estimate."""
    spent = (time.perf_counter() - started) / sum(len(k.time) for k in ready.kinematics)
    rows = zip(ready.kinematics, ready.seconds, estimates, strict=True)
    trials = []
    for k, seconds, after in rows:
        timing = {**seconds, "estimate": spent * len(k.time)}
        timing["total"] = sum(timing.values())
        trials.append(_trial_fit(ready.skeleton, ready.literature, k, bsp, after, timing))
    return tuple(trials)


def _trial_fit(
    before: Skeleton,
    literature: BodySegmentParameters,
    k: Kinematics,
    bsp: BodySegmentParameters,
    after: _Estimated,
    seconds: Mapping[str, float],
) -> TrialFit:
    wrench = k.foot_loads.sum(axis=1)
    corrected = joined([correct_pelvis(before, literature, part) for part in _windows(k)]) if k.complete else k.motion
    stages = {
        "literature": (before, literature, k.motion),
        "corrected": (before, literature, corrected),
    }
    measured, delivered = (loads.at(k.time) for loads in (after.before, after.reactions))
    trajectory = None if after.trajectory is None else _interpolated(k.trajectory_time, after.trajectory)
    inner = k.frames - k.trajectory_frames.start
    motion = _by_windows(k, after.motion) if trajectory is None else trajectory.cut(inner)
    curves = None if trajectory is None else _joint_curves(before, literature, k, bsp, after, trajectory)
    narrow = {name: residual(*stage, wrench) for name, stage in stages.items()}
    narrow["estimate"] = residual(after.skeleton, bsp, after.motion, after.foot_loads.sum(axis=1))
    full = {name: residual(*stage, measured.sum(axis=1)) for name, stage in stages.items()}
    full["estimate"] = residual(after.skeleton, bsp, motion, delivered.sum(axis=1))
    loads = {
        "literature": inverse_dynamics(before, literature, k.motion, measured),
        "estimate": inverse_dynamics(after.skeleton, bsp, motion, delivered),
    }
    if not k.complete and curves is not None:
        narrow, full = (
            {name: np.full_like(load, np.nan) for name, load in loads_by_stage.items()}
            for loads_by_stage in (narrow, full)
        )
        loads = {stage: load[inner] for stage, load in curves.forces.items()}
    deviations = after.deviations if curves is None else curves.deviations
    return TrialFit(
        kinematics=k,
        skeleton=after.skeleton,
        motion=motion,
        trajectory=after.trajectory,
        motion_hz=after.motion_hz,
        reactions=after.reactions,
        residuals=narrow,
        full_residuals=full,
        joint_loads=loads,
        deviations=None if deviations is None else deviations.at(inner),
        marker_errors_m={
            "ik": _of_worn(k, k.ik.errors_m[k.frames]),
            "final": _marker_errors(after.skeleton, k, after.motion),
        },
        seconds=seconds,
        joint_curves=curves,
    )


def _joint_curves(
    before: Skeleton,
    literature: BodySegmentParameters,
    k: Kinematics,
    bsp: BodySegmentParameters,
    after: _Estimated,
    trajectory: Motion,
) -> JointCurves:
    """Return the joint loads wherever they are known, before and after the estimate."""
    smoothed = Motion(*(k.spline(k.trajectory_time, order) for order in range(3)))
    stages = {
        "literature": (before, literature, smoothed, after.before),
        "estimate": (after.skeleton, bsp, trajectory, after.reactions),
    }
    known = known_with_forces(after.skeleton, k, after.reactions)
    return JointCurves.of(k, trajectory, stages, after.deviations, known)


def _by_windows(k: Kinematics, motion: Motion) -> Motion:
    """Return the motion that OpenSim's tools read from a file of the coordinates of the measured windows alone."""
    return joined([_interpolated(k.time[part], motion.q[part]) for part in k.intervals])


def _interpolated(time: np.ndarray, q: np.ndarray) -> Motion:
    """Return the motion that OpenSim's tools read from a file of coordinates."""
    spline = interpolate(time, q)
    return Motion(*(spline(time, order) for order in range(3)))


def _windows(k: Kinematics) -> list[Window]:
    """Return the measured windows of a trial, in parts over which the pelvis can be corrected."""
    wrench = k.foot_loads.sum(axis=1)
    return [
        part
        for frames in k.intervals
        for part in intervals(Window(k.time[frames], k.motion.cut(frames), wrench[frames]))
    ]


def _marker_errors(skeleton: Skeleton, kinematics: Kinematics, motion: Motion) -> np.ndarray:
    labels = kinematics.ik.labels
    used = skeleton.with_markers([m for m in skeleton.markers if m.label in labels])
    modelled = used.marker_positions(used.pose(motion.q))
    measured = kinematics.trial.markers.select(used.labels).positions[kinematics.frames]
    result: np.ndarray = np.linalg.norm(measured - modelled, axis=-1)
    return _of_worn(kinematics, result)


def _of_worn(k: Kinematics, errors_m: np.ndarray) -> np.ndarray:
    """Return marker errors (w, m) without the markers of a trunk that is not tracked."""
    virtual = np.array([label in {marker.label for marker in VIRTUAL_TRUNK} for label in k.ik.labels])
    return np.where(virtual, np.nan, errors_m)


def without_gains_of_missing_loads(ready: Prepared, fitted: SimultaneousFit) -> Prepared | None:
    """Return the person with incomplete plates: of their contacts, part of the load is missing.

    A plate is incomplete where the estimate shows it, or where a foot extends beyond its edge and it seems to read too
    little: not where all plates of a trial do, since then the person weighs less. None if there is none.
    """
    beyond = {finding.where.plate for finding in ready.findings if finding.code == _BEYOND_EDGE}
    light = light_plates(fitted.posterior.instrument_errors)
    incomplete = {missing_load.plate for missing_load in fitted.posterior.missing_loads} | {
        name for name in beyond & light if name
    }
    if not incomplete:
        return None
    instruments = replace(ready.uncertainty.instruments, incomplete=frozenset(incomplete))
    return replace(ready, uncertainty=replace(ready.uncertainty, instruments=instruments))


def light_plates(errors: Sequence[CalibrationEntry]) -> set[str | None]:
    """Return the plates that read too little, in all trials or in one, by more than another plate there does."""
    gains = [error for error in errors if error.quantity == GAIN]
    light = set()
    for gain in gains:
        others = [other for other in gains if other.trial == gain.trial and other.plate != gain.plate]
        most = max(others, key=lambda other: other.value, default=None)
        alone = most is None or most.value - gain.value > INTERVAL_SD * float(np.hypot(gain.sd, most.sd))
        if gain.found and gain.value < 0.0 and alone:
            light.add(gain.plate)
    return light
