"""Defines `kinertia instruments`: plate and synchronisation errors that the trials of a session share."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.findings_view import show_all
from kinertia.cli.options import Outcome, Quiet, own_file
from kinertia.cli.terminal import out, plain_table, shown_progress
from kinertia.errors import FileError, SessionError
from kinertia.estimation.simultaneous.calibration_entry import SHOWN_UNIT
from kinertia.io.results.output_folder import write_then_rename
from kinertia.io.subject.learnt_files import expect_session, session_text
from kinertia.io.subject.provenance import recordings
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import InstrumentsFiles, SubjectFile
from kinertia.io.versions import VERSION
from kinertia.workflow.from_files import check_plates, fit_subject
from kinertia.workflow.session import SessionInstruments, person_instruments, session_instruments


def instruments(
    subjects: Annotated[
        list[Path], typer.Argument(help="Subject files (.toml) of the people measured in the session.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path("instruments.toml"),
    quiet: Quiet = False,
) -> Outcome:
    """Estimate plate and synchronisation errors of a session from all its trials, for use in all its fits.

    Writes a file for session = "..." under \\[instruments] in the subject files
    of the session: what one person's walks cannot show of a plate's position,
    the others' can. A fit leaves out what its own trials contributed.

    [bold]Example[/]

    kinertia instruments anna/subject.toml ben/subject.toml -o instruments.toml
    """
    wanted = [_wanted(path) for path in subjects]
    for path, each in zip(subjects, wanted, strict=True):
        if each.instruments != wanted[0].instruments:
            raise SessionError(f"{path}: [instruments] differs from that of {subjects[0]}; it is the session's")
    own_file(output, expect_session, "kinertia instruments")
    people = []
    for each in wanted:
        with shown_progress() as progress:
            fit = fit_subject(each, progress)
        people.append(person_instruments(fit, recordings(each)))
    session = session_instruments(people, wanted[0].instruments)
    write_then_rename(output, session_text(output.name, VERSION, session.found, session.people))
    _report(session)
    out.print(f"written to {output}; name it in the subject files: session = ... under [instruments]", soft_wrap=True)
    names = [person.name for person in session.people]
    return Outcome(
        {
            "file": str(output),
            "people": names,
            "found": [asdict(one) for one in session.errors],
            "findings": [one.to_dict() for one in session.contradictions],
        }
    )


def _wanted(path: Path) -> SubjectFile:
    """Read a subject file, without what an earlier run found about the session."""
    if path.suffix.lower() != ".toml":
        raise FileError(path, "expected a subject file (.toml); kinertia init FOLDER drafts one of a person's files")
    wanted = read_subject(path)
    check_plates(wanted)
    own = InstrumentsFiles.model_validate({**wanted.instruments.model_dump(), "session": None})
    return wanted.model_copy(update={"instruments": own})


def _report(session: SessionInstruments) -> None:
    table = plain_table("instrument", "quantity", "error", "sd", "unit")
    for instrument, quantities in session.found.items():
        for quantity, (value, sd, unit) in quantities.items():
            factor, shown = SHOWN_UNIT[unit]
            table.add_row(instrument, quantity, f"{value * factor:+.1f}", f"{sd * factor:.1f}", shown)
    out.print(table)
    show_all(session.contradictions)
