"""Checks, fits or compares conditions of one person in its own process: `python -m kinertia.cli.web.worker fit FOLDER`.

With `prepare` alone it compiles what the first fit on a machine would compile.

A crash does not affect the page, and cancelling ends the process. Progress is reported on standard output, in lines of
JSON: `{"stage": ..., "share": ...}`, and at the end `{"error": ...}` if a file or entry was at fault.
"""

import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

from kinertia.cli.compiling import compile_once
from kinertia.cli.web.library import NORMS, OUTCOME, SUBJECT, SUMMARY, PersonFolder
from kinertia.errors import KinertiaError
from kinertia.findings.remedy import Span
from kinertia.io.file_names import command_line
from kinertia.io.output_folder import complete_folder
from kinertia.io.subject.provenance import sha256
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import SubjectFile

Progress = Callable[[str, float], None]


def check(person: PersonFolder, progress: Progress) -> None:
    """Run `kinertia check` on the subject file: check.html, and its findings for the page."""
    from kinertia.report.pages.check_page import save_check_page
    from kinertia.report.pages.finding_view import digest
    from kinertia.workflow.check import check_person
    from kinertia.workflow.person import read_person

    wanted = read_subject(person.subject)
    checked = check_person(read_person(wanted, progress))
    windows = windows_of(wanted, {recording.context.name: recording.windows for recording in checked.recordings})
    with complete_folder(person.check, "app") as work:
        save_check_page([checked.overview], checked.recordings, (), work)
        _write(work, {"inputs": person.inputs, **digest(checked.overview, windows)})


def fit(person: PersonFolder, progress: Progress) -> None:
    """Run `kinertia fit` on the subject file: the results, and the subject file that they are of."""
    from kinertia.diagnostics.result.suitability import suitability
    from kinertia.io.subject.provenance import provenance_of
    from kinertia.report.exports.contents import content_of
    from kinertia.report.exports.files import save_fit
    from kinertia.report.pages.finding_view import digest
    from kinertia.report.pages.headline import impossible, purposes
    from kinertia.workflow.from_files import fit_subject

    begun = time.time()
    wanted = read_subject(person.subject)
    result = fit_subject(wanted, progress)
    progress("writing the results", 0.0)
    windows = windows_of(wanted, {trial.name: longest_first(trial.kinematics.windows_s) for trial in result.trials})
    rated = purposes(suitability(result, result.findings, result.left_out), impossible(result))
    command = command_line(["kinertia", "fit", str(person.subject), "-o", str(person.results)])
    content = content_of(result, provenance_of(wanted, command))
    with complete_folder(person.results, "app") as work:
        save_fit(content, work, force=True)
        (work / SUBJECT).write_bytes(person.subject.read_bytes())
        ended = time.time()
        _write(
            work,
            {
                "inputs": person.inputs,
                "summary": sha256(work / SUMMARY),
                **digest(result.overview, windows),
                "purposes": [purpose._asdict() for purpose in rated],
                "ended": ended,
                "seconds": round(ended - begun, 1),
            },
        )


def comparison(person: PersonFolder, progress: Progress, before: str, after: str) -> None:
    """Run `kinertia compare --conditions` on the results: compare.html, and its sentences for the page."""
    from kinertia.report.comparison.what_changed import compare

    norms = person.folder.parent / NORMS
    found = compare(
        person.results, conditions=(before, after), progress=progress, norms=norms if norms.is_file() else None
    )
    outcome = {
        "summary": sha256(person.results / SUMMARY),
        "before": before,
        "after": after,
        "sentences": found.sentences,
    }
    with complete_folder(person.comparison, "app") as work:
        (work / "compare.html").write_text(found.page(), encoding="utf-8")
        _write(work, outcome)


def windows_of(wanted: SubjectFile, known: Mapping[str, Sequence[Span]]) -> dict[str, Sequence[Span]]:
    """Return the used parts (s) of each trial of a subject file by its name; none of one that was not read."""
    return {files.name: known.get(files.name, ()) for files in wanted.trials}


def longest_first(spans: Sequence[Span]) -> list[Span]:
    """Sort parts of a trial (s) by their length."""
    return sorted(spans, key=lambda span: span[0] - span[1])


def _write(folder: Path, outcome: Mapping[str, Any]) -> None:
    (folder / OUTCOME).write_text(json.dumps(outcome, indent=1) + "\n", encoding="utf-8")


def _said(stream: TextIO, **values: object) -> None:
    stream.write(json.dumps(values) + "\n")
    stream.flush()


def main(kind: str, folder: str = "", *conditions: str) -> int:
    """Run the worker; exit status 2 for an error in the person's files or entries."""
    page, sys.stdout = sys.stdout, sys.stderr  # keeps other output off the page's stream

    def progress(stage: str, share: float) -> None:
        _said(page, stage=stage, share=share)

    try:
        if kind == "prepare":
            compile_once(progress)
        else:
            work: Mapping[str, Callable[..., None]] = {"check": check, "fit": fit, "comparison": comparison}
            work[kind](PersonFolder(Path(folder)), progress, *conditions)
    except KinertiaError as error:
        _said(page, error=str(error))
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
