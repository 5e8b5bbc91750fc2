"""What an axis is called: as the person moves, and as the laboratory's files have it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from kinertia.io.lab_axes import ground_rotation
from kinertia.trial.data import Markers
from kinertia.trial.marker_quality import travel

_FORE_AFT, _MEDIOLATERAL = "fore-aft", "mediolateral"


class AxisNames(TypedDict):
    """Arguments of `Where`."""

    axis: str
    file_axis: str


@dataclass(frozen=True)
class Axes:
    """Names of the ground axes X, Y (up) and Z of a recording.

    Attributes:
        vertical: the file's axis that is up, "+Z".
        fore_aft: ground axis along which the person moves or faces, 0 or 2.
        turned_deg: by which the recording was turned about the vertical after reading.

    >>> Axes("+Z", 0).named(2)
    {'axis': 'mediolateral', 'file_axis': '-Y'}
    """

    vertical: str = "+Y"
    fore_aft: int = 0
    turned_deg: float = 0.0

    @classmethod
    def of(cls, vertical: str, markers: Markers) -> Axes:
        """Of a recording as read: along X unless the person walks along Z."""
        moves = travel(markers)
        along_z = moves.kind == "walks" and abs(np.sin(np.radians(moves.direction_deg))) > np.sqrt(0.5)
        return cls(vertical, 2 if along_z else 0)

    def named(self, ground_axis: int) -> AxisNames:
        """Of ground axis 0, 1 or 2: direction of the person's walk, and signed axis of the file."""
        across = _FORE_AFT if ground_axis == self.fore_aft else _MEDIOLATERAL
        direction = "vertical" if ground_axis == 1 else across
        angle = np.radians(self.turned_deg)
        turn = np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]])
        row = (turn @ ground_rotation(self.vertical))[ground_axis]
        index = int(np.argmax(np.abs(row)))
        return {"axis": direction, "file_axis": f"{'-' if row[index] < 0 else ''}{'XYZ'[index]}"}
