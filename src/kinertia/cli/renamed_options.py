"""Options that had another name in the version before: they still work, with a notice."""

from __future__ import annotations

from collections.abc import Sequence

from kinertia.cli.terminal import err

RENAMED = {"--force": "--overwrite"}
"""Old names, each with what it is called now; they go with the next version."""


def as_named_now(given: Sequence[str]) -> list[str]:
    """Replace old names of options among these arguments, and say so on standard error."""
    for old in [name for name in RENAMED if name in given]:
        err.print(f"{old} is called {RENAMED[old]} now; the old name goes with the next version")
    return [RENAMED.get(one, one) for one in given]
