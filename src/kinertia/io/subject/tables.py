"""Defines the tables of a subject file (`reader`), validates entries, and writes its text with descriptions."""

import datetime
import json
import os
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path, PureWindowsPath
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from kinertia.errors import missing_file
from kinertia.findings.finding import Severity, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.findings.rule import all_rules, matching, rule
from kinertia.io.file_names import path_from
from kinertia.io.marker_set_file import preset_names
from kinertia.io.text.toml_lines import quoted
from kinertia.settings import (
    Attached,
    Instruments,
    KnownSegment,
    Overrule,
    PriorSettings,
    Settings,
    Subject,
    Table,
    folder_of,
)
from kinertia.trial.file_contents import StatedContact
from kinertia.trial.trial_input import Task, TrialUse


class CodedError(ValueError):
    """Error of a value that has a code of its own."""

    def __init__(self, code: str, **evidence: Quantity) -> None:
        self.found = with_evidence(code, Where(), evidence, Severity.ERROR)
        super().__init__(self.found.message)


def _file(value: object, info: ValidationInfo, expected: str = "a file") -> Path:
    """Return an existing file as an absolute path, relative to the subject file's folder (the context) if relative."""
    if not isinstance(value, str | Path):
        raise ValueError("must be a path in quotes")
    path = path_from(folder_of(info), str(value)).resolve()
    if os.path.isfile(path):  # false where the system allows no such name
        return path
    if os.path.isdir(path):
        what = Quantity(f"be read, and {path} is one")
        raise CodedError("F102", given=Quantity("A folder"), what=what, expected=Quantity(expected))
    raise CodedError("F101", **missing_file(path, str(value), expected))


def _marker_set(value: object, info: ValidationInfo) -> str | Path:
    if value in preset_names():
        return str(value)
    return _file(value, info, f"a marker set's TOML file or one of the presets {', '.join(preset_names())}")


def _trial_name(value: object) -> str:
    """Check that a name can be a folder's: the results of several trials go to one folder each."""
    if isinstance(value, str) and value.strip(" .") and not set(value) & set("/\\\0"):
        return value
    problem = Quantity("it must be a valid folder name: not empty, and without / and \\")
    raise CodedError("F192", name=Quantity(shown(value)), problem=problem)


def _window(value: object) -> tuple[float, float]:
    match value:
        case [int() | float() as start, int() | float() as end] if start < end:
            return float(start), float(end)
    raise ValueError("must be [start, end] in seconds, the start before the end")


def _belt_speed(value: object, info: ValidationInfo) -> float | tuple[float, float] | Path:
    match value:
        case str() | Path():
            return _file(value, info)
        case {"right": right, "left": left, **others} if not others:
            return _one_belt_speed(right), _one_belt_speed(left)
        case (right, left):  # as it is once read
            return _one_belt_speed(right), _one_belt_speed(left)
    return _one_belt_speed(value)


def _one_belt_speed(value: object) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 < value <= 15:
        return float(value)
    raise ValueError("must be a belt's speed in m/s (up to 15), of two belts {right=1.2, left=0.6}, or a file")


def _stated_contacts(value: object) -> tuple[StatedContact, ...]:
    if not isinstance(value, list | tuple) or not value:
        raise ValueError(_CONTACT)
    return tuple(contact if isinstance(contact, StatedContact) else _stated_contact(contact) for contact in value)


def _stated_contact(value: object) -> StatedContact:
    match value:
        case {"plate": str(plate), "foot": "right" | "left" | "none" as foot, **others}:
            span = _window(others.pop("window_s", (-np.inf, np.inf)))
            if not others:
                return StatedContact(plate, {"right": 0, "left": 1}.get(foot), span)
    raise ValueError(_CONTACT)


