"""Defines `kinertia population`, `norms` and `instruments`: what fits of a group or session teach for later ones."""

import csv
import io
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from kinertia.cli.common import Outcome, Quiet, out, own_file, plain_table, shown_progress
from kinertia.cli.findings import show_all
from kinertia.cohort.tables import fitted_people
from kinertia.errors import FileError, KinertiaError, PriorError, SessionError
from kinertia.estimation.identifiability import evidence
from kinertia.estimation.learnt_prior import LearntPrior, PersonInformation, information_of, learn
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.mean_cycles import Control, band_columns, mixture
from kinertia.estimation.simultaneous.instruments.instrument_errors import SHOWN_UNIT
from kinertia.io.norms_file import read_norms
from kinertia.io.output_folder import write_then_rename
from kinertia.io.recording import MARKER_FILES
from kinertia.io.subject.learnt_files import expect_session, population_text, read_population, session_text
from kinertia.io.subject.provenance import recordings
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import InstrumentsFiles, SubjectFile
from kinertia.io.text.csv_file import inert
from kinertia.io.versions import VERSION
from kinertia.model.bsp import PARAMETERS
from kinertia.report.exports.saved_fit import FIT_FILE, SavedFit, read_saved
from kinertia.workflow.from_files import check_plates, fit_subject
from kinertia.workflow.session import SessionInstruments, person_instruments, session_instruments

_SHOWN = 12


@dataclass(frozen=True)
class PersonResults:
    """Folder of one person's results, and the person's name in a cohort; None in results of `kinertia fit`."""

    folder: Path
    name: str | None = None


def results_of_people(results: list[Path]) -> list[PersonResults]:
    """List every person's results in these folders, each once; reports those that a cohort no longer lists."""
    found: list[PersonResults] = []
    for path in results:
        if (path / FIT_FILE).is_file():
            found.append(PersonResults(path))
        elif people := sorted(path.glob(f"people/*/{FIT_FILE}")):
            listed = fitted_people(path)
            for folder in (file.parent for file in people):
                if listed is None or inert(folder.name) in listed:
                    found.append(PersonResults(folder, folder.name))
                else:
                    older = "has no current results according to people.csv, only older ones"
                    out.print(f"left out: {folder.name}: {older}", soft_wrap=True)
        elif people := sorted(path.glob(f"*/{FIT_FILE}")):
            found += [PersonResults(file.parent) for file in people]
        else:
            raise FileError(path, "holds no results of kinertia cohort or kinertia fit")
    return list(dict.fromkeys(found))


