"""Keeps the names that options and commands had in the previous version working, with a notice."""

from collections.abc import Sequence

from kinertia.cli.terminal import err
from kinertia.errors import KinertiaError

RENAMED = {"--force": "--overwrite"}
"""Old names, each with what it is called now; they go with the next version."""

MOVED = {f"study {name}": f"python -m validation {name}" for name in ("accuracy", "faults", "populations")}
"""Commands that are no longer installed, each with what to run in a clone of the repository."""


def as_named_now(given: Sequence[str]) -> list[str]:
    """Replace old names of options among these arguments, with a notice on standard error.

    Raises:
        KinertiaError: the command is no longer installed.
    """
    command = " ".join(given[:2])
    if command in MOVED:
        raise KinertiaError(f"kinertia {command} moved to the repository: run {MOVED[command]} in a clone of it")
    for old in [name for name in RENAMED if name in given]:
        err.print(f"{old} is now {RENAMED[old]}; the old name will be removed in the next version")
    return [RENAMED.get(one, one) for one in given]
