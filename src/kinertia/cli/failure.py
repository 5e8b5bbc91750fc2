"""Describes an internal error in one line, and writes a log file for the developers."""

import platform
import tempfile
import traceback
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from kinertia.errors import internal_error
from kinertia.io.subject.provenance import command_line
from kinertia.io.versions import VERSION

STATUS = 70
"""EX_SOFTWARE of sysexits.h: the fault is the program's."""
_PACKAGES = ("numpy", "scipy", "numba", "pandas", "ezc3d", "pydantic", "typer", "rich")


def failure_text(error: Exception, given: Sequence[str]) -> str:
    """Log an internal error of Kinertia, and describe it and where its log is."""
    return internal_error(error, _logged(error, given) or "this line and your command")


def _logged(error: Exception, given: Sequence[str]) -> Path | None:
    """Write the log file: command, versions and traceback; None where no file can be written."""
    text = "\n".join(
        [
            command_line(["kinertia", *given]),
            f"kinertia {VERSION}, Python {platform.python_version()}, {platform.platform()}",
            ", ".join(f"{name} {_version(name)}" for name in _PACKAGES),
            "",
            "".join(traceback.format_exception(error)),
        ]
    )
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="kinertia-failure-", suffix=".log", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write(text)
    except OSError:
        return None
    return Path(file.name)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "missing"
