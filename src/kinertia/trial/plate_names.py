"""Makes plate names unique to a trial when there are several trials.

Plates of C3D files are the laboratory's and have the same names in all trials. Columns of force files may stand for
feet rather than plates: each trial's columns count as plates of their own, until the user states that they are the
same.
"""

from collections.abc import Sequence
from dataclasses import replace

from kinertia.trial.data import Recording


def plate_of_trial(column: str, trial: str) -> str:
    """Return the name of a force file's column, made unique by the name of its trial."""
    return f"{column} ({trial})"


def with_plates_of_trial(recording: Recording) -> Recording:
    """Return the recording with plate names made unique to this trial, also in its findings."""
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
    """Group the plates that are columns of the same name in different trials.

    >>> columns_of_several_trials(["right (walk)", "left (walk)", "right (walk (2))", "plate 3"])
    ((0, 2),)
    """
    columns: dict[str, list[int]] = {}
    for place, plate in enumerate(plates):
        if column := _column(plate):
            columns.setdefault(column, []).append(place)
    return tuple(tuple(places) for places in columns.values() if len(places) > 1)


def _column(plate: str) -> str:
    """Return the column that `plate_of_trial` was given; empty if the name is not its output.

    Columns and trials may contain brackets, too.
    """
    unopened = 0
    for place in range(len(plate) - 1, 0, -1):
        unopened += (plate[place] == ")") - (plate[place] == "(")
        if unopened == 0:
            return plate[: place - 1] if plate[place - 1 : place + 1] == " (" else ""
    return ""
