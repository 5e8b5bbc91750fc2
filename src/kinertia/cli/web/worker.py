"""Checks or fits one person in a process of its own: `python -m kinertia.cli.web.worker fit FOLDER`.

With `prepare` alone it compiles what the first fit on a machine would compile.

A crash does not affect the page, and cancelling ends the process. Progress is reported on standard output, in lines of
JSON: `{"stage": ..., "share": ...}`, and at the end `{"error": ...}` if a file or entry was at fault.
"""

import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TextIO

from kinertia.cli.compiling import compile_once
from kinertia.cli.web.library import OUTCOME, SUBJECT, SUMMARY, PersonFolder
from kinertia.errors import KinertiaError
from kinertia.io.output_folder import complete_folder
from kinertia.io.subject.provenance import command_line, sha256
from kinertia.io.subject.reader import read_subject

Progress = Callable[[str, float], None]


def check(person: PersonFolder, progress: Progress) -> None:
    """Run `kinertia check` on the subject file: check.html, and its findings for the page."""
    from kinertia.report.pages.check_page import save_check_page
    from kinertia.report.pages.finding_view import digest
    from kinertia.workflow.check import check_person
    from kinertia.workflow.person import read_person

    checked = check_person(read_person(read_subject(person.subject), progress))
    with complete_folder(person.check, "app") as work:
        save_check_page([checked.overview], checked.recordings, (), work)
        _write(work, {"inputs": person.inputs, **digest(checked.overview)})


def fit(person: PersonFolder, progress: Progress) -> None:
    """Run `kinertia fit` on the subject file: the results, and the subject file that they are of."""
    from kinertia.io.subject.provenance import provenance_of
    from kinertia.report.exports.files import save_fit
    from kinertia.report.pages.finding_view import digest
    from kinertia.report.pages.headline import words
    from kinertia.workflow.from_files import fit_subject

    begun = time.time()
    wanted = read_subject(person.subject)
    result = fit_subject(wanted, progress)
    progress("writing the results", 0.0)
    command = command_line(["kinertia", "fit", str(person.subject), "-o", str(person.results)])
    with complete_folder(person.results, "app") as work:
        save_fit(result, work, provenance_of(wanted, command), force=True)
        (work / SUBJECT).write_bytes(person.subject.read_bytes())
        ended = time.time()
        _write(
            work,
            {
                "inputs": person.inputs,
                "summary": sha256(work / SUMMARY),
                **digest(result.overview),
                "purposes": [one._asdict() for one in words(result).purposes],
                "ended": ended,
                "seconds": round(ended - begun, 1),
            },
        )


def _write(folder: Path, outcome: Mapping[str, Any]) -> None:
    (folder / OUTCOME).write_text(json.dumps(outcome, indent=1) + "\n", encoding="utf-8")


def _said(stream: TextIO, **values: object) -> None:
    stream.write(json.dumps(values) + "\n")
    stream.flush()


def main(kind: str, folder: str = "") -> int:
    """Run the worker; exit status 2 for an error in the person's files or entries."""
    page, sys.stdout = sys.stdout, sys.stderr  # keeps other output off the page's stream

    def progress(stage: str, share: float) -> None:
        _said(page, stage=stage, share=share)

    try:
        if kind == "prepare":
            compile_once(progress)
        else:
            {"check": check, "fit": fit}[kind](PersonFolder(Path(folder)), progress)
    except KinertiaError as error:
        _said(page, error=str(error))
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
