"""Reads TOML with the line of every table and key, so that errors can state it."""

import json
import re
import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from kinertia.errors import expect_file, mismatch

Location = tuple[str | int, ...]
"""Place of a table or key from the top: ("trial", 1, "markers")."""


@dataclass(frozen=True)
class TomlFile:
    """A TOML text with its parsed content."""

    text: str
    content: dict[str, Any]

    @cached_property
    def lines(self) -> dict[Location, int]:
        """Line number (from 1) of every table heading and key, by its location."""
        return find_lines(self.text)

    @property
    def last_line(self) -> int:
        """Line where something that is missing would be added."""
        return self.text.count("\n") + 1

    def line(self, place: Location) -> int | None:
        """Return the line of a location, or of the nearest enclosing one where the file lacks it."""
        return next((self.lines[place[:size]] for size in range(len(place), 0, -1) if place[:size] in self.lines), None)


def read_toml(path: Path, expected: str) -> TomlFile:
    """Read a TOML file; `expected` describes it in messages ("a marker set").

    Raises:
        FileError: no such file, not UTF-8, not TOML; with the line.
    """
    try:
        return parse_toml(path.read_bytes().decode("utf-8-sig"), path)
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise mismatch(path, expected, "text that is not UTF-8", "the UTF-8 encoding", line) from error
    except OSError:
        expect_file(path, expected)
        raise


def parse_toml(text: str, path: Path) -> TomlFile:
    """Parse the text of a TOML file.

    Raises:
        FileError: not TOML; with the line.
    """
    try:
        return TomlFile(text, tomllib.loads(text))
    except RecursionError:
        raise mismatch(path, "TOML", "brackets within brackets, too many to read", "few of them") from None
    except tomllib.TOMLDecodeError as error:
        what, _, where = str(error).rpartition(" (at ")
        number = re.match(r"line (\d+)", where)
        line = int(number[1]) if number else text.count("\n") + 1
        slashes = "paths with / instead of \\"  # TOML reads \d and \U as the beginning of something else
        hints = {"Invalid value": "text in quotes", "Unescaped": slashes, "Invalid hex value": slashes}
        expected = next((hint for start, hint in hints.items() if what.startswith(start)), "key = value")
        wrong = text.splitlines()[line - 1] if number else ""
        if re.search("[“”„‘’«»]", wrong):
            expected = 'straight quotes ("), not curly ones'
        if comma := re.search(r"=\s*([-+]?\d+),(\d+)\s*(#|$)", wrong):
            expected = f"a decimal point, not a comma: {comma[1]}.{comma[2]}"
        raise mismatch(path, "TOML", what[:1].lower() + what[1:], expected, line) from error


def quoted(text: str) -> str:
    """Quote a text for TOML: JSON's escapes are TOML's, which requires one more character to be escaped."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def find_lines(text: str) -> dict[Location, int]:
    """Return the line number (from 1) of every table heading and key, by its location: ("trial", 1, "markers").

    Reads one `[table]`, `[[table]]` or `key =` per line, which is how such files are written; what is
    inside an inline table is found at the key that holds it.
    """
    places: dict[Location, int] = {}
    table: Location = ()
    counts: dict[Location, int] = {}

    def below(keys: Location) -> Location:
        """Return the location in the last table of an array: `[trial.diagnostics]` below the second `[[trial]]`."""
        return (keys[0], counts[keys[:1]], *keys[1:]) if keys[:1] in counts and len(keys) > 1 else keys

    for number, line in enumerate(text.split("\n"), start=1):
        if heading := re.match(r"\s*(\[\[?)\s*([\w.\"' -]+?)\s*\]\]?\s*(#.*)?$", line):
            place = table = below(_keys(heading[2]))
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
