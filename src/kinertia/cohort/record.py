"""Records the state of each person of a cohort, and decides who has to be fitted again.

A person's results and the record of what they are from appear in one folder at once (`people/NAME/person.json`); a
person who cannot be fitted has only the record (`failed/NAME.json`). A record identifies what went into the fit by one
SHA-256: every entry of the subject file, with the content of the files in place of their names.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from kinertia.cohort.people import Participant
from kinertia.errors import KinertiaError
from kinertia.io.output_folder import write_then_rename
from kinertia.io.recording import frame_count
from kinertia.io.subject.provenance import sha256
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import SubjectFile
from kinertia.io.versions import VERSION
from kinertia.io.working_folder import sweep

RECORD = "person.json"
PASSED, AGAINST, BAD_INPUT, FAILED = 0, 1, 2, 70
"""Statuses of people, as of commands."""


@dataclass(frozen=True)
class Record:
    """How the fit of one person ended.

    Attributes:
        person: name of the person.
        status: 0 fitted, 1 fitted with an open ERROR or without a trial, 2 an error in the files, 70 Kinertia or
            its process failed.
        sentence: what is wrong with it; empty if nothing is.
        inputs: SHA-256 of all inputs; empty where the same input may end differently.
        kinertia: version of Kinertia.
        trials: number of trials.
        seconds: computing time.
        verdict: verdict on the result, "use", "use with care" or "do not use"; empty without one.
        overruled: codes that the subject file waives or ignores, with spaces between them.
    """

    person: str
    status: int
    sentence: str
    inputs: str
    kinertia: str
    trials: int
    seconds: float
    verdict: str = ""
    overruled: str = ""

    @property
    def fitted(self) -> bool:
        """Whether there are results."""
        return self.status in (PASSED, AGAINST)

    def text(self) -> str:
        """Return the text of the record as stored."""
        return json.dumps(asdict(self), indent=1) + "\n"


@dataclass(frozen=True)
class Place:
    """Places of one person's results in the folder of a cohort."""

    cohort: Path
    person: str

    @property
    def results(self) -> Path:
        """Folder of the results."""
        return self.cohort / "people" / self.person

    @property
    def failure(self) -> Path:
        """Record of a person without results."""
        return self.cohort / "failed" / f"{self.person}.json"

    @property
    def findings(self) -> Path:
        """Findings of a person without results."""
        return self.cohort / "failed" / f"{self.person}.parquet"

    @property
    def log(self) -> Path:
        """Log of a failure for Kinertia's developers."""
        return self.cohort / "failed" / f"{self.person}.log"

    def record(self, inputs: str) -> Record | None:
        """Return the record of an earlier run of this version on these inputs; None where there is none.

        Results of other inputs stay until they are replaced: an entry that is changed and changed back costs
        nothing.
        """
        records = (_read(self.results / RECORD), _read(self.failure))
        return next((known for known in records if known and (known.inputs, known.kinertia) == (inputs, VERSION)), None)


@dataclass(frozen=True)
class Standing:
    """State of one person before a run.

    Attributes:
        person: the person.
        trials: number of trials in the subject file.
        frames: frames of all trials, by their headers.
        inputs: SHA-256 of all that goes into the fit.
        record: record of an earlier run on these inputs.
        problem: why the person cannot be fitted, in one line; empty otherwise.
    """

    person: Participant
    trials: int
    frames: int
    inputs: str
    record: Record | None
    problem: str

    def outcome(self, record: Record | None, cohort: Path) -> Record:
        """Return the record for the list of people: of this run, an earlier one, or why nothing could be fitted."""
        known = (
            record or self.record or Record(self.person.name, BAD_INPUT, self.problem, "", VERSION, self.trials, 0.0)
        )
        if known.fitted or not Place(cohort, known.person).results.is_dir():
            return known
        return replace(known, sentence=f"{known.sentence} (results of other files are in people/{known.person})")

    @property
    def due(self) -> bool:
        """Whether there is something to fit."""
        return not self.problem and self.record is None


