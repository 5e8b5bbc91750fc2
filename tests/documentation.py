"""Takes pages apart into examples, and compares what they show with what happens."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = (*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md")

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_MARK = re.compile(r"<!-- example: (\w+)(, slow)? -->")
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?|(?<=[\d.])\.\d+")
_RULE = re.compile(r"^[─-]+$")


@dataclass(frozen=True)
class Block:
    """A fenced block; `folder` is the name that the last example mark above it gives, "" without one."""

    language: str
    text: str
    folder: str
    slow: bool

    def commands(self) -> Iterator[tuple[str, str]]:
        """Each command line behind `$`, and the output shown below it."""
        joined = self.text.replace("\\\n", " ")
        for part in re.split(r"^\$ ", joined, flags=re.MULTILINE)[1:]:
            command, _, shown = part.partition("\n")
            yield " ".join(command.split()), shown


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    marks = list(_MARK.finditer(text))
    found = []
    for fence in _FENCE.finditer(text):
        above = [mark for mark in marks if mark.end() <= fence.start()]
        folder, slow = (above[-1][1], bool(above[-1][2])) if above else ("", False)
        found.append(Block(fence[1], fence[2], folder, slow))
    return found


def difference(shown: str, real: str) -> str | None:
    """What of the shown output, between lines `...`, the real one does not have in that order; None if it has all.

    White space and rules do not count; numbers may differ by a tenth, or by 3 in the last place shown.
    """
    rest = _words(real)
    for piece in re.split(r"^\.\.\.$", shown, flags=re.MULTILINE):
        words = _words(piece)
        if not words:
            continue
        starts = range(len(rest) - len(words) + 1)
        start = next((i for i in starts if all(map(_alike, words, rest[i:]))), None)
        if start is None:
            return " ".join(words)
        rest = rest[start + len(words) :]
    return None


def _words(text: str) -> list[str]:
    return [word for word in text.split() if not _RULE.match(word)]


def _alike(shown: str, real: str) -> bool:
    if _NUMBER.sub("#", shown) != _NUMBER.sub("#", real):
        return False
    return all(_near(one, other) for one, other in zip(_NUMBER.findall(shown), _NUMBER.findall(real), strict=True))


def _near(shown: str, real: str) -> bool:
    last_place = 10.0 ** -len(shown.partition(".")[2])
    return abs(float(shown) - float(real)) <= max(0.1 * abs(float(shown)), 3.0 * last_place) + 1e-12


def column(page: str, heading: str) -> list[str]:
    """Words in code marks in the first column of the table that follows a text of the page."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    table = re.search(r"(?:^\|.*\n)+", text[text.index(heading) :], re.MULTILINE)
    assert table is not None
    return [name for row in table[0].splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])]
