"""Errors of markers that are alike from frame to frame: their information, banded in time.

The errors of a marker coordinate are a second-order autoregressive process with a double pole,

    e[t] = 2 r e[t-1] - r^2 e[t-2] + white noise,

with the same deviation in every frame. The inverse of its covariance, the information, is banded: a frame sees itself
and the two on either side, so the normal matrix stays banded, too. A gap starts the process anew.

What skin does is slow. A first-order process that is as strong and as long has the same information on what is slow,
but a spectrum that falls by the square of the frequency only: errors of markers would shake the accelerations, and
with them joint moments, by more than they do. This one falls by the fourth power.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LATER = 2
"""How many frames after it a frame meets in the information."""


@dataclass(frozen=True)
class ErrorInformation:
    """Inverse covariance of the errors of m markers over n frames; the three axes are alike and independent.

    Attributes:
        own: (n, m) of each frame with itself, 1 / m^2; zero where the marker is not seen.
        next: (n - 1, m) of each frame with the one after it.
        second: (n - 2, m) of each frame with the second after it.
    """

    own: np.ndarray
    next: np.ndarray
    second: np.ndarray

    @classmethod
    def of(cls, seen: np.ndarray, sd_m: np.ndarray, frames: float) -> ErrorInformation:
        """Of markers seen (n, m), with deviations sd_m (m,), alike over so many neighbouring frames (`double_pole`)."""
        r = double_pole(frames)
        one, two = 2.0 * r, -r * r
        n, m = seen.shape
        own, after, second = np.zeros((n, m)), np.zeros((max(n - 1, 0), m)), np.zeros((max(n - 2, 0), m))
        # of a process of unit variance: white noise's, and the correlation of neighbours
        noise, alike = (1.0 - r * r) ** 3 / (1.0 + r * r), one / (1.0 - two)
        three = (seen[2:] & seen[1:-1] & seen[:-2]) / noise
        own[2:] += three
        own[1:-1] += one * one * three
        own[:-2] += two * two * three
        after[1:] -= one * three
        after[:-1] += one * two * three
        second -= two * three
        before = np.vstack([np.zeros((1, m), dtype=bool), seen[:-1]])
        # the first two after a gap
        pair = (seen[1:] & seen[:-1] & ~before[:-1]) / (1.0 - alike * alike)
        own[:-1] += pair
        own[1:] += pair
        after -= alike * pair
        own += seen & ~before & ~np.vstack([seen[1:], np.zeros((1, m), dtype=bool)])
        weight = 1.0 / np.square(sd_m)
        return cls(own * weight, after * weight, second * weight)


def double_pole(frames: float) -> float:
    """r of the process whose errors are alike over so many neighbouring frames, the sum of its correlations over all
    lags: (1 + r)^3 / ((1 + r^2) (1 - r)).

    >>> round(double_pole(1.0), 6), round(double_pole(9.0), 3)
    (0.0, 0.571)
    """
    if frames <= 1.0:
        return 0.0
    roots = np.roots([1.0 + frames, 3.0 - frames, 3.0 + frames, 1.0 - frames])
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(real[(real >= 0.0) & (real < 1.0)][0])