def prepare_folder(cohort: Path) -> None:
    """Make the folders of results and records, and remove what a killed run left there."""
    for folder in (cohort, cohort / "people", cohort / "failed"):
        folder.mkdir(parents=True, exist_ok=True)
        sweep(folder)
    for log in (cohort / "failed").glob("*.log"):
        if not log.with_suffix(".json").exists():  # of a person at work when the run was killed
            log.unlink()
    write_then_rename(cohort / "cohort.json", json.dumps({"kinertia": VERSION, "results": "cohort"}) + "\n")


def keep(cohort: Path, record: Record) -> None:
    """Record how a fit without results ended; results bring their own record and replace this one."""
    place = Place(cohort, record.person)
    if not record.fitted:
        write_then_rename(place.failure, record.text())
        return
    for path in (place.failure, place.findings, place.log):
        path.unlink(missing_ok=True)


def standings(people: Sequence[Participant], cohort: Path) -> Iterator[Standing]:
    """Yield each person's state in turn: all files are read for their hashes.

    A person listed a second time, by all inputs of a fit but the name, would count twice in every table and is not
    fitted.
    """
    met: dict[str, str] = {}
    for person in people:
        try:
            wanted = None if person.subject is None else read_subject(person.subject)
            content = {} if wanted is None else _contents(wanted.model_dump())
            inputs = "" if wanted is None else _hash(_for_session(content, person.session))
            if wanted is not None:
                _expect_new(person.name, content, met)
                _expect_forces(wanted)
        except (KinertiaError, OSError) as error:
            yield Standing(person, 0, 0, "", None, one_line(str(error)))
            continue
        trials = () if wanted is None else wanted.trials
        frames = sum(frame_count(trial.markers) for trial in trials)
        record = Place(cohort, person.name).record(inputs) if inputs else None
        yield Standing(person, len(trials), frames, inputs, record, person.problem)


def inputs_of(wanted: SubjectFile, session: str = "") -> str:
    """Return the SHA-256 of every entry of a subject file, defaults included, with the content of its files.

    Paths and names of the files do not affect it, nor do comments. Sessions are estimated otherwise.
    """
    return _hash(_for_session(_contents(wanted.model_dump()), session))


def _for_session(content: Mapping[str, Any], session: str) -> Mapping[str, Any]:
    return {**content, "session": True} if session else content


def _expect_new(name: str, content: Mapping[str, Any], met: dict[str, str]) -> None:
    """Raise a KinertiaError if an earlier person has the same inputs but for the name; else remember this one."""
    nameless = _hash({**content, "subject": {**content["subject"], "name": ""}})
    if (first := met.setdefault(nameless, name)) != name:
        raise KinertiaError(f"the same files and settings as '{first}', who would count twice; leave one of them out")


def _expect_forces(wanted: SubjectFile) -> None:
    """Raise a KinertiaError if a trial cannot have forces: files of other kinds than .trc may hold them."""
    for trial in wanted.trials:
        if trial.markers.suffix.lower() == ".trc" and trial.forces is None and trial.loads is None:
            raise KinertiaError(f"trial '{trial.name}' has no forces; name the force file: forces = \"...\"")


def _hash(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, default=str)  # a date
    return hashlib.sha256(text.encode()).hexdigest()


def _contents(value: Any) -> Any:
    """Replace paths by the SHA-256 of their files."""
    if isinstance(value, Path):
        return sha256(value)
    if isinstance(value, Mapping):
        return {key: _contents(content) for key, content in value.items()}
    if isinstance(value, list | tuple):
        return [_contents(content) for content in value]
    return value


def one_line(text: str) -> str:
    """Return the text without line ends."""
    return " ".join(text.split())


def _read(path: Path) -> Record | None:
    """Read a record; None where there is none, or none of this form: that person is fitted again."""
    try:
        return Record(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
