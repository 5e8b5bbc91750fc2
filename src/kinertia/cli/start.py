"""The command `kinertia`: answers `--version` at once, and loads the commands for everything else.

A terminal or pipe that is not UTF-8, as on Windows, gets a question mark for every letter that it lacks.
"""

from __future__ import annotations

import io
import sys
from importlib.metadata import version


def main() -> None:
    """Run the command line on the arguments of this process."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # of errors Python itself takes care
        sys.stdout.reconfigure(errors="replace")
    if sys.argv[1:] == ["--version"]:
        print(version("kinertia"))
        return
    from kinertia.cli.app import main as run

    run()
