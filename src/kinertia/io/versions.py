"""States the versions of this package and of those that its numbers depend on."""

import contextlib
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

VERSION = version("kinertia")
_COMPUTES = ("kinertia", "numpy", "scipy", "numba", "ezc3d")


@cache
def versions() -> dict[str, str]:
    """Return the versions of all installed packages that numbers depend on."""
    installed = {"Python": platform.python_version()}
    for name in _COMPUTES:
        with contextlib.suppress(PackageNotFoundError):  # ezc3d, where it has no wheel
            installed[name] = version(name)
    return installed
