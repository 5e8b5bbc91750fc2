"""Computes where on the ground a foot's load acts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinertia.trial.data import LOAD_THRESHOLD_N, FootLoads

FIRM_LOAD_N = 5 * LOAD_THRESHOLD_N
"""Below this a centre of pressure is too noisy to be judged."""


def centre_of_pressure(wrench: np.ndarray, height_m: float = 0.0) -> np.ndarray:
    """(..., 3) m, where at this height (0: the ground) a wrench (..., 6) acts with no moment but a vertical one.

    A wrench without vertical force has none: the point above the origin stands for it.
    """
    upward = np.where(wrench[..., 1] == 0.0, np.inf, wrench[..., 1])
    x = (wrench[..., 5] + height_m * wrench[..., 0]) / upward
    z = (height_m * wrench[..., 2] - wrench[..., 3]) / upward
    return np.stack([x, np.full_like(x, height_m), z], axis=-1)


def free_moment(wrench: np.ndarray) -> np.ndarray:
    """(...) N m about the vertical through the centre of pressure of a wrench (..., 6)."""
    result: np.ndarray = (wrench[..., 3:] - np.cross(centre_of_pressure(wrench), wrench[..., :3]))[..., 1]
    return result


def with_turned_free_moments(loads: FootLoads) -> FootLoads:
    """The same loads with the other sign of the moment about the vertical through each centre of pressure."""
    carried = loads.force[..., 1] >= LOAD_THRESHOLD_N
    moment = loads.moment.copy()
    moment[..., 1] -= np.where(carried, 2.0 * free_moment(loads.wrench), 0.0)
    return replace(loads, moment=moment)


def held_centre_of_pressure(wrench: np.ndarray, least_n: float = LOAD_THRESHOLD_N) -> np.ndarray:
    """(k, 3) m over k samples of one foot's load (k, 6); where it is below `least_n`, that of the nearest sample that
    is not. The origin for a foot that is never loaded.
    """
    firm = np.flatnonzero(wrench[:, 1] >= least_n)
    if not len(firm):
        return np.zeros((len(wrench), 3))
    nearest = firm[np.searchsorted((firm[1:] + firm[:-1]) / 2, np.arange(len(wrench)))]
    return centre_of_pressure(wrench[nearest])
