"""Random block tridiagonal matrices."""

import numpy as np


def random_system(blocks: int, size: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Dense positive definite block tridiagonal matrix, its diagonal blocks and the blocks below them."""
    rng = np.random.default_rng(seed)
    lower = np.zeros((blocks * size, blocks * size))
    for i in range(blocks):
        rows = slice(i * size, (i + 1) * size)
        lower[rows, rows] = np.tril(rng.normal(size=(size, size))) + 3.0 * np.eye(size)
        if i:
            lower[rows, (i - 1) * size : i * size] = rng.normal(size=(size, size))
    dense = lower @ lower.T
    tiles = dense.reshape(blocks, size, blocks, size)
    diagonal = np.stack([tiles[i, :, i] for i in range(blocks)])
    below = np.stack([tiles[i + 1, :, i] for i in range(blocks - 1)]) if blocks > 1 else np.empty((0, size, size))
    return dense, diagonal, below
