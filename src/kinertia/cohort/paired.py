"""Compares two conditions, or two sessions, of each person of a cohort, and shows what changed in the group.

A person's changes stay in `changes/NAME.json` and are computed again when the results that they are from change.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from kinertia.cohort.people import Participant
from kinertia.cohort.record import RECORD, Place, one_line
from kinertia.errors import KinertiaError, SettingsError
from kinertia.estimation.changes.change import Change, GroupChange, group_changes
from kinertia.io.output_folder import write_then_rename
from kinertia.io.subject.provenance import sha256
from kinertia.io.subject.reader import read_subject
from kinertia.io.versions import VERSION
from kinertia.report.comparison.change_tables import group_rows, person_columns
from kinertia.report.comparison.what_changed import compare
from kinertia.report.pages.rendering import Part
from kinertia.studies.parallel import in_parallel

FOLDER = "changes"
HEADINGS = ("outcome", "unit", "people", "before", "after", "mean change", "95 % interval", "SD of changes", "changed")


@dataclass(frozen=True)
class Pair:
    """Two conditions of one person.

    Attributes:
        person: name of the person.
        results: names of the results: of one fit, or of two sessions; none of a person who lacks one of both.
    """

    person: str
    results: tuple[str, ...]


@dataclass(frozen=True)
class PersonChanges:
    """What changed in one person; `remarks` is why nothing can be compared."""

    person: str
    changes: tuple[Change, ...] = ()
    remarks: str = ""

    def columns(self) -> dict[str, list[Any]]:
        """Return the person's rows of `changes.csv`: one per outcome, or one with the remark."""
        if not self.changes:
            return {"person": [self.person], "verdict": ["cannot be judged"], "remarks": [self.remarks]}
        return person_columns(self.person, self.changes)


def pairs_of(people: Sequence[Participant], conditions: tuple[str, str]) -> list[Pair]:
    """List everyone, and what they have of both: two sessions of these names, or else trials of both conditions.

    Raises:
        SettingsError: nobody has both.
    """
    sessions: dict[str, dict[str, str]] = {}
    for participant in people:
        if participant.session in conditions:
            sessions.setdefault(participant.person, {})[participant.session] = participant.name
    pairs = {
        person: Pair(person, tuple(sessions_of[name] for name in conditions))
        for person, sessions_of in sessions.items()
        if len(sessions_of) == len(set(conditions)) == 2
    }
    stated: set[str] = {participant.session for participant in people}
    for participant in people:
        own_conditions = set() if participant.session else _conditions(participant)
        stated |= own_conditions
        if set(conditions) <= own_conditions and len(set(conditions)) == 2:
            pairs.setdefault(participant.person, Pair(participant.person, (participant.name,)))
    if not pairs:
        known = ", ".join(sorted(filter(None, stated))) or "none"
        raise SettingsError(f"nobody has sessions or conditions {' and '.join(conditions)}; stated are: {known}")
    return [pairs.get(name, Pair(name, ())) for name in dict.fromkeys(participant.person for participant in people)]


def _conditions(participant: Participant) -> set[str]:
    try:
        return (
            set()
            if participant.subject is None
            else {trial.condition for trial in read_subject(participant.subject).trials}
        )
    except KinertiaError:
        return set()  # the list of people states what is wrong


def changes_of(
    cohort: Path, pairs: Sequence[Pair], conditions: tuple[str, str], progress: Callable[[str, float], None]
) -> list[PersonChanges]:
    """Compare both conditions of each person, in one process per core."""
    (cohort / FOLDER).mkdir(exist_ok=True)
    cases = [(cohort, pair, conditions) for pair in pairs]
    return in_parallel(_changes, cases, progress=lambda share: progress("changes", share))


def _changes(case: tuple[Path, Pair, tuple[str, str]]) -> PersonChanges:
    cohort, pair, conditions = case
    if not pair.results:
        return PersonChanges(pair.person, remarks="one of both is lacking")
    folders = [Place(cohort, name).results for name in pair.results]
    lacking = [name for name, folder in zip(pair.results, folders, strict=True) if not (folder / RECORD).is_file()]
    if lacking:
        return PersonChanges(pair.person, remarks=f"not fitted: {', '.join(lacking)}")
    known = [VERSION, conditions, [sha256(folder / RECORD) for folder in folders]]
    cause = hashlib.sha256(json.dumps(known).encode()).hexdigest()
    kept = cohort / FOLDER / f"{pair.person}.json"
    if (before := _kept(kept, cause)) is not None:
        return PersonChanges(pair.person, before)
    try:
        found = compare(folders[0], folders[1]) if len(folders) == 2 else compare(folders[0], conditions=conditions)
    except KinertiaError as error:
        return PersonChanges(pair.person, remarks=one_line(str(error)))
    changes = (*found.steps, *found.outcomes)
    write_then_rename(kept, json.dumps({"cause": cause, "changes": [asdict(change) for change in changes]}) + "\n")
    return PersonChanges(pair.person, changes)


def _kept(path: Path, cause: str) -> tuple[Change, ...] | None:
    """Return what was computed before from the same results; None if nothing was."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["cause"] != cause:
            return None
        return tuple(Change(**{**entry, **_pairs(entry)}) for entry in content["changes"])
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _pairs(entry: Mapping[str, Any]) -> dict[str, Any]:
    return {name: tuple(entry[name]) for name in ("strides", "stride_sd")}


def means_of(people: Sequence[PersonChanges]) -> tuple[GroupChange, ...]:
    """Average the changes over people."""
    return group_changes({changed.person: changed.changes for changed in people})


def changes_sentence(people: Sequence[PersonChanges]) -> str:
    """State how many people are compared, and why others are not."""
    compared = sum(bool(changed.changes) for changed in people)
    sentence = f"{compared} of {len(people)} people compared: changes.csv, change_means.csv"
    lacking = [f"{changed.person}: {changed.remarks}" for changed in people if not changed.changes]
    return f"{sentence}; not compared: {'; '.join(lacking)}" if lacking else sentence


def mean_parts(people: Sequence[PersonChanges], conditions: tuple[str, str] | None) -> Iterator[Part]:
    """Return a table of the mean changes: speed, steps and the primary outcomes."""
    means = means_of(people)
    if means and conditions is not None:
        text = (
            "Mean over people, with its 95 % interval; SD of changes between people, errors of measurement included; "
            "people whose own change is shown. All outcomes: change_means.csv; everyone's: changes.csv."
        )
        yield Part(f"{conditions[0]} to {conditions[1]}", (text,), headings=HEADINGS, rows=group_rows(means))
