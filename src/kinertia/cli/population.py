"""Defines `kinertia population`: learns the mean and spread of BSPs from the fits of a group."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from kinertia.cli.options import Quiet, own_file
from kinertia.cli.outcome import Outcome
from kinertia.cli.results_of_people import PersonResults, results_of_people
from kinertia.cli.terminal import out, plain_table, shown_progress
from kinertia.errors import KinertiaError, PriorError
from kinertia.estimation.identifiability import evidence
from kinertia.estimation.learnt_prior import LearntPrior, PersonInformation, information_of, learn
from kinertia.io.recording import MARKER_FILES
from kinertia.io.results.output_folder import write_then_rename
from kinertia.io.subject.population_file import population_text, read_population
from kinertia.io.versions import VERSION
from kinertia.model.bsp import PARAMETERS
from kinertia.report.exports.saved_fit import SavedFit, read_saved

_SHOWN = 12


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
        for k, one in enumerate(results):
            progress("reading", k / len(results))
            saved = read_saved(one.folder)
            if names := {saved.fit.subject.name, one.folder.name} & without:
                met |= names
                continue
            own = _recordings(saved)
            if twice := set(own) & set(files):
                problem = f"{len(twice)} of its files also belong to another person here; give each once"
                raise PriorError(f"{one.folder}: {problem}")
            try:
                person = information_of(saved.fit)
                people.append(replace(person, name=one.name or person.name))
            except KinertiaError as error:
                out.print(f"left out: {error}", soft_wrap=True)
                continue
            files += own
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
