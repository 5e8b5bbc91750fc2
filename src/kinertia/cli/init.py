"""Defines `kinertia init`: drafts a first subject file."""

import os
from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.outcome import Outcome
from kinertia.cli.terminal import out
from kinertia.errors import FileError
from kinertia.io.file_names import missing_file
from kinertia.io.results.output_folder import write_then_rename
from kinertia.io.subject.draft import FILL_IN, MARKER_SET, NO_FORCES, NOT_USED, SUBJECT, init_files
from kinertia.io.subject.measures_file import measures_sheet
from kinertia.io.subject.provenance import command_line
from kinertia.report.figures.measures_picture import measures_picture


def init(
    folder: Annotated[Path, typer.Argument(help="One person's folder, or any file in it.")],
    measures: Annotated[
        bool, typer.Option("--measures", help="Write the sheet of girths and lengths to fill in, and no subject.toml.")
    ] = False,
) -> Outcome:
    """Write a first subject.toml from the files in a folder.

    Where no marker-set preset fits the static trial, a draft of one,
    markers.toml, is written beside it.

    A completed sheet of girths and lengths in the folder is used. --measures
    writes an empty one, measures.csv, with a picture of where to measure,
    measures.svg. Fill in as many as you have time for.

    [bold]Example[/]

    kinertia init data/subject01
    """
    folder = folder.parent if folder.is_file() else folder
    if measures:
        return _measures(folder)
    path, own = folder / SUBJECT, folder / MARKER_SET
    if path.exists():
        raise FileError(path, "already exists and was not changed; remove it to draft a new one")
    if folder.is_dir() and not os.access(folder, os.W_OK):
        raise FileError(folder, "cannot be written to; copy the files into a folder of your own, and draft it there")
    files = init_files(folder)
    for name, text in sorted(files.items()):
        write_then_rename(folder / name, text)
    lines = files[SUBJECT].splitlines()
    notes = [line.removeprefix("# ") for line in lines if line.startswith(NO_FORCES)]
    for note in notes:
        out.print(note, soft_wrap=True)
    if MARKER_SET in files:
        against = next((line.partition(NOT_USED)[2] for line in lines if NOT_USED in line), "")
        check = f"it is not used: {against} and remove the # before markers" if against else "check it"
        out.print(f"no marker-set preset fits: wrote {own}, drafted from the marker positions; {check}", soft_wrap=True)
    check = command_line(["kinertia", "check", str(path)])
    out.print(f"wrote {path}: fill in what it asks for, then run: {check}", soft_wrap=True)
    asked = [line.removeprefix("# ").partition(" =")[0] for line in lines if FILL_IN in line]
    marker_set = str(own) if MARKER_SET in files else None
    return Outcome({"subject_file": str(path), "marker_set": marker_set, "fill_in": asked, "notes": notes})


def _measures(folder: Path) -> Outcome:
    sheet, picture = folder / "measures.csv", folder / "measures.svg"
    if not folder.is_dir():
        raise FileError.found(folder, "F101", **missing_file(folder, str(folder), "the person's folder", True))
    if sheet.exists():
        raise FileError(sheet, "already exists and was not changed; remove it to write a new one")
    write_then_rename(picture, measures_picture())
    write_then_rename(sheet, measures_sheet())
    init_again = command_line(["kinertia", "init", str(folder)])
    out.print(
        f"wrote {sheet}: fill in the column cm for what you measure ({picture} shows where). Then {init_again} "
        'uses it; a subject file that exists already needs measures = "measures.csv" under [prior]',
        soft_wrap=True,
    )
    return Outcome({"sheet": str(sheet), "picture": str(picture)})
