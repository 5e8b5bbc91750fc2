"""The whole way from recordings to body segment parameters: `estimate_bsp` and its result, `Fit`."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from kinertia.bandwidth import Bandwidth
from kinertia.bsp import BodySegmentParameters
from kinertia.bsp_prior import BspPrior
from kinertia.checks import check_masses, fit_warnings, known, mass_by_force_kg, turning_warnings, two_level_warnings
from kinertia.config import Settings, Subject
from kinertia.dynamics import Motion, inverse_dynamics, joined, residual
from kinertia.forces_used import forces_used
from kinertia.ground_reactions import GroundReactions, ground_reactions, measured_reactions
from kinertia.identifiability import evidence
from kinertia.io.osim import OsimModel
from kinertia.kinematics import Kinematics
from kinertia.marker_set import MarkerSet
from kinertia.osim_prepare import prepare_osim
from kinertia.prepare import Prepared, Progress, TrialInput, prepare
from kinertia.simultaneous_fit import Posterior, fit_simultaneous
from kinertia.skeleton import Skeleton
from kinertia.splines import interpolate
from kinertia.trial import Recording
from kinertia.two_level import Window, correct_pelvis, estimate_two_level, stretches

if TYPE_CHECKING:
    from kinertia.report.plots import FitPlots


@dataclass(frozen=True, eq=False)
class TrialFit:
    """One trial of a `Fit`. Arrays cover the w frames of the measured window.

    Attributes:
        kinematics: markers, coordinates and ground reactions before estimation.
        skeleton: with the markers where they are in this trial (`displacement`).
        motion: coordinates (rad, m) that go with the estimate, and their derivatives as OpenSim's tools will find them
            from `kinematics.mot`: those of natural quintic splines through the frames. They differ from the estimate's
            own in the first and last frames only.
        motion_hz: its bandwidth.
        reactions: the ground reactions that go with it, at the plates' rate, of instruments put right.
        residuals: root residual (w, 6: force N, moment N m about the pelvis origin, ground axes) per stage:
            "literature" (no correction), "corrected" (literature BSPs, pelvis correction), "estimate"; forces have the
            bandwidth of the motion.
        full_residuals: the same at the forces' full bandwidth: before the estimate those as measured, after it
            `reactions`. That of the estimate is what OpenSim's inverse dynamics finds on the result files.
        moments: joint inverse dynamics (w, 27; N m, N) per stage: "literature" (with forces as measured), "estimate"
            (with `reactions`); of the two-level estimate both with forces of the motion's bandwidth.
        moment_sd: (w, 27) posterior deviations of those of the estimate; None after two-level.
        marker_errors_m: distances (w, m) between measured and model markers per stage: "ik", "final".
        seconds: computing time per stage.
    """

    kinematics: Kinematics
    skeleton: Skeleton
    motion: Motion
    motion_hz: float
    reactions: GroundReactions
    residuals: Mapping[str, np.ndarray]
    full_residuals: Mapping[str, np.ndarray]
    moments: Mapping[str, np.ndarray]
    moment_sd: np.ndarray | None
    marker_errors_m: Mapping[str, np.ndarray]
    seconds: Mapping[str, float]

    @property
    def name(self) -> str:
        """The trial's name."""
        return self.kinematics.trial.name

    @property
    def time(self) -> np.ndarray:
        """(w,) s."""
        return self.kinematics.time

    @property
    def coordinates(self) -> pd.DataFrame:
        """Coordinates of the estimate (rad, m) over time."""
        names = list(self.kinematics.ik.coordinates)
        return pd.DataFrame(self.motion.q, index=pd.Index(self.time, name="time"), columns=names)

    def _repr_html_(self) -> str:
        """What a notebook shows: frames used, distances of the markers, residuals."""
        from kinertia.report.notebook import trial_fit_html

        return trial_fit_html(self)


