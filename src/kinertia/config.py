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

`read_subject` checks it whole and names the line of what is wrong; `init_subject` drafts one from a folder.
"""

from __future__ import annotations

import difflib
import json
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

_DOUBLE_BRACKETS = "every trial is a table of its own under the heading [[trial]], in double brackets"


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
    raise ValueError(_DOUBLE_BRACKETS)


File = Annotated[Path, BeforeValidator(_file)]
MarkerSetName = Annotated[str | Path, BeforeValidator(_marker_set)]
Cutoff = Annotated[float | Literal["gcv"], BeforeValidator(_cutoff)]
Window = Annotated[tuple[float, float], BeforeValidator(_window)]
Trials = Annotated[tuple["TrialFiles", ...], BeforeValidator(_tables)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Subject(_Table):
    """Who walked. Mass (kg) and height (m) are None where the file leaves them to the C3D files."""

    name: str = Field(min_length=1, description="name in files and report; left out: the folder's name")
    sex: Literal["male", "female"] = Field(description='"male" or "female": which table of the literature')
    mass_kg: float | None = Field(default=None, description="body mass on the scale, kg")
    height_m: float | None = Field(default=None, description="stature, m")

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any, info: ValidationInfo) -> Any:
        return {"name": _folder(info).name or "subject", **data} if isinstance(data, dict) else data


class Model(_Table):
    """What the skeleton is built from. `markers` is a preset's name, an absolute path, or None: detect it."""

    static: File = Field(description="static trial, .c3d or .trc")
    markers: MarkerSetName | None = Field(default=None, description="preset or TOML file; left out: detected")


class TrialFiles(_Table):
    """Files of one dynamic trial; `window_s` (start, end) overrides the measured window, s."""

    name: str = Field(min_length=1, description="name in files and report; left out: the marker file's")
    markers: File = Field(description="markers, .c3d or .trc")
    forces: File | None = Field(default=None, description="plate forces, .mot or .sto; C3D has its own")
    loads: File | None = Field(default=None, description="ExternalLoads .xml: what the columns are")
    window_s: Window | None = Field(default=None, description="[start, end], s; left out: measured part")

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        markers = data.get("markers")
        return {"name": Path(markers).stem if isinstance(markers, str | Path) else "trial", **data}


class Settings(_Table):
    """How to estimate."""

    method: Literal["two-level"] = Field(default="two-level", description='estimator: "two-level"')
    bsp: Literal["dumas", "deleva"] = Field(default="dumas", description='first guess: "dumas" or "deleva"')
    symmetry: bool = Field(default=True, description="true: left mirrors right, 49 parameters; false: 84")
    cutoff_hz: Cutoff = Field(
        default="gcv", description='smoothing: "gcv" (cross-validation) or a cutoff, Hz'
    )
    hip_centre: Literal["bell", "harrington"] = Field(
        default="bell", description='hip joint centres from the pelvis: "bell" or "harrington"'
    )


class SubjectFile(_Table):
    """A validated subject file: `read_subject` makes it. Names are filled in, paths absolute, files exist."""

    subject: Subject
    model: Model
    trials: Trials = Field(alias="trial")
    settings: Settings = Settings()


def read_subject(path: str | Path) -> SubjectFile:
    """Read and check a subject file.

    Raises:
        FileError: the file is missing, not TOML, or says something that cannot be (unknown key, missing or
            wrong value, no such trial file, two trials of one name, implausible mass); with the line.
    """
    path = Path(path).resolve()
    text, content = _parsed(path)
    lines = _lines(text)
    try:
        result = SubjectFile.model_validate(content, context={"folder": path.parent})
    except ValidationError as error:
        last = text.count("\n") + 1
        found = [(_line(lines, detail["loc"]) or last, _sentence(detail)) for detail in error.errors()]
        line, sentence = min(found)
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
        hint = "; put text in quotes" if what == "Invalid value" else ""
        if "\\" in what:
            hint = "; write paths with / instead of \\"
        raise FileError(path, f"not valid TOML: {what}{hint}", line) from error


