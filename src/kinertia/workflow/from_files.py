"""Leads from a subject file to its recordings, to what an estimator needs, and to a `Fit`.

Modules that only some subject files need are imported where they are used: all together take as long as reading a
trial.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinertia.errors import PriorError, SessionError, SettingsError
from kinertia.estimation.prepared import Prepared, Progress
from kinertia.estimation.result.fit import Fit
from kinertia.findings.finding import Finding, finding
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
    wanted, unused = _used(wanted)
    session = _session(wanted)
    measures = _measures(wanted)
    screened = screen(read_person(wanted, progress).with_overrule(overrule or Overrule()))
    body = _known_body(wanted, measures)
    ready = prepared(screened, wanted.settings, progress, known=body)
    ready = replace(ready, findings=(*ready.findings, *unused))
    if wanted.instruments == _only_recordings(wanted.instruments):
        return ready
    from kinertia.workflow.session import with_instruments

    return with_instruments(ready, wanted.instruments, session, recordings(wanted))


def _used(wanted: SubjectFile) -> tuple[SubjectFile, list[Finding]]:
    """Return the subject file without entries that its method does not use, and a finding for each that it has.

    Raises:
        SettingsError: a prosthesis is to mirror the other side.
    """
    settings = wanted.settings
    prostheses = [name for name, segment in wanted.segments.items() if segment.prosthesis]
    if prostheses and settings.uses.symmetry and settings.symmetry:
        raise SettingsError.of_entry(
            ", ".join(prostheses),
            "a prosthesis does not mirror the other side; use the default method, or symmetry = false",
        )
    without: dict[str, dict[str, Any]] = {}
    if not settings.uses.priors:
        without["[prior] and [segment]"] = {"prior": PriorFiles(), "segments": {}}
    if not settings.uses.instruments:
        without["[instruments]"] = {"instruments": _only_recordings(wanted.instruments)}
    used, unused = wanted, []
    for entry, values in without.items():
        before, used = used, used.model_copy(update=values)
        unused += [] if used == before else [finding("F194", entry=Quantity(entry))]
    return used, unused


def _only_recordings(instruments: InstrumentsFiles) -> InstrumentsFiles:
    """Return what concerns the recordings, and nothing of the errors of instruments."""
    return InstrumentsFiles(date=instruments.date, zeroed=instruments.zeroed, plates=instruments.plates)


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


def _known_body(wanted: SubjectFile, measures: BodyMeasures | None) -> KnownBody | None:
    """Return what is known of the body besides mass, height and sex; None if nothing."""
    if wanted.prior == PriorFiles() and not wanted.segments:
        return None
    from kinertia.io.subject.body_files import read_bsp
    from kinertia.workflow.known_body import KnownBody

    earlier = None if wanted.prior.bsp is None else read_bsp(wanted.prior.bsp)
    group = None if wanted.prior.population is None else _group(wanted, wanted.prior.population)
    return KnownBody(wanted.prior, earlier, wanted.segments, group, measures)


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
