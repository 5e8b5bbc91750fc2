"""Writes the text of a subject file from its entries, each with its description."""

from collections.abc import Mapping
from typing import Any

from kinertia.io.subject.tables import TABLES
from kinertia.io.text.toml_lines import quoted
from kinertia.settings import KnownSegment, Table


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