def population(
    results: Annotated[
        list[Path], typer.Argument(help="Folders written by kinertia cohort or kinertia fit, for people of one group.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path("population.toml"),
    without: Annotated[
        list[str] | None, typer.Option(help="Person to leave out, by name; may be given several times.")
    ] = None,
    quiet: Quiet = False,
) -> Outcome:
    """Learn the mean body and its spread between people from the fits of a group.

    Each person's trials show little about most parameters, all together show
    much about their mean. Writes a file for population = "..." under \\[prior]
    in the subject files of other people of the group.

    [bold]Examples[/]

    kinertia population out -o population.toml

    kinertia population out --without anna -o for_anna.toml
    """
    own_file(output, read_population, "kinertia population")
    people, files = _read(results_of_people(results), set(without or ()))
    learnt = learn(people)
    content = learnt.as_file(VERSION, [person.name for person in people], files)
    write_then_rename(output, population_text(content))
    _report(learnt)
    out.print(f"written to {output}; name it in subject files: population = ... under [prior]", soft_wrap=True)
    return Outcome({"file": str(output), "people": learnt.people, "parameters": _parameters(learnt)})


def _parameters(learnt: LearntPrior) -> list[dict[str, Any]]:
    """Return what was learnt of each parameter, in the literature's SDs."""
    names = [(segment, parameter) for segment in learnt.segments for parameter in PARAMETERS]
    columns = (learnt.mean, learnt.mean_sd, np.sqrt(np.diag(learnt.covariance)), learnt.learnt)
    return [
        {
            "segment": segment,
            "parameter": parameter,
            **dict(zip(("mean", "mean_sd", "spread", "learnt"), row, strict=True)),
        }
        for (segment, parameter), row in zip(names, np.transpose(columns).tolist(), strict=True)
    ]


def _read(results: list[PersonResults], without: set[str]) -> tuple[list[PersonInformation], tuple[str, ...]]:
    """Read each person's information and the SHA-256 of the files; reports people left out without error bars."""
    people: list[PersonInformation] = []
    files: list[str] = []
    met = set()
    with shown_progress() as progress:
        for k, results_of_person in enumerate(results):
            progress("reading", k / len(results))
            saved = read_saved(results_of_person.folder)
            if names := {saved.fit.subject.name, results_of_person.folder.name} & without:
                met |= names
                continue
            recorded = _recordings(saved)
            if twice := set(recorded) & set(files):
                problem = f"{len(twice)} of its files also belong to another person here; give each once"
                raise PriorError(f"{results_of_person.folder}: {problem}")
            try:
                person = information_of(saved.fit)
                people.append(replace(person, name=results_of_person.name or person.name))
            except KinertiaError as error:
                out.print(f"left out: {error}", soft_wrap=True)
                continue
            files += recorded
    if lost := without - met:
        raise PriorError(f"nobody is called {', '.join(sorted(lost))} here")
    return people, tuple(files)


def _recordings(saved: SavedFit) -> list[str]:
    """Return the SHA-256 of the marker files of a result; marker sets, loads and sessions are shared by many people."""
    files = {} if saved.provenance is None else saved.provenance.files
    return [content for name, content in files.items() if Path(name).suffix.lower() in MARKER_FILES]


def _report(learnt: LearntPrior) -> None:
    """Show the parameters whose mean is farthest from the tables, and how much was learnt in all."""
    words = [evidence(share) for share in learnt.learnt]
    table = plain_table("segment", "parameter", "mean", "known to", "spread")
    spread = np.sqrt(np.diag(learnt.covariance))
    for k in np.argsort(-np.abs(learnt.mean) / learnt.mean_sd)[:_SHOWN]:
        numbers = (f"{learnt.mean[k]:+.2f}", f"{learnt.mean_sd[k]:.2f}", f"{spread[k]:.2f}")
        table.add_row(learnt.segments[k // len(PARAMETERS)], PARAMETERS[k % len(PARAMETERS)], *numbers)
    out.print(table)
    counts = ", ".join(f"{words.count(word)} {word}" for word in ("measured", "informed", "assumed"))
    out.print(
        f"{learnt.people} people; means relative to the literature, in its standard deviations, clearest first; "
        f"parameters of another person, by the group's information: {counts}"
    )


def norms(
    results: Annotated[
        list[Path],
        typer.Argument(help="Folders of kinertia fit, one per control; a cohort; or folders of such folders."),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path("norms.csv"),
    quiet: Quiet = False,
) -> Outcome:
    """Make your laboratory's normative bands from the fits of people without pathology.

    Mean and SD between people at every percent of the gait cycle; each person
    counts once. kinertia report draws the bands and adds the Gait Profile Score.

    [bold]Examples[/]

    kinertia norms controls/anna controls/ben controls/cleo -o norms.csv

    kinertia report out --norms norms.csv
    """
    own_file(output, read_norms, "kinertia norms")
    people: dict[str, Control] = {}
    seen: set[str] = set()
    folders = results_of_people(results)
    with shown_progress() as progress:
        for k, found in enumerate(folders):
            progress("reading", k / len(folders))
            saved = read_saved(found.folder)
            fit, name = saved.fit, found.name or _name(saved.fit, found.folder)
            files = set() if saved.provenance is None else set(saved.provenance.files.values())
            if name in people or files & seen:
                raise FileError(found.folder, f"is a second fit of {name}: give one folder per person")
            seen |= files
            try:
                people[name] = Control.of(fit)
            except KinertiaError as error:
                out.print(f"left out: {error}", soft_wrap=True)
    columns = band_columns(list(people.values()))
    write_then_rename(output, norms_text(columns))
    if mixed := mixture(list(people.values())):
        out.print(f"note: {mixed}", soft_wrap=True)
    spans = {name: columns[name][0] for name in columns if name.endswith(("_min", "_max"))}
    out.print(f"norms of {len(people)} people{_spans_text(spans)} in {output}", soft_wrap=True)
    summary = {"file": str(output), "people": sorted(people), "convention": columns["convention"][0], "note": mixed}
    return Outcome({**summary, **spans})


def _name(fit: Fit, folder: Path) -> str:
    """Return the person's name, or the folder's name if the fit is only named after its trial."""
    return folder.resolve().name if fit.subject.name in {trial.name for trial in fit.trials} else fit.subject.name


def _spans_text(spans: dict[str, float | None]) -> str:
    words = []
    for name, unit in (("age_years", "years"), ("speed_m_s", "m/s")):
        low, high = spans[f"{name}_min"], spans[f"{name}_max"]
        if low is not None and high is not None:
            words.append(f"{low:g} {unit}" if low == high else f"{low:g} to {high:g} {unit}")
    return f" ({', '.join(words)})" if words else ""


def norms_text(columns: dict[str, list[object]]) -> str:
    """Return the text of a file of norms."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        writer.writerow(
            ["" if cell is None else f"{cell:.6g}" if isinstance(cell, float) else inert(cell) for cell in row]
        )
    return text.getvalue()


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
    for path, subject in zip(subjects, wanted, strict=True):
        if subject.instruments != wanted[0].instruments:
            raise SessionError(f"{path}: [instruments] differs from that of {subjects[0]}; it is the session's")
    own_file(output, expect_session, "kinertia instruments")
    people = []
    for subject in wanted:
        with shown_progress() as progress:
            fit = fit_subject(subject, progress)
        people.append(person_instruments(fit, recordings(subject)))
    session = session_instruments(people, wanted[0].instruments)
    write_then_rename(output, session_text(output.name, VERSION, session.found, session.people))
    _show_instruments(session)
    out.print(f"written to {output}; name it in the subject files: session = ... under [instruments]", soft_wrap=True)
    names = [person.name for person in session.people]
    return Outcome(
        {
            "file": str(output),
            "people": names,
            "found": [asdict(error) for error in session.errors],
            "findings": [contradiction.to_dict() for contradiction in session.contradictions],
        }
    )


def _wanted(path: Path) -> SubjectFile:
    """Read a subject file, without what an earlier run found about the session."""
    if path.suffix.lower() != ".toml":
        raise FileError(path, "expected a subject file (.toml); kinertia init FOLDER drafts one of a person's files")
    wanted = read_subject(path)
    check_plates(wanted)
    table = InstrumentsFiles.model_validate({**wanted.instruments.model_dump(), "session": None})
    return wanted.model_copy(update={"instruments": table})


def _show_instruments(session: SessionInstruments) -> None:
    table = plain_table("instrument", "quantity", "error", "sd", "unit")
    for instrument, quantities in session.found.items():
        for quantity, (value, sd, unit) in quantities.items():
            factor, shown = SHOWN_UNIT[unit]
            table.add_row(instrument, quantity, f"{value * factor:+.1f}", f"{sd * factor:.1f}", shown)
    out.print(table)
    show_all(session.contradictions)
