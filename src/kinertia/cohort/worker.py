"""Fits one person of a cohort after another, as its standard input asks: `python -m kinertia.cohort.worker`.

A file reader may hang in compiled code that blocks every other thread of its process, Dask's and any watchdog's. The
watchdog of `faulthandler` works without them. Dask then starts another process and tries the person again, which the
log prevents.

Each line is a `Job`; the answer is a line of JSON, what `Finished` holds. It ends with its input, even during a fit,
since the command that started it is then gone.
"""

import faulthandler
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import TextIO

from kinertia.cohort.job import Job, measured
from kinertia.cohort.record import AGAINST, BAD_INPUT, FAILED, PASSED, RECORD, Place, Record, inputs_of
from kinertia.cohort.tables import write_findings, write_person
from kinertia.errors import KinertiaError, internal_error
from kinertia.estimation.result.fit import Fit
from kinertia.findings.finding import Severity
from kinertia.io.file_names import command_line
from kinertia.io.output_folder import complete_folder, write_then_rename
from kinertia.io.subject.person_recordings import session_date
from kinertia.io.subject.provenance import provenance_of
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import SubjectFile
from kinertia.io.versions import VERSION
from kinertia.report.comparison.what_changed import fit_session
from kinertia.report.exports.contents import content_of
from kinertia.report.exports.files import save_fit
from kinertia.studies.parallel import one_thread
from kinertia.workflow.from_files import fit_subject

_ENDED = "Timeout ("
"""Beginning of faulthandler's output."""


def fit_person(job: Job) -> Record:
    """Fit one person and put the results into place, complete or not at all; return how it ended.

    Nothing is raised: an error in the person's files, or a failure, is stated in the record.
    """
    started = time.perf_counter()
    if job.kinertia != VERSION:
        versions = f"the worker has Kinertia {VERSION}, the command {job.kinertia}: install the same on both"
        return job.record(FAILED, versions, settled=False)
    place = Place(job.cohort, job.person)
    place.findings.unlink(missing_ok=True)
    log = place.log
    if was_ended(log, job.run):
        return job.record(FAILED, no_end(job.limit_s, log), settled=False)
    try:
        with time_limit(job.limit_s, log, job.run):
            return _fitted(job, started)
    except KinertiaError as error:  # of files that changed in between, or of the folder for the results
        return job.record(BAD_INPUT, str(error), settled=False)
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        sentence = f"{where}{error.strerror or error}; check the path, its permissions and the space on the disk"
        return job.record(BAD_INPUT, sentence, settled=False)
    except Exception as error:
        return _failed(job, error)


def _fitted(job: Job, started: float) -> Record:
    """Fit the person, put the results into place, and return the record."""
    wanted = read_subject(job.subject)
    overruled = _overruled(wanted)
    try:
        fit = fit_session(wanted) if job.session else fit_subject(wanted)
    except KinertiaError as error:
        write_findings(Place(job.cohort, job.person).findings, job.person, error)
        record = job.record(BAD_INPUT, str(error), _unchanged(job), time.perf_counter() - started)
        return replace(record, overruled=overruled)
    overview = fit.overview
    against = [finding.line() for finding in overview.open if finding.severity is Severity.ERROR]
    against += [f"{name} left out" for name in overview.left_out]
    record = job.record(AGAINST if overview.failed else PASSED, "; ".join(against), True, time.perf_counter() - started)
    record = replace(record, verdict=overview.verdict, overruled=overruled)
    _save(fit, wanted, job, record)
    return record


def _overruled(wanted: SubjectFile) -> str:
    """Return the codes that the subject file waives or ignores, for all trials or single ones."""
    given = [wanted.diagnostics.overrule, *(trial.diagnostics.overrule for trial in wanted.trials)]
    return " ".join(dict.fromkeys(code for overrule in given for code in (*overrule.waive, *overrule.ignore)))


def _save(fit: Fit, wanted: SubjectFile, job: Job, record: Record) -> None:
    """Save results, rows of the tables and the record, in one folder that appears at once."""
    folder = Place(job.cohort, job.person).results
    command = command_line(["kinertia", "fit", str(job.subject), "-o", str(folder)])
    content = content_of(fit, provenance_of(wanted, command))
    with complete_folder(folder, "cohort") as work:
        save_fit(content, work, force=True)
        with_session = wanted.instruments.session is not None
        write_person(work, job.person, fit, session_date(wanted), with_session)
        (work / RECORD).write_text(record.text(), encoding="utf-8")


def _unchanged(job: Job) -> bool:
    """Return whether the files are still unchanged: an error of an unavailable drive is not the files'."""
    try:
        return inputs_of(read_subject(job.subject), job.session) == job.inputs
    except (KinertiaError, OSError):
        return False


def _failed(job: Job, error: Exception) -> Record:
    """Record an internal error of Kinertia, with a log beside its record."""
    log = Place(job.cohort, job.person).log
    write_then_rename(log, "".join(traceback.format_exception(error)))
    return job.record(FAILED, internal_error(error, log), settled=not isinstance(error, MemoryError))


@contextmanager
def time_limit(seconds: float, log: Path, run: str) -> Iterator[None]:
    """End this process if the block takes longer; `log` then states where it was, and in which run.

    One block at a time in a process.
    """
    with log.open("w", encoding="utf-8") as file:
        file.write(_heading(run))
        file.flush()
        faulthandler.dump_traceback_later(seconds, exit=True, file=file)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
            file.close()  # Windows removes no file that is open
            log.unlink(missing_ok=True)


def was_ended(log: Path, run: str) -> bool:
    """Return whether a block of this run with this log was ended."""
    try:
        return log.read_text(encoding="utf-8").startswith(_heading(run) + _ENDED)
    except OSError:
        return False


def no_end(seconds: float, log: Path) -> str:
    """Describe the time limit that was exceeded."""
    return (
        f"the fit did not finish within {seconds / 60.0:.0f} min and was stopped; look for anything unusual in the "
        f"files, and send {log}, which shows where the fit was, to Kinertia's developers; the next run tries again"
    )


def _heading(run: str) -> str:
    return f"run {run}\n"


def main(fit: Callable[[Job], Record] = fit_person) -> None:
    """Answer until the input ends."""
    answers, sys.stdout = sys.stdout, sys.stderr  # keeps other output off the answers
    one_thread()
    lines: SimpleQueue[str] = SimpleQueue()
    Thread(target=_listen, args=(sys.stdin, lines), daemon=True).start()
    while True:
        answers.write(measured(fit, Job.of_text(lines.get())).text + "\n")
        answers.flush()


def _listen(asked: TextIO, lines: SimpleQueue[str]) -> None:
    for line in asked:
        lines.put(line)
    os._exit(0)


if __name__ == "__main__":
    main()
