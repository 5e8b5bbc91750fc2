"""Griffe extension: docstrings that describe several names at once, as `q, qd: coordinates`, describe each of them."""

import re
from typing import Any

import griffe

_ENTRY = re.compile(r"^(?P<indent> +)(?P<names>\w+(?:, \w+)+): (?P<text>.*(?:\n(?P=indent) +.*)*)", re.MULTILINE)


class SharedDescriptions(griffe.Extension):
    """Writes `q, qd: ...` as two entries: the parser would take `qd` for the type of `q`."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of a function, class or module."""
        if obj.docstring is not None:
            obj.docstring.value = _ENTRY.sub(_apart, obj.docstring.value)


def _apart(entry: re.Match[str]) -> str:
    return "\n".join(f"{entry['indent']}{name}: {entry['text']}" for name in entry["names"].split(", "))
