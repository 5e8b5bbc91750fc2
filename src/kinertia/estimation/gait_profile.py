"""Computes Gait Profile Score and Movement Analysis Profile: the distance from normal gait in degrees.

Baker, McGinley, Schwartz et al. 2009, The Gait Profile Score and Movement Analysis Profile, Gait & Posture 30:265-269.
Of nine kinematic variables the Gait Variable Score (GVS) is the root mean square difference, over the gait cycle,
between a person's curve and the mean of people without pathology; the GVS together are the Movement Analysis Profile.
The Gait Profile Score of a side is the root mean square of its nine GVS; that of the person is of fifteen: those of
hip, knee, ankle and foot of both sides, and the pelvis's once, of the left side's cycle.

The paper's angles are Plug-in Gait's; these are the coordinates of the fit, and scores compare with norms of the same
convention only.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinertia.errors import KinertiaError
from kinertia.estimation.gait_scores import VARIABLES, GaitProfile
from kinertia.estimation.mean_cycles import convention_of, mean_curves
from kinertia.estimation.result import Fit
from kinertia.io.norms_file import Norm
from kinertia.motion.gait_cycle import PERCENT
from kinertia.trial.data import FEET

_PELVIS = tuple(VARIABLES)[:3]
_PELVIS_SIDE = "l"
_LEAST_MEASURED = 0.95
"""Share of the cycle that must be known of a curve."""


def gait_profile(fit: Fit, norms: Mapping[str, Norm]) -> GaitProfile:
    """Scores of a fit against norms.

    Args:
        fit: with strides.
        norms: by quantity, as `kinertia norms` writes them.

    Raises:
        KinertiaError: norms lack a variable or are of another convention, or there are no strides.
    """
    check_convention(fit, norms)
    if lacking := [title for quantity, title in VARIABLES.items() if quantity not in norms]:
        raise KinertiaError(
            f"the norms lack {', '.join(lacking)}, which the Gait Profile Score needs: make them with kinertia norms"
        )
    curves = mean_curves(fit)
    if not curves:
        raise KinertiaError("no trial has a stride, and without strides there is no Gait Profile Score")
    unknown = np.full(len(PERCENT), np.nan)
    gvs = {
        (quantity, side): variable_score(curves.get((quantity, side), unknown), norms[quantity])
        for quantity in VARIABLES
        for side in FEET
    }
    of_sides = {side: _rms([gvs[quantity, side] for quantity in VARIABLES]) for side in FEET}
    fifteen = [gvs[quantity, _PELVIS_SIDE] for quantity in _PELVIS]
    fifteen += [gvs[quantity, side] for quantity in VARIABLES if quantity not in _PELVIS for side in FEET]
    people = norms[_PELVIS[0]].people
    return GaitProfile(gvs, of_sides, _rms(fifteen), people, convention_of(fit))


def check_convention(fit: Fit, norms: Mapping[str, Norm]) -> None:
    """Raise a KinertiaError where norms say that they are of another convention than a fit."""
    own = convention_of(fit)
    for norm in norms.values():
        if norm.convention and norm.convention != own:
            raise KinertiaError(
                f"the norms are of {norm.convention}, this fit is of {own}: angles and signs differ; make norms from "
                "fits with the same model"
            )


def variable_score(curve: np.ndarray, norm: Norm) -> float:
    """Gait Variable Score (deg) of a curve (101,); NaN where too little of the cycle is known.

    >>> variable_score(np.full(101, 3.0), Norm(np.array([0.0, 100.0]), np.zeros(2), np.ones(2)))
    3.0
    """
    known = np.isfinite(curve)
    if known.mean() < _LEAST_MEASURED:
        return float("nan")
    return _rms(curve[known] - np.interp(PERCENT, norm.percent, norm.mean)[known])


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
