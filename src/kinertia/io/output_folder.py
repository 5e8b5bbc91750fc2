"""Writes result folders that appear complete or not at all, and never overwrite other files unasked."""

import ctypes
import json
import os
import shutil
import signal
import sys
import threading
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from kinertia.errors import FileError
from kinertia.io.working_folder import BEFORE, sweep, working_folder

GENERATOR = '<meta name="generator" content="kinertia'
"""Tag in the head of every HTML page that is a result of its own."""
_TELLING = (".json", ".html")
"""Types of the result files that name Kinertia as what made them."""
_WRITTEN = ".kinertia.json"
"""File that lists Kinertia's files in a folder that it wrote to, by kind of result."""
INTERRUPTIONS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)
)
"""Ctrl-C, the request to end, and the end of the terminal, where the system has them."""
_OWN = ".kinertia"
"""Prefix of hidden files that Kinertia keeps beside results: lists, locks, and unfinished results."""
_ANYWHERE = {".DS_Store", ".localized", ".directory", ".gitkeep", ".gitignore", "desktop.ini", "Thumbs.db"}
"""Files that file managers and Git leave in folders that hold nothing else."""
_RESULTS = {".html", ".json", ".csv", ".osim", ".sto", ".mot", ".trc", ".c3d", ".xml", ".toml", ".md", ".png"}
"""Types of files that results have."""
_HERE = -100
"""AT_FDCWD of Linux: paths count from the current folder."""
_EXCHANGE = 2
"""RENAME_EXCHANGE of Linux, RENAME_SWAP of macOS."""


def check_folder(folder: str | Path, sub_folders: Collection[str] = (), files: Collection[str] = ()) -> None:
    """Raise FileError unless results can be written to `folder`, which need not exist yet.

    Call it before a long computation. It also removes what killed runs left beside the folder.

    Args:
        folder: folder that is replaced as a whole when results are complete, with everything else in it.
        sub_folders: names in it that results need as folders.
        files: names of results that are already known.
    """
    folder = _real(folder)
    _expect_place(folder)
    if not folder.is_dir():
        return
    _expect_nothing_of_others(folder, files, _written(folder))
    for path in folder.rglob("*"):
        if path.is_dir() and path.suffix.lower() in _RESULTS and path.name not in sub_folders:
            raise FileError(path, "is a folder where a file of the results may go; rename it, or give another folder")
        if path.is_file() and path.parent == folder and path.name in sub_folders:
            raise FileError(path, "is a file where a folder of the results goes; rename it, or give another folder")
    if sys.platform == "win32" and (held := _open_elsewhere(folder)):
        raise FileError(held[0], "is open in another program; close it there, and try again")


def _expect_place(folder: Path) -> None:
    """Raise FileError unless a folder can be made or replaced here; its content is not read."""
    parent = _existing(folder.parent)
    for place in (parent, folder):
        if place.exists() and not place.is_dir():
            raise FileError(place, "is a file; give a folder for the results")
    sweep(parent)
    with working_folder(parent):  # Windows does not tell otherwise whether that is allowed
        pass
    if folder.is_dir() and not os.access(folder, os.W_OK):
        raise FileError(folder, "cannot be written to; give another folder for the results")
    if folder.is_dir() and (trouble := _irreplaceable(folder)):
        problem = f"{trouble}, and results replace their folder as a whole; give a folder inside it ({folder / 'out'})"
        raise FileError(folder, problem)


def _real(folder: str | Path) -> Path:
    """Return the folder itself where the path is a link to it."""
    return Path(os.path.realpath(folder))


def _irreplaceable(folder: Path) -> str:
    """Return why a folder cannot be replaced by another; empty if it can."""
    here = Path.cwd().resolve()
    if folder == here or folder in here.parents:
        return "is the current folder, or contains it"
    if folder == _real(os.path.expanduser("~")):
        return "is your home folder"
    if os.path.ismount(folder):
        return "is a drive or mounted folder"
    return ""


def _open_elsewhere(folder: Path) -> list[Path]:
    """List files that another program has open, as Windows reports."""
    held = []
    for path in sorted(folder.rglob("*")):
        try:
            if path.is_file():
                path.open("r+b").close()
        except OSError:
            held.append(path)
    return held


