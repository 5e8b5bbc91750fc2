"""Shows conditions of trials and the parts of recordings that are used as fields of the form, and writes them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from kinertia.cli.web.file_table import Content
from kinertia.errors import SettingsError
from kinertia.io.text.number_table import number_of

CONDITION, START, END = "condition:", "start:", "end:"
"""Prefixes of the form's fields for the condition of a trial, and the part of a recording; the file's name follows."""
_WINDOW = "window_s"


@dataclass(frozen=True)
class TrialFields:
    """What the form shows of one recording beside its use: condition, start and end of the part used (s), as typed."""

    condition: str = ""
    start: str = ""
    end: str = ""


def trial_fields(content: Content, files: Iterable[str], typed: Mapping[str, str]) -> dict[str, TrialFields]:
    """Return the fields of each file; typed values precede written ones."""
    written = {file: _written(one) for file, one in _recordings(content)}
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
    return list(dict.fromkeys(str(one["condition"]) for _, one in _recordings(content) if one.get("condition")))


def with_trial_fields(content: Content, form: Mapping[str, str]) -> Content:
    """Return the entries with conditions and parts of the form; empty fields remove them.

    Raises:
        SettingsError: a part lacks its start or its end, or one is no number.
    """
    changed = dict(content)
    trials, model = content.get("trial"), content.get("model")
    if isinstance(trials, list):
        changed["trial"] = [
            _changed(one, str(one.get("markers")), form) if isinstance(one, Mapping) else one for one in trials
        ]
    if isinstance(model, Mapping) and "static" in model:
        changed["model"] = _changed(model, str(model["static"]), form)
    return changed


def _recordings(content: Content) -> list[tuple[str, Mapping[str, Any]]]:
    trials, model = content.get("trial"), content.get("model")
    known = [one for one in trials if isinstance(one, Mapping)] if isinstance(trials, list) else []
    static = [(str(model["static"]), model)] if isinstance(model, Mapping) and "static" in model else []
    return [*static, *((str(one.get("markers", "")), one) for one in known)]


def _written(one: Mapping[str, Any]) -> TrialFields:
    return TrialFields(str(one.get("condition", "")), *_ends(one.get(_WINDOW)))


def _changed(one: Mapping[str, Any], file: str, form: Mapping[str, str]) -> dict[str, Any]:
    given: dict[str, Any] = {}
    if CONDITION + file in form:
        given["condition"] = form[CONDITION + file].strip()
    if START + file in form:
        given[_WINDOW] = _window(file, form[START + file].strip(), form.get(END + file, "").strip(), one.get(_WINDOW))
    rest = {key: value for key, value in one.items() if key not in given}
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
