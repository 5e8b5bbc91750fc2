"""`kinertia study ...`: studies on synthetic trials with known truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
import typer

from kinertia.cli.options import Output, Overwrite, Quiet, results_folder
from kinertia.cli.outcome import Outcome, add_command
from kinertia.cli.terminal import out, plain_table, shown_progress
from kinertia.findings.overview import reported
from kinertia.io.subject_file import read_subject
from kinertia.report.accuracy import (
    HEADINGS,
    JOINT_CAPTION,
    JOINT_HEADINGS,
    accuracy_rows,
    accuracy_summary,
    joint_rows,
    save_accuracy,
)
from kinertia.report.extras import HOW, has_matplotlib
from kinertia.report.faults import counts, faults_summary, save_faults
from kinertia.report.populations import (
    CAPTION,
    mean_sentences,
    population_rows,
    populations_summary,
    rucksack_sentence,
    save_populations,
)
from kinertia.report.populations import HEADINGS as POPULATION_HEADINGS
from kinertia.report.sensitivity import save_sensitivity, sensitivity_summary
from kinertia.report.table1 import save_table1, table1_rows, table1_summary
from kinertia.report.table1_variants import HEADINGS as VARIANT_HEADINGS
from kinertia.report.table1_variants import save_variants, variants_frame, variants_rows
from kinertia.studies.accuracy import SCENARIOS, run_accuracy
from kinertia.studies.faults import run_faults, run_sound, sound_laboratories, synthetic_walk
from kinertia.studies.populations import run_populations
from kinertia.studies.sensitivity import KINDS, run_sensitivity
from kinertia.studies.table1 import CONDITIONS, Table1, measured_trial, run_table1, study_trial
from kinertia.studies.table1_variants import run_variants

study = typer.Typer(no_args_is_help=True, help="Studies on synthetic trials with known truth.")
SOUND_LABORATORIES = 10
Seed = Annotated[int, typer.Option(min=0, help="Same seed, same numbers, whatever the number of processes.")]
Workers = Annotated[int | None, typer.Option(min=1, help="Processes; one per core if left out.")]


def table1(
    repeats: Annotated[int, typer.Option(min=1, help="Independent draws of start and noise.")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same numbers.")] = 1,
    trial: Annotated[
        Path | None,
        typer.Option(help="Subject file of a measured trial to start from, or to have among the variants."),
    ] = None,
    variants: Annotated[
        bool,
        typer.Option("--variants", help="The noisy half again, one thing changed at a time; some 15 minutes."),
    ] = False,
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Repeat the study: 49 parameters from starts off by 50 %, with and without noise and pelvis correction.

    [bold]Examples[/]

    kinertia study table1 -o out

    kinertia study table1 --repeats 3 --trial subject.toml -o out

    kinertia study table1 --variants --trial subject.toml -o out
    """
    results_folder(output, overwrite)
    with shown_progress() as progress:
        measured = None if trial is None else measured_trial(read_subject(trial), progress)
        if variants:
            walk = None if measured is None else measured[0]
            results = run_variants(walk, repeats=repeats, seed=seed, progress=lambda share: progress("variants", share))
        else:
            source, name = measured or (study_trial(), "synthetic walk")
            table = run_table1(source, repeats, seed, name, progress=lambda share: progress(f"{repeats} draws", share))
    if variants:
        save_variants(results, output)
        _report_variants(results, seed)
        _say_where(output, ("variants.html", "variants.md", "variants.csv"), "variants.png")
        return Outcome({"seed": seed, "draws": variants_frame(results).to_dict(orient="records")})
    save_table1(table, output)
    _report_table1(table, source.deviation)
    _say_where(output, ("report.html", "table1.json", "table1.csv"), "table1.png")
    return Outcome(table1_summary(table))


def _report_variants(results: Mapping[str, Table1], seed: int) -> None:
    out.print(f"\nseed {seed}. RMS error without / with correction, both with noise: mean over the draws.\n")
    # forces and torques are in the files: a terminal is not as wide
    wanted = [k for k, heading in enumerate(VARIANT_HEADINGS) if "pelvis" not in heading and "without" not in heading]
    shown = plain_table(*(VARIANT_HEADINGS[k] for k in wanted))
    for row in variants_rows(results):
        shown.add_row(*(row[k] for k in wanted))
    out.print(shown)


def _report_table1(table: Table1, deviation: np.ndarray) -> None:
    moved = f"{deviation[:3].max() * 1e3:.2g} mm and {np.degrees(deviation[3:]).max():.2g} degrees"
    out.print(
        f"\n{table.trial}; seed {table.seed}; {len(table.draws)} draws. The pelvis was moved by at most {moved} so "
        "that the root equations hold exactly. RMS / max error: mean over the draws, spread (standard deviation), and "
        "the published value.\n"
    )
    shown = plain_table("error", *(heading.replace(", ", ",\n") for heading in CONDITIONS.values()))
    for row in table1_rows(table):
        shown.add_row(*row)
    out.print(shown)
    stopped = {c: sum(not draw.converged[c] for draw in table.draws) for c in CONDITIONS}
    for condition, count in stopped.items():
        if count:
            out.print(
                f"{CONDITIONS[condition]}: {count} of {len(table.draws)} draws stopped at the limit of evaluations"
            )