def expect_own_folder(folder: str | Path, otherwise: str = "") -> None:
    """Raise FileError where `folder` holds files and none of them states that Kinertia wrote the results there.

    Hidden files count, but for those that systems and programs leave in any folder. Subfolders are not read, so that it
    answers at once: call it before `check_folder`.

    Args:
        folder: need not exist yet.
        otherwise: what can be done instead of giving another folder, as the end of the error's sentence.
    """
    folder = Path(folder)
    _expect_place(_real(folder))
    if not folder.is_dir() or (folder / _WRITTEN).is_file():
        return
    found = [path.name for path in folder.iterdir() if not path.name.startswith(_OWN) and path.name not in _ANYWHERE]
    names = sorted(found, key=lambda name: (name.startswith("."), name))
    if names and not _has_results(folder):
        listed = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        problem = f"holds files that are not results of Kinertia ({listed}); give another folder{otherwise}"
        raise FileError(folder, problem)


def _has_results(folder: Path) -> bool:
    """Return whether a file in a folder states that Kinertia made it."""
    return any(_says_kinertia(path) for path in folder.iterdir() if path.suffix in _TELLING)


def _says_kinertia(path: Path) -> bool:
    """Return whether a file exists and states that Kinertia made it."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
    if path.suffix == ".html":
        return GENERATOR in text[:2000]
    try:
        content = json.loads(text)
    except ValueError:
        return False
    return isinstance(content, dict) and "kinertia" in content


def _existing(folder: Path) -> Path:
    """Return the folder itself, or the nearest existing one above it."""
    places = (folder.absolute(), *folder.absolute().parents)
    existing = next((path for path in places if path.exists()), None)
    if existing is None:
        raise FileError(folder, "on a drive or share that is not there; give another folder for the results")
    return existing


@contextmanager
def complete_folder(folder: str | Path, kind: str) -> Iterator[Path]:
    """Yield a hidden folder for new results, which replace those in `folder` when the block ends without an error.

    They replace all files of the last results of this kind, not only those with the same names; other files in `folder`
    stay. The folder is replaced as a whole and at once: even if this process is killed, it holds either the old results
    or the new ones. After an error or an interruption everything is as it was; an interruption while folders are being
    exchanged takes effect after that.

    Args:
        folder: folder of the results, made if necessary.
        kind: what they are results of, "fit" for one; results of other kinds stay.

    Raises:
        FileError: the folder cannot be written to or replaced.
    """
    folder = _real(folder)
    check_folder(folder)
    try:
        with working_folder(_existing(folder.parent)) as work:
            new = work / "new"
            new.mkdir()
            yield new
            with _uninterrupted():
                _replace(new, folder, kind, work / BEFORE / folder.name)
    except OSError as error:
        said = error.strerror or str(error)
        problem = f"cannot be written ({said}); nothing in it has changed: make room, or give another folder"
        raise FileError(folder, problem) from error


@contextmanager
def updated_files(folder: Path, kind: str, optional: Collection[str]) -> Iterator[Path]:
    """Yield a hidden folder whose files replace those in `folder` when the block ends without an error.

    Args:
        folder: folder of complete results, which stay but for these files.
        kind: what they are results of; the files belong to them from then on, and go when they are replaced.
        optional: names of files that are removed where an earlier update wrote them and this one does not.

    Raises:
        FileError: the folder cannot be written to.
    """
    with working_folder(folder) as work:
        new = work / "new"
        new.mkdir()
        yield new
        names, listed = _files(new), _written(folder)
        listed_names = set(listed.get(kind, ()))
        gone = listed_names & set(optional) - names
        if listed or names & set(optional):
            text = json.dumps({**listed, kind: sorted((listed_names | names) - gone)}, indent=1) + "\n"
            (new / _WRITTEN).write_text(text, encoding="utf-8")
        with _uninterrupted():
            for name in sorted(_files(new)):
                os.replace(new / name, folder / name)
            for name in gone:
                (folder / name).unlink(missing_ok=True)


def _replace(new: Path, folder: Path, kind: str, aside: Path) -> None:
    """Complete `new` with the lists of files and with what stays in `folder`, and put it there."""
    written = _written(new)
    others = {name for names in written.values() for name in names}
    written[kind] = sorted(_files(new) - others - {_WRITTEN})
    listed = _written(folder)
    _expect_nothing_of_others(folder, _files(new), listed)
    old = {name for written_kind in written for name in listed.get(written_kind, ())} | {_WRITTEN}
    everything = {
        **{written_kind: names for written_kind, names in listed.items() if written_kind not in written},
        **written,
    }
    (new / _WRITTEN).write_text(json.dumps(everything, indent=1) + "\n", encoding="utf-8")
    try:
        staying = _files(folder) - old - _files(new)
        for name in sorted(staying):
            _link(folder / name, new / name)
        if folder.is_dir():
            shutil.copystat(folder, new)
        folder.parent.mkdir(parents=True, exist_ok=True)
        before = put_in_place(new, folder, aside)
    except OSError as error:
        held = _open_elsewhere(folder) if sys.platform == "win32" else []
        problem = (
            f"cannot be replaced ({error.strerror}): nothing was written; close the program that has it or one of its "
            "files open, and try again"
        )
        raise FileError(held[0] if held else folder, problem) from error
    for name in _files(before) - staying - old - _files(folder):  # came in the meantime
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        os.replace(before / name, folder / name)


def _expect_nothing_of_others(folder: Path, names: Collection[str], listed: Mapping[str, Sequence[str]]) -> None:
    """Raise FileError if one of these files is there already from elsewhere, like a recording or the user's own model.

    Results that were copied without their hidden list count as Kinertia's.
    """
    if not folder.is_dir() or (not listed and _has_results(folder)):
        return
    ours = {_WRITTEN, *(name for of_kind in listed.values() for name in of_kind)}
    if foreign := sorted((_files(folder) & set(names)) - ours):
        problem = "is a file of yours that a result of this name would replace; nothing was written"
        raise FileError(folder / foreign[0], f"{problem}: give another folder, or rename the file")


def _written(folder: Path) -> dict[str, list[str]]:
    """Return files that Kinertia wrote to this folder, by kind; none where it is not stated."""
    try:
        written = json.loads((folder / _WRITTEN).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(written, dict):
        return {}
    return {kind: [str(name) for name in names] for kind, names in written.items() if isinstance(names, list)}


def _files(folder: Path) -> set[str]:
    """Return names of all files and links in a folder, relative to it."""
    return {
        (Path(place) / name).relative_to(folder).as_posix()
        for place, folders, names in os.walk(folder)
        for name in (*names, *(linked for linked in folders if (Path(place) / linked).is_symlink()))
    }


def _link(source: Path, target: Path) -> None:
    """Link the file into another folder, or copy it where the file system has no links."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target, follow_symlinks=False)
    except (OSError, NotImplementedError):
        shutil.copy2(source, target, follow_symlinks=False)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Delay interruptions until the block is done; only the main thread can, and only it is interrupted."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []
    before = {number: signal.signal(number, lambda n, _: caught.append(n)) for number in INTERRUPTIONS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    for number in caught:
        signal.raise_signal(number)


def write_then_rename(path: Path, text: str) -> None:
    """Write text so that `path` appears complete or not at all; remains of a killed process are removed by the next.

    Raises:
        FileError: nothing can be written beside it.
    """
    with working_folder(path.parent) as work:
        temporary = work / path.name
        temporary.write_text(text, encoding="utf-8", newline="\n")
        os.replace(temporary, path)


def put_in_place(new: Path, folder: Path, aside: Path) -> Path:
    """Put `new` in the place of `folder`; return where the former `folder` is now.

    Linux and macOS exchange the two in one step, so that a process killed at any moment leaves one or the other.
    Windows, and file systems that cannot, take two steps: `folder` goes to `aside`, where `sweep` finds it.

    Raises:
        OSError: it cannot be done; everything is unchanged.
    """
    if not folder.exists():
        os.rename(new, folder)
        return aside
    if _exchanged(new, folder):
        return new
    aside.parent.mkdir(exist_ok=True)
    os.rename(folder, aside)
    try:
        os.rename(new, folder)
    except OSError:
        os.rename(aside, folder)
        raise
    return aside


def _exchanged(path: Path, other: Path) -> bool:
    """Exchange the two folders; return whether the system could."""
    if sys.platform == "win32":
        return False
    system = ctypes.CDLL(None)
    first, second = os.fsencode(path), os.fsencode(other)
    try:
        if sys.platform == "darwin":
            return bool(system.renamex_np(first, second, _EXCHANGE) == 0)
        return bool(system.renameat2(_HERE, first, _HERE, second, _EXCHANGE) == 0)
    except AttributeError:  # a C library without it
        return False
