"""Fits of a short synthetic walk with camera noise."""

from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.fit import fit_simultaneous
from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY
from kinertia.synthetic.laboratory import camera_noise
from kinertia.synthetic.walk import SyntheticTrial, walking_subject
from validation.synthetic_walks import kinematics_of


def seen(trial: SyntheticTrial, seed=0, sd_m=0.002, loads=None, name="walk"):
    """Kinematics of the walk with camera noise, and with these foot loads where they are not the true ones."""
    solved = kinematics_of(trial, camera_noise(trial.markers, sd_m, np.random.default_rng(seed)), loads)
    return replace(solved, trial=replace(solved.trial, name=name))


def estimated(trial: SyntheticTrial, kinematics, literature=None, uncertainty=GAIT27_UNCERTAINTY):
    """Outcome of the estimate that begins at the walker's literature, or at another."""
    prior = literature_prior(literature or walking_subject().literature)
    with threadpool_limits(1, user_api="blas"):
        return fit_simultaneous(trial.skeleton, prior, kinematics, uncertainty=uncertainty)


def fitted(trial: SyntheticTrial, literature=None, disturb=lambda positions, loads: None):
    """Outcome for 2 mm of camera noise, after `disturb` has changed marker positions and loads in place."""
    positions = camera_noise(trial.markers, 0.002, np.random.default_rng(0)).positions
    loads = trial.foot_loads.copy()
    disturb(positions, loads)
    kinematics = kinematics_of(trial, replace(trial.markers, positions=positions), loads)
    return estimated(trial, [kinematics], literature)
