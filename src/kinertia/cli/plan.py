"""The commands around a fit: `kinertia plan` (what to record) and `kinertia crossval` (does it hold elsewhere)."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.options import Force, Output, Quiet, results_folder
from kinertia.cli.terminal import out, plain_table, shown_progress
from kinertia.estimation.from_files import prepare_subject
from kinertia.estimation.simultaneous.bandwidth import Bandwidth
from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import VERSION
from kinertia.io.subject_file import read_subject
from kinertia.studies.cross_validation import HeldOut, cross_validate
from kinertia.studies.plan import Plan
from kinertia.studies.plan import plan as plan_motions


def plan(
    subject: Annotated[
        Path | None,
        typer.Argument(help="Subject file (.toml) whose trials to choose from; the package's motions if left out."),
    ] = None,
    output: Output = Path("out"),
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Predict the error bar of every BSP from candidate motions, to know what to record. Estimates nothing.

    [bold]Examples[/]

    kinertia plan -o out

    kinertia plan subject.toml -o out
    """
    results_folder(output, force)
    with shown_progress() as progress:
        if subject is None:
            progress("predicting", 0.0)
            planned = plan_motions()
        else:
            wanted = read_subject(subject)
            planned = plan_motions(prepare_subject(wanted, progress), wanted.settings.cutoff_hz)
    _report_plan(planned)
    with complete_folder(output, "plan") as work:
        planned.table.to_csv(work / "plan.csv", index=False, lineterminator="\n")
        counts = {" + ".join(names): planned.counts(names) for names in planned.sd}
        text = json.dumps({"kinertia": VERSION, "recordings": counts}, indent=2)
        (work / "plan.json").write_text(text + "\n", encoding="utf-8")
    out.print(f"predicted sd of every parameter in {output / 'plan.csv'}, counts in plan.json")


def _report_plan(planned: Plan) -> None:
    table = plain_table("recorded", "measured", "informed", "assumed", "mass", "CoM", "Ixx Iyy Izz")
    for names in planned.sd:
        ratio = planned.sd[names] / planned.prior_sd
        means = (ratio[:, columns].mean() for columns in (slice(0, 1), slice(1, 4), slice(4, 7)))
        counts = (str(count) for count in planned.counts(names).values())
        table.add_row(" + ".join(names), *counts, *(f"{value:.2f}" for value in means))
    out.print(
        "\nHow many of the parameters each recording would leave measured, informed, assumed (the literature's); and "
        "the error bars over those of the literature, mean by class. Below the single recordings: the best two and "
        "three together."
    )
    out.print(table)


def crossval(
    subject: Annotated[Path, typer.Argument(help="Subject file (.toml) with two or more trials.")],
    output: Output = Path("out"),
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Hold out each trial in turn: do BSPs from the others explain it better than the literature's?

    [bold]Example[/]

    kinertia crossval subject.toml -o out
    """
    results_folder(output, force)
    wanted = read_subject(subject)
    with shown_progress() as progress:
        ready = prepare_subject(wanted, progress)
        bandwidth = Bandwidth.of(ready.kinematics, wanted.settings.cutoff_hz)
        held_out = cross_validate(ready, bandwidth, progress)
    _report_crossval(held_out, "literature" if ready.file is None else "model")
    with complete_folder(output, "crossval") as work:
        text = json.dumps({"kinertia": VERSION, "held_out": [asdict(held) for held in held_out]}, indent=2)
        (work / "crossval.json").write_text(text + "\n", encoding="utf-8")
    out.print(f"results in {output / 'crossval.json'}")


def _report_crossval(held_out: tuple[HeldOut, ...], before: str) -> None:
    table = plain_table("held out", "", "objective", "force\n(N)", "moment\n(N m)", "markers\n(mm)")
    for held in held_out:
        for source, explained in ((before, held.literature), ("others", held.estimate)):
            cells = (f"{explained.objective:.0f}", f"{explained.force_rms_n:.1f}", f"{explained.moment_rms_nm:.1f}")
            table.add_row(held.trial, source, *cells, f"{explained.marker_rms_m * 1e3:.1f}")
    out.print(f"\nMotion and calibration estimated with frozen BSPs: the {before}'s, and those from the other trials.")
    out.print(table)
    better = sum(held.estimate.objective < held.literature.objective for held in held_out)
    out.print(f"the BSPs from the other trials explain {better} of {len(held_out)} held-out trials better")
