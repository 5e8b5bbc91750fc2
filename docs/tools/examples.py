"""Examples in the pages: take them apart, compare what they show with what happens, renew their numbers.

    PYTHONPATH=.:tests python docs/tools/examples.py

runs every command shown behind `$` (with measured files, where the page names them) and puts the
numbers of now into the pages. Words that have changed are told, and to be mended by hand. The tests of the pages use
the same functions.
"""

import os
import re
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from kinertia.cli.demo import write_measured_lab
from validation.measured_data import data_folder

ROOT = Path(__file__).resolve().parents[2]
PAGES = (
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "validation").glob("*.md")),
    ROOT / "README.md",
)
SYNTHETIC = "qualisys"
"""Mark of examples that run beside a synthetic laboratory's files (`tests/qualisys_lab.py`)."""
MEASURED = ("pig_c3d", "rajagopal_walk")
"""Marks of examples that run beside the files of this folder among the measured data; others run in an empty folder."""

NOTEBOOKS = ("paper_figure", "opensim_day")
"""Of the site, by their names in docs/notebooks."""

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_MARK = re.compile(r"<!-- example: (\w+)(, slow)? -->")
_FILE = re.compile(r"<!-- file: ([\w.-]+) -->\n$")
_COMMAND = re.compile(r"^\$ ((?:[^\n]*\\\n)*[^\n]*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
_ELISION = re.compile(r"^( ?\.\.\.(?: \(.*\))?)$\n?", re.MULTILINE)
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?")
_RULE = re.compile(r"[─-]+")


@dataclass(frozen=True)
class Block:
    """A fenced block; `folder` is the name that the last example mark above it gives, "" without one.

    `file` is the name under which a mark just above the block puts its text into the folder, "" without one.
    """

    language: str
    text: str
    folder: str
    slow: bool
    file: str

    def commands(self) -> Iterator[tuple[str, str]]:
        """Each command line behind `$`, and the output shown below it."""
        for match in _COMMAND.finditer(self.text):
            yield " ".join(match[1].replace("\\\n", " ").split()), match[2]


def blocks(text: str) -> list[Block]:
    """All fenced blocks of a page, in order."""
    marks = list(_MARK.finditer(text))
    fenced = []
    for fence in _FENCE.finditer(text):
        above = [mark for mark in marks if mark.end() <= fence.start()]
        folder, slow = (above[-1][1], bool(above[-1][2])) if above else ("", False)
        file = _FILE.search(text, 0, fence.start())
        fenced.append(Block(fence[1], fence[2], folder, slow, file[1] if file else ""))
    return fenced


def link_measured(name: str, folder: Path) -> None:
    """Put links to measured files into a folder, one person's, as a user would have them."""
    for file in (data_folder() / name).iterdir():
        if file.is_file() and not file.name.startswith("subject_a"):
            (folder / file.name).symlink_to(file)


def put_files(notebook: str, folder: Path) -> None:
    """The measured files that a notebook finds beside it."""
    if notebook == "paper_figure":
        write_measured_lab(folder / "measured" / "lab")
    else:
        link_measured("rajagopal_walk", folder)


def difference(shown: str, real: str) -> str | None:
    """What of the shown output, between lines `...`, the real one does not have in that order; None if it has all.

    White space and rules do not count; numbers may differ by a tenth, or by 3 in the last place shown.
    """
    start = 0
    for piece in _ELISION.split(shown)[::2]:
        span = _place(piece, real, start, strict=True)
        if span is None:
            return " ".join(piece.split())
        start = span[1]
    return None


def renewed(shown: str, real: str) -> str:
    """The shown output with the numbers of the real one.

    Raises:
        ValueError: the real one does not have these words in this order.
    """
    parts, start = [], 0
    for k, piece in enumerate(_ELISION.split(shown)):
        if k % 2:
            parts.append(piece + "\n")
        elif piece.strip():
            span = _place(piece, real, start, strict=False)
            if span is None:
                raise ValueError(" ".join(piece.split()))
            begin, start = span
            lines = real[real.rfind("\n", 0, begin) + 1 : start].splitlines()
            parts.append("\n".join(line.rstrip() for line in lines) + "\n")
    return "".join(parts)


def _place(piece: str, text: str, start: int, strict: bool) -> tuple[int, int] | None:
    """First stretch of the text from `start` with the words of the piece, and with its numbers if `strict`."""
    wanted = [word for word in piece.split() if not _RULE.fullmatch(word)]
    words = [word for word in re.finditer(r"\S+", text) if word.start() >= start and not _RULE.fullmatch(word[0])]
    if not wanted:
        return start, start
    for k in range(len(words) - len(wanted) + 1):
        here = words[k : k + len(wanted)]
        if all(_alike(wanted_word, other[0], strict) for wanted_word, other in zip(wanted, here, strict=True)):
            return here[0].start(), here[-1].end()
    return None


def _alike(shown: str, real: str, strict: bool) -> bool:
    if not strict:
        shown, real = shown.rstrip("*"), real.rstrip("*")
    if _NUMBER.sub("#", shown) != _NUMBER.sub("#", real):
        return False
    pairs = zip(_NUMBER.findall(shown), _NUMBER.findall(real), strict=True)
    return not strict or all(_near(wanted_word, other) for wanted_word, other in pairs)


def _near(shown: str, real: str) -> bool:
    last_place = 10.0 ** -len(shown.partition(".")[2])
    return abs(float(shown) - float(real)) <= max(0.1 * abs(float(shown)), 3.0 * last_place) + 1e-12


def main() -> None:
    """Renew the numbers of all pages."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        folders: dict[str, Path] = {}
        for block in blocks(text):
            if block.language != "console" and not block.file:
                continue
            if block.folder not in folders:
                folders[block.folder] = Path(tempfile.mkdtemp(prefix="kinertia-examples-"))
                if block.folder in MEASURED:
                    link_measured(block.folder, folders[block.folder])
                if block.folder == SYNTHETIC:
                    import_module("qualisys_lab").write_qualisys_lab(folders[block.folder])
            if block.file:
                (folders[block.folder] / block.file).write_text(block.text, encoding="utf-8")
                continue
            new = block.text
            for command, shown in block.commands():
                environment = os.environ | {"COLUMNS": "80"}
                done = subprocess.run(
                    command, shell=True, cwd=folders[block.folder], env=environment, capture_output=True, text=True
                )
                try:
                    new = new.replace(shown, renewed(shown, done.stdout))
                except ValueError as missing:
                    print(f"{page.name}: {command}: not in its output: {missing}\n{done.stdout}{done.stderr}")
            text = text.replace(block.text, new)
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
