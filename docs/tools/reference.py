"""Write the generated parts of the pages: commands from the command line, the subject file's keys from its models.

    python docs/tools/reference.py

A generated part stands between `<!-- generated: NAME -->` and `<!-- end -->`. A test compares the pages with the code.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from kinertia.cli.commands import application
from kinertia.io.subject.tables import Diagnostics, InstrumentsFiles, Model, PriorFiles, TrialFiles
from kinertia.model.marker_set import LANDMARKS, SEGMENTS, WIDTHS
from kinertia.settings import Attached, KnownSegment, Settings, Subject, Table

DOCS = Path(__file__).resolve().parents[1]
PAGES = tuple(DOCS / name for name in ("commands.md", "subject-file.md"))
_PART = re.compile(r"(<!-- generated: ([\w ]+) -->\n).*?(<!-- end -->)", re.DOTALL)
_SHARED = ("--help", "--quiet", "--verbose", "--overwrite")
"""Options that mean the same everywhere; the page explains them once."""


def filled(text: str) -> str:
    """The text of a page with all its generated parts as the code is now."""
    return _PART.sub(lambda part: f"{part[1]}\n{_GENERATED[part[2]]()}\n\n{part[3]}", text)


def commands() -> Iterator[tuple[str, Any]]:
    """Every command with its full name, sub-commands after their group, in the order of `kinertia --help`."""
    yield from _below("kinertia", typer.main.get_command(application()))


def _below(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    for child_name, child in getattr(command, "commands", {}).items():
        yield f"{name} {child_name}", child
        yield from _below(f"{name} {child_name}", child)


def _commands() -> str:
    return "\n\n".join(_command(name, command) for name, command in commands())


def _command(name: str, command: Any) -> str:
    text = command.help.replace("\b\n", "").replace(r"\[", "[")
    prose, _, examples = re.sub(r"\[bold\](Examples?)\[/\]", r"[bold]", text).partition("[bold]")
    paragraphs = [" ".join(part.split()) for part in prose.strip().split("\n\n")]
    parts = [f"## {name} {{ #{name.replace(' ', '-')} }}", *paragraphs]
    if examples.strip():
        parts.append("```text\n" + "\n".join(examples.split("\n\n")).strip() + "\n```")
    rows = [_parameter(param) for param in command.params if not set(param.opts) & set(_SHARED)]
    if rows:
        parts.append("\n".join(["| | | default |", "|---|---|---|", *rows]))
    shared = [f"`{name}`" for name in _SHARED[1:] if any(name in param.opts for param in command.params)]
    if shared:
        parts.append(f"Also {', '.join(shared)}: [everywhere the same](#everywhere-the-same).")
    return "\n\n".join(parts)


def _parameter(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        names = f"`{parameter.metavar or parameter.name.upper()}`"
    else:
        names = ", ".join(f"`{name}`" for name in parameter.opts)
    shown = "" if parameter.default in (None, False) else f"`{parameter.default}`"
    if parameter.required:
        shown = "needed"
    return f"| {names} | {' '.join((parameter.help or '').split())} | {shown} |"


def _table(model: type[Table]) -> str:
    rows = ["| key | what | default |", "|---|---|---|"]
    for name, field in model.model_fields.items():
        if field.is_required():
            default = "" if name == "name" else "is an error"
        else:
            nothing = name == "name" or field.default in (None, (), Diagnostics())
            default = "" if nothing else f"`{str(field.default).lower()}`"
        rows.append(f"| `{name}` | {(field.description or '')} | {default} |")
    return "\n".join(rows)


def _marker_set() -> str:
    sided = [name.removesuffix("_r") for name in LANDMARKS if name.endswith("_r")]
    middle = [name for name in LANDMARKS if not name.endswith(("_r", "_l"))]
    rows = {
        "landmarks with `_r` or `_l`": sided,
        "landmarks in the middle": middle,
        "segments": SEGMENTS,
        "widths": WIDTHS,
    }
    listed = [f"| {what} | {', '.join(f'`{name}`' for name in names)} |" for what, names in rows.items()]
    return "\n".join(["| | names that Kinertia knows |", "|---|---|", *listed])


_GENERATED = {
    "commands": _commands,
    "subject": lambda: _table(Subject),
    "model": lambda: _table(Model),
    "trial": lambda: _table(TrialFiles),
    "marker set": _marker_set,
    "settings": lambda: _table(Settings),
    "instruments": lambda: _table(InstrumentsFiles),
    "prior": lambda: _table(PriorFiles),
    "segment": lambda: _table(KnownSegment),
    "attached": lambda: _table(Attached),
    "diagnostics": lambda: _table(Diagnostics),
}


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")
