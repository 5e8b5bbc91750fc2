"""The subject file: one TOML text that says who walked, which files hold the trials, and how to estimate.

    [subject]
    sex = "female"                 # "male" or "female"
    mass_kg = 61.5                 # may be left out where a C3D file carries it; so may height_m
    height_m = 1.68

    [model]
    static = "static.c3d"          # paths are relative to this file
    markers = "plug-in-gait"       # a preset or a TOML file of your own; left out: found from the labels
    # or, in place of both: osim = "scaled.osim"; with calibrate = true its markers and joint centres may move

    [[trial]]                      # as many as there are
    markers = "walk1.trc"          # a C3D file needs no `forces`
    forces = "walk1_grf.mot"
    loads = "walk1_grf.xml"        # ExternalLoads: which column of `forces` is what
    window_s = [0.4, 1.9]          # left out: where every foot on the ground is measured
    belt_speed_m_s = 1.25          # of a treadmill; or "speed.csv": time_s,speed_m_s; left out: by the standing feet

    [settings]                     # every one has a default, see `kinertia.settings.Settings`
    cutoff_hz = 6.0

    [instruments]                  # what the laboratory knows of plates and clock; all may be left out
    plate_sd_mm = 2.0              # from a spot check of the centre of pressure
    session = "instruments.toml"   # what `kinertia instruments` wrote

    [segment.thigh_r]              # what was measured of a segment; as many as there are
    mass_kg = "8.9 +- 0.4"
    source = "DXA"

    [[attached]]                   # what is not body and moves with a segment; as many as there are
    name = "rucksack"
    segment = "torso"
    mass_kg = "unknown"            # or 10.0, or "10 +- 0.5"
    on_scale = false               # whether the person was weighed with it
    com_mm = [-200, 300, 0]

    [prior]
    bsp = "spring/bsp.csv"         # an earlier estimate in place of the literature's

`read_subject` checks it whole and names the line of what is wrong; `kinertia.io.subject_draft` drafts one.
"""

from __future__ import annotations

import datetime
import difflib
import json
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path, PureWindowsPath
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from kinertia.errors import FileError, SettingsError, SubjectError
from kinertia.io.file_names import path_from, path_trouble, trouble_as_folders
from kinertia.io.marker_set_file import preset_names
from kinertia.io.toml_lines import Location, read_toml
from kinertia.model.anthropometry import check_subject
from kinertia.settings import (
    Attached,
    Instruments,
    KnownSegment,
    PriorSettings,
    Settings,
    Subject,
    Table,
    folder_of,
    number_of,
)


def _file(value: object, info: ValidationInfo) -> Path:
    """An existing file, absolute; a relative one counts from the subject file's folder (the context)."""
    if not isinstance(value, str | Path):
        raise ValueError("must be a path in quotes")
    path = path_from(folder_of(info), str(value)).resolve()
    if os.path.isfile(path):  # false where the system allows no such name
        return path
    if os.path.isdir(path):
        raise ValueError(f"{path} is a folder; give a file")
    if trouble := path_trouble(str(value)):
        raise ValueError(trouble)
    names = sorted(entry.name for entry in path.parent.iterdir()) if os.path.isdir(path.parent) else []
    near = difflib.get_close_matches(path.name, names, n=1)
    raise ValueError(f"no such file in {path.parent}" + (f"; did you mean '{near[0]}'?" if near else ""))


def _marker_set(value: object, info: ValidationInfo) -> str | Path:
    if value in preset_names():
        return str(value)
    try:
        return _file(value, info)
    except ValueError as error:
        presets = ", ".join(f"'{name}'" for name in preset_names())
        raise ValueError(f"{error}; give a marker set's TOML file or one of the presets {presets}") from None


def _trial_name(value: object) -> str:
    """A name that can be a folder's: the results of several trials go to one folder each."""
    if isinstance(value, str) and value.strip(" .") and not set(value) & set("/\\\0"):
        return value
    raise ValueError("must be a name that a folder can have: not empty, and without / and \\")


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
    raise ValueError(
        "must be the speed of a treadmill's belt in m/s (up to 15), of two belts { right = 1.2, left = 0.6 }, or a "
        "file with it over time"
    )


File = Annotated[Path, BeforeValidator(_file)]
MarkerSetName = Annotated[str | Path, BeforeValidator(_marker_set)]
TrialName = Annotated[str, BeforeValidator(_trial_name)]
Window = Annotated[tuple[float, float], BeforeValidator(_window)]
LengthUnit = Literal["mm", "cm", "m"]
BeltSpeed = Annotated[float | tuple[float, float] | Path, BeforeValidator(_belt_speed)]


