"""Where a result comes from: the command, the files with their hashes, and the versions that computed it."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from kinertia.io.subject_file import SubjectFile

VERSION = version("kinertia")
_COMPUTES = ("kinertia", "numpy", "scipy", "pin", "ezc3d")


@dataclass(frozen=True)
class Provenance:
    """What it takes to repeat a result.

    Attributes:
        command: as typed on a command line.
        files: SHA-256 of every input file, by its path from the folder that holds them all.
    """

    command: str
    files: Mapping[str, str]


def provenance_of(wanted: SubjectFile, command: str) -> Provenance:
    """The command with the hashes of all files that the subject file names."""
    model = wanted.model
    paths = [path for path in (model.static, model.osim, model.markers) if isinstance(path, Path)]
    for trial in wanted.trials:
        paths += [path for path in (trial.markers, trial.forces, trial.loads) if path is not None]
    above = os.path.commonpath([path.parent for path in paths])
    return Provenance(command, {path.relative_to(above).as_posix(): _sha256(path) for path in paths})


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def versions() -> dict[str, str]:
    """Versions of everything that numbers depend on."""
    return {"Python": platform.python_version(), **{name: version(name) for name in _COMPUTES}}
