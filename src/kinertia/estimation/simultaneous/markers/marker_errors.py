"""Computes the information of marker errors that are correlated over time, as a matrix banded in time.

The errors of a marker coordinate are a second-order autoregressive process with the poles r and s,

    e[t] = (r + s) e[t-1] - r s e[t-2] + white noise,

with the same standard deviation in every frame. The inverse of its covariance, the information, is banded: a frame is
coupled to itself and the two on either side, so the normal matrix stays banded, too. The process starts again after a
gap.

Skin motion is slow. With s = 0, a first-order process, the spectrum falls only with the square of the frequency: marker
errors would affect the accelerations, and with them joint moments, more than they do. With s = r it falls with the
fourth power. But every frame has camera noise, and for long-lasting errors, as in a slow movement or a posture, such a
spectrum would fall below it: the estimate would follow the noise. So s is as close to r as the observed innovation of
the errors allows, the part of a frame's error that the two previous frames do not predict.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

LATER = 2
"""Number of later frames to which a frame is coupled in the information."""


_STEPS = 32
"""Number of processes tried between a double pole and white noise."""


class ErrorProcess(NamedTuple):
    """Poles of the process, the larger first; white noise has none.

    >>> process = ErrorProcess.double_over(9.0)
    >>> round(process.larger, 3), process.larger == process.smaller, round(process.frames, 6)
    (0.571, True, 9.0)
    """

    larger: float = 0.0
    smaller: float = 0.0

    @classmethod
    def double_over(cls, frames: float) -> Self:
        """Return the process with a double pole that is correlated over so many neighbouring frames.

        The number of frames is the sum of its correlations over all lags: (1 + r)^3 / ((1 + r^2) (1 - r)).
        """
        if frames <= 1.0:
            return cls()
        roots = np.roots([1.0 + frames, 3.0 - frames, 3.0 + frames, 1.0 - frames])
        real = roots[np.abs(roots.imag) < 1e-9].real
        r = float(real[(real >= 0.0) & (real < 1.0)][0])
        return cls(r, r)

    @classmethod
    def with_smaller(cls, smaller: float, frames: float) -> Self:
        """Return the process with this smaller pole s that is correlated over so many neighbouring frames.

        The number of frames is (1 - r s) (1 + r) (1 + s) / ((1 + r s) (1 - r) (1 - s)).
        """
        more = frames * (1.0 - smaller) / (1.0 + smaller)
        half = (1.0 - smaller) * (1.0 + more)
        larger = 2.0 * (more - 1.0) / (half + np.sqrt(half**2 + 4.0 * smaller * (more - 1.0) ** 2))
        return cls(float(larger), smaller)

    @property
    def of_before(self) -> tuple[float, float]:
        """Coefficients of a frame's error on those of the frame before it and of the second before it."""
        return self.larger + self.smaller, -self.larger * self.smaller

    @property
    def new(self) -> float:
        """Innovation variance of a process of unit variance: what the two frames before do not predict."""
        one, two = self.of_before
        return (1.0 + two) * ((1.0 - two) ** 2 - one**2) / (1.0 - two)

    @property
    def frames(self) -> float:
        """Number of neighbouring frames over which its errors are correlated."""
        one, two = self.of_before
        return self.new / (1.0 - one - two) ** 2

    @classmethod
    def read(cls, frames: float, products: np.ndarray) -> tuple[Self, float]:
        """Fit the slowest process with as much innovation per frame as the errors have; return it with its variance.

        The errors have unit variance and are correlated over so many frames. If even a first-order process has too
        little innovation, a shorter one is used with proportionally larger variance: the information on what does not
        vary stays equal.

        Args:
            frames: number of frames over which the errors are correlated.
            products: (k, 3, 3) mean products of the errors of a frame and of the two before it, for several kinds of
                errors; the largest innovation counts.
        """
        double = cls.double_over(frames)
        slow = [cls.with_smaller(float(s), frames) for s in np.linspace(double.smaller, 0.0, _STEPS)[1:]]
        short = [cls.with_smaller(0.0, float(f)) for f in np.geomspace(max(frames, 1.0), 1.0, _STEPS)[1:]]
        for process in (double, *slow, *short):
            variance = frames / process.frames
            beyond = np.array([1.0, *(-each for each in process.of_before)])
            if np.max(beyond @ products @ beyond) <= variance * process.new:
                break
        return process, max(variance, 1.0)


@dataclass(frozen=True)
class ErrorInformation:
    """Inverse covariance of the errors of m markers over n frames; the three axes are independent and alike.

    Attributes:
        own: (n, m) of each frame with itself, 1 / m^2; zero where the marker is not seen.
        next: (n - 1, m) of each frame with the one after it.
        second: (n - 2, m) of each frame with the second after it.
    """

    own: np.ndarray
    next: np.ndarray
    second: np.ndarray

    @classmethod
    def of(cls, seen: np.ndarray, sd_m: np.ndarray, process: ErrorProcess) -> Self:
        """Compute the information for markers seen (n, m), with standard deviations sd_m (m,)."""
        one, two = process.of_before
        n, m = seen.shape
        own, after, second = np.zeros((n, m)), np.zeros((max(n - 1, 0), m)), np.zeros((max(n - 2, 0), m))
        three = (seen[2:] & seen[1:-1] & seen[:-2]) / process.new
        # correlation of neighbours
        alike = one / (1.0 - two)
        own[2:] += three
        own[1:-1] += one * one * three
        own[:-2] += two * two * three
        after[1:] -= one * three
        after[:-1] += one * two * three
        second -= two * three
        before = np.vstack([np.zeros((1, m), dtype=bool), seen[:-1]])
        # the first two frames after a gap
        pair = (seen[1:] & seen[:-1] & ~before[:-1]) / (1.0 - alike * alike)
        own[:-1] += pair
        own[1:] += pair
        after -= alike * pair
        own += seen & ~before & ~np.vstack([seen[1:], np.zeros((1, m), dtype=bool)])
        weight = 1.0 / np.square(sd_m)
        return cls(own * weight, after * weight, second * weight)
