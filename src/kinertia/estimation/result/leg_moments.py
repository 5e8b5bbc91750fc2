"""Describes in which parts of stances and strides joint moments are known, and which ground reactions they rest on."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kinertia.estimation.result.drawn_fit import drawn_forces
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import JointCurves, TrialFit
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.model_outputs import Convention, Departures, ModelOutput, model_outputs
from kinertia.settings import Settings
from kinertia.trial.data import FEET
from kinertia.trial.plate_assignment import FOOT_NAMES
from kinertia.trial.stances import LegCoverage, joined_coverage

NOTABLE_IMPACT_N = 0.5
"""RMS below which impact transients are not mentioned."""
_MOST_DRAWS = 100
"""A correlation is known to 0.1 or better from so many."""


def coverage_by_task(trials: Sequence[TrialFit]) -> Mapping[str, tuple[LegCoverage, ...]]:
    """Return what is known of each leg in any of the trials of a task, by task."""
    by_task: dict[str, list[tuple[LegCoverage, ...]]] = {}
    for trial in trials:
        if legs := trial.coverage:
            by_task.setdefault(trial.kinematics.trial.task, []).append(legs)
    return {task: joined_coverage(legs) for task, legs in by_task.items()}


def coverage_sentence(trials: Sequence[TrialFit]) -> str:
    """Describe what is known: "right: whole stride; left: 0 to 48 % of the stride, no push-off"; empty without strides.

    With several tasks: "walk (right: ...; left: ...); turn (...)".
    """
    parts = coverage_by_task(trials)
    texts = {task: "; ".join(leg.sentence for leg in legs) for task, legs in parts.items()}
    return "; ".join(f"{task} ({text})" if len(texts) > 1 and task else text for task, text in texts.items())


def gaps_sentence(trials: Sequence[TrialFit]) -> str:
    """List the gaps by reason: "the foot stands beside the plates (right 1.20 to 1.40 s)"; with several trials by
    trial.
    """
    parts = []
    for trial in trials:
        spans: dict[str, list[str]] = {}
        for gap in trial.moment_gaps:
            side = FOOT_NAMES[FEET.index(gap.side)]
            spans.setdefault(gap.reason, []).append(f"{side} {gap.start_s:.2f} to {gap.end_s:.2f} s")
        gaps = "; ".join(f"{reason} ({', '.join(texts)})" for reason, texts in spans.items())
        if gaps:
            parts.append(f"{trial.name}: {gaps}" if len(trials) > 1 else gaps)
    return ". ".join(parts)


class ForcesUsed(NamedTuple):
    """Description of the ground reactions used for joint moments.

    Attributes:
        which: "as measured, ..."; used in headers of files, so without an equals sign.
        why: the rest of the sentence, with its punctuation in front; may be empty.
    """

    which: str
    why: str


def forces_used(reactions: GroundReactions, settings: Settings, motion_hz: float) -> ForcesUsed:
    """Describe what was done to the ground reactions of a trial before joint moments were computed from them.

    Args:
        reactions: used for the trial's joint moments.
        settings: as used.
        motion_hz: bandwidth of the motion.
    """
    which, why = _bandwidth(reactions, settings)
    if reactions.impact_n < NOTABLE_IMPACT_N:
        return ForcesUsed(which, why)
    size = f"impacts of {reactions.impact_n:.1f} N (RMS over the trial)"
    spikes = "spikes in the moments of knee and hip (Bisseling and Hof 2006, J Biomech 39:2438)"
    faster = f"faster than the motion ({motion_hz:g} Hz)"
    if settings.force_cutoff_hz == "none":
        return ForcesUsed(f"{which}, {size} included", f"{why}; they are {faster} and put {spikes}")
    keep = 'to keep them: force_cutoff_hz = "none" under [settings]'
    return ForcesUsed(f"{which}, less {size}", f"{why}; they are {faster} and would cause {spikes}; {keep}")


def forces_before(reactions: GroundReactions, settings: Settings) -> str:
    """Describe the ground reactions of the joint moments before the estimate, which include impact transients."""
    by_user = settings.uses.force_cutoff and not isinstance(settings.force_cutoff_hz, str)
    return "as measured" if by_user else _bandwidth(reactions, settings).which


def full_bandwidth(reactions: GroundReactions) -> str:
    """Return the label of residuals at the bandwidth of these ground reactions."""
    if reactions.cutoff_hz is None:
        return "forces at full bandwidth"
    return f"forces up to {reactions.cutoff_hz:.3g} Hz"


def _bandwidth(reactions: GroundReactions, settings: Settings) -> ForcesUsed:
    if reactions.cutoff_hz is None:
        return ForcesUsed("as measured", "")
    which = f"low-passed at {reactions.cutoff_hz:.3g} Hz"
    if not settings.uses.force_cutoff:
        return ForcesUsed(which, ", the bandwidth of the motion")
    if isinstance(settings.force_cutoff_hz, str):
        return ForcesUsed(which, ", because the plates are noisy when unloaded")
    return ForcesUsed(which, ", as force_cutoff_hz says")


def outputs_of(fit: Fit, trial: TrialFit, convention: Convention, correlated: bool = True) -> list[ModelOutput]:
    """Return model outputs at `output_times`, with SDs from the posterior draws; NaN where they are not known.

    Not `correlated`, errors about a joint's axes are taken as independent, which is quick and needs no draws.
    """
    loads, body = trial.reactions.at(output_times(trial)), fit.estimate
    drawn = _departures(fit, trial) if correlated else None
    curves = trial.joint_curves
    motion, sd = (trial.motion, trial.deviations) if curves is None else (curves.motion, curves.deviations)
    found = model_outputs(trial.skeleton, body, motion, loads, fit.mass_kg, convention, sd, drawn)
    return found if curves is None else [_where_known(output, curves, convention, fit.mass_kg) for output in found]


def output_times(trial: TrialFit) -> np.ndarray:
    """Return the times (w,) s of the outputs: of all frames in which any joint's load is known."""
    return trial.time if trial.joint_curves is None else trial.joint_curves.time


