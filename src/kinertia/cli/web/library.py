"""Manages the library: a folder per person, which the command line reads as well, and files dropped on the page.

    Kinertia/
        Anna/
            subject.toml, static.c3d, walk1.c3d, ...    what `kinertia fit` takes
            check/check.html                            what `kinertia check` wrote
            results/                                    what `kinertia fit` wrote
        comparison/compare.html                     what `kinertia compare --conditions` wrote

All that is known about a person is in the folder: there is no index that could contradict it.
"""

import json
import os
import shutil
import tempfile
import threading
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from kinertia.cohort.record import inputs_of
from kinertia.errors import FileError, KinertiaError
from kinertia.io.file_names import NEXUS_MEASURES, fits_everywhere, last_part, same_folder
from kinertia.io.output_folder import check_folder, write_then_rename
from kinertia.io.recording import FORCE_FILES, MARKER_FILES
from kinertia.io.subject.provenance import sha256
from kinertia.io.subject.reader import read_subject
from kinertia.io.working_folder import sole_use, sweep

SUBJECT, SUMMARY, OUTCOME, NORMS = "subject.toml", "fit.json", "outcome.json", "norms.csv"
LOG = "failure.log"
"""Log that a crash left for the developers."""
_RECORD, _LOCK = ".kinertia-person.json", ".kinertia-app.lock"
_STARTED, _INTERRUPTED = "started", "interrupted"
_LONGEST_NAME = 80
_NOTING = threading.Lock()
"""Check, fit and page note what they know of a person at the same time."""
LARGEST_FILE_MB, LARGEST_PERSON_MB, MOST_FILES = 500, 2000, 200
"""Limits of one file, of all files of a person, and of their number; pages state them."""
ENDINGS = tuple(dict.fromkeys((*MARKER_FILES, *FORCE_FILES, ".xml", ".osim", ".toml", NEXUS_MEASURES)))
LIMITS = {"file_mb": LARGEST_FILE_MB, "person_mb": LARGEST_PERSON_MB, "files": MOST_FILES, "endings": ENDINGS}
"""Limits as stated on pages."""
_LONGEST_NAME_BYTES, _LARGEST_TOML_MB = 150, 1


@dataclass(frozen=True)
class PersonFolder:
    """Folder of one person, named after the person."""

    folder: Path

    @property
    def name(self) -> str:
        """Name of the person in the library."""
        return self.folder.name

    @property
    def subject(self) -> Path:
        """Path of the subject file, which need not exist yet."""
        return self.folder / SUBJECT

    @property
    def check(self) -> Path:
        """Folder of check.html."""
        return self.folder / "check"

    @property
    def results(self) -> Path:
        """Folder of the results of the fit."""
        return self.folder / "results"

    @property
    def comparison(self) -> Path:
        """Folder of the comparison of two conditions."""
        return self.folder / "comparison"

    @property
    def fitted(self) -> bool:
        """Whether there are results."""
        return (self.results / SUMMARY).is_file()

    def files(self) -> list[Path]:
        """List the dropped files: everything but the subject file and remains of a crash."""
        return sorted(
            path
            for path in self.folder.iterdir()
            if path.is_file() and path.name not in (SUBJECT, LOG) and not path.name.startswith(".")
        )

    def changed(self) -> float:
        """Return when files or results last changed, seconds since 1970."""
        return max((self.folder / _RECORD).stat().st_mtime, self.folder.stat().st_mtime)

    @cached_property
    def inputs(self) -> str:
        """SHA-256 of the subject file's entries and the content of its files; empty where they cannot be read."""
        try:
            return inputs_of(read_subject(self.subject))
        except (KinertiaError, OSError):
            return ""

    def outcome(self, kind: str) -> dict[str, Any]:
        """Return the outcome that the last check, fit or comparison left; empty without, or if of other results."""
        outcome = _json(getattr(self, kind) / OUTCOME)
        summary = self.results / SUMMARY
        if kind != "check" and (not summary.is_file() or outcome.get("summary") != sha256(summary)):
            return {}
        return outcome

    def notes(self) -> dict[str, Any]:
        """Return other notes: how a check and a fit that left no files ended, and which files were seen."""
        return _json(self.folder / _RECORD)

    def note(self, **values: Any) -> None:
        """Add these values to the notes."""
        with _NOTING:
            write_then_rename(
                self.folder / _RECORD, json.dumps({**self.notes(), **values}, indent=1, default=str) + "\n"
            )


