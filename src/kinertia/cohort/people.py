"""Lists the people of a study: a folder with a folder per person, or a CSV file with a row per person."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from kinertia.errors import FileError
from kinertia.io.file_names import RESULT_FILES, command_line, fits_everywhere, path_from, same_name_key
from kinertia.io.subject.draft import is_capture
from kinertia.io.subject.reader import subject_file_in
from kinertia.io.text.csv_file import read_csv

_LONGEST_NAME = 200
"""Longest name in bytes: systems limit file names to 255, and some of Kinertia's begin with a person's."""


@dataclass(frozen=True)
class Participant:
    """One person of a study.

    Attributes:
        name: name in tables, and of the folder of results.
        subject: the subject file; None where there is none.
        problem: why there is none, in one line; empty otherwise.
        session: which of the person's sessions it is, of a row that states it: `name` then ends with it.
    """

    name: str
    subject: Path | None
    problem: str = ""
    session: str = ""

    @property
    def person(self) -> str:
        """Name of the person, without the session."""
        return self.name.removesuffix(f" {self.session}") if self.session else self.name


def people_of(study: Path, output: Path) -> list[Participant]:
    """List all people in a study, by name (folders) or in the order of the rows (CSV).

    Args:
        study: a folder with one folder per person, each with a subject file; or a CSV file with the columns `subject`
            (path of a subject file, from the CSV file's folder) and, optionally, `name` and `session`.
        output: folder for the results, which may be inside the study and is not a person's.

    Raises:
        FileError: no such study, no one in it, columns missing, or names that cannot be folders side by side.
    """
    if study.is_dir():
        people = list(_of_folders(study, output.resolve()))
        if not people:
            raise FileError(
                study,
                "none of its folders holds a subject file or recordings; give the folder with the people's folders",
            )
        _check_names(study, [(None, person.name) for person in people])
    elif study.is_file():
        rows = list(_of_rows(study))
        people = [person for _, person in rows]
        _check_names(study, [(line, person.name) for line, person in rows])
    else:
        raise FileError(study, "no such folder or file; give a folder with a folder per person, or a CSV file")
    return people


def _of_folders(study: Path, output: Path) -> Iterator[Participant]:
    """Yield folders with a subject file, or with recordings that need one, also in their own folders; ignore others."""
    for folder in sorted(study.iterdir()):
        if not folder.is_dir() or folder.name.startswith(".") or folder.resolve() == output:
            continue
        if _holds_subject(folder):
            yield _with_subject_in(folder, folder.name)
        elif _holds_recordings(folder):
            init = command_line(["kinertia", "init", str(folder)])
            yield Participant(folder.name, None, f"no subject file; {init} drafts one")
        elif deeper := [inner.name for inner in _shown(folder) if inner.is_dir() and _is_session(inner, output)]:
            problem = (
                f"no subject file, but there are files in its folder{'s' if deeper[1:] else ''} {', '.join(deeper)}; "
                f"write one in {folder} that names them, or list people in a CSV file"
            )
            yield Participant(folder.name, None, problem)


def _with_subject_in(folder: Path, name: str) -> Participant:
    try:
        return Participant(name, subject_file_in(folder))
    except FileError as error:
        return Participant(name, None, str(error))


def _is_session(folder: Path, output: Path) -> bool:
    """Return whether a folder holds a person's files, results aside."""
    results = (folder / RESULT_FILES[0]).exists() or folder.resolve() == output
    return not results and (_holds_subject(folder) or _holds_recordings(folder))


def _holds_subject(folder: Path) -> bool:
    return any(path.suffix.lower() == ".toml" for path in _files(folder))


def _holds_recordings(folder: Path) -> bool:
    return any(is_capture(path) for path in _files(folder))


def _files(folder: Path) -> list[Path]:
    """List files, including links to missing ones: some archives fetch files only when requested."""
    return [path for path in _shown(folder) if not path.is_dir()]


def _shown(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if not path.name.startswith("."))


def _of_rows(path: Path) -> Iterator[tuple[int, Participant]]:
    """Yield line number and person of every row."""
    for row in read_csv(path, ["subject"], "a row per person, with the path of the person's subject file"):
        written = row.cells["subject"]
        if not written:
            raise FileError(path, "the column 'subject' is empty; give the path of a subject file", row.line)
        subject = path_from(path.parent, written)
        name, session = (row.cells.get(column, "") for column in ("name", "session"))
        if session and not name:
            raise FileError(path, "a row with a session needs the person's name in the column 'name'", row.line)
        if subject.is_dir():
            person = _with_subject_in(subject, name or subject.resolve().name)
        else:
            person = Participant(name or _name_of(subject), subject)
        yield row.line, replace(person, name=f"{person.name} {session}", session=session) if session else person


def _name_of(subject: Path) -> str:
    """Return the name that distinguishes a subject file from others: its own, or its folder's."""
    return subject.resolve().parent.name if subject.stem.lower() == "subject" else subject.stem


def _check_names(study: Path, named: Sequence[tuple[int | None, str]]) -> None:
    seen: dict[str, str] = {}
    for line, name in named:
        if not fits_everywhere(name) or name.startswith(".") or len(name.encode()) > _LONGEST_NAME:
            raise FileError(
                study,
                f"'{name}' cannot be the name of a folder on every system (none of < > : \" / \\ | ? *, no dot at the "
                f"start, no dot or blank at the end, no device of Windows, at most {_LONGEST_NAME} bytes); give the "
                "person another name",
                line,
            )
        key = same_name_key(name)
        if key in seen:
            both = "twice" if seen[key] == name else f"and so is '{seen[key]}': one folder on Windows and macOS"
            raise FileError(study, f"'{name}' is there {both}; give every person a name of their own", line)
        seen[key] = name