@dataclass(frozen=True, eq=False)
class Fit:
    """Body segment parameters of a person, and what they were estimated from.

    Attributes:
        subject: with mass and height filled in.
        settings: as used.
        skeleton: calibrated model.
        literature, estimate: body segment parameters before and after; before, those of an OpenSim model are its own.
        trials: one entry per trial.
        converged: whether the estimator met its criterion.
        posterior: error bars and calibration; None after two-level, which has none.
        warnings: what the user should know before using the numbers; one sentence each.
        notes: assumptions made on the way; one sentence each.
        file: the OpenSim model that the skeleton is from, if it is.
    """

    subject: Subject
    settings: Settings
    skeleton: Skeleton
    literature: BodySegmentParameters
    estimate: BodySegmentParameters
    trials: tuple[TrialFit, ...]
    converged: bool
    posterior: Posterior | None
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    file: OsimModel | None = None

    @cached_property
    def bsp(self) -> pd.DataFrame:
        """One row per segment and parameter: segment, parameter, unit, literature, estimate.

        The simultaneous estimate adds prior_sd, sd (deviations before and after), information, and evidence:
        "measured" (information above 0.75), "informed" (0.25 to 0.75) or "assumed" (the literature's, hardly changed).
        """
        table = self.literature.to_frame().rename(columns={"value": "literature"})
        table = table.assign(estimate=self.estimate.to_frame()["value"])
        if self.posterior is None:
            return table
        told = {name: getattr(self.posterior, name).ravel() for name in ("prior_sd", "sd", "information")}
        return table.assign(**told, evidence=[evidence(value) for value in told["information"]])

    def save(self, folder: str | Path) -> Path:
        """Write all result files into a folder, as `kinertia.save_fit` does; returns the folder."""
        # estimation does not depend on files, only asks for them when somebody saves
        from kinertia.results import save_fit

        return save_fit(self, folder)

    @property
    def covariance(self) -> pd.DataFrame | None:
        """Posterior covariance of all body segment parameters, by "segment.parameter"; None after two-level."""
        if self.posterior is None:
            return None
        names = (self.bsp["segment"] + "." + self.bsp["parameter"]).tolist()
        return pd.DataFrame(self.posterior.covariance, index=names, columns=names)

    @property
    def calibration(self) -> pd.DataFrame | None:
        """Value, prior and posterior deviation and unit of every calibrated quantity; None after two-level."""
        return None if self.posterior is None else pd.DataFrame(dict(self.posterior.calibration)).T

    @property
    def plot(self) -> FitPlots:
        """Pictures for a notebook: `fit.plot.residuals()`, `.bsp()`, `.coordinates()`, `.skeleton()` and others."""
        # here and in `_repr_html_`: estimation does not depend on the report, only asks for it when somebody looks
        from kinertia.report.plots import FitPlots

        return FitPlots(self)

    def _repr_html_(self) -> str:
        """What a notebook shows: verdict, warnings, body segment parameters."""
        from kinertia.report.notebook import fit_html

        return fit_html(self)


def estimate_bsp(
    subject: Subject,
    static: Recording,
    inputs: Sequence[TrialInput],
    settings: Settings | None = None,
    marker_set: MarkerSet | None = None,
    progress: Progress = lambda stage, share: None,
    prior: BspPrior | None = None,
) -> Fit:
    """Body segment parameters of a person from a static trial and one or more gait trials.

    Args:
        subject: mass and height may be None where a recording carries them.
        static: the person standing.
        inputs: the gait trials.
        settings: defaults if None.
        marker_set: found from the static trial's labels if None.
        progress: called as the work goes on.
        prior: of the body segment parameters, for the simultaneous estimate; the literature's if None.

    Raises:
        KinertiaError: the subject, a marker set or a trial cannot be used; the message says why and what to do.
    """
    # the matrices are small: BLAS threads cost twice what they give, and ten times on a busy machine
    with threadpool_limits(limits=1, user_api="blas"):
        ready = prepare(subject, static, inputs, settings or Settings(), marker_set, progress)
        return _estimate(ready if prior is None else replace(ready, prior=prior), settings or Settings(), progress)


def estimate_bsp_of_model(
    subject: Subject,
    model: OsimModel,
    inputs: Sequence[TrialInput],
    settings: Settings | None = None,
    calibrate: bool = False,
    progress: Progress = lambda stage, share: None,
) -> Fit:
    """Body segment parameters of a person whose scaled OpenSim model is known, by the simultaneous estimate.

    Args:
        subject: mass may be None where a recording carries it.
        model: as `kinertia.io.osim.read_osim` reads it.
        inputs: the trials.
        settings: defaults if None.
        calibrate: let markers and joint centres move; else they stay where the model has them.
        progress: called as the work goes on.

    Raises:
        KinertiaError: the subject, the model or a trial cannot be used; the message says why and what to do.
    """
    settings = settings or Settings()
    with threadpool_limits(limits=1, user_api="blas"):
        return _estimate(prepare_osim(subject, model, inputs, settings, calibrate, progress), settings, progress)


def _estimate(ready: Prepared, settings: Settings, progress: Progress) -> Fit:
    estimator = _two_level if settings.method == "two-level" else _simultaneous
    outcome = estimator(ready, settings, time.perf_counter(), progress)
    warnings = (
        *ready.warnings,
        *turning_warnings(ready.skeleton, ready.kinematics),
        *outcome.warnings,
        *fit_warnings(
            known(ready.subject.mass_kg), ready.literature, outcome.bsp, outcome.trials, ready.freedom.source
        ),
    )
    return Fit(
        subject=ready.subject,
        settings=settings,
        skeleton=outcome.skeleton,
        literature=ready.literature,
        estimate=outcome.bsp,
        trials=outcome.trials,
        converged=outcome.converged,
        posterior=outcome.posterior,
        warnings=tuple(dict.fromkeys(warnings)),
        notes=(*ready.notes, *_force_notes(outcome.trials, settings)),
        file=ready.file,
    )


def _force_notes(trials: Sequence[TrialFit], settings: Settings) -> list[str]:
    """Per trial, which ground reactions the joint moments are from."""
    return [f"{t.name}: {forces_used(t.reactions, settings, t.motion_hz).sentence}" for t in trials]


