"""Time whole processes; another checkout beside.

Times whole processes, `kinertia --version` and `kinertia fit`, next to the import of what they stand on.

Those of another checkout of the repository, as `git worktree add FOLDER COMMIT` makes it, can run by turns with those
of this one, and the last columns compare both. The yardstick is `python -c "import numpy, scipy.optimize, pandas"` in
the same run; by turns, so that all meet the same load of the machine, and the best of a few runs counts. Compiled
modules are kept, as pip keeps them. Processor time is told beside the time on the clock: on a busy machine it is the
steadier of the two.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from validation.measured_data import data_folder
from validation.measured_trials import table
from validation.walks import WALKS, fit_arguments

YARDSTICK = "import numpy, scipy.optimize, pandas"
FITTED = ("rajagopal", "gait2354")
"""Walks among WALKS."""


def commands(results: Path) -> dict[str, list[str]]:
    """Return command lines by their title in the table."""
    kinertia = [sys.executable, "-m", "kinertia"]
    fits = {
        f"`kinertia fit`, {WALKS[walk]}, with its report": [
            *kinertia,
            "fit",
            *fit_arguments(data_folder(), walk),
            "-o",
            str(results / walk),
            "--quiet",
        ]
        for walk in FITTED
    }
    return {
        f"`{YARDSTICK}`": [sys.executable, "-c", YARDSTICK],
        "`kinertia --version`": [*kinertia, "--version"],
        **fits,
    }


def spent(command: Sequence[str], before: Path | None = None) -> tuple[float, float]:
    """Return wall-clock and processor seconds of a process from its start to its end.

    Args:
        command: the command line.
        before: checkout whose package it runs; the installed one if None.

    Raises:
        subprocess.CalledProcessError: it fails; a fit with an open ERROR (status 1) does not count as failure.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    if before is not None:
        environment["PYTHONPATH"] = str(before / "src")
    used, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    status = subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=False).returncode
    clock, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    if status not in ((0, 1) if "fit" in command else (0,)):
        raise subprocess.CalledProcessError(status, command)
    return clock, after.ru_utime + after.ru_stime - used.ru_utime - used.ru_stime


def measured(runs: int, before: Path | None = None) -> tuple[dict[str, list[float]], int]:
    """Measure the best seconds (wall-clock, processor) of every command after one run that fills the caches, followed
    by those of the checkout `before`, if any; and the bytes of the first fit's report.
    """
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder)
        trees = [None] if before is None else [None, before.resolve(strict=True)]
        lines = commands(results)
        times = [
            {name: [seconds for tree in trees for seconds in spent(line, tree)] for name, line in lines.items()}
            for _ in range(runs + 1)
        ][1:]
        size = (results / FITTED[0] / "report.html").stat().st_size
    return {
        name: [min(column) for column in zip(*(seconds[name] for seconds in times), strict=True)] for name in lines
    }, size


def command_section(runs: int, before: Path | None = None) -> str:
    """Return every command's wall-clock and processor seconds, relative to the yardstick's; and the report's size."""
    seconds, size = measured(runs, before)
    yardstick = next(iter(seconds.values()))
    heading = ["process", "clock (s)", "ratio", "processor (s)", "ratio"]
    if before is not None:
        heading += ["clock before (s)", "now / before", "processor before (s)", "now / before"]
    rows = []
    for name, (clock, processor, *earlier) in seconds.items():
        cells = [clock, clock / yardstick[0], processor, processor / yardstick[1]]
        for now, then in zip((clock, processor), earlier, strict=False):
            cells += [then, now / then]
        rows.append([name, *(f"{cell:.2f}" for cell in cells)])
    return f"{table(heading, rows)}\n\nThe fit's report has {size / 1e6:.2f} MB."


def main(
    runs: Annotated[int, typer.Option(help="The best of so many runs counts.")] = 5,
    before: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Checkout to compare with.")] = None,
) -> None:
    """Measure and print the times."""
    print(command_section(runs, before))
