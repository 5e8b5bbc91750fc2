"""Defines `kinertia cohort`: fits all people of a study in parallel, with one table of results."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from kinertia.cli.common import (
    Outcome,
    Output,
    Overwrite,
    Quiet,
    be_quiet,
    finite,
    out,
    plain_table,
    results_folder,
    shown_progress,
)
from kinertia.cohort.cluster import (
    SlurmFile,
    doubts_of_workers,
    expect_extra,
    read_slurm,
    run_jobs,
    running_cluster,
    slurm_cluster,
)
from kinertia.cohort.job import Finished, Job, guessed_seconds, note_resources
from kinertia.cohort.learning import FOLDER as LEARNT
from kinertia.cohort.learning import write_second_study
from kinertia.cohort.local import fit_here, local_size
from kinertia.cohort.page import write_cohort_page
from kinertia.cohort.paired import Pair, changes_of, changes_sentence, mean_parts, pairs_of
from kinertia.cohort.people import Participant, people_of
from kinertia.cohort.record import Record, Standing, keep, prepare_folder, standings
from kinertia.cohort.tables import write_tables
from kinertia.cohort.worker import fit_person
from kinertia.errors import SettingsError
from kinertia.estimation.result.mean_cycles import expect_all_nine
from kinertia.io.norms_file import Norm, read_norms
from kinertia.io.working_folder import sole_use

_LOCK = ".kinertia-cohort.lock"
_MOST_SHOWN = 20


def cohort(
    study: Annotated[
        Path,
        typer.Argument(
            help="A folder with a folder per person, each with a subject file; or a CSV file with a row per "
            "person: subject (path of the subject file) and, optionally, name and session."
        ),
    ],
    output: Output = Path("out"),
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a running Dask scheduler (default: this computer).")
    ] = None,
    slurm: Annotated[
        Path | None,
        typer.Option(help="File (.toml) with the SLURM settings for workers: docs/cohort.md has a template."),
    ] = None,
    learn: Annotated[
        bool,
        typer.Option(
            "--learn",
            help="Refit everyone with group body data and same-day plate and synchronisation calibration; the results "
            "go to the folder learnt.",
        ),
    ] = False,
    conditions: Annotated[
        tuple[str, str] | None,
        typer.Option("--conditions", help="What changed from one to the other: conditions of trials, or sessions."),
    ] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Also write all tables as CSV.")] = False,
    norms: Annotated[
        Path | None, typer.Option(help="File of kinertia norms: adds Gait Profile Scores to tables and page.")
    ] = None,
    json_lines: Annotated[
        bool, typer.Option("--json-lines", help="Print progress as JSON only, one object per line.")
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run", help="Only list who would be fitted, what is missing, and roughly how long it would take."
        ),
    ] = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print everyone's outcome as JSON only, for scripts.")
    ] = False,
) -> Outcome:
    """Fit everyone in a study in parallel; continue where the last run ended.

    Results of each person go to out/people/NAME, as kinertia fit writes them; tables of all people are beside them. Run
    it again after adding people or correcting files: only people whose files or settings have changed are fitted. It
    needs the extra "cohort".

    Exit status 1 if a result has an open ERROR or a person could not be fitted: people.csv lists who, and why.

    [bold]Examples[/]

    kinertia cohort STUDY --dry-run

    kinertia cohort STUDY -o out

    kinertia cohort people.csv -o out --csv

    kinertia cohort STUDY -o out --conditions before after

    kinertia cohort STUDY -o out --learn

    kinertia cohort STUDY -o out --scheduler tcp://node7:8786

    kinertia cohort STUDY -o out --slurm slurm.toml
    """
    expect_extra()
    for option, other, both in (
        ("--scheduler", "--slurm", scheduler and slurm),
        ("--json", "--json-lines", as_json and json_lines),
        ("--learn", "--conditions", learn and conditions),
    ):
        if both:
            raise SettingsError(f"{option} and {other}: give one of them")
    where = _Where(scheduler, None if slurm is None else read_slurm(slurm))
    lines = JsonLines(json_lines)
    be_quiet(quiet or json_lines)
    wanted = _Wanted(csv, {} if norms is None else read_norms(norms), conditions)
    if norms is not None:
        expect_all_nine(wanted.norms)
    people = people_of(study, output)
    if learn and any(person.session for person in people):
        raise SettingsError("--learn does not know sessions: leave out the column 'session'")
    pairs = [] if conditions is None else pairs_of(people, conditions)
    if dry_run:
        return _plan(people, output, where, lines)
    results_folder(output, overwrite)
    output.mkdir(parents=True, exist_ok=True)
    with sole_use(output / _LOCK, "the folder of this cohort"):
        outcomes = _run(people, output, where, wanted, lines, pairs)
        if learn:
            outcomes += _run_again(people, outcomes, output, where, wanted, lines)
    fitted = [{**_ended(record), "fitted": record.fitted} for record in outcomes]
    return Outcome({"folder": str(output), "people": fitted}, int(any(record.status for record in outcomes)))


def _plan(people: Sequence[Participant], output: Path, where: _Where, lines: JsonLines) -> Outcome:
    """Show who would be fitted, without fitting anyone; status 1 if anyone's inputs are incomplete."""
    everybody = _standing(people, output, lines)
    _report_plan(everybody, where)
    plan = [_planned(standing) for standing in everybody]
    for line in plan:
        lines.say("plan", **line)
    return Outcome({"people": plan}, int(any(standing.problem for standing in everybody)))


