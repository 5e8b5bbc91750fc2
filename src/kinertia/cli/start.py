"""The command `kinertia`: answers `--version` at once, and loads the commands for everything else."""

from __future__ import annotations

import sys
from importlib.metadata import version


def main() -> None:
    """Run the command line on the arguments of this process."""
    if sys.argv[1:] == ["--version"]:
        print(version("kinertia"))
        return
    from kinertia.cli.app import main as run

    run()
