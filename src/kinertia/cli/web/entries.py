"""The entries of a person's subject file: drafted from the files, corrected in a form, written for the command line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from kinertia.cli.web.file_table import (
    Content,
    file_table,
    is_subject_file,
    with_new_files,
    with_uses,
    within_folder,
)
from kinertia.cli.web.library import SUBJECT, Person
from kinertia.errors import KinertiaError, SettingsError
from kinertia.io.output_folder import write_then_rename
from kinertia.io.subject_draft import init_subject
from kinertia.io.subject_file import read_subject
from kinertia.io.subject_text import subject_text
from kinertia.io.toml_lines import parse_toml, read_toml
from kinertia.settings import Subject, number_of, sex_of

_HEADING = "Written by kinertia app; `kinertia fit` takes it as it is."
_LABELS = {
    "name": "Name in files and report",
    "sex": "Sex",
    "mass_kg": "Body mass (kg)",
    "height_m": "Height (m)",
    "age_years": "Age (years)",
    "population": "Population",
    "knee_width_mm": "Knee width (mm)",
    "ankle_width_mm": "Ankle width (mm)",
    "elbow_width_mm": "Elbow width (mm)",
}
USE = "use:"
"""What the fields of the form are called that say what a file is used as; the file's name follows."""


@dataclass(frozen=True)
class Field:
    """One entry of `[subject]` in the form.

    Attributes:
        key: of the subject file.
        label, about: what it is, short and at length.
        value: as the field shows it.
        choices: of a field that is no number or text.
        optional: whether most people leave it empty.
    """

    key: str
    label: str
    about: str
    value: str
    choices: tuple[str, ...]
    optional: bool


def fields(content: Content, typed: Mapping[str, str] | None = None) -> list[Field]:
    """The entries of `[subject]`, all that the subject file knows; what was typed goes before what is written."""
    written = content.get("subject")
    known = written if isinstance(written, Mapping) else {}
    shown = []
    for key, about in Subject.model_fields.items():
        value = str((typed or {}).get(key, known.get(key, "")))
        choices = _choices(about.annotation)
        label = _LABELS.get(key, key.replace("_", " "))
        optional = key == "name" or key.endswith("_mm")
        shown.append(
            Field(key, label, about.description or "", str(sex_of(value)) if choices else value, choices, optional)
        )
    return sorted(shown, key=lambda field: field.optional)


def _choices(annotation: object) -> tuple[str, ...]:
    """What an entry can be where there is a list of it."""
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    return next((found for part in get_args(annotation) if (found := _choices(part))), ())


def entries(person: Person) -> Content:
    """Of the person's subject file; none where there is none.

    Raises:
        FileError: it is not TOML.
    """
    return read_toml(person.subject, "a subject file").content if person.subject.is_file() else {}


def recognise(person: Person) -> None:
    """Make or complete the subject file after files came or went; what was corrected before stays.

    Raises:
        KinertiaError: nothing in the files can be used, or the subject file is not TOML.
    """
    _adopt(person)
    content, seen = entries(person), person.notes().get("seen", [])
    present = [path.name for path in person.files()]
    person.note(seen=present)
    draft = parse_toml(init_subject(person.folder, nearby=False), person.subject).content
    write(person, with_new_files(within_folder(content), draft, present, seen) if content else draft)


def _adopt(person: Person) -> None:
    """A subject file under another name is the person's if it is the only one."""
    dropped = [path for path in person.files() if is_subject_file(path)]
    if len(dropped) == 1 and not person.subject.exists():
        dropped[0].rename(person.subject)
        # what it names has been thought of
        person.note(seen=[path.name for path in person.files()])


def write(person: Person, content: Content) -> None:
    """Write the subject file with these entries."""
    write_then_rename(person.subject, subject_text(within_folder(content), _HEADING))


def write_text(person: Person, text: str) -> None:
    """Write the subject file as a user typed it; files are named without folders.

    Raises:
        FileError: it is not TOML, and the file stays as it was.
    """
    content = parse_toml(text.replace("\r\n", "\n"), Path(SUBJECT)).content
    if within_folder(content) == content:
        write_then_rename(person.subject, text.replace("\r\n", "\n"))
    else:
        write(person, content)


def write_form(person: Person, form: Mapping[str, str]) -> None:
    """Write the subject file with what the form says, everything else as it was.

    Raises:
        SettingsError: a number is none.
    """
    content = entries(person)
    subject: dict[str, Any] = dict(content.get("subject", {}))
    for key in Subject.model_fields:
        if key not in form:
            continue
        text = form[key].strip()
        subject.pop(key, None)
        if text:
            number = not _choices(Subject.model_fields[key].annotation) and key != "name"
            subject[key] = _number(key, text) if number else text
    uses = {name.removeprefix(USE): use for name, use in form.items() if name.startswith(USE)}
    rows = file_table(person.files(), content)
    known = {row.name: uses.get(row.name, row.use) for row in rows if row.choices}
    write(person, with_uses({**content, "subject": subject}, known))


def _number(key: str, text: str) -> float:
    try:
        return number_of(text)
    except ValueError as error:
        raise SettingsError(f"{_LABELS.get(key, key)}: {error}") from None


def trouble(person: Person) -> str:
    """What is wrong with the subject file, as the command line says it; empty if nothing is."""
    try:
        read_subject(person.subject)
    except KinertiaError as error:
        return str(error)
    return ""
