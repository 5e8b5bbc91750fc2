"""The whole way from recordings to body segment parameters: `estimate_bsp` and its result, `Fit`."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from kinertia.anthropometry import literature_bsp
from kinertia.bsp import BodySegmentParameters
from kinertia.calibration import adapt, hold_uninformed, sampled
from kinertia.checks import check_visible, complete_subject, fit_warnings, known, two_level_warnings
from kinertia.config import Settings, Subject
from kinertia.contacts import build_trial
from kinertia.dynamics import Motion, inverse_dynamics, joined, residual
from kinertia.errors import MarkerSetError, TrialError
from kinertia.gait27 import ARM_COORDINATES, ARM_ROTATIONS, SHOULDER_OFFSETS, Gait27, build_gait27
from kinertia.kinematics import Kinematics, facing, solve_kinematics
from kinertia.labels import check_labels
from kinertia.marker_set import MarkerSet, check_marker_set, choose_marker_set
from kinertia.simultaneous_fit import Posterior, fit_simultaneous
from kinertia.skeleton import Skeleton
from kinertia.trial import Recording, Trial
from kinertia.two_level import Window, correct_pelvis, estimate_two_level, stretches

_LOWER_BODY_SD_M = 0.01
_UPPER_BODY_SD_M = 0.04
_ARM_ROTATION_SD_RAD = 1.0

Progress = Callable[[str, float], None]
"""Called with the stage's name and the share of it that is done (0 to 1)."""


@dataclass(frozen=True, eq=False)
class TrialFit:
    """One trial of a `Fit`. Arrays cover the w frames of the measured window.

    Attributes:
        kinematics: markers, coordinates and ground reactions before estimation.
        motion: coordinates (rad, m) and derivatives that go with the estimate.
        residuals: root residual (w, 6: force N, moment N m about the pelvis origin, ground axes) per stage:
            "literature" (no correction), "corrected" (literature BSPs, pelvis correction), "estimate".
        moments: joint inverse dynamics (w, 27; N m, N) per stage: "literature", "estimate".
        marker_errors_m: distances (w, m) between measured and model markers per stage: "ik", "final".
        seconds: computing time per stage.
    """

    kinematics: Kinematics
    motion: Motion
    residuals: Mapping[str, np.ndarray]
    moments: Mapping[str, np.ndarray]
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


