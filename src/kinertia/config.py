"""The subject file: one TOML text that says who walked, which files hold the trials, and how to estimate.

    [subject]
    sex = "female"                 # "male" or "female"
    mass_kg = 61.5                 # may be left out where a C3D file carries it; so may height_m
    height_m = 1.68

    [model]
    static = "static.c3d"          # paths are relative to this file
    markers = "plug-in-gait"       # a preset or a TOML file of your own; left out: found from the labels

    [[trial]]                      # as many as there are
    markers = "walk1.trc"          # a C3D file needs no `forces`
    forces = "walk1_grf.mot"
    loads = "walk1_grf.xml"        # ExternalLoads: which column of `forces` is what
    window_s = [0.4, 1.9]          # left out: where every foot on the ground is measured

    [settings]                     # every one has a default, see `Settings`
    cutoff_hz = 6.0

`read_subject` checks it whole and names the line of what is wrong; `init_subject` writes a first one from the files
of a folder.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from kinertia.anthropometry import check_subject
from kinertia.errors import FileError, KinertiaError, SubjectError
from kinertia.marker_set import preset_names

Location = tuple[str | int, ...]


def _folder(info: ValidationInfo) -> Path:
    return (info.context or {}).get("folder", Path.cwd())


def _file(value: object, info: ValidationInfo) -> Path:
    """An existing file, absolute; a relative one counts from the subject file's folder (the context)."""
    if not isinstance(value, str | Path):
        raise ValueError("must be a path in quotes")
    path = (_folder(info) / Path(value).expanduser()).resolve()
    if path.is_file():
        return path
    names = sorted(entry.name for entry in path.parent.iterdir()) if path.parent.is_dir() else []
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


def _cutoff(value: object) -> float | str:
    if value == "gcv":
        return "gcv"
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < float("inf"):
        raise ValueError('must be "gcv" or a positive frequency in Hz')
    return float(value)


def _window(value: object) -> tuple[float, float]:
    match value:
        case [int() | float() as start, int() | float() as end] if start < end:
            return float(start), float(end)
    raise ValueError("must be [start, end] in seconds, the start before the end")


def _tables(value: object) -> tuple[object, ...]:
    if isinstance(value, list | tuple) and value:
        return tuple(value)
    raise ValueError("every trial is a table of its own under the heading [[trial]], in double brackets")


File = Annotated[Path, BeforeValidator(_file)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Subject(_Table):
    """Who walked. Mass (kg) and height (m) are None where the file leaves them to the C3D files."""

    name: str = Field(min_length=1, description="name in files and report; left out: the folder's name")
    sex: Literal["male", "female"] = Field(description='"male" or "female": which table of the literature')
    mass_kg: float | None = Field(None, description="body mass on the scale, kg")
    height_m: float | None = Field(None, description="stature, m")

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any, info: ValidationInfo) -> Any:
        return {"name": _folder(info).name or "subject", **data} if isinstance(data, dict) else data


class Model(_Table):
    """What the skeleton is built from: the static trial, and a marker set (preset, absolute path, or None: detect)."""

    static: File = Field(description="static trial, .c3d or .trc")
    markers: Annotated[str | Path, BeforeValidator(_marker_set)] | None = Field(
        None, description="marker set: a preset or a TOML file; left out: found from the labels"
    )


class TrialFiles(_Table):
    """Files of one dynamic trial (absolute paths); `window_s` (start, end) overrides the measured window, s."""

    name: str = Field(min_length=1, description="name in files and report; left out: the marker file's")
    markers: File = Field(description="markers, .c3d or .trc")
    forces: File | None = Field(None, description="plate forces, .mot or .sto; a C3D file has its own")
    loads: File | None = Field(None, description="ExternalLoads .xml: which column of `forces` is what")
    window_s: Annotated[tuple[float, float], BeforeValidator(_window)] | None = Field(
        None, description="[start, end] to use, s; left out: where every foot on the ground is measured"
    )

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any) -> Any:
        named = isinstance(data, dict) and isinstance(data.get("markers"), str | Path)
        return {"name": Path(data["markers"]).stem, **data} if named else data


class Settings(_Table):
    """How to estimate."""

    method: Literal["two-level"] = Field("two-level", description='estimator: "two-level"')
    bsp: Literal["dumas", "deleva"] = Field(
        "dumas", description='literature to start from: "dumas" or "deleva"'
    )
    symmetry: bool = Field(True, description="true: left mirrors right, 49 parameters; false: 84")
    cutoff_hz: Annotated[float | Literal["gcv"], BeforeValidator(_cutoff)] = Field(
        "gcv", description='smoothing: "gcv" (cross-validation, signal by signal) or a cutoff, Hz'
    )
    hip_centre: Literal["bell", "harrington"] = Field(
        "bell", description='hip joint centres from the pelvis: "bell" or "harrington"'
    )


class SubjectFile(_Table):
    """A validated subject file: `read_subject` makes it. Names are filled in, paths absolute, files exist."""

    subject: Subject = Field(description="who walked")
    model: Model = Field(description="the static trial and its marker set")
    trials: Annotated[tuple[TrialFiles, ...], BeforeValidator(_tables)] = Field(
        alias="trial", description="a dynamic trial: its files"
    )
    settings: Settings = Field(default_factory=Settings, description="how to estimate")


