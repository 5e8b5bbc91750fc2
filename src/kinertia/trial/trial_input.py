"""Holds a recording of a motion, its window and use, with plate names that are unique among trials.

Plates of C3D files are the laboratory's and have the same names in all trials. Columns of force files may stand for
feet rather than plates: each trial's columns count as plates of their own, until the user states that they are the
same.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from kinertia.trial.data import PlateLoads, Recording

TrialUse = Literal["all", "kinematics"]
Task = Literal["walk", "turn", "run", "landing", "squat", "other"]
"""What a person does in a trial; results of different tasks are not averaged."""
GAIT: tuple[Task, ...] = ("walk", "turn", "run")
"""Tasks that consist of strides."""
WITHOUT_STRIDES: tuple[Task, ...] = ("landing", "squat")
"""Tasks in which no strides are looked for."""


@dataclass(frozen=True)
class TrialInput:
    """A recording and, if the user gives one, the window (s) to use instead of the detected one.

    Attributes:
        recording: as read.
        window_s: first and last time; None: as detected.
        read_seconds: time that reading it took.
        task: what the person does; None: as found.
        condition: under which the trial was recorded, as the laboratory names it; trials of two can be compared.
        use: "all", or "kinematics" to use its markers alone, for joint centres, joint axes and marker positions.

    Examples:
        >>> walk = kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot")
        >>> kinertia.TrialInput(walk, window_s=(0.5, 1.0)).window_s
        (0.5, 1.0)
    """

    recording: Recording
    window_s: tuple[float, float] | None = None
    read_seconds: float = 0.0
    use: TrialUse = "all"
    task: Task | None = None
    condition: str = ""


def plate_of_trial(column: str, trial: str) -> str:
    """Return the name of a force file's column, made unique by the name of its trial."""
    return f"{column} ({trial})"


def selected(plates: PlateLoads, names: Sequence[str]) -> PlateLoads:
    """Return the plates of these names alone, in the order of the recording."""
    kept = [p for p, name in enumerate(plates.names) if name in names]

    def of_kept(values: Sequence[Any] | None) -> Any:
        return None if values is None else tuple(values[p] for p in kept)

    torques = plates.torques and [
        torque._replace(belongs_to=kept.index(torque.belongs_to) if torque.belongs_to in kept else None)
        for torque in plates.torques
    ]
    return PlateLoads(
        plates.time,
        of_kept(plates.names),
        plates.force[:, kept],
        plates.moment[:, kept],
        of_kept(plates.declared_feet),
        None if plates.corners is None else plates.corners[kept],
        of_kept(plates.noise_n),
        of_kept(plates.unloaded),
        of_kept(plates.spikes),
        None if torques is None else tuple(torques[p] for p in kept),
    )


def with_plates_of_trial(recording: Recording) -> Recording:
    """Return the recording with plate names made unique to this trial, also in its findings."""
    findings = tuple(
        replace(reported, where=replace(reported.where, plate=plate_of_trial(reported.where.plate, recording.name)))
        if reported.where.plate is not None
        else reported
        for reported in recording.findings
    )
    plates = recording.plates
    if plates is not None:
        plates = replace(plates, names=tuple(plate_of_trial(name, recording.name) for name in plates.names))
    stated = tuple(
        contact._replace(plate=plate_of_trial(contact.plate, recording.name)) for contact in recording.stated_contacts
    )
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