def _where_known(output: ModelOutput, curves: JointCurves, convention: Convention, mass_kg: float) -> ModelOutput:
    """Return an output with NaN where it is not known; what a hinge transmits gets the SD of `JointCurves`."""
    label, joints = f"{output.joint.lower()}_{output.side}", curves.joints["estimate"]
    if output.kind == "ANGLES" or label not in joints.joints:
        known = np.logical_or.reduce(curves.known, axis=1)
    else:
        row = joints.joints.index(label)
        known = np.isfinite(joints.moments[:, row, 0])
        if output.kind == "MOMENTS" and curves.moment_sd is not None:
            factor = (1000.0 if convention == "plug-in-gait" else 1.0) / mass_kg
            output = replace(output, sd=np.where(np.isfinite(output.sd), output.sd, factor * curves.moment_sd[:, row]))
    shown = known[:, None]
    return replace(output, values=np.where(shown, output.values, np.nan), sd=np.where(shown, output.sd, np.nan))


def _departures(fit: Fit, trial: TrialFit) -> Departures | None:
    """Return the departures of the draws in a trial, at `output_times`; None after two-level."""
    if fit.posterior is None:
        return None
    k, kept = [fitted.name for fitted in fit.trials].index(trial.name), fit.posterior.draws
    here, numbers = _curves(trial), list(range(min(kept.count, _MOST_DRAWS)))
    drawn = [
        (motion.q, forces, forces * motion.qd) for motion, forces in drawn_forces(fit, trial, kept.trials[k], numbers)
    ]
    return Departures(*(np.array(departed) - at for departed, at in zip(zip(*drawn, strict=True), here, strict=True)))


def _curves(trial: TrialFit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coordinates, moments and powers (w, c) at `output_times`."""
    curves = trial.joint_curves
    if curves is not None:
        forces = curves.forces["estimate"]
        return curves.motion.q, forces, forces * curves.motion.qd
    moments = trial.joint_loads["estimate"]
    return trial.motion.q, moments, moments * trial.motion.qd
