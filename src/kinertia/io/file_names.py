"""Makes names of files and folders valid on every system, and reads Windows paths elsewhere."""

import os
import re
import unicodedata
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from kinertia.findings.quantity import Quantity

_DEVICES = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9¹²³]) *", re.IGNORECASE)
_FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f]|[ .]$')
RESULT_FILES = ("fit.json", "report.html", "bsp.csv", "model.osim", "model_changes.csv")
"""Result files beside the folders of several trials."""
_DRIVE = re.compile(r"[A-Za-z]:[\\/]")


def fits_everywhere(name: str) -> bool:
    """Return whether a folder can have this name on Windows, macOS and Linux.

    Windows reserves the names of devices, with any extension (`nul.walk`), and drops dots and blanks at the end.
    """
    return bool(name) and not _FORBIDDEN.search(name) and not _DEVICES.fullmatch(name.partition(".")[0])


def same_folder(folder: str, other: str) -> bool:
    """Return whether two names are the same folder on some system: Windows and macOS ignore case."""
    return same_name_key(folder) == same_name_key(other)


def same_name_key(name: str) -> str:
    """Return a key that is equal for names of the same folder on some system."""
    return unicodedata.normalize("NFC", name).casefold()


def trouble_as_folders(trials: Sequence[str]) -> tuple[int, str] | None:
    """Return the first trial whose name cannot be a folder beside the earlier ones, and why."""
    for index, name in enumerate(trials if len(trials) > 1 else ()):
        if not fits_everywhere(name):
            return index, 'folders cannot have it on every system (no <>:"/\\|?*, no final dot or blank, no NUL)'
        if taken := next((file for file in RESULT_FILES if same_folder(file, name)), None):
            return index, f"the results have a file {taken}, not a folder"
        for before in trials[:index]:
            if same_folder(before, name):
                same = "" if before == name else "; Windows and macOS treat both as one folder"
                return index, f"trial '{before}' is there already{same}"
    return None


def last_part(written: str) -> str:
    """Return the name at the end of a path in any system's notation, without folders and drive."""
    return re.split(r"[\\/:]", written)[-1]


def path_from(folder: Path, written: str) -> Path:
    """Return a path as written in a file, relative to a folder; backslashes are separators unless a file has them."""
    path = folder / _at_home(written)
    # false, and not an error, where the system allows no such name
    return path if os.path.isfile(path) else folder / _at_home(written.replace("\\", "/"))


def _at_home(written: str) -> Path:
    """Replace ~ by the user's folder; unchanged where there is no such user."""
    try:
        return Path(written).expanduser()
    except RuntimeError:
        return Path(written)


def missing_file(path: Path, written: str, expected: str = "", is_folder: bool = False) -> dict[str, Quantity]:
    """Return evidence of F101: the file, the folder that was searched, and similar names in it.

    Args:
        path: path that leads to no file.
        written: the path as the user wrote it.
        expected: what it should be, in words.
        is_folder: whether it should be a folder: then names of files are no help.
    """
    folder = path.parent.absolute()
    exists = os.path.isdir(folder)
    beside = [entry for entry in folder.iterdir() if entry.is_dir() or not is_folder] if exists else []
    names = {entry.name.lower(): entry.name for entry in beside if entry.name[0] != "."}
    nearest = [names[near] for near in get_close_matches(path.name.lower(), sorted(names), n=3, cutoff=0.4)]
    hint = "nothing there has a similar name" if exists else "that folder does not exist"
    if nearest:
        hint = f"the nearest name{'s' * (len(nearest) > 1)} there: {', '.join(nearest)}"
    hint = _foreign_path(written) or hint
    if expected not in ("", "a file"):
        hint += f" (expected {expected})"
    evidence = {"nearest": Quantity(", ".join(nearest))} if nearest else {}
    words = {"file": _printable(path.name), "folder": _printable(str(folder)), "hint": hint}
    return evidence | {name: Quantity(text) for name, text in words.items()}


def _printable(text: str) -> str:
    return text if text.isprintable() else ascii(text)


def _foreign_path(written: str) -> str:
    """Explain why a path leads nowhere, where it is written in Windows' notation; empty if that is not the reason."""
    if any(ord(letter) < 32 for letter in written):
        return "the path has a tab or line end, which TOML makes of \\t and \\n in double quotes: write / instead of \\"
    if _DRIVE.match(written) and not Path(written).is_absolute():
        return f"drive {written[:2]} of Windows is not on this computer: give the path from here"
    return ""
