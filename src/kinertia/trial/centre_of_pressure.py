"""Computes where on the ground a foot's load acts."""

from dataclasses import replace

import numpy as np

from kinertia.trial.data import LOAD_THRESHOLD_N, FootLoads

FIRM_LOAD_N = 5 * LOAD_THRESHOLD_N
"""Vertical force below which a centre of pressure is too noisy to be judged."""


def centre_of_pressure(wrench: np.ndarray, height_m: float = 0.0) -> np.ndarray:
    """Return the point (..., 3) m at this height (0: the ground) at which a wrench (..., 6) has no horizontal moment.

    Without vertical force there is no such point: the point above the origin is returned.
    """
    upward = np.where(wrench[..., 1] == 0.0, np.inf, wrench[..., 1])
    x = (wrench[..., 5] + height_m * wrench[..., 0]) / upward
    z = (height_m * wrench[..., 2] - wrench[..., 3]) / upward
    return np.stack([x, np.full_like(x, height_m), z], axis=-1)


def free_moment(wrench: np.ndarray) -> np.ndarray:
    """Return the moment (...) N m about the vertical through the centre of pressure of a wrench (..., 6)."""
    return (wrench[..., 3:] - np.cross(centre_of_pressure(wrench), wrench[..., :3]))[..., 1]


def with_turned_free_moments(loads: FootLoads) -> FootLoads:
    """Return the loads with the sign of the free moment about the vertical at each centre of pressure reversed."""
    carried = loads.force[..., 1] >= LOAD_THRESHOLD_N
    moment = loads.moment.copy()
    moment[..., 1] -= np.where(carried, 2.0 * free_moment(loads.wrench), 0.0)
    return replace(loads, moment=moment)


def held_centre_of_pressure(wrench: np.ndarray, least_n: float = LOAD_THRESHOLD_N) -> np.ndarray:
    """Return the centre of pressure (k, 3) m of one foot's load (k, 6); below `least_n` the nearest sample's above it.

    For a foot that is never loaded it is the origin.
    """
    firm = np.flatnonzero(wrench[:, 1] >= least_n)
    if not len(firm):
        return np.zeros((len(wrench), 3))
    nearest = firm[np.searchsorted((firm[1:] + firm[:-1]) / 2, np.arange(len(wrench)))]
    return centre_of_pressure(wrench[nearest])
