"""Records where a result comes from: command, files with their hashes, versions; finds these files again."""

import hashlib
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath, PurePosixPath

from kinertia.errors import FileError
from kinertia.io.recording import MARKER_FILES
from kinertia.io.subject.person_recordings import session_date
from kinertia.io.subject.tables import SubjectFile


@dataclass(frozen=True)
class Provenance:
    """Everything needed to repeat a result.

    Attributes:
        command: command as typed on a command line.
        files: SHA-256 of every input file, by its path from the folder that holds them all.
        trials: path of each trial's markers, as in `files`.
        date: day of the recording, as 2026-05-03; empty where unknown.
    """

    command: str
    files: Mapping[str, str]
    trials: Mapping[str, str] = field(default_factory=dict)
    date: str = ""


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
    hashes = {name: sha256(path) for path, name in by_path.items()}
    return Provenance(command, hashes, trials, str(session_date(wanted) or ""))


def recordings(wanted: SubjectFile) -> tuple[str, ...]:
    """Return the SHA-256 of the person's static trial or model and gait trials: files that no other person has."""
    paths = [wanted.model.static, wanted.model.osim, *(trial.markers for trial in wanted.trials)]
    return tuple(sha256(path) for path in paths if path is not None)


def names_from_common_folder(paths: Sequence[PurePath]) -> list[str]:
    """Return each path relative to their common folder; whole paths where there is none, as on two Windows drives."""
    above = next((folder for folder in paths[0].parents if all(path.is_relative_to(folder) for path in paths)), None)
    return [(path if above is None else path.relative_to(above)).as_posix() for path in paths]


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def trial_file(provenance: Provenance | None, name: str, results: Path, recordings: Path | None) -> Path:
    """Find the file with the markers of a trial.

    Searches `recordings` if given, else the folder of the results, `lab` there (the demo's) and above it, the working
    folder, and the folders used by the fit. Of several files of its name, the one whose content was fitted is returned.

    Args:
        provenance: provenance of the fit; None if it was saved from Python, where only its name is known.
        name: name of the trial.
        results: folder of the fit.
        recordings: folder of the files.

    Raises:
        FileError: it is missing, or has changed since.
    """
    stated = None if provenance is None else provenance.trials.get(name)
    if provenance is None or stated is None:
        named = [Path(file) for file in (provenance.files if provenance else ()) if PurePosixPath(file).stem == name]
        names = [str(path) for path in named] or [name + kind for kind in MARKER_FILES]
    else:
        names = [stated]
    folders = [recordings] if recordings is not None else list(_folders(provenance, results))
    found = [path for path in _candidates(folders, names) if path.is_file()]
    if not found:
        hint = "give the folder of the recordings with --recordings"
        raise FileError(names[0], f"the recording of trial {name} is not found; {hint}")
    hashes = set(provenance.files.values()) if provenance is not None else set()
    same = [path for path in found if not hashes or sha256(path) in hashes]
    if not same:
        raise FileError(found[0], f"has changed since trial {name} was fitted; fit it again, or give --recordings")
    return same[0]


def _folders(provenance: Provenance | None, results: Path) -> Iterator[Path]:
    whole = results.resolve()
    yield from (whole, whole / "lab", *whole.parents[:3], Path.cwd())
    words: Sequence[str] = ()
    if provenance is not None:
        words = shlex.split(provenance.command, posix="\\" not in provenance.command)
    for word in words:
        path = Path(word.strip('"'))
        if path.exists():
            yield path.resolve() if path.is_dir() else path.resolve().parent


def _candidates(folders: Sequence[Path], names: Sequence[str]) -> Iterator[Path]:
    for name in names:
        for folder in folders:
            yield folder / name
            yield folder / PurePosixPath(name).name
