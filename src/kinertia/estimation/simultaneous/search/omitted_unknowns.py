"""Adds the variance of unknowns that are left out of the vector, because they only displace others."""

import numpy as np


def with_left_out(
    directions: np.ndarray, data: np.ndarray, pull: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the effect of u more unknowns of unit standard deviation that displace the others, as seen by the data.

    It returns (S,) how far the estimate moves back to the prior, and (S, u) a root of what is added to its covariance.

    Args:
        directions: (S, u) displacements of the unknowns.
        data: (S, u) information of the data on the unknowns, times these.
        pull: (u,) of the data along them, at the estimate without these unknowns.
        covariance: (S, S) without them.

    >>> one = np.ones((1, 1))
    >>> moved, root = with_left_out(one, 99.0 * one, np.array([1.98]), 0.01 * one)  # 1.98 +- 0.1, prior 0 +- 1
    >>> moved.round(2), (root @ root.T).round(2)
    (array([-0.99]), array([[0.49]]))
    """
    carried = covariance @ data
    left, along = np.linalg.eigh(np.eye(len(pull)) + directions.T @ data - data.T @ carried)
    # never below the prior's; rounding makes it so where other priors are next to exact
    root = carried @ (along / np.sqrt(np.maximum(left, 1.0)))
    return -root @ (along.T @ pull / np.sqrt(np.maximum(left, 1.0))), root
