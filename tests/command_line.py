"""Runs the command line as a user does, and knows the command for each measured trial."""

from __future__ import annotations

import contextlib
import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinertia.cli import main


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
    assert outcome.status == 0, outcome.err
    return Fitted(folder, json.loads((folder / "fit.json").read_text()), outcome)


def measured_trial(data: Path, name: str) -> list[object]:
    """The arguments of `kinertia fit` for one of the four measured walks."""
    if name == "gait2354":
        walk = data / "gait2354" / "subject01_walk1"
        files = [f"{walk}.trc", "--forces", f"{walk}_grf.mot", "--loads", f"{walk}_grf.xml"]
        person = ["--static", data / "gait2354" / "subject01_static.trc", "--mass", 72.6, "--height", 1.803]
        return [*files, *person, "--sex", "male"]
    if name == "rajagopal":
        lab = data / "rajagopal_walk"
        files = [lab / "motion_capture_walk.trc", "--forces", lab / "grf_walk.mot", "--loads", lab / "grf_walk.xml"]
        return [*files, "--static", lab / "static_walk_1.trc", "--mass", 85, "--height", 1.83, "--sex", "male"]
    walk, static = (data / "pig_c3d" / f"subject_{name[-1]}_{kind}.c3d" for kind in ("walk", "static"))
    person = ["--mass", 41.5, "--height", 1.61, "--sex", "male"] if name == "pig_a" else ["--sex", "female"]
    return [walk, "--static", static, *person]
