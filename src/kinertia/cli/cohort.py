"""`kinertia cohort`: everybody of a study, fitted in parallel, with one table for all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from kinertia.cli.options import Force, Output, Quiet, results_folder
from kinertia.cli.terminal import out, plain_table, shown_progress
from kinertia.io.file_lock import sole_use
from kinertia.report.cohort_page import write_cohort_page
from kinertia.report.cohort_person import fit_person
from kinertia.report.cohort_tables import write_tables
from kinertia.studies.cohort_cluster import (
    Job,
    expect_extra,
    guessed_seconds,
    local_cluster,
    local_size,
    run_jobs,
    running_cluster,
)
from kinertia.studies.cohort_people import people_of
from kinertia.studies.cohort_record import Record, Standing, keep, prepare_folder, standings

_LOCK = ".kinertia-cohort.lock"
_MOST_SHOWN = 20


def cohort(
    study: Annotated[
        Path,
        typer.Argument(
            help="A folder with a folder per person, each with a subject file; or a CSV file with a row per "
            "person: subject (path of the subject file) and, if wanted, name."
        ),
    ],
    output: Output = Path("out"),
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler that runs already; left out: this computer.")
    ] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Write all tables as CSV, too.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say who would be fitted, what is missing, and roughly how long.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Fit everybody of a study, in parallel; go on where the last run ended.

    Results of each person go to out/people/NAME, as kinertia fit writes them;
    tables of everybody beside them. Run it again after adding people or
    correcting files: only those are fitted whose files or settings have
    changed. It runs on Dask, which the extra "cohort" installs.

    Exit status 1 if a check of somebody failed, or somebody could not be
    fitted: people.csv says who, and why.

    [bold]Examples[/]

    kinertia cohort STUDY --dry-run

    kinertia cohort STUDY -o out

    kinertia cohort people.csv -o out --csv

    kinertia cohort STUDY -o out --scheduler tcp://node7:8786
    """
    expect_extra()
    people = people_of(study, output)
    if not dry_run:
        results_folder(output, force)
        output.mkdir(parents=True, exist_ok=True)
        with sole_use(output / _LOCK, "the folder of this cohort"):
            prepare_folder(output)
            everybody = _standing(people, output)
            _say_due(everybody)
            records = _fitted(everybody, output.resolve(), scheduler)
            outcomes = [one.outcome(records.get(one.person.name), output) for one in everybody]
            write_tables(output, outcomes, csv)
            write_cohort_page(output)
        _report(outcomes, output)
        raise typer.Exit(int(any(record.status for record in outcomes)))
    everybody = _standing(people, output)
    _report_plan(everybody, scheduler)
    raise typer.Exit(int(any(one.problem for one in everybody)))


def _standing(people: Sequence[Any], output: Path) -> list[Standing]:
    everybody = []
    with shown_progress() as progress:
        for k, one in enumerate(standings(people, output), start=1):
            everybody.append(one)
            progress("looking for changes", k / len(people))
    return everybody


def _fitted(everybody: Sequence[Standing], output: Path, scheduler: str | None) -> dict[str, Record]:
    """Records of all that were due, by name; nothing is started where nobody is."""
    jobs = [Job.of(one, output) for one in everybody if one.due]
    records: dict[str, Record] = {}
    if not jobs:
        return records
    with shown_progress() as progress, _cluster(scheduler, len(jobs)) as client:
        progress("people", 0.0)
        for record in run_jobs(client, fit_person, jobs):
            keep(output, record)
            records[record.person] = record
            progress("people", len(records) / len(jobs))
    return records


@contextmanager
def _cluster(scheduler: str | None, people: int) -> Iterator[Any]:
    with running_cluster(scheduler) if scheduler else local_cluster(local_size(people)) as client:
        yield client


def _say_due(everybody: Sequence[Standing]) -> None:
    due, lacking = sum(one.due for one in everybody), sum(bool(one.problem) for one in everybody)
    kept = len(everybody) - due - lacking
    out.print(f"{len(everybody)} people: {due} to fit, {kept} as before, {lacking} without what a fit needs")


def _where(people: int, scheduler: str | None) -> str:
    """Where it runs."""
    if scheduler:
        return f"On the cluster of {scheduler}"
    size = local_size(people)
    each = f"each with one thread and at most {size.memory_bytes / 1024**3:.1f} GB of memory"
    return f"On this computer, in {size.workers} process{'es' if size.workers > 1 else ''}, {each}"


def _report_plan(everybody: Sequence[Standing], scheduler: str | None) -> None:
    """Who, how much, what is missing, and roughly how long."""
    table = plain_table("person", "", "trials", "frames")
    for one in everybody:
        state = one.problem or ("to fit" if one.due else "as before")
        table.add_row(one.person.name, state, str(one.trials or "–"), str(one.frames or "–"))
    out.print(table)
    _say_due(everybody)
    due = [one for one in everybody if one.due]
    if due:
        workers = 1 if scheduler else local_size(len(due)).workers
        minutes = guessed_seconds(due, workers) / 60.0
        shared = " of one processor, to be divided by the number of workers" if scheduler else ""
        out.print(f"{_where(len(due), scheduler)}: very roughly {max(1, round(minutes))} min{shared}")


def _report(outcomes: Sequence[Record], output: Path) -> None:
    noted = [record for record in outcomes if record.status]
    for record in noted[:_MOST_SHOWN]:
        word = "fail" if record.fitted else "not fitted"
        out.print(f"{word}: {record.person}: {record.sentence}", soft_wrap=True)
    if noted[_MOST_SHOWN:]:
        out.print(f"... and {len(noted) - _MOST_SHOWN} more, in people.csv")
    fitted = sum(record.fitted for record in outcomes)
    passed = len(outcomes) - len(noted)
    out.print(f"{len(outcomes)} people: {fitted} fitted, {passed} of them with all checks passed")
    out.print(
        f"results in {output}: cohort.parquet, trials.parquet, cycles.parquet, people.csv, people", soft_wrap=True
    )
