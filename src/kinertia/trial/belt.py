"""Describes the belt of a treadmill whose speed is stated.

Where it is not stated, one speed for the whole trial is measured from the feet in stance. That is as good for a belt of
constant speed, and wrong for a belt that starts, stops or follows the person.
"""

from dataclasses import dataclass

import numpy as np

_NO_WAY_M_S = 0.05


@dataclass(frozen=True, eq=False)
class Belt:
    """Speed of a treadmill belt over time; for a belt of constant speed a single time is enough.

    Attributes:
        time: (k,) s, on the time base of the markers.
        speed_m_s: (k,); with two belts (k, 2), under the right and the left foot.

    Examples:
        >>> belt = Belt(np.array([0.0, 2.0]), np.array([1.0, 2.0]))
        >>> belt.velocity(np.array([1.0]), np.array([-0.9, 0.0, 0.0])).tolist()
        [[-1.5, 0.0, 0.0]]
        >>> belt.distance_m(0.0, 2.0)
        3.0
        >>> Belt(np.zeros(1), np.array([[1.4, 0.7]])).under(1).distance_m(0.0, 2.0)
        1.4
    """

    time: np.ndarray
    speed_m_s: np.ndarray

    def under(self, foot: int) -> "Belt":
        """Return the belt under the right (0) or the left foot (1)."""
        return self if self.speed_m_s.ndim == 1 else Belt(self.time, self.speed_m_s[:, foot])

    def velocity(self, time: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return the belt velocity (n, 3) m/s at these times, along the displacement (3,) m of feet in stance.

        It is zero if the feet do not move.
        """
        length = float(np.linalg.norm(along))
        direction = along / length if length > _NO_WAY_M_S else np.zeros(3)
        return np.asarray(np.interp(time, self.time, self.speed_m_s)[:, None] * direction)

    def distance_m(self, start_s: float, end_s: float) -> float:
        """Return the distance (m) that the belt covers between two times (s)."""
        between = self.time[(self.time > start_s) & (self.time < end_s)]
        at = np.array([start_s, *between, end_s])
        return float(np.trapezoid(np.interp(at, self.time, self.speed_m_s), at))
