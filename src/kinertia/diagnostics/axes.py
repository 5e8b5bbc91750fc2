"""Names an axis twice: as the person moves, and as the laboratory's files have it."""

from dataclasses import dataclass
from typing import Self, TypedDict

import numpy as np

from kinertia.io.lab_plates import ground_rotation
from kinertia.trial.marker_quality import Travel

_FORE_AFT, _MEDIOLATERAL = "fore-aft", "mediolateral"


class AxisNames(TypedDict):
    """Names of a ground axis, as keyword arguments of `Where`."""

    axis: str
    file_axis: str


@dataclass(frozen=True)
class Axes:
    """Names of the ground axes X, Y (up) and Z of a recording.

    Attributes:
        vertical: the file's axis that is up, "+Z".
        fore_aft: ground axis along which the person moves or faces, 0 or 2.

    >>> Axes("+Z", 0).named(2)
    {'axis': 'mediolateral', 'file_axis': '-Y'}
    """

    vertical: str = "+Y"
    fore_aft: int = 0

    @classmethod
    def of(cls, vertical: str, moves: Travel) -> Self:
        """Name the axes of a recording: fore-aft is X unless the person walks along Z."""
        along_z = moves.kind == "walks" and abs(np.sin(np.radians(moves.direction_deg))) > np.sqrt(0.5)
        return cls(vertical, 2 if along_z else 0)

    def named(self, ground_axis: int) -> AxisNames:
        """Return the anatomical direction of ground axis 0, 1 or 2, and the signed axis of the file that it is."""
        across = _FORE_AFT if ground_axis == self.fore_aft else _MEDIOLATERAL
        direction = "vertical" if ground_axis == 1 else across
        row = ground_rotation(self.vertical)[ground_axis]
        index = int(np.argmax(np.abs(row)))
        return {"axis": direction, "file_axis": f"{'-' if row[index] < 0 else ''}{'XYZ'[index]}"}