class Model(Table):
    """What the skeleton is built from: a static trial, or an OpenSim model.

    `markers` is a preset's name, an absolute path, or None: detect it.
    """

    static: File | None = Field(default=None, description="static trial, .c3d, .trc, .tsv or .csv")
    length_unit: LengthUnit | None = Field(
        default=None, description="of a static C3D file that says none, or a wrong one: mm, cm or m"
    )
    markers: MarkerSetName | None = Field(default=None, description="preset or TOML file; left out: detected")
    osim: File | None = Field(default=None, description="scaled OpenSim model, .osim, in place of a static trial")
    calibrate: bool = Field(default=False, description="OpenSim model only; true: markers and joint centres may move")


class TrialFiles(Table):
    """Files of one dynamic trial; `window_s` (start, end) overrides the measured window, s."""

    name: TrialName = Field(description="name in files and report; left out: the marker file's")
    markers: File = Field(description="markers, .c3d, .trc, .tsv or .csv")
    forces: File | None = Field(
        default=None, description="plate forces, .mot or .sto; C3D, .tsv and .csv have their own"
    )
    loads: File | None = Field(default=None, description="ExternalLoads .xml: what the columns are")
    length_unit: LengthUnit | None = Field(
        default=None, description="of a C3D file that says none, or a wrong one: mm, cm or m"
    )
    window_s: Window | None = Field(default=None, description="[start, end], s; left out: measured part")
    belt_speed_m_s: BeltSpeed | None = Field(
        default=None,
        description="of a treadmill: m/s, of two belts `{ right = 1.2, left = 0.6 }`, or a file with it over time; "
        "left out: by standing feet",
    )

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        markers = data.get("markers")
        # Windows' kind of path knows both separators
        return {"name": PureWindowsPath(markers).stem if isinstance(markers, str | Path) else "trial", **data}


class InstrumentsFiles(Instruments):
    """What the laboratory states of its instruments, and the file of its session."""

    session: File | None = Field(default=None, description="what kinertia instruments wrote of the same session")
    date: datetime.date | None = Field(
        default=None, description="day of the recording, 2026-05-03; left out: as the recordings say, if they do"
    )


class PriorFiles(PriorSettings):
    """What the estimate starts from, and the file of an earlier one."""

    bsp: File | None = Field(
        default=None, description="bsp.csv of an earlier fit: its estimates and sd in place of the literature's"
    )
    population: File | None = Field(
        default=None, description="what kinertia population learnt of the person's group, in place of the literature's"
    )
    measures: File | None = Field(
        default=None, description="girths and lengths of the person: the sheet of kinertia init --measures, filled in"
    )


