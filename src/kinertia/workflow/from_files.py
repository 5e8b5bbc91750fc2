"""Leads from a subject file to its recordings, to what an estimator needs, and to a `Fit`.

Modules that only some subject files need are imported where they are used: all together take as long as reading a
trial.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from kinertia.errors import PriorError, SessionError, SettingsError
from kinertia.estimation.prepared import Prepared, Progress
from kinertia.estimation.result.fit import Fit
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity
from kinertia.io.file_names import command_line
from kinertia.io.subject.provenance import recordings
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import InstrumentsFiles, PriorFiles, SubjectFile
from kinertia.settings import Overrule
from kinertia.workflow.estimate import estimate
from kinertia.workflow.person import read_person
from kinertia.workflow.prepare import prepared
from kinertia.workflow.screening import screen

if TYPE_CHECKING:
    from kinertia.estimation.learnt_prior import LearntPrior
    from kinertia.estimation.simultaneous.terms.cost_term import CostTerm
    from kinertia.io.subject.body_files import BodyMeasures
    from kinertia.io.subject.learnt_files import PersonInstruments
    from kinertia.workflow.known_body import KnownBody


def prepare_subject(
    subject: str | Path | SubjectFile,
    progress: Progress = lambda stage, share: None,
    overrule: Overrule | None = None,
) -> Prepared:
    """Read, calibrate, solve and smooth all that an estimator needs of the person in a subject file.

    Args:
        subject: the file, or the result of `read_subject`.
        progress: called as the work progresses.
        overrule: what is overruled besides what the subject file says.

    Raises:
        KinertiaError: a file is missing or broken, or something in it cannot be used.
    """
    wanted = subject if isinstance(subject, SubjectFile) else read_subject(subject)
    known = wanted.instruments
    _expect_no_mirrored_prosthesis(wanted)
    session = _session(wanted)
    measures = _measures(wanted)
    screened = screen(read_person(wanted, progress).with_overrule(overrule or Overrule()))
    body = _known_body(wanted, measures)
    ready = prepared(screened, wanted.settings, progress, known=body)
    if wanted.settings.method == "two-level" and not _only_tables(wanted):
        ready = _with_unused(ready, "[prior] and [segment]")
    if known.model_copy(update={"date": None, "zeroed": False, "plates": None}) == InstrumentsFiles():
        return ready
    if wanted.settings.method == "two-level":
        return _with_unused(ready, "[instruments]")
    from kinertia.workflow.session import with_instruments

    return with_instruments(ready, known, session, recordings(wanted))


def _expect_no_mirrored_prosthesis(wanted: SubjectFile) -> None:
    names = [name for name, segment in wanted.segments.items() if segment.prosthesis]
    if names and wanted.settings.method == "two-level" and wanted.settings.symmetry:
        raise SettingsError.of_entry(
            ", ".join(names),
            "a prosthesis does not mirror the other side; use the default method, or symmetry = false",
        )


def _session(wanted: SubjectFile) -> tuple[PersonInstruments, ...]:
    """Return the other people of the session, whose plates this person shares, with their instrument information."""
    if wanted.instruments.session is None:
        return ()
    from kinertia.io.subject.learnt_files import read_session

    session = read_session(wanted.instruments.session)
    if session:
        check_plates(wanted)
    return session


def _measures(wanted: SubjectFile) -> BodyMeasures | None:
    """Read the sheet of girths and lengths, before anything is computed."""
    if wanted.prior.measures is None:
        return None
    from kinertia.io.subject.body_files import read_measures
    from kinertia.model.stadium_body import expect_yeadon

    expect_yeadon()
    return read_measures(wanted.prior.measures)


def _only_tables(wanted: SubjectFile) -> bool:
    """Return whether nothing is known of the body besides mass, height and sex."""
    return wanted.prior == PriorFiles() and not wanted.segments


def _known_body(wanted: SubjectFile, measures: BodyMeasures | None) -> KnownBody | None:
    """Return what is known of the body besides mass, height and sex, for a method that uses it; None if nothing."""
    if _only_tables(wanted) or wanted.settings.method == "two-level":
        return None
    from kinertia.io.subject.body_files import read_bsp
    from kinertia.workflow.known_body import KnownBody

    earlier = None if wanted.prior.bsp is None else read_bsp(wanted.prior.bsp)
    group = None if wanted.prior.population is None else _group(wanted, wanted.prior.population)
    return KnownBody(wanted.prior, earlier, wanted.segments, group, measures)


def _with_unused(ready: Prepared, entry: str) -> Prepared:
    """Add a finding for an entry of the subject file that has no effect."""
    return replace(ready, findings=(*ready.findings, finding("F194", entry=Quantity(entry))))


def _group(wanted: SubjectFile, path: Path) -> LearntPrior:
    """Read the prior learnt from the person's group, unless this person was part of it."""
    from kinertia.estimation.learnt_prior import LearntPrior
    from kinertia.io.subject.learnt_files import read_population

    file = read_population(path)
    if set(recordings(wanted)) & set(file.files):
        raise PriorError(
            f"{path.name} was learnt from these trials as well, so they would count twice; write one for this person: "
            f"kinertia population ... {command_line(['--without', wanted.subject.name])}"
        )
    return LearntPrior.from_file(file)


def check_plates(wanted: SubjectFile) -> None:
    """Check that plates with the same name in this person's and the session's files are the same plates.

    Raises:
        SessionError: they are columns of force files, and the subject file does not state that those are plates.
    """
    files = [trial.forces for trial in wanted.trials if trial.forces is not None]
    if files and not wanted.instruments.same_plates:
        raise SessionError(
            f"{files[0].name}: columns of force files need not be plates (some laboratories sort steps into them, a "
            "column for each foot); if the same columns are the same plate in all files of the session, set "
            "same_plates = true under [instruments] in the subject file"
        )


def fit_subject(
    subject: str | Path | SubjectFile,
    progress: Progress = lambda stage, share: None,
    overrule: Overrule | None = None,
    terms: Sequence[type[CostTerm]] = (),
) -> Fit:
    """Estimate body segment parameters of the person in a subject file: what `kinertia fit` does, in one call.

    Args:
        subject: the file, or the result of `read_subject`.
        progress: called as the work progresses, with a stage's name and the share of it that is done.
        overrule: what is overruled besides what the subject file says.
        terms: cost terms of your own, besides those of the simultaneous estimate, in any order: classes like the
            example under "Cost terms" on the page about the architecture.

    Raises:
        KinertiaError: a file is missing or broken, or something in it cannot be used.
    """
    wanted = subject if isinstance(subject, SubjectFile) else read_subject(subject)
    return estimate(prepare_subject(wanted, progress, overrule), progress, terms)