@dataclass(frozen=True, eq=False)
class Fit:
    """Body segment parameters of a person, and what they were estimated from.

    Attributes:
        subject: with mass and height filled in.
        settings: as used.
        skeleton: calibrated model.
        literature, estimate: body segment parameters before and after.
        trials: one entry per trial.
        converged: whether the estimator met its criterion.
        posterior: error bars and calibration; None after two-level, which has none.
        warnings: what the user should know before using the numbers; one sentence each.
        notes: assumptions made on the way; one sentence each.
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

    @cached_property
    def bsp(self) -> pd.DataFrame:
        """One row per segment and parameter: segment, parameter, unit, literature, estimate.

        The simultaneous estimate adds prior_sd, sd (deviations before and after) and information.
        """
        table = self.literature.to_frame().rename(columns={"value": "literature"})
        table = table.assign(estimate=self.estimate.to_frame()["value"])
        if self.posterior is None:
            return table
        told = {name: getattr(self.posterior, name).ravel() for name in ("prior_sd", "sd", "information")}
        return table.assign(**told)


@dataclass(frozen=True, eq=False)
class Prepared:
    """All that an estimator needs of a person: what recordings become before any estimate.

    Attributes:
        subject: with mass and height filled in.
        skeleton: calibrated model.
        literature: body segment parameters of its geometry.
        kinematics: smoothed coordinates and ground reactions, one entry per trial.
        seconds: computing time by stage, one entry per trial.
        warnings, notes: one sentence each.
    """

    subject: Subject
    skeleton: Skeleton
    literature: BodySegmentParameters
    kinematics: tuple[Kinematics, ...]
    seconds: tuple[Mapping[str, float], ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class TrialInput:
    """A recording and, where the user gives one, the window (s) to use instead of the detected one."""

    recording: Recording
    window_s: tuple[float, float] | None = None
    read_seconds: float = 0.0


def calibrate(
    static: Recording,
    trials: Sequence[Trial],
    marker_set: MarkerSet,
    subject: Subject,
    hip_centre: str,
) -> tuple[Gait27, Skeleton, list[str]]:
    """The 27-DOF model of the static trial, adapted to the trials.

    Returns the model as the static trial gives it, the adapted skeleton, and notes. Markers of pelvis, legs and feet
    are held to the static trial by a deviation of 10 mm, those of torso and arms and the shoulder centres by 40 mm.
    """
    model = build_gait27(static, marker_set, known(subject.height_m), subject.sex, hip_centre)
    for trial in trials:
        check_visible(model.skeleton, trial)
    skeleton, held = hold_uninformed(model.skeleton, trials, ARM_COORDINATES)
    for trial in trials:
        check_labels(skeleton.free(ARM_ROTATIONS), trial.name, sampled(trial.markers))
    upper = {"torso", *(f"{name}_{side}" for side in "rl" for name in ("upper_arm", "forearm"))}
    marker_sd = {s: _UPPER_BODY_SD_M if s in upper else _LOWER_BODY_SD_M for s in model.skeleton.segments}
    coordinate_sd = dict.fromkeys(SHOULDER_OFFSETS, _UPPER_BODY_SD_M) | dict.fromkeys(
        ARM_ROTATIONS, _ARM_ROTATION_SD_RAD
    )
    adapted = adapt(skeleton, [trial.markers for trial in trials], marker_sd, coordinate_sd)
    far = {label: moved for label, moved in adapted.moved_m.items() if moved > 0.03}
    notes = []
    if held:
        notes.append(f"no marker shows {', '.join(held)}: held at 0 (the arm hangs along the torso)")
    if far:
        listed = ", ".join(f"{label} {moved * 1e3:.0f} mm" for label, moved in sorted(far.items(), key=lambda i: -i[1]))
        notes.append(f"markers that sit elsewhere in the trials than in the static trial (adapted): {listed}")
    return model, adapted.skeleton, notes


def estimate_bsp(
    subject: Subject,
    static: Recording,
    inputs: Sequence[TrialInput],
    settings: Settings | None = None,
    marker_set: MarkerSet | None = None,
    progress: Progress = lambda stage, share: None,
) -> Fit:
    """Body segment parameters of a person from a static trial and one or more gait trials.

    Args:
        subject: mass and height may be None where a recording carries them.
        static: the person standing.
        inputs: the gait trials.
        settings: defaults if None.
        marker_set: found from the static trial's labels if None.
        progress: called as the work goes on.

    Raises:
        KinertiaError: the subject, a marker set or a trial cannot be used; the message says why and what to do.
    """
    # the matrices are small: BLAS threads cost twice what they give, and ten times on a busy machine
    with threadpool_limits(limits=1, user_api="blas"):
        return _estimate(subject, static, inputs, settings or Settings(), marker_set, progress)


def _estimate(
    subject: Subject,
    static: Recording,
    inputs: Sequence[TrialInput],
    settings: Settings,
    marker_set: MarkerSet | None,
    progress: Progress,
) -> Fit:
    ready = prepare(subject, static, inputs, settings, marker_set, progress)
    estimator = _two_level if settings.method == "two-level" else _simultaneous
    outcome = estimator(ready, settings, time.perf_counter(), progress)
    warnings = (
        *ready.warnings,
        *outcome.warnings,
        *fit_warnings(known(ready.subject.mass_kg), ready.literature, outcome.bsp, outcome.trials),
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
        notes=ready.notes,
    )


def prepare(
    subject: Subject,
    static: Recording,
    inputs: Sequence[TrialInput],
    settings: Settings,
    marker_set: MarkerSet | None = None,
    progress: Progress = lambda stage, share: None,
) -> Prepared:
    """Calibrated skeleton, literature BSPs and smoothed kinematics of all trials; the arguments are `estimate_bsp`'s.

    Raises:
        KinertiaError: the subject, a marker set or a trial cannot be used.
    """
    recordings = [item.recording for item in inputs]
    subject, warnings = complete_subject(subject, [static, *recordings])
    if marker_set is None:
        marker_set = choose_marker_set(static.markers.labels)
    else:
        check_marker_set(marker_set, static.markers.labels)

    progress("calibration", 0.0)
    started = time.perf_counter()
    turned = [_turned(item, marker_set) for item in inputs]
    model, skeleton, notes = calibrate(static, [trial for trial, _ in turned], marker_set, subject, settings.hip_centre)
    literature = literature_bsp(
        known(subject.mass_kg), known(subject.height_m), subject.sex, model.geometry, settings.bsp
    )
    calibration_s = (time.perf_counter() - started) / len(inputs)

    kinematics, seconds = [], []
    for k, (trial, angle) in enumerate(turned):
        progress("inverse kinematics", k / len(turned))
        started = time.perf_counter()
        kinematics.append(solve_kinematics(skeleton, trial, angle, settings.cutoff_hz))
        ik_s = time.perf_counter() - started
        seconds.append({"read": inputs[k].read_seconds, "calibration": calibration_s, "ik": ik_s})

    notes = [f"marker set: {marker_set.name}", *static.notes, *notes]
    for trial, _ in turned:
        absent = [label for label in skeleton.labels if label not in trial.markers.labels]
        if absent:
            notes.append(f"{trial.name}: markers of the static trial that it does not have: {', '.join(absent)}")
    notes += [note for k in kinematics for note in k.notes]
    return Prepared(
        subject=subject,
        skeleton=skeleton,
        literature=literature,
        kinematics=tuple(kinematics),
        seconds=tuple(seconds),
        warnings=tuple(warnings),
        notes=tuple(dict.fromkeys(notes)),
    )


def _turned(item: TrialInput, marker_set: MarkerSet) -> tuple[Trial, float]:
    """The trial with its loads sorted by foot, facing +X, and the angle (deg) it was turned by."""
    recording = item.recording
    for side in "rl":
        label = marker_set.landmarks[f"asis_{side}"][0]
        if label not in recording.markers.labels:
            raise TrialError(recording.name, f"the marker {label} is missing; it tells which way the person faces")
    present = set(recording.markers.labels)
    feet = {side: [label for label in labels if label in present] for side, labels in marker_set.foot_labels().items()}
    for side, labels in feet.items():
        if not labels:
            raise TrialError(
                recording.name, f"no marker of the {'right' if side == 'r' else 'left'} foot is in the file"
            )
    trial = build_trial(recording, feet, item.window_s)
    try:
        rotation, angle = facing(trial.markers, marker_set)
    except MarkerSetError as error:
        raise TrialError(trial.name, str(error)) from error
    if angle == 0.0:
        return trial, 0.0
    note = f"{trial.name}: turned by {angle:g} degrees about the vertical so that the person faces +X"
    return replace(trial.rotated(rotation), notes=(*trial.notes, note)), angle


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
    estimates = [
        (joined([next(motions) for _ in parts]), k.foot_loads) for k, parts in zip(ready.kinematics, cut, strict=True)
    ]
    trials = _trial_fits(ready, ready.skeleton, result.bsp, estimates, started)
    warnings = two_level_warnings(result)
    return _Outcome(ready.skeleton, result.bsp, trials, result.converged, None, tuple(warnings))


def _simultaneous(ready: Prepared, settings: Settings, started: float, progress: Progress) -> _Outcome:
    progress("estimate", 0.0)
    fitted = fit_simultaneous(ready.skeleton, ready.literature, ready.kinematics, settings.cutoff_hz)
    bsp, skeleton = fitted.result.bsp, fitted.result.skeleton
    estimates = list(zip(fitted.motions, fitted.foot_loads, strict=True))
    trials = _trial_fits(ready, skeleton, bsp, estimates, started)
    return _Outcome(skeleton, bsp, trials, fitted.result.converged, fitted.posterior, fitted.warnings)


def _trial_fits(
    ready: Prepared,
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    estimates: Sequence[tuple[Motion, np.ndarray]],
    started: float,
) -> tuple[TrialFit, ...]:
    """Every trial before and after; `estimates` holds its motion and its foot loads (w, 2, 6) as estimated."""
    spent = (time.perf_counter() - started) / sum(len(k.time) for k in ready.kinematics)
    before, literature = ready.skeleton, ready.literature
    trials = []
    for k, seconds, (motion, loads) in zip(ready.kinematics, ready.seconds, estimates, strict=True):
        window = _window(k)
        corrected = joined([correct_pelvis(before, literature, part) for part in stretches(window)])
        residuals = {
            "literature": residual(before, literature, window.motion, window.wrench),
            "corrected": residual(before, literature, corrected, window.wrench),
            "estimate": residual(skeleton, bsp, motion, loads.sum(axis=1)),
        }
        moments = {
            "literature": inverse_dynamics(before, literature, window.motion, k.foot_loads),
            "estimate": inverse_dynamics(skeleton, bsp, motion, loads),
        }
        errors = {"ik": k.ik.errors_m[k.frames], "final": _marker_errors(skeleton, k, motion)}
        timing = {**seconds, "estimate": spent * len(k.time)}
        timing["total"] = sum(timing.values())
        trials.append(TrialFit(k, motion, residuals, moments, errors, timing))
    return tuple(trials)


def _window(kinematics: Kinematics) -> Window:
    return Window(kinematics.time, kinematics.motion, kinematics.foot_loads.sum(axis=1))


def _marker_errors(skeleton: Skeleton, kinematics: Kinematics, motion: Motion) -> np.ndarray:
    labels = kinematics.ik.labels
    used = skeleton.with_markers([m for m in skeleton.markers if m.label in labels])
    modelled = used.marker_positions(used.pose(motion.q))
    measured = kinematics.trial.markers.select(used.labels).positions[kinematics.frames]
    return np.linalg.norm(measured - modelled, axis=-1)