def _planned(standing: Standing) -> dict[str, Any]:
    """Return what is to be done for a person, for scripts."""
    state = "lacking" if standing.problem else "due" if standing.due else "as before"
    return {
        "person": standing.person.name,
        "state": state,
        "trials": standing.trials,
        "frames": standing.frames,
        "why": standing.problem or ("" if standing.record is None else standing.record.sentence),
    }


def _ended(record: Record) -> dict[str, Any]:
    """Return how a person's fit ended, for scripts."""
    return {name: getattr(record, name) for name in ("person", "status", "verdict", "sentence", "seconds")}


@dataclass(frozen=True)
class _Where:
    """Where fits run: on a scheduler's workers, on SLURM's, or, with neither, on this computer."""

    scheduler: str | None
    slurm: SlurmFile | None

    def run(self, jobs: Sequence[Job], say_notes: Callable[[Sequence[str]], None]) -> Generator[Finished, None, None]:
        """Run the jobs and yield how each ended; on a running scheduler, describe first what may be wrong with it."""
        if self.scheduler:
            with running_cluster(self.scheduler) as client:
                say_notes(doubts_of_workers(client, self.scheduler))
                yield from run_jobs(client, fit_person, jobs)
        elif self.slurm is not None:
            with slurm_cluster(self.slurm, len(jobs)) as client:
                yield from run_jobs(client, fit_person, jobs)
        else:
            yield from fit_here(jobs, local_size(len(jobs)))

    def sentence(self, people: int) -> str:
        """Describe in words where fits run."""
        if self.scheduler:
            return f"On the cluster of {self.scheduler}"
        if self.slurm is not None:
            return f"On SLURM, in {min(self.slurm.workers, people)} jobs of {self.slurm.memory_gb:g} GB"
        size = local_size(people)
        limits = f"each with one thread and at most {size.memory_bytes / 1024**3:.1f} GB of memory"
        return f"On this computer, in {size.workers} process{'es' if size.workers > 1 else ''}, {limits}"

    def workers(self, people: int) -> int:
        """Return the number of workers; one where only the scheduler has it."""
        if self.scheduler:
            return 1
        return local_size(people).workers if self.slurm is None else min(self.slurm.workers, people)


@dataclass(frozen=True)
class _Wanted:
    """Options of the tables: whether to write CSV as well, norms for the gait scores, conditions to compare."""

    csv: bool
    norms: Mapping[str, Norm]
    conditions: tuple[str, str] | None


def _run(
    people: Sequence[Participant],
    output: Path,
    where: _Where,
    wanted: _Wanted,
    lines: JsonLines,
    pairs: Sequence[Pair] = (),
) -> list[Record]:
    """Fit the people who are due, and write everyone's tables and page."""
    prepare_folder(output)
    everybody = _standing(people, output, lines)
    _say_due(everybody)
    records = _fitted(everybody, output.resolve(), where, lines)
    outcomes = [standing.outcome(records.get(standing.person.name), output) for standing in everybody]
    with shown_progress() as shown:
        progress = lines.with_progress(shown)
        changes = changes_of(output, pairs, wanted.conditions, progress) if wanted.conditions else []
        write_tables(output, _each(outcomes, "tables", progress), wanted.csv, wanted.norms, changes)
        progress("page", 0.0)
        write_cohort_page(output, mean_parts(changes, wanted.conditions))
    _report(outcomes, output)
    if changes:
        out.print(changes_sentence(changes), soft_wrap=True)
    fitted, passed = sum(outcome.fitted for outcome in outcomes), sum(not outcome.status for outcome in outcomes)
    lines.say("end", folder=str(output), people=len(outcomes), fitted=fitted, passed=passed)
    return outcomes


def _run_again(
    people: Sequence[Participant],
    outcomes: Sequence[Record],
    output: Path,
    where: _Where,
    wanted: _Wanted,
    lines: JsonLines,
) -> list[Record]:
    """Refit everyone with group body data and session calibration from the first fits."""
    there = {record.person for record in outcomes if record.fitted}
    with shown_progress() as shown:
        taught = [person for person in people if person.name in there]
        second, notes = write_second_study(output, taught, lines.with_progress(shown))
    _say_notes(notes, lines)
    return _run(second, output / LEARNT, where, wanted, lines)


