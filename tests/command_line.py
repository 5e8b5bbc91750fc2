"""Runs the command line as a user does."""

import contextlib
import io
import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinertia.cli.commands import main

PROGRAM = [sys.executable, "-m", "kinertia"]
"""The command in a process of its own: what a test that kills it, or talks to it, puts its arguments behind."""


@dataclass(frozen=True)
class Outcome:
    """What a command left behind: exit status, and the text on both streams."""

    status: int
    out: str
    err: str


def run(*arguments: object) -> Outcome:
    out, err = io.StringIO(), io.StringIO()
    status: Any = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = end.code
    return Outcome(0 if status is None else status, out.getvalue(), err.getvalue())


def run_apart(*arguments: object, encoding: str = "utf-8", **environment: str) -> Outcome:
    """The same in a process of its own, whose streams have this encoding."""
    known = os.environ | {"PYTHONIOENCODING": encoding} | environment
    done = subprocess.run(
        [*PROGRAM, *map(str, arguments)], env=known, capture_output=True, encoding=encoding, check=False
    )
    return Outcome(done.returncode, done.stdout, done.stderr)


def loaded_after(code: str) -> set[str]:
    """Names of all modules in a fresh interpreter once it has run this."""
    program = f"import json, sys\n{code}\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def loaded_by(*arguments: object) -> set[str]:
    """Names of all modules that the installed command has loaded when it ends."""
    given = ["kinertia", *map(str, arguments)]
    return loaded_after(
        f"sys.argv = {given!r}\nfrom kinertia.cli.start import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert end.code in (0, 1, None), end.code"
    )


@dataclass(frozen=True)
class Fitted:
    """A finished run: the folder, its fit.json, and what the terminal showed."""

    folder: Path
    summary: dict[str, Any]
    outcome: Outcome

    @property
    def trial(self) -> dict[str, Any]:
        (only,) = self.summary["trials"]
        return only


def fitted(folder: Path, *arguments: object) -> Fitted:
    outcome = run("fit", *arguments, "-o", folder)
    assert outcome.status in (0, 1), outcome.err  # 1: done, with a verdict against
    return Fitted(folder, json.loads((folder / "fit.json").read_text()), outcome)
