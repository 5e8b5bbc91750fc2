"""Computes moments of a plate's force about the laboratory's origin.

Files do not state the reference point of their moments: the middle of the plate, of its surface, or the origin. But the
force has no horizontal moment about the centre of pressure. So the point c is the one for which

    M - (p - c) x F

has none, by least squares over the loaded samples; the rest is the free moment.
"""

from typing import NamedTuple, Self

import numpy as np

from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray

MOMENTS_FIT = 0.05
"""Moments agree with the centre of pressure if they miss it by no more than this share (RMS)."""
_FEWEST = 10


class PlateMoments(NamedTuple):
    """Moments of one plate about the laboratory's origin.

    Attributes:
        about_origin: (k, 3) N m; without a free moment where moments and centre of pressure contradict each other.
        mismatch: share of the horizontal moments by which they do; infinite while the plate is unloaded.
    """

    about_origin: FloatArray
    mismatch: float

    @property
    def agree(self) -> bool:
        """Whether moments and centre of pressure agree."""
        return self.mismatch <= MOMENTS_FIT

    @classmethod
    def of(cls, force: FloatArray, moment: FloatArray, point: FloatArray) -> Self:
        """Compute from force (k, 3) N, moment (k, 3) N m about an unknown point, and centre of pressure (k, 3) m."""
        at = np.cross(np.nan_to_num(point), force)
        with np.errstate(over="ignore"):
            known = np.isfinite(np.square(np.hstack([point, force, moment, at]))).all(axis=1)
        loaded = known & (np.abs(force[:, 2]) > LOAD_THRESHOLD_N)
        if loaded.sum() < _FEWEST:
            return cls(at, float("inf"))
        rest, f = moment[loaded] - at[loaded], force[loaded]
        zero = np.zeros(len(f))
        # rows of -c x F, horizontal axes
        rows = -np.concatenate(
            [np.stack([zero, f[:, 2], -f[:, 1]], axis=1), np.stack([-f[:, 2], zero, f[:, 0]], axis=1)]
        )
        centre = np.linalg.lstsq(rows, rest[:, :2].T.ravel(), rcond=None)[0]
        left = moment - at + np.cross(centre, force)
        size = moment[loaded, :2] - moment[loaded, :2].mean(axis=0)
        mismatch = float(np.sqrt(np.square(left[loaded, :2]).sum() / max(np.square(size).sum(), 1e-12)))
        if mismatch <= MOMENTS_FIT:
            at[:, 2] += left[:, 2]
        return cls(at, mismatch)