class SubjectFile(Table):
    """A validated subject file: `read_subject` makes it. Names are filled in, paths absolute, files exist.

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


def subject_file_in(folder: Path) -> Path:
    """The subject file of a folder: `subject.toml`, or the only .toml file there; hidden files are none.

    Raises:
        FileError: there is none, or several of which none is called subject.toml.
    """
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() == ".toml" and path.name[0] != ".")
    named = [path for path in paths if path.name.lower() == "subject.toml"] or paths
    if len(named) == 1:
        return named[0]
    if not named:
        raise FileError(folder, f"holds no subject file; draft one with: kinertia init {folder}")
    listed = ", ".join(path.name for path in named)
    raise FileError(folder, f"holds several .toml files ({listed}) and none is subject.toml; name the one you mean")


def read_subject(path: str | Path) -> SubjectFile:
    """Read and check a subject file.

    Raises:
        FileError: the file is missing, not TOML, or says something that cannot be (unknown key, missing or
            wrong value, no such trial file, several trials whose names cannot be folders side by side, implausible
            mass); with the line.
    """
    path = Path(path).resolve()
    document = read_toml(path, "a subject file (subject.toml)")
    try:
        result = SubjectFile.model_validate(document.content, context={"folder": path.parent})
    except ValidationError as error:
        # a trial with an error in it does not count, so that pydantic also finds too few trials
        errors = [one for one in error.errors() if one["type"] != "too_short" or not one["input"]]
        # a key that is not known explains one that is missing
        errors = [one for one in errors if one["type"] == "extra_forbidden"] or errors
        line, sentence = min((document.line(one["loc"]) or document.last_line, _sentence(one)) for one in errors)
        raise FileError(path, sentence, line) from None
    if lack := _incomplete(result):
        place, sentence = lack
        raise FileError(path, sentence, document.line(place) or document.last_line)
    subject = result.subject
    mass_kg = 70.0 if subject.mass_kg is None else subject.mass_kg  # left open: any plausible value
    height_m = 1.7 if subject.height_m is None else subject.height_m
    try:
        check_subject(mass_kg, height_m, subject.sex or "male")
    except SubjectError as error:
        raise FileError(path, str(error), document.line(("subject", error.field))) from error
    if trouble := trouble_as_folders([trial.name for trial in result.trials]):
        index, problem = trouble
        advice = 'give this trial a name = "..." of its own'
        raise FileError(path, f"{problem}; {advice}", document.line(("trial", index, "name")))
    return result


def subject_from_options(content: Mapping[str, Any]) -> SubjectFile:
    """The same from a dictionary of the subject file's form, as the command line makes it; paths from here.

    Raises:
        SettingsError: something is missing, wrong or not there; the message names the entry.
    """
    try:
        result = SubjectFile.model_validate(content, context={"folder": Path.cwd()})
    except ValidationError as error:
        raise SettingsError(_sentence(error.errors()[0])) from None
    if problem := _incomplete(result):
        raise SettingsError(problem[1])
    return result


def _incomplete(wanted: SubjectFile) -> tuple[Location, str] | None:
    """Where and what the entries lack, or have too much of, for the kind of model."""
    model = wanted.model
    for table, key, value in (("model", "static", model.static), ("subject", "sex", wanted.subject.sex)):
        if value is None and model.osim is None:
            return (table, key), _sentence({"loc": (table, key), "type": "missing"})
    if model.osim is not None:
        for key, given in (("static", model.static), ("markers", model.markers)):
            if given is not None:
                return ("model", key), f"[model] has both osim and {key}; the OpenSim model says it all, remove {key}"
        if wanted.settings.method == "two-level":
            problem = 'method = "two-level" works on the built-in model only; remove it, or give a static trial'
            return ("settings", "method"), problem
    elif model.calibrate:
        return ("model", "calibrate"), "[model] calibrate goes with osim; the built-in model is always calibrated"
    return None


def with_settings(wanted: SubjectFile, **values: Any) -> SubjectFile:
    """The same with other settings.

    Raises:
        SettingsError: a value cannot be.
    """
    try:
        settings = Settings.model_validate({**wanted.settings.model_dump(), **values})
    except ValidationError as error:
        detail = error.errors()[0]
        raise SettingsError(_sentence({**detail, "loc": ("settings", *detail["loc"])})) from None
    changed = wanted.model_copy(update={"settings": settings})
    if problem := _incomplete(changed):
        raise SettingsError(problem[1])
    return changed


TABLES: dict[str, type[Table]] = dict(
    subject=Subject,
    model=Model,
    trial=TrialFiles,
    settings=Settings,
    instruments=InstrumentsFiles,
    prior=PriorFiles,
    segment=KnownSegment,
    attached=Attached,
)
"""Of a subject file, by their names there."""


def _sentence(detail: Any) -> str:
    """One sentence for the user from one of pydantic's errors."""
    *holder, key = detail["loc"]
    table, kind = str(holder[0] if holder else key), detail["type"]
    inside = ".".join(part for part in holder if isinstance(part, str))
    if kind == "extra_forbidden":
        known = list(TABLES[table].model_fields) if holder else list(TABLES)
        near = difflib.get_close_matches(str(key), known, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"
        return f"unknown key '{key}'{f' in [{inside}]' if holder else ''}; {hint}"
    if table == "segment" and len(detail["loc"]) < 3:
        return "every segment is a table of its own under a heading like [segment.thigh_r]"
    if table == "trial" and (not holder or isinstance(key, int)) and kind != "missing":
        return "every trial is a table of its own under the heading [[trial]], in double brackets"
    if table == "attached" and (not holder or isinstance(key, int)) and kind != "missing":
        return "everything attached is a table of its own under the heading [[attached]], in double brackets"
    if not holder:
        heading = f"[[{table}]]" if table in ("trial", "attached") else f"[{table}]"
        return f"there is no heading {heading} with its entries below; add it"
    if kind == "missing":
        heading = f"[[{table}]]" if table == "attached" else f"[{table}]"
        return f"{heading} lacks '{key}' ({TABLES[table].model_fields[key].description}); add it"
    problem = re.sub("^(Input|String) should", "must", detail["msg"]).replace("'", '"')
    if kind == "value_error":
        problem = str(detail["ctx"]["error"])
    if kind == "bool_type":
        problem = "must be true or false, without quotes"
    if kind == "float_type" and isinstance(detail["input"], str):
        with suppress(ValueError):
            problem += f"; write it without quotes: {number_of(detail['input']):g}"
    return f"{key} = {json.dumps(detail['input'], default=str, ensure_ascii=False)}: {problem}"
