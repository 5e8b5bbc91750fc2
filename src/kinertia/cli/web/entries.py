"""Drafts, corrects and saves the entries of a person's subject file."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from kinertia.cli.web.file_table import (
    Content,
    file_table,
    is_subject_file,
    put_aside,
    taken_up,
    with_new_files,
    with_uses,
    within_folder,
)
from kinertia.cli.web.library import SUBJECT, PersonFolder
from kinertia.cli.web.rows import Field, choices_of, with_rows, with_trial_fields
from kinertia.errors import KinertiaError, SettingsError
from kinertia.io.marker_set_file import preset_names
from kinertia.io.output_folder import write_then_rename
from kinertia.io.subject.draft import init_subject
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import subject_text
from kinertia.io.text.number_table import number_of
from kinertia.io.text.toml_lines import parse_toml, read_toml
from kinertia.settings import Subject, sex_of

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
_IN_FORM = tuple(key for key in Subject.model_fields if key != "ranges_deg")
"""Entries of `[subject]` with one value each; joint ranges are a table, for the text of the subject file."""
_MARKER_SET = "marker_set"
_ABOUT_MARKER_SET = "blank: detected from the labels if most of a preset's are there"
USE = "use:"
"""Prefix of the form's fields for the use of a file; the file's name follows."""


def label_of(key: str) -> str:
    """Return the label of an entry of `[subject]` in the form."""
    return _LABELS.get(key, key.replace("_", " "))


def fields(content: Content, typed: Mapping[str, str] | None = None) -> list[Field]:
    """Return all entries of `[subject]` with one value; typed values precede written ones."""
    written = content.get("subject")
    known = written if isinstance(written, Mapping) else {}
    shown = []
    for key in _IN_FORM:
        about = Subject.model_fields[key]
        value = str((typed or {}).get(key, known.get(key, "")))
        choices = choices_of(about.annotation)
        label = label_of(key)
        optional = key == "name" or key.endswith("_mm")
        shown.append(
            Field(key, label, about.description or "", str(sex_of(value)) if choices else value, choices, optional)
        )
    return sorted(shown, key=lambda field: field.optional)


def marker_set_field(content: Content, typed: Mapping[str, str] | None = None) -> Field | None:
    """Return the choice of preset; None where the marker set is a file of the person's, or a model has the markers."""
    model = _model(content)
    written = str(model.get("markers", ""))
    if "osim" in model or (written and written not in preset_names()):
        return None
    value = (typed or {}).get(_MARKER_SET, written)
    return Field(_MARKER_SET, "Marker set", _ABOUT_MARKER_SET, value, tuple(preset_names()), False)


def _model(content: Content) -> Mapping[str, Any]:
    model = content.get("model")
    return model if isinstance(model, Mapping) else {}


def entries(person: PersonFolder) -> Content:
    """Read the entries of the person's subject file; none without a file.

    Raises:
        FileError: it is not TOML.
    """
    return read_toml(person.subject, "a subject file").content if person.subject.is_file() else {}


def recognise(person: PersonFolder) -> None:
    """Make or complete the subject file after files were added or removed; earlier corrections stay.

    Raises:
        KinertiaError: nothing in the files can be used, or the subject file is not TOML.
    """
    _adopt(person)
    content, seen = entries(person), person.notes().get("seen", [])
    present = [path.name for path in person.files()]
    person.note(seen=present)
    draft = parse_toml(init_subject(person.folder, nearby=False), person.subject).content
    write(person, with_new_files(within_folder(content), draft, present, seen) if content else draft)


def _adopt(person: PersonFolder) -> None:
    """Adopt a subject file under another name if it is the only one."""
    dropped = [path for path in person.files() if is_subject_file(path)]
    if len(dropped) == 1 and not person.subject.exists():
        dropped[0].rename(person.subject)
        # the files that it states count as seen
        person.note(seen=[path.name for path in person.files()])


def write(person: PersonFolder, content: Content) -> None:
    """Write the subject file with these entries."""
    write_then_rename(person.subject, subject_text(within_folder(content), _HEADING))


def write_text(person: PersonFolder, text: str) -> None:
    """Write the subject file as a user typed it; files are stated without folders.

    Raises:
        FileError: it is not TOML, and the file stays as it was.
    """
    content = parse_toml(text.replace("\r\n", "\n"), Path(SUBJECT)).content
    if within_folder(content) == content:
        write_then_rename(person.subject, text.replace("\r\n", "\n"))
    else:
        write(person, content)


def write_form(person: PersonFolder, form: Mapping[str, str]) -> None:
    """Write the subject file with the form's entries, everything else as it was.

    Raises:
        SettingsError: a number cannot be read.
    """
    content = entries(person)
    subject: dict[str, Any] = dict(content.get("subject", {}))
    for key in _IN_FORM:
        if key not in form:
            continue
        text = form[key].strip()
        subject.pop(key, None)
        if text:
            number = not choices_of(Subject.model_fields[key].annotation) and key != "name"
            subject[key] = _number(key, text) if number else text
    uses = {name.removeprefix(USE): use for name, use in form.items() if name.startswith(USE)}
    rows = file_table(person.files(), content)
    known = {row.name: uses.get(row.name, row.use) for row in rows if row.choices}
    changed = with_rows({**content, "subject": subject}, form)
    changed = with_trial_fields(changed, form)
    if _MARKER_SET in form:
        changed["model"] = {**_model(content), "markers": form[_MARKER_SET]}
        if not form[_MARKER_SET]:
            del changed["model"]["markers"]
    _write_uses(person, content, changed, known)


def _write_uses(person: PersonFolder, before: Content, changed: Content, uses: Mapping[str, str]) -> None:
    """Write the entries with these uses of files; a trial that is used again gets back its forces and other entries."""
    aside = person.notes().get("aside", [])
    after = with_uses(*taken_up(changed, uses, aside))
    if after != before:
        write(person, after)
    person.note(aside=put_aside(before, after, aside))


def _number(key: str, text: str) -> float:
    label = label_of(key)
    try:
        number = number_of(text)
    except ValueError as error:
        raise SettingsError(f"{label}: {error}") from None
    if not math.isfinite(number):
        raise SettingsError(f"{label}: '{text}' is not a usable number; write it like 72.6")
    return number


def trouble(person: PersonFolder) -> str:
    """Return what is wrong with the subject file, as the command line reports it; empty if nothing is."""
    try:
        read_subject(person.subject)
    except KinertiaError as error:
        return str(error)
    return ""
