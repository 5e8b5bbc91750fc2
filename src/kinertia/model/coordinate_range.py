"""`Range`: between which values a coordinate moves.

A body has one pose but coordinates have several values for it: three angles turn a segment as three others do (a half
turn more of the first and the last), and an arm that is turned by half a turn with the elbow bent backwards fits its
markers nearly as well. Ranges tell which is meant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Range:
    """Smallest and largest value (rad or m) of a coordinate.

    Attributes:
        low, high: the ends.
        clamped: inverse kinematics stays within; else it may go beyond where the markers say so.

    Examples:
        >>> from kinertia.model.coordinate_range import Range
        >>> Range(-0.1, 2.6, clamped=True).middle
        1.25
    """

    low: float
    high: float
    clamped: bool

    @property
    def middle(self) -> float:
        """Halfway between the ends."""
        return (self.low + self.high) / 2


@dataclass(frozen=True)
class Bounds:
    """The ranges of c coordinates as arrays; infinite where there is none.

    Attributes:
        low, high: (c,) ends of all ranges.
        least, most: (c,) ends of the clamped ones.
    """

    low: np.ndarray
    high: np.ndarray
    least: np.ndarray
    most: np.ndarray

    @classmethod
    def of(cls, coordinates: Sequence[str], ranges: Mapping[str, Range]) -> Bounds:
        """Of these coordinates, in this order."""
        free = Range(-np.inf, np.inf, clamped=False)
        known = [ranges.get(name, free) for name in coordinates]
        clamped = [one if one.clamped else free for one in known]
        ends = [[getattr(one, end) for one in some] for some in (known, clamped) for end in ("low", "high")]
        return cls(*(np.array(end, dtype=float) for end in ends))

    def beyond(self, q: np.ndarray) -> np.ndarray:
        """How far coordinates (n, c) lie beyond their ranges, with the sign of the side; NaN where unknown."""
        result: np.ndarray = q - np.clip(q, self.low, self.high)
        return result

    def clamped(self, q: np.ndarray) -> np.ndarray:
        """The nearest coordinates (n, c) that the clamped ranges allow."""
        result: np.ndarray = np.clip(q, self.least, self.most)
        return result

    def held(self, q: np.ndarray, pull: np.ndarray) -> np.ndarray:
        """(n, c) True at an end of a clamped range, with a pull (n, c) outwards."""
        result: np.ndarray = ((q <= self.least) & (pull < 0)) | ((q >= self.most) & (pull > 0))
        return result
