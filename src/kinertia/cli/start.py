"""Starts the command `kinertia`: answers `--version` at once, and loads only the command that is called.

A terminal or pipe that is not UTF-8, as on Windows, gets a question mark for every letter that it lacks.
"""

import atexit
import gc
import io
import os
import sys
import threading
from importlib.metadata import version

_NEW_OBJECTS = 100_000
"""After so many more than were freed, garbage is looked for: a fit makes arrays, which are few and large."""


def main() -> None:
    """Run the command line on the arguments of this process."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # Python itself handles errors
        sys.stdout.reconfigure(errors="replace")
    given = sys.argv[1:]
    if given == ["--version"]:
        print(version("kinertia"))
        return
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # otherwise every installed package is searched
    gc.disable()  # what is imported stays: looking through it for garbage, again and again, finds none
    from kinertia.cli.commands import application_for, run

    app = application_for(given)
    gc.freeze()
    gc.set_threshold(_NEW_OBJECTS)
    gc.enable()
    try:
        run(app, given)
    finally:
        gc.freeze()  # all of it ends with the process: Python need not look through it for garbage once more


def program() -> None:
    """Run `main` and end this process."""
    try:
        main()
    except SystemExit as end:
        _end(end.code)
        raise


def _end(status: object) -> None:
    """End this process without freeing every object first, unless something else is at work in it."""
    from kinertia.motion.workload import THREAD

    at_work = [thread for thread in threading.enumerate() if not thread.name.startswith(THREAD)]
    if len(at_work) > 1 or not isinstance(status, int):
        return
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except (OSError, ValueError):  # a closed pipe: Python has its own way to say so
        return
    os._exit(status)
