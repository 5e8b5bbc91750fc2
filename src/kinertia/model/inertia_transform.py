"""Transforms the ten dynamic parameters of a body to another frame."""

import numpy as np

from kinertia.model.bsp import inertia_of, second_moments


def transformed_parameters(places: np.ndarray) -> np.ndarray:
    """Return linear maps (s, 10, 10) of dynamic parameters from frames to the one in which they are given (`places`).

    The pseudo-inertia of a body moves as J' = T J T^T (Wensing, Kim and Slotine 2018); the parameters are linear in J.

    Args:
        places: (s, 4, 4) homogeneous transforms T.
    """
    transform = places[:, None]
    moved = transform @ _PSEUDO @ transform.transpose(0, 1, 3, 2)
    return _from_pseudo(moved).transpose(0, 2, 1)


def _unit_pseudo() -> np.ndarray:
    """Return pseudo-inertias (10, 4, 4) of unit dynamic parameters (mass, first moments, xx xy yy xz yz zz)."""
    pseudo = np.zeros((10, 4, 4))
    pseudo[0, 3, 3] = 1.0
    for axis in range(3):
        pseudo[1 + axis, axis, 3] = pseudo[1 + axis, 3, axis] = 1.0
    for k, (i, j) in enumerate(_INERTIA, start=4):
        inertia = np.zeros((3, 3))
        inertia[i, j] = inertia[j, i] = 1.0
        pseudo[k, :3, :3] = second_moments(inertia)
    return pseudo


def _from_pseudo(pseudo: np.ndarray) -> np.ndarray:
    """Return dynamic parameters (..., 10) of pseudo-inertias (..., 4, 4)."""
    inertia = inertia_of(pseudo[..., :3, :3])
    rows, columns = zip(*_INERTIA, strict=True)
    return np.concatenate([pseudo[..., 3, 3:], pseudo[..., :3, 3], inertia[..., rows, columns]], axis=-1)


_INERTIA = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
"""Order of the moments of inertia among the dynamic parameters."""
_PSEUDO = _unit_pseudo()