def accuracy(
    draws: Annotated[int, typer.Option(min=2, help="People in each scenario.")] = 100,
    seed: Seed = 1,
    workers: Workers = None,
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Do the error bars hold? People drawn from the literature's prior, measured with faults, estimated.

    [bold]Example[/]

    kinertia study accuracy -o out
    """
    results_folder(output, overwrite)
    with shown_progress() as progress:
        accuracies = run_accuracy(SCENARIOS, draws, seed, workers, lambda share: progress("people", share))
    save_accuracy(accuracies, seed, output)
    for scenario in accuracies.values():
        out.print(f"\n{scenario.title}; {scenario.draws} people, {100 * scenario.converged:.0f} % converged")
        for headings, rows in ((JOINT_HEADINGS, joint_rows), (HEADINGS, accuracy_rows)):
            shown = plain_table(*headings)
            for row in rows(scenario):
                shown.add_row(*row)
            out.print(shown)
    out.print(JOINT_CAPTION)
    out.print(f"\nresults in {output}: accuracy.html, accuracy.json, accuracy.md")
    return Outcome(accuracy_summary(accuracies, seed))


def populations(
    people: Annotated[int, typer.Option(min=2, help="People of each population.")] = 20,
    seed: Seed = 1,
    workers: Workers = None,
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """What does a wrong prior cost? Children, obese, old people, prostheses, with the adults' prior and their own.

    Also: what does a group teach of its mean, and is a rucksack of unknown
    mass found?

    [bold]Example[/]

    kinertia study populations -o out
    """
    results_folder(output, overwrite)
    with shown_progress() as progress:
        found = run_populations(people, seed, workers, lambda share: progress("people", share))
    save_populations(found, seed, output)
    shown = plain_table(*POPULATION_HEADINGS)
    for row in population_rows(found.accuracies):
        shown.add_row(*row)
    out.print(shown)
    out.print("\n\n".join((CAPTION, *mean_sentences(found.means), rucksack_sentence(found.rucksacks))))
    out.print(f"\nresults in {output}: populations.html, populations.json, populations.md", soft_wrap=True)
    return Outcome(populations_summary(found, seed))


def sensitivity(
    draws: Annotated[int, typer.Option(min=2, help="People in each condition.")] = 24,
    seed: Seed = 1,
    workers: Workers = None,
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Which BSPs are not highly sensitive to noisy kinematics? Errors against noise, strides and squats.

    [bold]Example[/]

    kinertia study sensitivity -o out
    """
    results_folder(output, overwrite)
    with shown_progress() as progress:
        result = run_sensitivity(draws, seed, workers, lambda share: progress("people", share))
    save_sensitivity(result, output)
    for kind, title in KINDS.items():
        listed = ", ".join(result.insensitive(kind)) or "none"
        out.print(f"small errors up to twice the amplitude of {title}: {listed}")
    out.print(f"shown by no condition: {', '.join(result.never()) or 'none'}")
    _say_where(output, ("sensitivity.html", "sensitivity.md", "sensitivity.json", "sensitivity.csv"), "sensitivity.png")
    return Outcome(sensitivity_summary(result))


def faults(
    walks: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[SUBJECT]...", help="Subject files of fault-free walks to use besides the synthetic one."
        ),
    ] = None,
    workers: Workers = None,
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Is a wrong measurement identified? Fifty known faults in fault-free walks, one at a time.

    Swapped labels, wrong axes, units, delays and zeros, another person's static
    trial and the like are made in the files of fault-free walks: a synthetic
    one, and yours. Each goes to kinertia check, and to kinertia fit where that
    does not identify it. Findings are counted by code, those in fault-free
    walks and of ten synthetic people in fault-free laboratories as well.

    [bold]Examples[/]

    kinertia study faults -o out

    kinertia study faults anna.toml ben.toml -o out
    """
    results_folder(output, overwrite)
    given = [read_subject(path) for path in walks or ()]
    with TemporaryDirectory() as folder, shown_progress() as progress:
        sources = {"synthetic walk": synthetic_walk(Path(folder) / "lab")}
        for wanted in given:
            name = wanted.subject.name
            sources[name if name not in sources else f"{name} ({len(sources)})"] = wanted
        sound, outcomes = run_faults(sources, workers=workers, progress=lambda share: progress("faults", share))
        people = sound_laboratories(Path(folder), SOUND_LABORATORIES)
        laboratories = run_sound(people, workers, lambda share: progress("fault-free laboratories", share))
    save_faults(sound, outcomes, laboratories, output)
    shown = plain_table("", *(one.name for one in sound))
    for kind in counts(()):
        shown.add_row(kind, *(str(counts([one for one in outcomes if one.walk == walk.name])[kind]) for walk in sound))
    out.print(shown)
    for one in outcomes:
        if one.outcome in ("silent", "warned"):
            out.print(f"{one.outcome}: {one.walk}: {one.mistake}" + (f": {one.code} {one.said}" if one.said else ""))
    for walk in laboratories:
        for finding in reported(walk.findings):
            out.print(f"fault-free {walk.name}: {finding.line()}")
    out.print(f"results in {output}: faults.html, faults.md, faults.json", soft_wrap=True)
    return Outcome(faults_summary(sound, outcomes, laboratories))


def _say_where(output: Path, files: Sequence[str], picture: str) -> None:
    """The files of the results, and how to have the picture, too, where matplotlib is missing."""
    drawn = has_matplotlib()
    out.print(f"results in {output}: {', '.join([*files, picture] if drawn else files)}", soft_wrap=True)
    if not drawn:
        out.print(f"no {picture}: matplotlib is not installed; install it: {HOW}", soft_wrap=True)


for command in (table1, accuracy, populations, sensitivity, faults):
    add_command(study, command)
