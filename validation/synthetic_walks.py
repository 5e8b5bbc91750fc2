"""Synthetic walks that the pages estimate from, and their kinematics as a laboratory would find them."""

from dataclasses import replace

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.observation import Observation, observe
from kinertia.motion.kinematics import Kinematics, solve_kinematics
from kinertia.studies.table1 import MARGIN_S, symmetric_truth
from kinertia.synthetic.walk import SyntheticTrial, walk, walking_subject
from kinertia.trial.data import FootLoads, Markers, Trial

STRIDE_S = 1.24
FIRST_SEED = 1


BANDWIDTH = Bandwidth(10.0)
"""Bandwidth of the estimates from the studies' walks."""


def study_walk(duration_s: float = STRIDE_S + 2 * MARGIN_S) -> SyntheticTrial:
    """Return the study's trial with exact derivatives: the estimator's splines contain no trapezoid sums."""
    subject = walking_subject()
    return walk(replace(subject, bsp=symmetric_truth(subject.bsp)), duration_s, trapezoid=False)


def kinematics_of(trial: SyntheticTrial, markers: Markers, loads: np.ndarray | None = None) -> Kinematics:
    """Run inverse kinematics and smoothing of a synthetic trial with these markers and foot loads (n, 2, 6)."""
    loads = trial.foot_loads if loads is None else loads
    measured = np.ones(len(trial.time), dtype=bool)
    feet = FootLoads(trial.time, loads[..., :3], loads[..., 3:])
    return solve_kinematics(trial.skeleton, Trial("walk", markers, feet, measured), 0.0, BANDWIDTH.motion_hz)


def observation_of(
    trial: SyntheticTrial, markers: Markers, loads: np.ndarray | None = None, bandwidth: Bandwidth = BANDWIDTH
) -> Observation:
    """Return the observation of a synthetic trial with these markers and foot loads (n, 2, 6)."""
    kinematics = kinematics_of(trial, markers, loads)
    return observe(trial.skeleton, [kinematics], trial.bsp.total_mass_kg, [bandwidth]).pooled[0]
