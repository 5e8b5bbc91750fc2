"""Shows repeated entries of a subject file, conditions of trials and parts of recordings as rows of a form.

Rows are written as typed, numbers as numbers; `read_subject` reports what is wrong with them.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from kinertia.cli.web.file_table import Content
from kinertia.errors import SettingsError
from kinertia.io.text.number_table import number_of
from kinertia.settings import Attached, KnownSegment, Table

_SEGMENT = "segment"
_TABLES: dict[str, type[Table]] = {"segment": KnownSegment, "attached": Attached}
_TEXTS = (_SEGMENT, "name", "source")
_LABELS = {
    "segment": "Segment",
    "name": "Name",
    "mass_kg": "Mass (kg)",
    "com_x_mm": "CoM forwards (mm)",
    "com_y_mm": "CoM upwards (mm)",
    "com_z_mm": "CoM to the right (mm)",
    "ixx_kgm2": "Ixx (kg m2)",
    "iyy_kgm2": "Iyy (kg m2)",
    "izz_kgm2": "Izz (kg m2)",
    "prosthesis": "Prosthesis",
    "source": "Measured by",
    "on_scale": "On the scale, too",
    "com_mm": "CoM: forwards, upwards, right (mm)",
    "com_sd_mm": "CoM known to (mm)",
    "size_mm": "Depth, height, width (mm)",
}
_TITLES = {"segment": "Segments that were measured", "attached": "What is worn or carried"}
_LONGEST_NUMBER = 4
_THREE = ("com_mm", "size_mm")
_BETWEEN = re.compile(r"\s*;\s*|,?\s+")
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
CONDITION, START, END = "condition:", "start:", "end:"
"""Prefixes of the form's fields for the condition of a trial, and the part of a recording; the file's name follows."""
_WINDOW = "window_s"


@dataclass(frozen=True)
class Field:
    """One entry of the form.

    Attributes:
        key: its name in the form.
        label, about: description, short and long.
        value: value as the field shows it.
        choices: choices of a field that is not a number or text.
        optional: whether most people leave it empty.
    """

    key: str
    label: str
    about: str
    value: str
    choices: tuple[str, ...]
    optional: bool


def choices_of(annotation: object) -> tuple[str, ...]:
    """Return the possible values of an entry where they are a list."""
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    return next((found for part in get_args(annotation) if (found := choices_of(part))), ())


@dataclass(frozen=True)
class Rows:
    """All rows of one kind, the last of them empty, for one more.

    Attributes:
        kind: "segment" or "attached".
        rows: fields of each row.
    """

    kind: str
    rows: tuple[tuple[Field, ...], ...]

    @property
    def title(self) -> str:
        """Heading of the rows in the form."""
        return _TITLES[self.kind]

    @property
    def written(self) -> int:
        """Number of rows without the empty one."""
        return len(self.rows) - 1


def rows(content: Content, typed: Mapping[str, str] | None = None) -> list[Rows]:
    """Return rows of every kind; typed values take precedence over written ones."""
    return [
        Rows(kind, tuple(_fields(kind, number, row) for number, row in enumerate([*table, {}])))
        for kind in _TABLES
        for table in (_typed(kind, typed) if typed else _written(kind, content),)
    ]


def with_rows(content: Content, form: Mapping[str, str]) -> Content:
    """Return the entries with those of the form; emptying a row's segment or name removes it, other kinds stay.

    Raises:
        SettingsError: a new row lacks its segment or name, or a segment has two rows.
    """
    changed = dict(content)
    for kind in _TABLES:
        if not any(key.startswith(f"{kind}:") for key in form):
            continue
        typed = _with_heads(kind, _typed(kind, form), len(_written(kind, content)))
        entries = [{key: _value(key, text) for key, text in row.items()} for row in typed]
        if kind == _SEGMENT:
            given: Any = {str(row.pop(_SEGMENT)): row for row in entries}
        else:
            given = entries
        changed.pop(kind, None)
        if given:
            changed[kind] = given
    return changed


def _keys(kind: str) -> list[str]:
    """Return the keys of a row, the required one first."""
    keys = list(_TABLES[kind].model_fields)
    return [_SEGMENT, *keys] if kind == _SEGMENT else keys


def _fields(kind: str, number: int, row: Mapping[str, str]) -> tuple[Field, ...]:
    fields = []
    for key in _keys(kind):
        about = _TABLES[kind].model_fields.get(key)
        choices = ("yes", "no") if about is not None and about.annotation is bool else ()
        description = "which" if about is None else about.description or ""
        optional = about is None or not about.is_required()
        fields.append(Field(f"{kind}:{number}:{key}", _LABELS[key], description, row.get(key, ""), choices, optional))
    return tuple(fields)


def _written(kind: str, content: Content) -> list[dict[str, str]]:
    """Return rows of the subject file as the form shows them, without those of another shape."""
    value = content.get(kind)
    if kind == _SEGMENT and isinstance(value, Mapping):
        value = [{_SEGMENT: name, **entry} for name, entry in value.items() if isinstance(entry, Mapping)]
    if not isinstance(value, list):
        return []
    return [
        {key: _shown(entry[key]) for key in _keys(kind) if key in entry}
        for entry in value
        if isinstance(entry, Mapping)
    ]


def _typed(kind: str, form: Mapping[str, str]) -> list[dict[str, str]]:
    """Return rows of the form up to the last that is not empty."""
    found: dict[int, dict[str, str]] = {}
    for name, text in form.items():
        what, _, rest = name.partition(":")
        number, _, key = rest.partition(":")
        if (
            what == kind
            and number.isdecimal()
            and len(number) < _LONGEST_NUMBER
            and key in _keys(kind)
            and text.strip()
        ):
            found.setdefault(int(number), {})[key] = text.strip()
    return [found.get(number, {}) for number in range(max(found, default=-1) + 1)]


def _with_heads(kind: str, typed: Sequence[Mapping[str, str]], written: int) -> list[dict[str, str]]:
    """Return rows with their segment or name; a written row is removed by emptying it."""
    head, title = _keys(kind)[0], _TITLES[kind]
    kept: list[dict[str, str]] = []
    for number, row in enumerate(typed):
        if head not in row:
            if row and number >= written:
                key, text = next(iter(row.items()))
                raise SettingsError(f"{title}: a row with {_LABELS[key]} '{text}' has no {head}; fill it in")
            continue
        if kind == _SEGMENT and any(kept_row[head] == row[head] for kept_row in kept):
            raise SettingsError(f"{title}: {row[head]} has two rows; give all its values in one")
        kept.append(dict(row))
    return kept


def _shown(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def _value(key: str, text: str) -> object:
    """Convert typed text to the value in a subject file."""
    if key in _TEXTS:
        return text
    if text in ("yes", "no"):
        return text == "yes"
    if key in _THREE:
        bare = text.strip("[] ")
        return [_number(part) for part in (_BETWEEN.split(bare) if _BETWEEN.search(bare) else bare.split(","))]
    return _number(text)


def _number(text: str) -> object:
    """Parse a number; for a value with its SD return the text, with decimal points."""
    try:
        return number_of(text)
    except ValueError:
        return _DECIMAL_COMMA.sub(".", text)


@dataclass(frozen=True)
class TrialFields:
    """What the form shows of one recording beside its use: condition, start and end of the part used (s), as typed."""

    condition: str = ""
    start: str = ""
    end: str = ""


def trial_fields(content: Content, files: Iterable[str], typed: Mapping[str, str]) -> dict[str, TrialFields]:
    """Return the fields of each file; typed values precede written ones."""
    written = {file: _written_trial(trial) for file, trial in _recordings(content)}
    shown = {}
    for file in files:
        known = written.get(file, TrialFields())
        shown[file] = TrialFields(
            typed.get(CONDITION + file, known.condition),
            typed.get(START + file, known.start),
            typed.get(END + file, known.end),
        )
    return shown


def conditions(content: Content) -> list[str]:
    """Return the stated conditions, each once."""
    return list(dict.fromkeys(str(trial["condition"]) for _, trial in _recordings(content) if trial.get("condition")))


def with_trial_fields(content: Content, form: Mapping[str, str]) -> Content:
    """Return the entries with conditions and parts of the form; empty fields remove them.

    Raises:
        SettingsError: a part lacks its start or its end, or one is no number.
    """
    changed = dict(content)
    trials, model = content.get("trial"), content.get("model")
    if isinstance(trials, list):
        changed["trial"] = [
            _changed(trial, str(trial.get("markers")), form) if isinstance(trial, Mapping) else trial
            for trial in trials
        ]
    if isinstance(model, Mapping) and "static" in model:
        changed["model"] = _changed(model, str(model["static"]), form)
    return changed


def _recordings(content: Content) -> list[tuple[str, Mapping[str, Any]]]:
    trials, model = content.get("trial"), content.get("model")
    known = [trial for trial in trials if isinstance(trial, Mapping)] if isinstance(trials, list) else []
    static = [(str(model["static"]), model)] if isinstance(model, Mapping) and "static" in model else []
    return [*static, *((str(trial.get("markers", "")), trial) for trial in known)]


def _written_trial(trial: Mapping[str, Any]) -> TrialFields:
    return TrialFields(str(trial.get("condition", "")), *_ends(trial.get(_WINDOW)))


def _changed(trial: Mapping[str, Any], file: str, form: Mapping[str, str]) -> dict[str, Any]:
    given: dict[str, Any] = {}
    if CONDITION + file in form:
        given["condition"] = form[CONDITION + file].strip()
    if START + file in form:
        given[_WINDOW] = _window(file, form[START + file].strip(), form.get(END + file, "").strip(), trial.get(_WINDOW))
    rest = {key: value for key, value in trial.items() if key not in given}
    return {**rest, **{key: value for key, value in given.items() if value}}


def _window(file: str, start: str, end: str, before: Any) -> Any:
    """Return the part as a subject file states it; as it was if nobody changed it, None without one."""
    if not start and not end:
        return None
    if not start or not end:
        raise SettingsError(f"Part of {file}: give its start and its end, in seconds, or neither")
    try:
        return before if (start, end) == _ends(before) else [number_of(start), number_of(end)]
    except ValueError as error:
        raise SettingsError(f"Part of {file}: {error}") from None


def _ends(window: Any) -> tuple[str, str]:
    """Return start and end as the form shows them; empty where there is no window, or a wrong one."""
    match window:
        case [int() | float() as start, int() | float() as end]:
            return f"{start:g}", f"{end:g}"
    return "", ""
