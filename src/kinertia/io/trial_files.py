"""Finds the files of a finished fit again, by their names and hashes."""

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

from kinertia.errors import FileError
from kinertia.io.recording import MARKER_FILES
from kinertia.io.subject.provenance import Provenance, sha256


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
