"""Records where a result comes from: command, files with their hashes, and versions."""

import hashlib
import os
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath

from kinertia.io.subject.tables import SubjectFile


@dataclass(frozen=True)
class Provenance:
    """Everything needed to repeat a result.

    Attributes:
        command: command as typed on a command line.
        files: SHA-256 of every input file, by its path from the folder that holds them all.
        trials: path of each trial's markers, as in `files`.
    """

    command: str
    files: Mapping[str, str]
    trials: Mapping[str, str] = field(default_factory=dict)


def provenance_of(wanted: SubjectFile, command: str) -> Provenance:
    """Collect the command and the hashes of all files in the subject file."""
    model, prior = wanted.model, wanted.prior
    others = (wanted.instruments.session, prior.bsp, prior.population, prior.measures)
    paths = [path for path in (model.static, model.osim, model.markers, *others) if isinstance(path, Path)]
    for trial in wanted.trials:
        paths += [path for path in (trial.markers, trial.forces, trial.loads) if path is not None]
        paths += [trial.belt_speed_m_s] if isinstance(trial.belt_speed_m_s, Path) else []
    names = names_from_common_folder(paths)
    by_path = dict(zip(paths, names, strict=True))
    trials = {trial.name: by_path[trial.markers] for trial in wanted.trials}
    return Provenance(command, {name: sha256(path) for path, name in by_path.items()}, trials)


def recordings(wanted: SubjectFile) -> tuple[str, ...]:
    """Return the SHA-256 of the person's static trial or model and gait trials: files that no other person has."""
    paths = [wanted.model.static, wanted.model.osim, *(trial.markers for trial in wanted.trials)]
    return tuple(sha256(path) for path in paths if path is not None)


def names_from_common_folder(paths: Sequence[PurePath]) -> list[str]:
    """Return each path relative to their common folder; whole paths where there is none, as on two Windows drives."""
    above = next((folder for folder in paths[0].parents if all(path.is_relative_to(folder) for path in paths)), None)
    return [(path if above is None else path.relative_to(above)).as_posix() for path in paths]


def command_line(words: Sequence[str], windows: bool = os.name == "nt") -> str:
    """Join words to one line that a shell splits into these again: cmd and PowerShell do not support POSIX single
    quotes."""
    return subprocess.list2cmdline(words) if windows else shlex.join(words)


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
