"""How posterior draws of a trial depart from its estimate, which tells how errors of different axes go together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinertia.estimation.drawn_fit import drawn_fit
from kinertia.estimation.result import Fit, TrialFit
from kinertia.motion.model_outputs import Departures

MOST = 100
"""Draws: a correlation is known to 0.1 or better."""


def departures(fit: Fit, trial: TrialFit) -> Departures | None:
    """Of a trial of a fit, at its measured frames; None of a fit that keeps no draws."""
    if fit.posterior is None or fit.posterior.draws is None:
        return None
    k, kept = [one.name for one in fit.trials].index(trial.name), fit.posterior.draws
    own = replace(kept, trials=(kept.trials[k],))
    alone = replace(fit, trials=(trial,), posterior=replace(fit.posterior, draws=own))
    here = _curves(trial)
    drawn = [_curves(drawn_fit(alone, number).trials[0]) for number in range(min(kept.count, MOST))]
    return Departures(*(np.array(each) - at for each, at in zip(zip(*drawn, strict=True), here, strict=True)))


def _curves(trial: TrialFit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates, moments and powers (w, c)."""
    moments = trial.joint_loads["estimate"]
    return trial.motion.q, moments, moments * trial.motion.qd
