"""What the plates of a trial are called when it is one of several.

Plates of C3D files are the laboratory's, and have the same names in all trials. Columns of force files may be feet
rather than plates: those of each trial are plates of their own, until somebody says that they are the same.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

_OF_TRIAL = re.compile(r"(?P<column>.+) \((?P<trial>[^()]+)\)$")


def plate_of_trial(column: str, trial: str) -> str:
    """The name of a column of the force file of this trial."""
    return f"{column} ({trial})"


def columns_of_several_trials(plates: Sequence[str]) -> tuple[tuple[int, ...], ...]:
    """Which of these plates are columns of the same name, of different trials.

    >>> columns_of_several_trials(["right (walk 1)", "left (walk 1)", "right (walk 2)", "plate 3"])
    ((0, 2),)
    """
    columns: dict[str, list[int]] = {}
    for place, plate in enumerate(plates):
        if named := _OF_TRIAL.match(plate):
            columns.setdefault(named["column"], []).append(place)
    return tuple(tuple(places) for places in columns.values() if len(places) > 1)
