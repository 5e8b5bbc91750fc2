"""Times whole processes, `kinertia --version` and `kinertia fit`, next to the import of what they stand on.

    python benchmarks/command_speed.py

The yardstick is `python -c "import numpy, scipy.optimize, pandas"` in the same run; by turns, so that all meet the same
load of the machine, and the best of a few runs counts. Compiled modules are kept, as pip keeps them. Processor time is
told beside the time on the clock: on a busy machine it is the steadier of the two.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from measured_data import data_folder
from measured_trials import table
from walks import WALKS, fit_arguments

YARDSTICK = "import numpy, scipy.optimize, pandas"


def commands(results: Path) -> dict[str, list[str]]:
    """Command lines by what the table calls them."""
    kinertia = [sys.executable, "-m", "kinertia"]
    fit = ["fit", *fit_arguments(data_folder(), "rajagopal"), "-o", str(results), "--quiet"]
    return {
        f"`{YARDSTICK}`": [sys.executable, "-c", YARDSTICK],
        "`kinertia --version`": [*kinertia, "--version"],
        f"`kinertia fit`, {WALKS['rajagopal']}, with its report": [*kinertia, *fit],
    }


def spent(command: Sequence[str]) -> tuple[float, float]:
    """Seconds on the clock and of the processor that a process takes from its start to its end.

    Raises:
        subprocess.CalledProcessError: it fails; a fit of which a check fails (status 1) is done all the same.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    status = subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=False).returncode
    clock, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    if status not in ((0, 1) if "fit" in command else (0,)):
        raise subprocess.CalledProcessError(status, command)
    return clock, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measured(runs: int) -> tuple[dict[str, tuple[float, float]], int]:
    """Best seconds (clock, processor) of every command after one run that fills the caches; bytes of the report."""
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "out"
        lines = commands(results)
        times = [{name: spent(line) for name, line in lines.items()} for _ in range(runs + 1)][1:]
        size = (results / "report.html").stat().st_size
    return {name: (min(one[name][0] for one in times), min(one[name][1] for one in times)) for name in lines}, size


def command_section(runs: int) -> str:
    """Seconds of every command on the clock and of the processor, over those of the yardstick; the report's size."""
    seconds, size = measured(runs)
    clock, processor = next(iter(seconds.values()))
    rows = [
        [name, f"{one[0]:.2f}", f"{one[0] / clock:.2f}", f"{one[1]:.2f}", f"{one[1] / processor:.2f}"]
        for name, one in seconds.items()
    ]
    heading = ["process", "clock (s)", "ratio", "processor (s)", "ratio"]
    return f"{table(heading, rows)}\n\nThe fit's report has {size / 1e6:.2f} MB."


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--runs", type=int, default=5, help="the best of so many runs counts")
    print(command_section(parser.parse_args().runs))


if __name__ == "__main__":
    main()
