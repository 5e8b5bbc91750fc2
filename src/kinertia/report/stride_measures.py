"""Computes mean stride measures of a trial, left and right, with Vicon's names and units."""

import numpy as np

from kinertia.estimation.result import TrialFit
from kinertia.io.c3d_analysis import Measure
from kinertia.motion.gait_cycle import Stride, feet_under_pelvis
from kinertia.motion.spatiotemporal import Spatiotemporal, spatiotemporal
from kinertia.trial.data import FEET

_CONTEXTS = {"r": "Right", "l": "Left"}


def stride_measures(trial: TrialFit) -> list[Measure]:
    """Return all that are known; none without strides."""
    if not trial.strides:
        return []
    feet = feet_under_pelvis(trial.skeleton, trial.kinematics)
    found = [
        (stride.side, _measures(stride, one))
        for stride, one in zip(
            trial.strides, spatiotemporal(feet, trial.strides, trial.kinematics.trial.belt), strict=True
        )
    ]
    result = []
    for side in FEET:
        own = [measures for of, measures in found if of == side]
        for name, unit in own[0] if own else ():
            values = np.array([measures[name, unit] for measures in own])
            if np.isfinite(values).any():
                result.append(Measure(_CONTEXTS[side], name, unit, float(np.nanmean(values))))
    return result


def _measures(stride: Stride, one: Spatiotemporal) -> dict[tuple[str, str], float]:
    """Return the measures by name and unit."""
    return {
        ("Cadence", "steps/min"): one.cadence_steps_min,
        ("Walking Speed", "m/s"): one.speed_m_s,
        ("Stride Time", "s"): one.stride_time_s,
        ("Step Time", "s"): one.step_time_s,
        ("Opposite Foot Off", "%"): stride.percent(stride.opposite_toe_off_s),
        ("Opposite Foot Contact", "%"): stride.percent(stride.opposite_strike_s),
        ("Foot Off", "%"): stride.percent(stride.toe_off_s),
        ("Single Support", "s"): stride.opposite_strike_s - stride.opposite_toe_off_s,
        ("Double Support", "s"): 0.01 * one.double_support_percent * one.stride_time_s,
        ("Stride Length", "m"): one.stride_length_m,
        ("Step Length", "m"): one.step_length_m,
        ("Step Width", "m"): one.step_width_m,
    }
