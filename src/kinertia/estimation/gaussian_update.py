"""Updates a Gaussian by a linear measurement."""

from __future__ import annotations

import numpy as np


def updated(
    mean: np.ndarray, covariance: np.ndarray, seen: np.ndarray, values: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n,) and covariance (n, n) once `values` (m,) = `seen` (m, n) x, with errors of covariance `noise` (m, m).

    >>> mean, covariance = updated(np.zeros(1), np.eye(1), np.eye(1), np.ones(1), np.eye(1))
    >>> float(mean[0]), float(covariance[0, 0])
    (0.5, 0.5)
    """
    across = seen @ covariance
    gain = np.linalg.solve(across @ seen.T + noise, across).T
    left = covariance - gain @ across
    return mean + gain @ (values - seen @ mean), 0.5 * (left + left.T)
