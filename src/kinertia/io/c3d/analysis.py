"""Writes measures of strides into the group ANALYSIS of a C3D file, where Vicon's programs have them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kinertia.io.c3d.parameters import ParameterSection, Value

_GROUP = "ANALYSIS"
_OURS = "Kinertia"
_MOST = 255


class Measure(NamedTuple):
    """One value: side ("Left", "Right"), and name and unit as Vicon has them: "Walking Speed", "m/s"."""

    context: str
    name: str
    unit: str
    value: float


def add_analysis(section: ParameterSection, measures: Sequence[Measure], subject: str) -> None:
    """Write the measures into a file that states none of its own; those of an earlier export are replaced.

    Args:
        section: parameters of the file.
        measures: at most 255.
        subject: name of the person; empty where the file has no names.
    """
    names, described = (section.get(_GROUP, name) for name in ("NAMES", "DESCRIPTIONS"))
    stated = 0 if names is None else len(names)
    if not measures or len(measures) > _MOST or (stated and list(described or ()) != [_OURS] * stated):
        return
    lists: dict[str, Value] = {
        "USED": np.array([len(measures)], dtype=np.int16),
        "NAMES": [one.name for one in measures],
        "DESCRIPTIONS": [_OURS] * len(measures),
        "SUBJECTS": [subject] * len(measures),
        "CONTEXTS": [one.context for one in measures],
        "UNITS": [one.unit for one in measures],
        "VALUES": np.array([one.value for one in measures], dtype=np.float32),
    }
    for name, value in lists.items():
        section.put(_GROUP, name, value)
