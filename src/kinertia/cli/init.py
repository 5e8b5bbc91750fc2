"""`kinertia init`: a first subject file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.outcome import Outcome
from kinertia.cli.terminal import out
from kinertia.errors import FileError
from kinertia.io.output_folder import write_then_rename
from kinertia.io.subject_draft import FILL_IN, NO_FORCES, init_subject


def init(
    folder: Annotated[Path, typer.Argument(help="Folder with the files of one person.")],
) -> Outcome:
    """Write a first subject.toml from the files in a folder.

    [bold]Example[/]

    kinertia init data/subject01
    """
    path = folder / "subject.toml"
    if path.exists():
        raise FileError(path, "exists already and is left alone; remove it to draft a new one")
    text = init_subject(folder)
    write_then_rename(path, text)
    lines = text.splitlines()
    notes = [line.removeprefix("# ") for line in lines if line.startswith(NO_FORCES)]
    for note in notes:
        out.print(note, soft_wrap=True)
    out.print(f"wrote {path}: fill in what it asks for, then run: kinertia fit {path} -o out", soft_wrap=True)
    asked = [line.removeprefix("# ").partition(" =")[0] for line in lines if FILL_IN in line]
    return Outcome({"subject_file": str(path), "fill_in": asked, "notes": notes})
