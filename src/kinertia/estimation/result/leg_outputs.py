"""Computes the legs' outputs of a fit as clinical software has them, with SDs from the posterior draws."""

from dataclasses import replace

import numpy as np

from kinertia.estimation.result.drawn_fit import drawn_fit
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import JointCurves, TrialFit
from kinertia.motion.model_outputs import Convention, Departures, ModelOutput, model_outputs

_MOST_DRAWS = 100
"""A correlation is known to 0.1 or better from so many."""


def outputs_of(fit: Fit, trial: TrialFit, convention: Convention, correlated: bool = True) -> list[ModelOutput]:
    """Return model outputs at `output_times`, with SDs from the posterior draws; NaN where they are not known.

    Not `correlated`, errors about a joint's axes are taken as independent, which is quick and needs no draws.
    """
    loads, body = trial.reactions.at(output_times(trial)), fit.estimate
    drawn = _departures(fit, trial) if correlated else None
    curves = trial.joint_curves
    motion, sd = (trial.motion, trial.deviations) if curves is None else (curves.motion, curves.deviations)
    found = model_outputs(trial.skeleton, body, motion, loads, fit.mass_kg, convention, sd, drawn)
    return found if curves is None else [_where_known(one, curves, convention, fit.mass_kg) for one in found]


def output_times(trial: TrialFit) -> np.ndarray:
    """Return the times (w,) s of the outputs: of all frames in which any joint's load is known."""
    return trial.time if trial.joint_curves is None else trial.joint_curves.time


def _where_known(one: ModelOutput, curves: JointCurves, convention: Convention, mass_kg: float) -> ModelOutput:
    """Return an output with NaN where it is not known; what a hinge transmits gets the SD of `JointCurves`."""
    label, joints = f"{one.joint.lower()}_{one.side}", curves.joints["estimate"]
    if one.kind == "ANGLES" or label not in joints.joints:
        known = np.logical_or.reduce(curves.known, axis=1)
    else:
        row = joints.joints.index(label)
        known = np.isfinite(joints.moments[:, row, 0])
        if one.kind == "MOMENTS" and curves.moment_sd is not None:
            factor = (1000.0 if convention == "plug-in-gait" else 1.0) / mass_kg
            one = replace(one, sd=np.where(np.isfinite(one.sd), one.sd, factor * curves.moment_sd[:, row]))
    shown = known[:, None]
    return replace(one, values=np.where(shown, one.values, np.nan), sd=np.where(shown, one.sd, np.nan))


def _departures(fit: Fit, trial: TrialFit) -> Departures | None:
    """Return the departures of the draws in a trial, at `output_times`; None if the fit has no draws."""
    if fit.posterior is None or fit.posterior.draws is None:
        return None
    k, kept = [one.name for one in fit.trials].index(trial.name), fit.posterior.draws
    own = replace(kept, trials=(kept.trials[k],))
    alone = replace(fit, trials=(trial,), posterior=replace(fit.posterior, draws=own))
    here = _curves(trial)
    drawn = [_curves(drawn_fit(alone, number).trials[0]) for number in range(min(kept.count, _MOST_DRAWS))]
    return Departures(*(np.array(each) - at for each, at in zip(zip(*drawn, strict=True), here, strict=True)))


def _curves(trial: TrialFit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coordinates, moments and powers (w, c) at `output_times`."""
    curves = trial.joint_curves
    if curves is not None:
        forces = curves.forces["estimate"]
        return curves.motion.q, forces, forces * curves.motion.qd
    moments = trial.joint_loads["estimate"]
    return trial.motion.q, moments, moments * trial.motion.qd