def _lines(text: str) -> dict[Location, int]:
    """Line number (from 1) of every table heading and key, by its place: ("trial", 1, "markers").

    Reads one `[table]`, `[[table]]` or `key =` per line, which is how subject files are written; what stands
    inside an inline table is found at the key that holds it.
    """
    places: dict[Location, int] = {}
    table: Location = ()
    counts: dict[Location, int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if heading := re.match(r"\s*(\[\[?)\s*([\w.\"' -]+?)\s*\]\]?\s*(#.*)?$", line):
            place = table = _keys(heading[2])
            if heading[1] == "[[":
                counts[place] = counts.get(place, -1) + 1
                place = table = (*place, counts[place])
        elif key := re.match(r"\s*([\w.\"' -]+?)\s*=", line):
            place = (*table, *_keys(key[1]))
        else:
            continue
        for size in range(1, len(place) + 1):
            places.setdefault(place[:size], number)
    return places


def _keys(dotted: str) -> Location:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _line(lines: dict[Location, int], place: Location) -> int | None:
    """Line of a place; of the nearest that holds it where the file does not have it."""
    return next((lines[place[:size]] for size in range(len(place), 0, -1) if place[:size] in lines), None)


_TABLES: dict[str, type[_Table]] = dict(subject=Subject, model=Model, trial=TrialFiles, settings=Settings)


def _sentence(detail: Any) -> str:
    """One sentence for the user from one of pydantic's errors."""
    *holder, key = detail["loc"]
    table, kind = str(holder[0] if holder else key), detail["type"]
    if kind == "extra_forbidden":
        known = list(_TABLES[table].model_fields) if holder else list(_TABLES)
        near = difflib.get_close_matches(str(key), known, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"
        return f"unknown key '{key}'{f' in [{table}]' if holder else ''}; {hint}"
    if table == "trial" and (not holder or isinstance(key, int)) and kind != "missing":
        return _DOUBLE_BRACKETS
    if not holder:
        heading = "[[trial]]" if table == "trial" else f"[{table}]"
        return f"there is no heading {heading} with its entries below; add it"
    if kind == "missing":
        return f"[{table}] lacks '{key}' ({_TABLES[table].model_fields[key].description}); add it"
    problem = re.sub("^(Input|String) should", "must", detail["msg"]).replace("'", '"')
    if kind == "value_error":
        problem = str(detail["ctx"]["error"])
    return f"{key} = {json.dumps(detail['input'], default=str, ensure_ascii=False)}: {problem}"


_STATIC_NAME = re.compile(r"static|(?<![a-z])cal(ib\w*)?(?![a-z])", re.IGNORECASE)


def init_subject(folder: str | Path) -> str:
    """Draft a subject file for the recordings in a folder (not its subfolders); writes nothing.

    The static trial is the one whose name says so ("static", "cal"), else the shortest; forces and loads are
    matched to trials by the longest common part of their names; mass and height come from a C3D file that holds
    them. What stays unknown is a commented line marked FILL IN. Recordings whose names begin like another static
    trial's are left out and named in a comment.

    Raises:
        FileError: no such folder, or no .c3d or .trc file in it.
    """
    folder = Path(folder).resolve()
    if not folder.is_dir():
        raise FileError(folder, "no such folder; give the one that holds the recordings")
    files = sorted(folder.iterdir())
    c3d = [file for file in files if file.suffix.lower() == ".c3d"]
    stems = {file.stem for file in c3d}
    captures = c3d + [file for file in files if file.suffix.lower() == ".trc" and file.stem not in stems]
    if not captures:
        raise FileError(folder, "holds no .c3d or .trc file; give the folder that holds the recordings")
    static, trials = _static_and_trials(captures)
    others = [file.name for file in captures if file not in (static, *trials)]
    forces = [file for file in files if _holds_forces(file)]
    loads = [file for file in files if file.suffix.lower() == ".xml" and "<ExternalLoads" in _head(file)]
    chosen = _matched([trial for trial in trials if trial not in c3d], forces)
    text = [
        f"# Drafted from the files in {folder.name}: complete the lines marked FILL IN, check the others."
    ]
    if others:
        text += [f"# Left out, as another subject's or another static trial: {', '.join(others)}."]
    text += ["", "[subject]", *_subject_lines([file for file in (static, *trials) if file in c3d])]
    guessed = static is not None and not _STATIC_NAME.search(static.stem)
    note = " (the shortest recording)" if guessed else ""
    text += ["", "[model]", _entry(Model, "static", static and static.name, "static.trc", note)]
    text += ["# " + _entry(Model, "markers", "plug-in-gait")]
    for trial in trials:
        text += ["", "[[trial]]", _entry(TrialFiles, "markers", trial.name)]
        if trial in chosen:
            text += [_entry(TrialFiles, "forces", chosen[trial].name, note=" (matched by name)")]
            for file in _matched([chosen[trial]], loads).values():
                text += [_entry(TrialFiles, "loads", file.name, note=" (matched by name)")]
        elif trial not in c3d:
            text += [_entry(TrialFiles, "forces", None, "walk_grf.mot")]
    if not trials:
        text += ["", "[[trial]]", _entry(TrialFiles, "markers", None, "walk.trc")]
    text += ["", "[settings]", *(_entry(Settings, *item) for item in Settings().model_dump().items()), ""]
    return "\n".join(text)


def _entry(table: type[_Table], key: str, value: object, example: object = None, note: str = "") -> str:
    """`key = value  # what it is`; without a value a commented example to fill in."""
    about = f"{table.model_fields[key].description}{note}"
    if value is None:
        return f"# {key} = {json.dumps(example)}  # FILL IN: {about}"
    return f"{key} = {json.dumps(value, ensure_ascii=False)}  # {about}"


def _subject_lines(c3d: Sequence[Path]) -> list[str]:
    recordings = [recording for recording in map(_recording, c3d) if recording]
    mass_kg = next((recording.mass_kg for recording in recordings if recording.mass_kg), None)
    height_m = next((recording.height_m for recording in recordings if recording.height_m), None)
    return [
        _entry(Subject, "sex", None, "female"),
        _entry(Subject, "mass_kg", mass_kg, 70.0, " (from C3D)" if mass_kg else ""),
        _entry(Subject, "height_m", height_m, 1.7, " (from C3D)" if height_m else ""),
    ]


def _static_and_trials(captures: Sequence[Path]) -> tuple[Path | None, list[Path]]:
    """The static trial and the dynamic trials that share most of the beginning of its name."""
    statics = [file for file in captures if _STATIC_NAME.search(file.stem)]
    if not statics and len(captures) > 1:
        statics = [min(captures, key=_duration_s)]
    dynamic = [file for file in captures if file not in statics]
    if not statics or not dynamic:
        return (statics[0] if statics else None), dynamic
    # of equals `max` takes the first, so that unrelated names all go to the first static trial
    owners = [max(statics, key=lambda s: _common_start(s.stem, file.stem)) for file in dynamic]
    return owners[0], [file for file, owner in zip(dynamic, owners, strict=True) if owner == owners[0]]


def _common_start(a: str, b: str) -> int:
    return next((k for k, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))


def _recording(file: Path) -> Any:
    """What a capture holds, or None where it cannot be read: reading the trial itself will say why."""
    from kinertia.io.recording import read_recording

    try:
        return read_recording(file)
    except KinertiaError:
        return None


def _duration_s(file: Path) -> float:
    recording = _recording(file)
    return recording.markers.time[-1] - recording.markers.time[0] if recording else float("inf")


def _head(file: Path) -> str:
    with file.open("rb") as stream:
        return stream.read(20_000).decode("utf-8", errors="replace")


def _holds_forces(file: Path) -> bool:
    """Whether a motion file has force columns (`..._vx`, `..._vy`, ...) and is not the static trial's."""
    motion = file.suffix.lower() in (".mot", ".sto") and not _STATIC_NAME.search(file.stem)
    return motion and re.search(r"_v[xyz]\b", _head(file)) is not None


def _matched(wanting: Sequence[Path], offered: Sequence[Path]) -> dict[Path, Path]:
    """Pairs of files by the longest common part of their names, the best pair first; each file once.

    At least four letters must agree, unless there is one file on each side.
    """
    scores = {}
    for wants in wanting:
        for offers in offered:
            matcher = difflib.SequenceMatcher(None, wants.stem.lower(), offers.stem.lower(), autojunk=False)
            scores[wants, offers] = (matcher.find_longest_match().size, matcher.ratio())
    least = 0 if len(wanting) == len(offered) == 1 else 4
    pairs: dict[Path, Path] = {}
    for (wants, offers), score in sorted(scores.items(), key=lambda item: item[1], reverse=True):
        if score[0] >= least and wants not in pairs and offers not in pairs.values():
            pairs[wants] = offers
    return pairs