def read_subject(path: str | Path) -> SubjectFile:
    """Read and check a subject file.

    Raises:
        FileError: the file is missing, not TOML, or says something that cannot be (unknown key, missing or wrong
            value, no such trial file, two trials of one name, implausible mass or height); with the line.
    """
    path = Path(path).resolve()
    text, content = _parsed(path)
    lines = _lines(text)
    try:
        result = SubjectFile.model_validate(content, context={"folder": path.parent})
    except ValidationError as error:
        found = [(_line(lines, detail["loc"]), _sentence(detail)) for detail in error.errors()]
        line, sentence = min(found, key=lambda item: item[0] or 0)
        raise FileError(path, sentence, line) from None
    subject = result.subject
    try:
        # a value that the file leaves open is stood in for by a plausible one
        check_subject(
            70.0 if subject.mass_kg is None else subject.mass_kg,
            1.7 if subject.height_m is None else subject.height_m,
            subject.sex,
        )
    except SubjectError as error:
        raise FileError(path, str(error), _line(lines, ("subject", error.field))) from error
    names = [trial.name for trial in result.trials]
    for index, name in enumerate(names):
        if name in names[:index]:
            problem = f"trial '{name}' is there already; give this one a name = \"...\" of its own"
            raise FileError(path, problem, _line(lines, ("trial", index, "name")))
    return result


def _parsed(path: Path) -> tuple[str, dict[str, Any]]:
    """The text and what TOML makes of it."""
    if not path.is_file():
        raise FileError(path, "no such file; expected a subject file (subject.toml)")
    raw = path.read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise FileError(path, "not UTF-8 text; save the file in the UTF-8 encoding", line) from error
    try:
        return text, tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        where = re.search(r" \(at line (\d+), column \d+\)$", message)
        line = int(where[1]) if where else text.count("\n") + 1
        what = message[: message.rindex(" (at ")] if " (at " in message else message
        hint = "; write paths with / instead of \\" if "\\" in text.splitlines()[line - 1] else ""
        raise FileError(path, f"not valid TOML: {what}{hint}", line) from error


def _lines(text: str) -> dict[Location, int]:
    """Line number (from 1) of every table heading and key, by its place: ("trial", 1, "markers").

    Reads one `[table]`, `[[table]]` or `key =` per line, which is how subject files are written; what stands inside an
    inline table is found at the key that holds it.
    """
    places: dict[Location, int] = {}
    prefix: Location = ()
    counts: dict[Location, int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if heading := re.match(r"\s*(\[\[?)\s*([\w.\"' -]+?)\s*\]\]?\s*(#.*)?$", line):
            prefix = _keys(heading[2])
            if heading[1] == "[[":
                counts[prefix] = counts.get(prefix, -1) + 1
                prefix = (*prefix, counts[prefix])
            places.setdefault(prefix, number)
        elif key := re.match(r"\s*([\w.\"' -]+?)\s*=", line):
            place = (*prefix, *_keys(key[1]))
            places.setdefault(place, number)
    for place, number in list(places.items()):
        for size in range(1, len(place)):
            places.setdefault(place[:size], number)
    return places


def _keys(dotted: str) -> Location:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _line(lines: dict[Location, int], place: Location) -> int | None:
    """Line of a place; of the nearest that holds it where the file does not have it."""
    return next((lines[place[:size]] for size in range(len(place), 0, -1) if place[:size] in lines), None)


_TABLES: dict[str, type[_Table]] = {
    "subject": Subject,
    "model": Model,
    "trial": TrialFiles,
    "settings": Settings,
}


def _sentence(detail: Any) -> str:
    """One sentence for the user from one of pydantic's errors."""
    *holder, key = detail["loc"]
    if not holder:
        return _sentence_on_table(str(key), detail)
    table = f"[{holder[0]}]"
    fields = _TABLES[str(holder[0])].model_fields
    value = json.dumps(detail["input"], default=str)
    if isinstance(key, int):
        return "every trial is a table of its own under the heading [[trial]], in double brackets"
    match detail["type"]:
        case "missing":
            return f"{table} lacks '{key}' ({fields[key].description}); add it"
        case "extra_forbidden":
            return f"{table} knows no key '{key}'{_nearest(key, list(fields))}"
        case "literal_error":
            return f"{key} = {value}: must be {detail['ctx']['expected'].replace(chr(39), chr(34))}"
        case "value_error":
            return f"{key} = {value}: {detail['ctx']['error']}"
        case _:
            return f"{key} = {value}: {detail['msg'].replace('Input should be', 'must be')}"


def _sentence_on_table(key: str, detail: Any) -> str:
    heading = "[[trial]]" if key == "trial" else f"[{key}]"
    match detail["type"]:
        case "missing":
            description = SubjectFile.model_fields["trials" if key == "trial" else key].description
            return f"there is no {heading} ({description}); add it"
        case "extra_forbidden":
            return f"a subject file knows no '{key}'{_nearest(key, list(_TABLES))}"
        case "value_error":
            return str(detail["ctx"]["error"])
        case _:
            return f"'{key}' must be a table under the heading {heading}"


def _nearest(key: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(key, known, n=1)
    return f"; did you mean '{near[0]}'?" if near else f"; it knows {', '.join(known)}"
