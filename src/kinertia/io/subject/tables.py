"""Defines the tables of a subject file (`reader`), and writes its text, each entry with its description."""

import datetime
from collections.abc import Mapping
from pathlib import Path, PureWindowsPath
from typing import Any

from pydantic import Field, model_validator

from kinertia.io.subject.values import BeltSpeed, File, LengthUnit, MarkerSetName, StatedContacts, TrialName, Window
from kinertia.io.text.toml_lines import quoted
from kinertia.settings import Attached, Diagnostics, Instruments, KnownSegment, PriorSettings, Settings, Subject, Table
from kinertia.trial.trial_input import Task, TrialUse


class Model(Table):
    """What the skeleton is built from: a static trial, or an OpenSim model.

    `markers` is a preset's name, an absolute path, or None for automatic detection.
    """

    static: File | None = Field(default=None, description="static trial, .c3d, .trc, .tsv or .csv")
    window_s: Window | None = Field(
        default=None, description="[start, end] of the static trial, s, while the person stands; left out: all of it"
    )
    length_unit: LengthUnit | None = Field(
        default=None, description="unit of a static C3D file that states none, or a wrong one: mm, cm or m"
    )
    markers: MarkerSetName | None = Field(default=None, description="preset or TOML file; left out: detected")
    osim: File | None = Field(default=None, description="scaled OpenSim model, .osim, in place of a static trial")
    calibrate: bool = Field(default=False, description="OpenSim model only; true: markers and joint centres may move")


class TrialFiles(Table):
    """Files of one dynamic trial; `window_s` (start, end) overrides the measured window, s."""

    name: TrialName = Field(description="name in files and report; left out: the marker file's")
    markers: File = Field(description="markers, .c3d, .trc, .tsv or .csv")
    forces: File | None = Field(
        default=None, description="plate forces, .mot, .sto or .forces; C3D, .tsv and .csv have their own"
    )
    loads: File | None = Field(default=None, description="ExternalLoads .xml: meaning of the force columns")
    length_unit: LengthUnit | None = Field(
        default=None, description="unit of a C3D file that states none, or a wrong one: mm, cm or m"
    )
    window_s: Window | None = Field(default=None, description="[start, end], s; left out: measured part")
    feet: StatedContacts = Field(
        default=(),
        strict=False,
        description='whose foot is on a plate, where the nearest is wrong: `[{ plate = "plate 1", foot = "right", '
        'window_s = [0.4, 1.1] }]`; foot "right", "left" or "none", window_s may be left out',
    )
    use: TrialUse = Field(
        default="all",
        description='"kinematics": only its markers are used, for joint centres, joint axes and marker positions',
    )
    task: Task | None = Field(
        default=None,
        description='"walk", "turn", "run", "landing", "squat" or "other"; left out: found; curves of different tasks '
        "are not averaged",
    )
    condition: str = Field(
        default="",
        description='as "before", "with orthosis": `kinertia compare --conditions` compares trials of two conditions',
    )
    belt_speed_m_s: BeltSpeed | None = Field(
        default=None,
        description="of a treadmill: m/s, of two belts `{ right = 1.2, left = 0.6 }`, or a file with it over time; "
        "left out: by standing feet",
    )
    diagnostics: Diagnostics = Field(default=Diagnostics(), description="findings that are overruled in this trial")

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        markers = data.get("markers")
        # Windows' kind of path knows both separators
        return {"name": PureWindowsPath(markers).stem if isinstance(markers, str | Path) else "trial", **data}


class InstrumentsFiles(Instruments):
    """Statements of the laboratory about its instruments, and the file of its session."""

    session: File | None = Field(default=None, description="file of kinertia instruments for the same session")
    plates: tuple[str, ...] | None = Field(
        default=None, strict=False, description='plates that are used: `["plate 1", "plate 2"]`; left out: all'
    )
    date: datetime.date | None = Field(
        default=None, description="day of the recording, 2026-05-03; left out: as stated in the recordings"
    )


class PriorFiles(PriorSettings):
    """Settings of the prior, and the file of an earlier estimate."""

    bsp: File | None = Field(
        default=None, description="bsp.csv of an earlier fit: its estimates and sd in place of the literature's"
    )
    population: File | None = Field(
        default=None, description="file of kinertia population for the person's group, in place of the literature"
    )
    measures: File | None = Field(
        default=None, description="girths and lengths of the person: the sheet of kinertia init --measures, filled in"
    )


class SubjectFile(Table):
    """A validated subject file, made by `read_subject`: names are filled in, paths absolute, files exist.

    Examples:
        >>> wanted = kinertia.read_subject("lab/subject.toml")  # the files of `kinertia demo`
        >>> [trial.name for trial in wanted.trials]
        ['walk']
    """

    subject: Subject
    model: Model
    trials: tuple[TrialFiles, ...] = Field(alias="trial", strict=False, min_length=1)
    settings: Settings = Settings()
    instruments: InstrumentsFiles = InstrumentsFiles()
    prior: PriorFiles = PriorFiles()
    segments: dict[str, KnownSegment] = Field(default={}, alias="segment")
    attached: tuple[Attached, ...] = Field(default=(), strict=False)
    diagnostics: Diagnostics = Diagnostics()


class StudyFile(Table):
    """Settings for all subject files in the study file's folder and in those below."""

    diagnostics: Diagnostics = Diagnostics()


TABLES: dict[str, type[Table]] = dict(
    subject=Subject,
    model=Model,
    trial=TrialFiles,
    settings=Settings,
    instruments=InstrumentsFiles,
    prior=PriorFiles,
    segment=KnownSegment,
    attached=Attached,
    diagnostics=Diagnostics,
)
"""Tables of a subject file, by name."""


def subject_text(content: Mapping[str, Any], heading: str) -> str:
    """Write a subject file (TOML) with these entries; unknown ones are written unchanged, for `read_subject` to report.

    Args:
        content: tables by their names, as `tomllib` reads them.
        heading: first line, a comment.
    """
    lines = [f"# {heading}"]
    for name in sorted(content, key=lambda name: [*TABLES, name].index(name)):
        value = content[name]
        if name == "segment" and isinstance(value, Mapping):
            for segment, entries in value.items():
                lines += ["", f"[segment.{_key(segment)}]", *_entries(KnownSegment, entries)]
        elif isinstance(value, Mapping):
            lines += ["", f"[{_key(name)}]", *_entries(TABLES.get(name), value)]
        elif isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
            for one in value:
                lines += ["", f"[[{_key(name)}]]", *_entries(TABLES.get(name), one)]
        else:  # tables come after all plain entries
            lines.insert(1, f"{_key(name)} = {_value(value)}")
    return "\n".join([*lines, ""])


def entry_line(table: type[Table] | None, key: str, value: object, note: str = "") -> str:
    """Write the line `key = value  # description`."""
    field = None if table is None else table.model_fields.get(key)
    about = f"  # {field.description}{note}" if field is not None else ""
    return f"{_key(key)} = {_value(value)}{about}"


def _entries(table: type[Table] | None, entries: Any) -> list[str]:
    if not isinstance(entries, Mapping):
        return []
    return [entry_line(table, key, value) for key, value in entries.items()]


def _key(key: str) -> str:
    bare = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if bare else quoted(key)


def _value(value: object) -> str:
    match value:
        case Mapping():
            return "{ " + ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items()) + " }"
        case list() | tuple():
            return "[" + ", ".join(map(_value, value)) + "]"
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case str():
            return quoted(value)
    return str(value)  # a date or time
