"""Names the plates of a trial when it is one of several.

Plates of C3D files are the laboratory's, and have the same names in all trials. Columns of force files may be feet
rather than plates: those of each trial are plates of their own, until somebody says that they are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from kinertia.trial.data import Recording


def plate_of_trial(column: str, trial: str) -> str:
    """The name of a column of the force file of this trial."""
    return f"{column} ({trial})"


def with_plates_of_trial(recording: Recording) -> Recording:
    """The same with plates that are called as those of this trial alone, in its findings, too."""
    findings = tuple(
        replace(one, where=replace(one.where, plate=plate_of_trial(one.where.plate, recording.name)))
        if one.where.plate is not None
        else one
        for one in recording.findings
    )
    plates = recording.plates
    if plates is not None:
        plates = replace(plates, names=tuple(plate_of_trial(name, recording.name) for name in plates.names))
    return replace(recording, plates=plates, findings=findings)


def columns_of_several_trials(plates: Sequence[str]) -> tuple[tuple[int, ...], ...]:
    """Which of these plates are columns of the same name, of different trials.

    >>> columns_of_several_trials(["right (walk)", "left (walk)", "right (walk (2))", "plate 3"])
    ((0, 2),)
    """
    columns: dict[str, list[int]] = {}
    for place, plate in enumerate(plates):
        if column := _column(plate):
            columns.setdefault(column, []).append(place)
    return tuple(tuple(places) for places in columns.values() if len(places) > 1)


def _column(plate: str) -> str:
    """What `plate_of_trial` was given; empty if it was not asked. Columns and trials may have brackets, too."""
    unopened = 0
    for place in range(len(plate) - 1, 0, -1):
        unopened += (plate[place] == ")") - (plate[place] == "(")
        if unopened == 0:
            return plate[: place - 1] if plate[place - 1 : place + 1] == " (" else ""
    return ""