_CONTACT = 'must be like [{plate="plate 1",foot="right",window_s=[0.4,1.1]}]; foot "right", "left" or "none"'
File = Annotated[Path, BeforeValidator(_file)]
MarkerSetName = Annotated[str | Path, BeforeValidator(_marker_set)]
TrialName = Annotated[str, BeforeValidator(_trial_name)]
Window = Annotated[tuple[float, float], BeforeValidator(_window)]
StatedContacts = Annotated[tuple[StatedContact, ...], BeforeValidator(_stated_contacts)]
LengthUnit = Literal["mm", "cm", "m"]
BeltSpeed = Annotated[float | tuple[float, float] | Path, BeforeValidator(_belt_speed)]


def shown(value: object) -> str:
    """Format a value nearly as TOML does."""
    return json.dumps(value, default=str, ensure_ascii=False)


def _codes(value: object) -> tuple[str, ...]:
    if not isinstance(value, list | tuple) or not all(isinstance(code, str) for code in value):
        raise ValueError('must be a list of codes, questions or families in quotes, like ["M102", "R40"]')
    for code in value:
        if not matching(code):
            written = code[:1].upper() + code[1:].upper().replace("O", "0")
            near = get_close_matches(written, all_rules(), n=3, cutoff=0.5)
            hint = f"the nearest are {', '.join(near)}" if near else "see kinertia explain"
            raise ValueError(f"'{code}' is not a code, question or family; {hint}")
    return tuple(value)


def _waivable(value: object) -> tuple[str, ...]:
    codes = _codes(value)
    if hard := [code for code in codes if code in all_rules() and rule(code).hard]:
        raise ValueError(f"'{hard[0]}' cannot be waived, since nothing can be computed with it")
    return codes


class Diagnostics(Table):
    """Findings that are overruled for a study, for one person or for one trial.

    Examples:
        >>> from kinertia.io.subject.tables import Diagnostics
        >>> Diagnostics(waive=["P244"], ignore=["M102", "R40"]).overrule
        Overrule(waive=('P244',), ignore=('M102', 'R40'), reasons=())
    """

    ignore: Annotated[tuple[str, ...], BeforeValidator(_codes)] = Field(
        default=(),
        description='findings below ERROR that are hidden and do not lower the verdict, like ["M102", "R40"]',
    )
    waive: Annotated[tuple[str, ...], BeforeValidator(_waivable)] = Field(
        default=(), description='ERRORs that do not stop an estimate and are shown as waived, like ["P244"]'
    )
    reasons: dict[str, str] = Field(default={}, description='why, by code: `{ P244 = "plates were moved" }`')

    @property
    def overrule(self) -> Overrule:
        """The codes to waive and to ignore, in the form that findings take."""
        return Overrule(self.waive, self.ignore, tuple(self.reasons.items()))

    def __add__(self, other: "Diagnostics") -> "Diagnostics":
        ignore, waive = (*self.ignore, *other.ignore), (*self.waive, *other.waive)
        return Diagnostics(ignore=ignore, waive=waive, reasons=self.reasons | other.reasons)


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


def trial_name(table: Mapping[str, Any]) -> Any:
    """Return the name of a `[[trial]]`: as stated, or that of its file of markers without the ending."""
    markers = table.get("markers")
    # Windows' kind of path knows both separators
    default = PureWindowsPath(markers).stem if isinstance(markers, str | Path) else "trial"
    return table.get("name", default)


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
    leave_out: tuple[str, ...] = Field(
        default=(), strict=False, description='markers that are not used in this trial: `["LTHI"]`'
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
        return {"name": trial_name(data), **data}


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
        elif isinstance(value, list) and value and all(isinstance(entry, Mapping) for entry in value):
            for entry in value:
                lines += ["", f"[[{_key(name)}]]", *_entries(TABLES.get(name), entry)]
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
            return "{ " + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + " }"
        case list() | tuple():
            return "[" + ", ".join(map(_value, value)) + "]"
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case str():
            return quoted(value)
    return str(value)  # a date or time
