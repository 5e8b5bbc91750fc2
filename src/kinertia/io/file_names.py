"""Makes names of files and folders valid on every system, matches files by them, and quotes them for shells."""

import difflib
import os
import re
import shlex
import subprocess
import sys
import unicodedata
from collections.abc import Sequence
from pathlib import Path

_DEVICES = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9¹²³]) *", re.IGNORECASE)
_FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f]|[ .]$')

PYTHON = (sys.executable, "-P")
"""Python which imports nothing from the folder that it is started in: a file coverage.py there is somebody's data."""
NEXUS_MEASURES = ".mp"
"""Ending of the measures that Vicon Nexus keeps beside a person's recordings."""
RESULT_FILES = ("fit.json", "report.html", "bsp.csv", "model.osim", "model_changes.csv")
"""Result files beside the folders of several trials."""


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


def command_line(words: Sequence[str], windows: bool = os.name == "nt") -> str:
    """Join words to one line that a shell splits into these again: cmd and PowerShell do not support POSIX single
    quotes."""
    return subprocess.list2cmdline(words) if windows else shlex.join(words)


def matched_by_name(wanting: Sequence[Path], offered: Sequence[Path]) -> dict[Path, Path]:
    """Match files by the longest common part of their names, the best pair first; each file once.

    First come names that have the other as a whole word, however short: DJ1 and DJ1_forces, but not DJ12. Of others at
    least four letters must agree, unless there is one file on each side.
    """
    scores = {}
    for wants in wanting:
        for offers in offered:
            wanted, other = wants.stem.lower(), offers.stem.lower()
            matcher = difflib.SequenceMatcher(None, wanted, other, autojunk=False)
            scores[wants, offers] = (_has_word(other, wanted), matcher.find_longest_match().size, matcher.ratio())
    least = 0 if len(wanting) == len(offered) == 1 else 4
    pairs: dict[Path, Path] = {}
    for (wants, offers), score in sorted(scores.items(), key=lambda item: item[1], reverse=True):
        if (score[0] or score[1] >= least) and wants not in pairs and offers not in pairs.values():
            pairs[wants] = offers
    return pairs


def _has_word(text: str, word: str) -> bool:
    return re.search(rf"(?<![a-z0-9]){re.escape(word)}(?![a-z0-9])", text) is not None
