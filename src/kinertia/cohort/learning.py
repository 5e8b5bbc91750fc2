"""Teaches a cohort its own group prior: subject files for a second fit, each person left out of the prior.

For bodies this is the group's prior (`estimation.learnt_prior`), learnt from all others for a tenth of the people at a
time. For plates and synchronisation it is the combined information of one day's people (`estimation.session`), from
which a fit leaves out its own. The second fits are a cohort of their own, whose subject files name both; as in any
cohort, a person is fitted again when they change.
"""

import datetime
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from kinertia.cohort.people import Participant
from kinertia.cohort.record import RECORD, Place
from kinertia.errors import KinertiaError, PriorError
from kinertia.estimation.learnt_prior import FEWEST_PEOPLE, LearntPrior, PersonInformation, information_of, learn
from kinertia.estimation.prepared import known
from kinertia.io.file_names import path_from
from kinertia.io.output_folder import write_then_rename
from kinertia.io.subject.learnt_files import PersonInstruments, population_text, session_text
from kinertia.io.subject.person_recordings import session_date
from kinertia.io.subject.provenance import recordings, sha256
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import InstrumentsFiles, SubjectFile, subject_text
from kinertia.io.text.toml_lines import read_toml
from kinertia.io.versions import VERSION
from kinertia.report.exports.saved_fit import read_saved
from kinertia.studies.parallel import in_parallel
from kinertia.workflow.from_files import check_plates
from kinertia.workflow.session import person_instruments, session_instruments

FOLDER = "learnt"
_DONE = "learnt.json"
PARTS = 10
"""Number of parts of the people; each part's prior is learnt from the others."""
_FILES = ("static", "osim", "markers", "forces", "loads", "session", "bsp", "population", "measures")
"""Keys of a subject file that name files."""


@dataclass
class _Known:
    """What is known of one person from the first fits.

    Attributes:
        name, subject: name and subject file in the cohort's list.
        wanted: content of the subject file.
        recordings: SHA-256 of the recordings.
        body: information from the person's trials on the body; None where unusable.
        instruments: information on plates and synchronisation.
        entries: entries for the subject file of the second fit, by table and key.
    """

    name: str
    subject: Path
    wanted: SubjectFile
    recordings: tuple[str, ...]
    body: PersonInformation | None
    instruments: PersonInstruments | None
    entries: dict[str, dict[str, str]] = field(default_factory=dict)


def write_second_study(
    cohort: Path, people: Sequence[Participant], progress: Callable[[str, float], None]
) -> tuple[list[Participant], list[str]]:
    """Learn from the results of these people, and write the subject files of their second fits.

    Args:
        cohort: folder of the first fits; everything goes to a folder in it.
        people: people with results there, and so with a subject file.
        progress: called as the work progresses.

    Returns:
        the people of the second study, and sentences about what could not be learnt and whose data were not used.

    Raises:
        KinertiaError: nothing can be learnt at all.
    """
    folder = cohort / FOLDER
    cause = _cause(cohort, people)
    if (before := _learnt_before(folder, cause)) is not None:
        return [Participant(person.name, _subject_of(folder, person.name)) for person in people], before
    notes: list[str] = []
    everybody = []
    for k, person in enumerate(people):
        progress("reading results", k / len(people))
        everybody.append(_read(cohort, person, notes))
    once = {fitted_person.name for fitted_person in _others((), everybody)}
    twice = [fitted_person.name for fitted_person in everybody if fitted_person.name not in once]
    notes += [
        f"{name}: not used for learning, since some of their recordings also belong to another person here"
        for name in twice
    ]
    (folder / _DONE).unlink(missing_ok=True)
    for name in ("priors", "sessions", "subjects"):
        (folder / name).mkdir(parents=True, exist_ok=True)
        for old in (folder / name).glob("*.toml"):
            old.unlink()
    _teach_bodies(
        folder / "priors",
        [fitted_person for fitted_person in everybody if fitted_person.body is not None],
        notes,
        progress,
    )
    _teach_instruments(folder / "sessions", everybody, notes)
    if not any(fitted_person.entries for fitted_person in everybody):
        raise KinertiaError(f"nothing can be learnt from these people: {'; '.join(notes)}")
    second = [_second(folder, fitted_person) for fitted_person in everybody]
    write_then_rename(folder / _DONE, json.dumps({"kinertia": VERSION, "cause": cause, "notes": notes}) + "\n")
    return second, notes


def _cause(cohort: Path, people: Sequence[Participant]) -> str:
    """Return the SHA-256 of everything that is learnt from: records of first fits, subject files by path and text."""
    parts = []
    for person in people:
        subject = known(person.subject)
        record = sha256(Place(cohort, person.name).results / RECORD)
        parts.append([person.name, str(subject.resolve()), sha256(subject), record])
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def _learnt_before(folder: Path, cause: str) -> list[str] | None:
    """Return the notes of an earlier run of this version on the same data; None where there was none."""
    try:
        done = json.loads((folder / _DONE).read_text(encoding="utf-8"))
        return list(done["notes"]) if (done["kinertia"], done["cause"]) == (VERSION, cause) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _subject_of(folder: Path, name: str) -> Path:
    return folder / "subjects" / f"{name}.toml"


