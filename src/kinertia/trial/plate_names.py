"""Selects plates by name, and makes plate names unique to a trial when there are several trials.

Plates of C3D files are the laboratory's and have the same names in all trials. Columns of force files may stand for
feet rather than plates: each trial's columns count as plates of their own, until the user states that they are the
same.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from kinertia.trial.data import PlateLoads, Recording


def plate_of_trial(column: str, trial: str) -> str:
    """Return the name of a force file's column, made unique by the name of its trial."""
    return f"{column} ({trial})"


def selected(plates: PlateLoads, names: Sequence[str]) -> PlateLoads:
    """Return the plates of these names alone, in the order of the recording."""
    kept = [p for p, name in enumerate(plates.names) if name in names]

    def own(values: Sequence[Any] | None) -> Any:
        return None if values is None else tuple(values[p] for p in kept)

    torques = plates.torques and [
        one._replace(belongs_to=kept.index(one.belongs_to) if one.belongs_to in kept else None)
        for one in plates.torques
    ]
    return PlateLoads(
        plates.time,
        own(plates.names),
        plates.force[:, kept],
        plates.moment[:, kept],
        own(plates.declared_feet),
        None if plates.corners is None else plates.corners[kept],
        own(plates.noise_n),
        own(plates.unloaded),
        own(plates.spikes),
        None if torques is None else tuple(torques[p] for p in kept),
    )


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
    stated = tuple(one._replace(plate=plate_of_trial(one.plate, recording.name)) for one in recording.stated_contacts)
    return replace(recording, plates=plates, findings=findings, stated_contacts=stated)


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
