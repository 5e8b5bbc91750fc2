"""Terms of the markers in a trial's normal equations, for errors that are alike from frame to frame.

The errors of a marker coordinate are a first-order autoregressive process: e[t] = a e[t-1] + white noise, with the same
deviation in every frame. The inverse of its covariance, the information, is tridiagonal in time: a
frame sees itself and its two neighbours, so the normal matrix stays banded. A gap starts the process anew.

Slow skin motion (a near one) counts for few independent frames where the motion is slow, and hardly disturbs what is
fast: accelerations, which the forces answer to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.model.skeleton import Pose, Skeleton
from kinertia.motion.inverse_kinematics import gram, marker_forces, twist_blocks

FRAMES_AT_ONCE = 100
"""Larger arrays would leave the processor's cache."""


@dataclass(frozen=True)
class MarkerTerms:
    """J^T W J and the like: J is the derivative of the markers by the coordinates, S that by what does not move (static
    coordinates, then marker positions), r = measured - model, and W the information of the errors.

    Attributes:
        per_frame: (n, c, c) of J^T W J, each frame with itself.
        to_next: (n - 1, c, c) of J^T W J, each frame (rows) with the one after it (columns).
        across: (n, c, k) J^T W S.
        gradient: (n, c) J^T W r.
        static: (k, k) S^T W S.
        static_gradient: (k,) S^T W r.
        square: r^T W r.
    """

    per_frame: np.ndarray
    to_next: np.ndarray
    across: np.ndarray
    gradient: np.ndarray
    static: np.ndarray
    static_gradient: np.ndarray
    square: float


@dataclass(frozen=True)
class ErrorInformation:
    """Inverse covariance of the errors of m markers over n frames; the three axes are alike and independent.

    Attributes:
        own: (n, m) of each frame with itself, 1 / m^2; zero where the marker is not seen.
        next: (n - 1, m) of each frame with the one after it.
    """

    own: np.ndarray
    next: np.ndarray

    @classmethod
    def of(cls, seen: np.ndarray, sd_m: np.ndarray, autocorrelation: float) -> ErrorInformation:
        """Of markers seen (n, m), with deviations sd_m (m,) and this correlation between neighbouring frames."""
        both = seen[:-1] & seen[1:]
        a = autocorrelation
        own = seen.astype(float)
        own[1:] += a**2 / (1.0 - a**2) * both
        own[:-1] += a**2 / (1.0 - a**2) * both
        weight = 1.0 / np.square(sd_m)
        return cls(own * weight, -a / (1.0 - a**2) * both * weight)

    def __matmul__(self, values: np.ndarray) -> np.ndarray:
        """(n, m, ...) the information times values (n, m, ...), along time."""
        own, following = (part.reshape(*part.shape, *(1,) * (values.ndim - 2)) for part in (self.own, self.next))
        result: np.ndarray = own * values
        result[:-1] += following * values[1:]
        result[1:] += following * values[:-1]
        return result


def marker_terms(
    skeleton: Skeleton,
    measured: np.ndarray,
    q: np.ndarray,
    deviation: tuple[np.ndarray, float],
    moving: np.ndarray,
    still: np.ndarray,
) -> MarkerTerms:
    """The terms of one trial at the coordinates q.

    Args:
        skeleton: with static coordinates free.
        measured: (n, m, 3) m; NaN where not seen.
        q: (n, c) rad and m.
        deviation: (m,) of each marker's errors, m, and their correlation between neighbouring frames.
        moving, still: columns of q that move in time, and that do not.
    """
    (n, m), c, k = measured.shape[:2], len(moving), len(still)
    pose = skeleton.pose(q)
    positions = skeleton.marker_positions(pose)
    error = measured - positions
    seen = np.isfinite(error).all(axis=-1)
    information = ErrorInformation.of(seen, *deviation)
    error = np.where(seen[..., None], error, 0.0)
    pull = information @ error
    gradient = marker_forces(skeleton, pose, positions, pull)
    turned = pose.rotation[:, skeleton.marker_segments]
    weighted = information @ turned
    per_frame, to_next = np.empty((n, c, c)), np.empty((n - 1, c, c))
    across, by_still = np.empty((n, c, k + 3 * m)), np.zeros((n, q.shape[1], k))
    static = np.zeros((k + 3 * m, k + 3 * m))
    for start in range(0, n, FRAMES_AT_ONCE):
        here, before, after = _stretch(start, n)
        now = pose.cut(here)
        blocks = twist_blocks(skeleton, positions[here], positions[here], information.own[here])
        whole = gram(skeleton, now, blocks)
        per_frame[here] = whole[:, moving[:, None], moving]
        by_still[here] += whole[:, :, still]
        by_place = _by_places(skeleton, now, positions[here], weighted[here])
        across[here, :, k:] = by_place[:, moving]
        static[:k, k:] += by_place[:, still].sum(axis=0)
        blocks = twist_blocks(skeleton, positions[before], positions[after], information.next[before])
        following = gram(skeleton, pose.cut(before), blocks, pose.cut(after))
        to_next[before] = following[:, moving[:, None], moving]
        by_still[before] += following[:, :, still]
        by_still[after] += following[:, still].transpose(0, 2, 1)
    across[:, :, :k] = by_still[:, moving]
    static[:k, :k] = by_still[:, still].sum(axis=0)
    static[k:, :k] = static[:k, k:].T
    each = np.arange(k, k + 3 * m).reshape(m, 3)
    static[each[:, :, None], each[:, None]] = np.einsum("nmij,nmik->mjk", turned, weighted)
    by_place = np.einsum("nmij,nmi->mj", turned, pull)
    return MarkerTerms(
        per_frame,
        to_next,
        across,
        gradient[:, moving],
        static,
        np.concatenate([gradient[:, still].sum(axis=0), by_place.ravel()]),
        float((error * pull).sum()),
    )


def _stretch(start: int, n: int) -> tuple[slice, slice, slice]:
    """The frames of one stretch, those of them that have one after them, and the ones after these."""
    end = min(start + FRAMES_AT_ONCE, n)
    last = min(end, n - 1)
    return slice(start, end), slice(start, last), slice(start + 1, last + 1)


def _by_places(skeleton: Skeleton, pose: Pose, positions: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n, c, 3 m) generalised forces of the columns of directions (n, m, 3, 3) at each marker's place (n, m, 3)."""
    n, m = positions.shape[:2]
    wrench = np.concatenate([directions, np.cross(positions[..., None], directions, axis=2)], axis=2)
    forces = pose.axes @ wrench.transpose(0, 2, 1, 3).reshape(n, 6, 3 * m)
    forces *= np.repeat(skeleton.support[skeleton.marker_segments].T, 3, axis=1)
    return skeleton.map.to_coordinates(forces.transpose(0, 2, 1), pose.slopes).transpose(0, 2, 1)