class Library:
    """All people in a folder."""

    def __init__(self, folder: Path) -> None:
        """Open the library, making the folder if necessary.

        Raises:
            FileError: it cannot be written to.
        """
        self.folder = folder.absolute()
        check_folder(self.folder / "person")
        self.folder.mkdir(parents=True, exist_ok=True)

    @property
    def norms(self) -> Path:
        """Path of the laboratory's norms, which need not exist."""
        return self.folder / NORMS

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Lock the library during the block; jobs that an earlier process did not finish are noted as interrupted.

        Raises:
            FileError: another process has it open.
        """
        with sole_use(self.folder / _LOCK, f"the library {self.folder}"):
            sweep(self.folder)
            for person in self.people():
                sweep(person.folder)
                ended = [kind for kind, how in person.notes().items() if how == {"how": _STARTED}]
                if ended:
                    person.note(**{kind: {"how": _INTERRUPTED} for kind in ended})
            yield

    def people(self) -> list[PersonFolder]:
        """List all people, most recently changed first."""
        found = [
            PersonFolder(path) for path in self.folder.iterdir() if (path / _RECORD).is_file() and not path.is_symlink()
        ]
        return sorted(found, key=PersonFolder.changed, reverse=True)

    def person(self, name: str) -> PersonFolder | None:
        """Find the person of this name; names are compared, so that none leads out of the library."""
        return next((person for person in self.people() if person.name == name), None)

    def add(self, wanted: str) -> PersonFolder:
        """Add a new person with this name, or a similar one that is free."""
        person = PersonFolder(self.folder / self._free(_folder_name(wanted) or "Person"))
        person.folder.mkdir()
        person.note()
        return person

    def rename(self, person: PersonFolder, wanted: str) -> PersonFolder:
        """Rename a person to this name, or a similar one that is free; unchanged if nothing valid is left of it.

        Raises:
            FileError: a file is open in another program.
        """
        name = self._free(_folder_name(wanted) or person.name, but=person.name)
        try:
            os.rename(person.folder, self.folder / name)
        except OSError as error:
            problem = f"cannot be renamed ({error.strerror}); close the program that has one of its files open"
            raise FileError(person.folder, problem) from error
        return PersonFolder(self.folder / name)

    def _free(self, base: str, but: str = "") -> str:
        """Return this name, with a number where it is taken by another folder than `but`."""
        taken = [path.name for path in self.folder.iterdir() if path.name != but]
        name, number = base, 1
        while any(same_folder(name, other) for other in taken):
            number += 1
            name = f"{base} {number}"
        return name

    def delete(self, person: PersonFolder) -> None:
        """Delete a person's files and results, all at once.

        Raises:
            FileError: a file is open in another program.
        """
        aside = self.folder / f".deleted {person.name}"
        try:
            os.rename(person.folder, aside)
            shutil.rmtree(aside)
        except OSError as error:
            problem = f"cannot be deleted ({error.strerror}); close the program that has one of its files open"
            raise FileError(person.folder, problem) from error


def _folder_name(wanted: str) -> str:
    """Return a name that a folder can have on every system; empty if nothing is left of it."""
    cleaned = "".join(letter if letter.isalnum() or letter in " -_.,()" else " " for letter in wanted)
    cleaned = " ".join(cleaned.split())[:_LONGEST_NAME].strip(" .")
    return cleaned if fits_everywhere(cleaned) else ""


def started() -> Mapping[str, str]:
    """Return the note of a check or fit that has begun."""
    return {"how": _STARTED}


def _json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def harmless_name(given: str) -> str:
    """Return the name of a file without the folders before it.

    Raises:
        FileError: it cannot be a file's name on every system, or is hidden, or Kinertia does not read its kind.
    """
    name = last_part(given)
    shown = name[:_LONGEST_NAME_BYTES] or given[:_LONGEST_NAME] or "a file without a name"
    sound = fits_everywhere(name) and name.isprintable() and len(name.encode()) <= _LONGEST_NAME_BYTES
    if name.startswith(".") or not sound:
        raise FileError(
            shown,
            "not accepted: a file's name must be valid on every system (none of < > : \" / \\ | ? *, no dot first or "
            f"last, no device of Windows, at most {_LONGEST_NAME_BYTES} bytes); rename it",
        )
    suffix = Path(name).suffix.lower()
    if suffix == ".zip":
        raise FileError(name, "not accepted: archives are not unpacked here; unpack it and drop the folder")
    if suffix not in ENDINGS:
        kind = f"a '{suffix}' file" if suffix else "a file without an ending"
        raise FileError(name, f"not accepted: {kind} is none that Kinertia reads; those are {', '.join(ENDINGS)}")
    return name


async def receive(person: PersonFolder, given: str, chunks: AsyncIterator[bytes]) -> Path:
    """Write a dropped file to the person's folder, complete or not at all; one of the same name is replaced.

    Raises:
        FileError: the name or the size is not accepted.
    """
    name = harmless_name(given)
    files = [path for path in person.files() if not same_folder(path.name, name)]
    if len(files) >= MOST_FILES:
        raise FileError(name, f"not accepted: {len(files)} files are here, the most of one person; remove some")
    left = 1_000_000 * LARGEST_PERSON_MB - sum(path.stat().st_size for path in files)
    text = name.lower().endswith(".toml")
    largest_mb, what = (_LARGEST_TOML_MB, "a TOML file") if text else (LARGEST_FILE_MB, "one file")
    handle, temporary = tempfile.mkstemp(dir=person.folder, prefix=".upload.")
    try:
        with os.fdopen(handle, "wb") as file:
            async for chunk in chunks:
                left -= len(chunk)
                if file.tell() + len(chunk) > 1_000_000 * largest_mb:
                    raise FileError(name, f"not accepted: larger than {largest_mb} MB, the most of {what}")
                if left < 0:
                    raise FileError(name, f"not accepted: all files of a person have {LARGEST_PERSON_MB} MB at most")
                file.write(chunk)
        os.replace(temporary, person.folder / name)
    except BaseException:
        os.unlink(temporary)
        raise
    return person.folder / name
