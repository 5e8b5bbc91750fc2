"""Parameterises inertial parameters so that they are always physically consistent.

There are ten free numbers per segment, any real values: log m; the CoM c; and the lower triangular L of the second
moments about the CoM, Sigma = L L^T with logarithms on its diagonal. Mass is then positive and Sigma positive definite,
which is equivalent to physical consistency of the pseudo-inertia. It is the log-Cholesky form of Rucker and Wensing
(2022, IEEE RA-L 7:2735) taken about the CoM instead of the origin: mass, CoM and inertia then stay separate, as in the
anthropometric prior.
"""

import numpy as np

from kinertia.model.bsp import BodySegmentParameters, dynamic_by_table, inertia_of, second_moments

_ROWS, _COLUMNS = np.array([0, 1, 2, 1, 2, 2]), np.array([0, 1, 2, 0, 0, 1])
_ROUNDING = 1e-9
"""Share of a segment's largest second moment below which the smallest counts as not positive."""


def to_log_cholesky(bsp: BodySegmentParameters) -> np.ndarray:
    """Convert physically consistent body segment parameters to (10 s,) free parameters.

    Raises:
        numpy.linalg.LinAlgError: a segment is not physically consistent.
    """
    lower = np.linalg.cholesky(second_moments(bsp.inertia_kgm2))
    entries = lower[:, _ROWS, _COLUMNS]
    entries[:, :3] = np.log(entries[:, :3])
    return np.hstack([np.log(bsp.mass_kg)[:, None], bsp.com_m, entries]).ravel()


def from_log_cholesky(segments: tuple[str, ...], theta: np.ndarray) -> BodySegmentParameters:
    """Convert (10 s,) free parameters to body segment parameters."""
    rows = theta.reshape(-1, 10)
    lower = _lower(rows)
    return BodySegmentParameters(
        segments, np.exp(rows[:, 0]), rows[:, 1:4], inertia_of(lower @ lower.transpose(0, 2, 1))
    )


def table_jacobian(theta: np.ndarray) -> np.ndarray:
    """Return the derivative (s, 10, 10) of each segment's table row by its own ten free parameters.

    A row is mass, CoM, ixx, iyy, izz, ixy, ixz, iyz.
    """
    rows = theta.reshape(-1, 10)
    lower = _lower(rows)
    jacobian = np.zeros((len(rows), 10, 10))
    jacobian[:, 0, 0] = np.exp(rows[:, 0])
    jacobian[:, [1, 2, 3], [1, 2, 3]] = 1.0
    change = np.zeros((6, *lower.shape))
    for entry, (i, j) in enumerate(zip(_ROWS, _COLUMNS, strict=True)):
        change[entry, :, i, j] = lower[:, i, j] if i == j else 1.0
    product = change @ lower.transpose(0, 2, 1)
    inertia = inertia_of(product + product.transpose(0, 1, 3, 2))
    jacobian[:, 4:, 4:] = inertia[..., [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].transpose(1, 2, 0)
    return jacobian


def dynamic_jacobian(theta: np.ndarray) -> np.ndarray:
    """Return the derivative (s, 10, 10) of each segment's dynamic parameters, in their usual order, by its own ten."""
    rows = theta.reshape(-1, 10)
    result: np.ndarray = dynamic_by_table(np.exp(rows[:, 0]), rows[:, 1:4]) @ table_jacobian(theta)
    return result


def nearest_consistent(bsp: BodySegmentParameters, floor: float = 0.05) -> BodySegmentParameters:
    """Return the parameters with physically consistent second moments about the CoM.

    Second moments of an inconsistent segment are raised to at least this share of its largest; consistent segments are
    unchanged.
    """
    values, vectors = np.linalg.eigh(second_moments(bsp.inertia_kgm2))
    largest = values[:, -1:]
    values = np.where(values[:, :1] > _ROUNDING * largest, values, np.maximum(values, floor * largest))
    raised = (vectors * values[:, None, :]) @ vectors.transpose(0, 2, 1)
    return BodySegmentParameters(bsp.segments, bsp.mass_kg, bsp.com_m, inertia_of(raised))


def _lower(rows: np.ndarray) -> np.ndarray:
    lower = np.zeros((len(rows), 3, 3))
    lower[:, _ROWS, _COLUMNS] = np.hstack([np.exp(rows[:, 4:7]), rows[:, 7:]])
    return lower