@dataclass(frozen=True, eq=False)
class _Outcome:
    """What an estimator makes of a prepared person."""

    skeleton: Skeleton
    bsp: BodySegmentParameters
    trials: tuple[TrialFit, ...]
    converged: bool
    posterior: Posterior | None
    warnings: tuple[str, ...]


def _two_level(ready: Prepared, settings: Settings, started: float, progress: Progress) -> _Outcome:
    windows = [_window(k) for k in ready.kinematics]
    cut = [stretches(window) for window in windows]
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
        estimates.append(_Estimated(ready.skeleton, motion, k.cutoff_hz, k.foot_loads, smoothed, smoothed, None))
    trials = _trial_fits(ready, result.bsp, estimates, started)
    warnings = two_level_warnings(result)
    return _Outcome(ready.skeleton, result.bsp, trials, result.converged, None, tuple(warnings))


def _simultaneous(ready: Prepared, settings: Settings, started: float, progress: Progress) -> _Outcome:
    progress("estimate", 0.0)
    by_force = {}
    for k in ready.kinematics:
        left = residual(ready.skeleton, ready.literature, k.motion, _window(k).wrench)
        by_force[k.trial.name] = mass_by_force_kg(ready.literature, k.foot_loads, left)
    check_masses(known(ready.subject.mass_kg), by_force)
    bandwidth = Bandwidth.of(ready.kinematics, settings.cutoff_hz, settings.force_cutoff_hz)
    fitted = fit_simultaneous(ready.skeleton, ready.prior, ready.kinematics, bandwidth, ready.freedom)
    result = fitted.result
    parts = (fitted.skeletons, fitted.motions, fitted.foot_loads, result.reactions, result.moment_sd, ready.kinematics)
    estimates = [
        _Estimated(skeleton, motion, bandwidth.motion_hz, loads, reactions, measured_reactions(k), moment_sd)
        for skeleton, motion, loads, reactions, moment_sd, k in zip(*parts, strict=True)
    ]
    trials = _trial_fits(ready, fitted.bsp, estimates, started)
    return _Outcome(fitted.skeleton, fitted.bsp, trials, result.converged, fitted.posterior, fitted.warnings)


@dataclass(frozen=True, eq=False)
class _Estimated:
    """One trial as estimated.

    Attributes:
        skeleton: with the markers where they are in it.
        motion, motion_hz: and its bandwidth.
        foot_loads: (w, 2, 6) of the motion's bandwidth.
        reactions, before: for the joint moments after and before the estimate.
        moment_sd: (w, c) of the joint moments, or None.
    """

    skeleton: Skeleton
    motion: Motion
    motion_hz: float
    foot_loads: np.ndarray
    reactions: GroundReactions
    before: GroundReactions
    moment_sd: np.ndarray | None


def _trial_fits(
    ready: Prepared, bsp: BodySegmentParameters, estimates: Sequence[_Estimated], started: float
) -> tuple[TrialFit, ...]:
    """Every trial before and after."""
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
    window = _window(k)
    corrected = joined([correct_pelvis(before, literature, part) for part in stretches(window)])
    stages = {
        "literature": (before, literature, window.motion),
        "corrected": (before, literature, corrected),
    }
    measured, delivered = (loads.at(k.time) for loads in (after.before, after.reactions))
    spline = interpolate(k.time, after.motion.q)
    motion = Motion(*(spline(k.time, order) for order in range(3)))
    narrow = {name: residual(*stage, window.wrench) for name, stage in stages.items()}
    narrow["estimate"] = residual(after.skeleton, bsp, after.motion, after.foot_loads.sum(axis=1))
    full = {name: residual(*stage, measured.sum(axis=1)) for name, stage in stages.items()}
    full["estimate"] = residual(after.skeleton, bsp, motion, delivered.sum(axis=1))
    return TrialFit(
        kinematics=k,
        skeleton=after.skeleton,
        motion=motion,
        motion_hz=after.motion_hz,
        reactions=after.reactions,
        residuals=narrow,
        full_residuals=full,
        moments={
            "literature": inverse_dynamics(before, literature, window.motion, measured),
            "estimate": inverse_dynamics(after.skeleton, bsp, motion, delivered),
        },
        moment_sd=after.moment_sd,
        marker_errors_m={"ik": k.ik.errors_m[k.frames], "final": _marker_errors(after.skeleton, k, after.motion)},
        seconds=seconds,
    )


def _window(kinematics: Kinematics) -> Window:
    return Window(kinematics.time, kinematics.motion, kinematics.foot_loads.sum(axis=1))


def _marker_errors(skeleton: Skeleton, kinematics: Kinematics, motion: Motion) -> np.ndarray:
    labels = kinematics.ik.labels
    used = skeleton.with_markers([m for m in skeleton.markers if m.label in labels])
    modelled = used.marker_positions(used.pose(motion.q))
    measured = kinematics.trial.markers.select(used.labels).positions[kinematics.frames]
    return np.linalg.norm(measured - modelled, axis=-1)
