"""Make a page of evidence again, with the commit and day on it; or all."""

import ast
import subprocess
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import typer

from validation.page import REPOSITORY, made_at

EVIDENCE = (
    "accuracy",
    "faults",
    "populations",
    "sensitivity",
    "peers",
    "scoreboard",
    "measured-trials",
    "field-trials",
    "vicon-moments",
    "whole-stance",
    "functional-trials",
    "held-out",
    "sessions",
    "changes",
    "osim-models",
    "speed",
    "long-trials",
    "cohort-speed",
)
"""Commands that write a page of their name, in the order of `all`; that of cohort-speed reads the one before it."""
TOOLS = ("command-speed", "leg-moments", "recording-ends", "truth-trials", "synthetic-walk-table", "usual-build")
"""Commands that print, or write data."""


def application(only: str | None = None) -> typer.Typer:
    """Build the command line with all commands, or with one: dependencies of the others may not be installed."""
    app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, help=__doc__)
    app.command("all", help="Make all pages again, one after the other: hours.")(_make_all)
    for names, panel in ((EVIDENCE, "Evidence: each writes the page of its name"), (TOOLS, "Tools")):
        for name in names:
            module = name.replace("-", "_")
            command = import_module(f"validation.{module}").main if name == only else _not_loaded
            app.command(name, help=_first_line(module), rich_help_panel=panel)(command)
    return app


def _first_line(module: str) -> str:
    """Return the first line of the module's docstring, without importing it."""
    text = Path(__file__).with_name(f"{module}.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]


def _not_loaded() -> None:
    raise AssertionError


def _make_all() -> None:
    failed = []
    for name in EVIDENCE:
        print(f"== {name}", flush=True)
        if subprocess.run([sys.executable, "-m", "validation", name], cwd=REPOSITORY, check=False).returncode:
            failed.append(name)
    if failed:
        print(f"not made: {', '.join(failed)}", file=sys.stderr)
        raise typer.Exit(1)


def main(arguments: Sequence[str]) -> None:
    """Run the command line on these arguments."""
    made_at()  # before anything is computed
    known = arguments[0] if arguments and arguments[0] in EVIDENCE + TOOLS else None
    application(known)(args=list(arguments), prog_name="python -m validation")


if __name__ == "__main__":
    main(sys.argv[1:])
