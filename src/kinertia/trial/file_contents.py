"""Defines what is stated besides markers and forces: events, outputs of other software, the speed of a belt.

Where it is not stated, one speed for the whole trial is measured from the feet in stance. That is as good for a belt of
constant speed, and wrong for a belt that starts, stops or follows the person.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple, Self

import numpy as np
import numpy.typing as npt

EventKind = Literal["heel strike", "toe off"]
SAME_EVENT_S = 0.15
"""Events of a file and of the forces that are farther apart belong to different steps."""
FloatArray = npt.NDArray[np.float64]
_NO_WAY_M_S = 0.05


class GaitEvent(NamedTuple):
    """A foot strike ("heel strike") or foot off ("toe off") at a time (s)."""

    time_s: float
    side: str
    kind: EventKind


def nearest_event(events: Iterable[GaitEvent], to: GaitEvent, within_s: float) -> GaitEvent | None:
    """Return the event of the same foot and kind that is nearest in time, or None if none is within `within_s`."""
    alike = [event for event in events if event[1:] == to[1:] and abs(event.time_s - to.time_s) <= within_s]
    return min(alike, key=lambda event: abs(event.time_s - to.time_s), default=None)


@dataclass(frozen=True)
class FileEvent:
    """An event stated in a file.

    Attributes:
        time_s: on the time base of the markers.
        side: "r" or "l"; empty for a general event.
        label: as in the file: "Foot Strike", "Foot Off", the name of a general event.
        subject: the participant's name; empty where the file has none.
        kind: what the foot does; None for a general event.

    Examples:
        >>> from kinertia.trial.file_contents import FileEvent
        >>> FileEvent(1.63, "l", "Foot Strike", "", "heel strike").of_gait
        GaitEvent(time_s=1.63, side='l', kind='heel strike')
    """

    time_s: float
    side: str
    label: str
    subject: str
    kind: EventKind | None

    @property
    def of_gait(self) -> GaitEvent | None:
        """The event as a `GaitEvent`; None for a general one."""
        return None if self.kind is None or not self.side else GaitEvent(self.time_s, self.side, self.kind)


class StatedContact(NamedTuple):
    """Statement of the user whose foot a load is.

    Attributes:
        plate: name of the plate.
        foot: 0 right, 1 left; None: no foot of this person's, so that the load is not used.
        span_s: first and last time (s).
    """

    plate: str
    foot: int | None
    span_s: tuple[float, float] = (-np.inf, np.inf)


@dataclass(frozen=True, eq=False)
class FileOutputs:
    """Model outputs of the legs, with the names and axes of Plug-in Gait.

    Attributes:
        time: (f,) s, all frames of the file.
        values: "LHipAngles" -> (f, 3) deg, "LHipMoment" -> N m, "LHipPower" -> W, the last two per kg or not, as the
            file has them; NaN where they are missing.
        points: joint centres and ends of axes of Vicon's segments, "LFEO" -> (f, 3) m in ground axes, NaN likewise.
    """

    time: FloatArray
    values: Mapping[str, FloatArray]
    points: Mapping[str, FloatArray] = field(default_factory=dict)

    def rotated(self, rotation: FloatArray) -> Self:
        """Return the same outputs with points in axes rotated by `rotation` (3, 3): new = rotation @ old."""
        return replace(self, points={name: point @ rotation.T for name, point in self.points.items()})


class TorqueColumns(NamedTuple):
    """Content of the torque columns of one plate in its file, while the plate was loaded.

    Attributes:
        lever_arm_m: median of the horizontal torque over the vertical force, m; NaN where the point of application does
            not move, or the plate was hardly loaded.
        rms_nm: RMS torque about X, Y and Z, N m.
        belongs_to: index of the other plate whose load the torque follows; None if there is none.
        height_m: median height of the point of application, m; NaN where the plate was hardly loaded.
    """

    lever_arm_m: float
    rms_nm: tuple[float, float, float]
    belongs_to: int | None
    height_m: float = np.nan


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