def _say_notes(notes: Sequence[str], lines: JsonLines) -> None:
    for note in notes:
        out.print(f"note: {note}", soft_wrap=True)
        lines.say("note", sentence=note)


def _each(records: Sequence[Record], stage: str, progress: Callable[[str, float], None]) -> Iterator[Record]:
    for k, record in enumerate(records):
        progress(stage, k / len(records))
        yield record


def _standing(people: Sequence[Participant], output: Path, lines: JsonLines) -> list[Standing]:
    everybody = []
    with shown_progress() as shown:
        progress = lines.with_progress(shown)
        for k, standing in enumerate(standings(people, output), start=1):
            everybody.append(standing)
            progress("looking for changes", k / len(people))
    return everybody


def _fitted(everybody: Sequence[Standing], output: Path, where: _Where, lines: JsonLines) -> dict[str, Record]:
    """Fit everyone who is due and return records by name; nothing is started if no one is due."""
    jobs = [Job.of(standing, output) for standing in everybody if standing.due]
    records: dict[str, Record] = {}
    if not jobs:
        return records
    with shown_progress() as shown, closing(where.run(jobs, partial(_say_notes, lines=lines))) as ended:
        progress = lines.with_progress(shown)
        progress("people", 0.0)
        for finished in ended:
            record = finished.record
            keep(output, record)
            note_resources(output, finished)
            records[record.person] = record
            lines.say("person", **_ended(record), memory_mb=finished.memory_mb, worker=finished.worker)
            progress("people", len(records) / len(jobs))
    return records


def _say_due(everybody: Sequence[Standing]) -> None:
    due, lacking = sum(standing.due for standing in everybody), sum(bool(standing.problem) for standing in everybody)
    kept = len(everybody) - due - lacking
    out.print(f"{len(everybody)} people: {due} to fit, {kept} as before, {lacking} with missing inputs")


def _report_plan(everybody: Sequence[Standing], where: _Where) -> None:
    """Show the people, the amount of data, what is missing, and roughly how long the fits take."""
    table = plain_table("person", "", "trials", "frames")
    for standing in everybody:
        before = (
            "as before"
            if standing.record is None or standing.record.fitted
            else f"as before: {standing.record.sentence}"
        )
        state = standing.problem or ("to fit" if standing.due else before)
        table.add_row(standing.person.name, state, str(standing.trials or "–"), str(standing.frames or "–"))
    out.print(table)
    _say_due(everybody)
    due = [standing for standing in everybody if standing.due]
    if due:
        minutes = guessed_seconds(due, where.workers(len(due))) / 60.0
        shared = " of one processor, to be divided by the number of workers" if where.scheduler else ""
        out.print(f"{where.sentence(len(due))}: very roughly {max(1, round(minutes))} min{shared}")


def _report(outcomes: Sequence[Record], output: Path) -> None:
    noted = [record for record in outcomes if record.status]
    for record in noted[:_MOST_SHOWN]:
        out.print(f"{record.verdict or 'not fitted'}: {record.person}: {record.sentence}", soft_wrap=True)
    if noted[_MOST_SHOWN:]:
        out.print(f"... and {len(noted) - _MOST_SHOWN} more, in people.csv")
    verdicts = Counter(record.verdict or "not fitted" for record in outcomes)
    said = ", ".join(f"{count} {word}" for word, count in verdicts.most_common())
    out.print(f"{len(outcomes)} people: {said}")
    out.print(
        f"results in {output}: cohort.html, cohort.parquet, trials.parquet, findings.parquet, cycles.parquet, "
        "instruments.parquet, people.csv, people",
        soft_wrap=True,
    )


_EVERY_S = 1.0


class JsonLines:
    """Events of a run as JSON lines; nothing is written unless they are wanted."""

    def __init__(self, wanted: bool) -> None:
        self.wanted = wanted

    def say(self, event: str, **content: Any) -> None:
        """Write one line: the name of the event and its content; numbers that are not finite are null."""
        if self.wanted:
            typer.echo(json.dumps({"event": event, **finite(content)}, allow_nan=False))

    def with_progress(self, shown: Callable[[str, float], None]) -> Callable[[str, float], None]:
        """Wrap a progress display to also write it here: at the start and end of a stage, and once a second between."""
        stage_now, began, said = "", 0.0, 0.0

        def progress(stage: str, share: float) -> None:
            nonlocal stage_now, began, said
            shown(stage, share)
            now = time.monotonic()
            new = stage != stage_now
            if new:
                stage_now, began = stage, now
            if new or share >= 1.0 or now - said >= _EVERY_S:
                said = now
                left_s = (now - began) * (1.0 - share) / share if share > 0.0 else None
                self.say("progress", stage=stage, share=round(share, 4), left_s=left_s and round(left_s, 1))

        return progress