def _read(cohort: Path, person: Participant, notes: list[str]) -> _Known:
    subject = known(person.subject)
    wanted = read_subject(subject)
    fit = read_saved(Place(cohort, person.name).results).fit
    of_person = _Known(person.name, subject, wanted, recordings(wanted), None, None)
    try:
        if wanted.prior.bsp is not None or wanted.prior.population is not None:
            raise PriorError(f"{person.name}: [prior] names a prior of its own")
        of_person.body = information_of(fit)
    except KinertiaError as error:
        notes.append(f"not in the group's prior, nor fitted with it: {error}")
    try:
        if wanted.instruments.session is None and fit.posterior is not None:
            check_plates(wanted)
            of_person.instruments = person_instruments(fit, of_person.recordings)
    except KinertiaError as error:
        notes.append(f"{person.name}: plate and synchronisation errors are not shared: {error}")
    return of_person


def _teach_bodies(
    folder: Path, people: Sequence[_Known], notes: list[str], progress: Callable[[str, float], None]
) -> None:
    """Write a prior for each part of the people, learnt from the others."""
    parts = [list(people[k::PARTS]) for k in range(min(PARTS, len(people)))]
    others = [_others(part, people) for part in parts]
    if min(map(len, others), default=0) < FEWEST_PEOPLE:
        found = f"{len(people)} people whose fits can be learnt from"
        notes.append(f"no prior was learnt: {found}; each one needs at least {FEWEST_PEOPLE} others")
        return
    bodies = [[person.body for person in teachers if person.body is not None] for teachers in others]
    try:
        learnt = in_parallel(learn, bodies, None, partial(progress, "learning"))
    except PriorError as error:
        notes.append(f"no prior was learnt: {error}")
        return
    for k, (part, teachers, prior) in enumerate(zip(parts, others, learnt, strict=True)):
        path = folder / f"{k + 1}.toml"
        write_then_rename(path, _population(teachers, prior))
        for person in part:
            person.entries["prior"] = {"population": str(path.resolve())}


def _others(part: Sequence[_Known], people: Sequence[_Known]) -> list[_Known]:
    """Return the people who share no recording with this part or with someone before: each counts once."""
    met = {name for person in part for name in person.recordings}
    others = []
    for person in people:
        if not met & set(person.recordings):
            others.append(person)
            met.update(person.recordings)
    return others


def _population(people: Sequence[_Known], learnt: LearntPrior) -> str:
    files = [name for person in people for name in person.recordings]
    return population_text(learnt.as_file(VERSION, [person.name for person in people], files))


def _teach_instruments(folder: Path, people: Sequence[_Known], notes: list[str]) -> None:
    """Write the combined information of each day's people on their plates and synchronisation."""
    days: dict[tuple[datetime.date, str], list[_Known]] = {}
    undated = 0
    for person in people:
        if person.instruments is None:
            continue
        day = session_date(person.wanted)
        if day is None:
            undated += 1
        else:
            days.setdefault((day, _stated(person.wanted.instruments)), []).append(person)
    if undated:
        notes.append(
            f"{undated} people without a date ([instruments] date): their plate and synchronisation errors are not "
            "shared"
        )
    for k, ((day, _), of_day) in enumerate(sorted(days.items(), key=lambda item: item[0])):
        sharing = [person for person in of_day if _plates([person]) & _plates(_others([person], of_day))]
        if not sharing:
            continue
        said = [person.instruments for person in _others((), of_day) if person.instruments is not None]
        session = session_instruments(said, of_day[0].wanted.instruments)
        notes += [f"{day}: {contradiction.line()} {contradiction.remedy}" for contradiction in session.contradictions]
        path = folder / f"{day}-{k + 1}.toml"
        write_then_rename(path, session_text(path.name, VERSION, session.found, session.people))
        for person in sharing:
            person.entries["instruments"] = {"session": str(path.resolve())}


def _stated(instruments: InstrumentsFiles) -> str:
    """Return what the laboratory states, which is the same for all people of a session."""
    return instruments.model_dump_json(exclude={"session", "date"})


def _plates(people: Sequence[_Known]) -> set[str]:
    """Return the plates on which these people stood."""
    return {plate for person in people if person.instruments is not None for plate in person.instruments.plates}


def _second(folder: Path, person: _Known) -> Participant:
    """Write the person's subject file with what was learnt, and with absolute paths."""
    content = read_toml(person.subject, "a subject file").content
    tables = {name: _from_everywhere(value, person.subject.parent) for name, value in content.items()}
    tables["subject"] = {**tables["subject"], "name": person.wanted.subject.name}
    for table, entries in person.entries.items():
        tables[table] = {**tables.get(table, {}), **entries}
    path = _subject_of(folder, person.name)
    heading = f"{person.name}, refitted with group data; written by kinertia cohort --learn"
    write_then_rename(path, subject_text(tables, heading))
    return Participant(person.name, path)


def _from_everywhere(value: Any, folder: Path) -> Any:
    """Return a table of a subject file with absolute paths."""
    if isinstance(value, list):
        return [_from_everywhere(item, folder) for item in value]
    if not isinstance(value, dict):
        return value
    absolute = dict(value)
    for key in _FILES:
        if isinstance(value.get(key), str) and (path := path_from(folder, value[key])).is_file():
            absolute[key] = str(path.resolve())
    return absolute
