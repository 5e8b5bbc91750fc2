"""Accepts files that are dropped on the page: with harmless names, and of limited size."""

import os
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path

from kinertia.cli.web.library import PersonFolder
from kinertia.errors import FileError
from kinertia.io.file_names import fits_everywhere, last_part, same_folder
from kinertia.io.recording import FORCE_FILES, MARKER_FILES

LARGEST_FILE_MB, LARGEST_PERSON_MB, MOST_FILES = 500, 2000, 200
"""Limits of one file, of all files of a person, and of their number; pages state them."""
ENDINGS = tuple(dict.fromkeys((*MARKER_FILES, *FORCE_FILES, ".xml", ".osim", ".toml")))
LIMITS = {"file_mb": LARGEST_FILE_MB, "person_mb": LARGEST_PERSON_MB, "files": MOST_FILES, "endings": ENDINGS}
"""Limits as stated on pages."""
_LONGEST_NAME, _LARGEST_TOML_MB = 150, 1


def harmless_name(given: str) -> str:
    """Return the name of a file without the folders before it.

    Raises:
        FileError: it cannot be a file's name on every system, or is hidden, or Kinertia does not read its kind.
    """
    name = last_part(given)
    shown = name[:_LONGEST_NAME] or given[:_LONGEST_NAME] or "a file without a name"
    sound = fits_everywhere(name) and name.isprintable() and len(name.encode()) <= _LONGEST_NAME
    if name.startswith(".") or not sound:
        raise FileError(
            shown,
            "not accepted: a file's name must be valid on every system (none of < > : \" / \\ | ? *, no dot first or "
            f"last, no device of Windows, at most {_LONGEST_NAME} bytes); rename it",
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
