"""Means over neighbouring samples, weighed or not; beyond either end the last sample goes on."""

from __future__ import annotations

import numpy as np

_REACH_SD = 4.0
"""How far a Gaussian is followed."""


def gaussian_mean(values: np.ndarray, samples: float) -> np.ndarray:
    """Values (n, ...) averaged with Gaussian weights of so many samples' deviation."""
    reach = int(_REACH_SD * samples + 0.5)
    weights = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / samples))
    return _averaged(values, weights / weights.sum())


def moving_mean(values: np.ndarray, samples: int) -> np.ndarray:
    """Values (n, ...) averaged over an odd number of samples."""
    return _averaged(values, np.full(samples, 1.0 / samples))


def _averaged(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    if not values.size:
        return values
    reach = len(weights) // 2
    columns = np.pad(values.reshape(len(values), -1), ((reach, reach), (0, 0)), mode="edge").T
    result = np.stack([np.convolve(column, weights, mode="valid") for column in columns], axis=1)
    return result.reshape(values.shape)
