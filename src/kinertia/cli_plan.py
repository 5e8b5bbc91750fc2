"""The commands around a fit: `kinertia plan` (what to record) and `kinertia crossval` (does it hold elsewhere)."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from kinertia import __version__
from kinertia.bandwidth import Bandwidth
from kinertia.cli_options import Force, Output, Quiet, results_folder
from kinertia.config import read_subject
from kinertia.crossval import HeldOut, cross_validate
from kinertia.inputs import read_prepared
from kinertia.io.folder import complete_folder
from kinertia.plan import Plan, plan_measured, plan_synthetic
from kinertia.terminal import out, plain_table, shown_progress


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
            found = plan_synthetic()
        else:
            wanted = read_subject(subject)
            ready, cutoff_hz = read_prepared(wanted, progress), wanted.settings.cutoff_hz
            found = plan_measured(ready.skeleton, ready.prior, ready.kinematics, cutoff_hz, ready.freedom)
    _report_plan(found)
    with complete_folder(output) as work:
        found.table.to_csv(work / "plan.csv", index=False, lineterminator="\n")
        counts = {" + ".join(names): found.counts(names) for names in found.sd}
        told = json.dumps({"kinertia": __version__, "recordings": counts}, indent=2)
        (work / "plan.json").write_text(told + "\n", encoding="utf-8")
    out.print(f"predicted deviation of every parameter in {output / 'plan.csv'}, counts in plan.json")


def _report_plan(found: Plan) -> None:
    table = plain_table("recorded", "measured", "informed", "assumed", "mass", "CoM", "Ixx Iyy Izz")
    for names in found.sd:
        ratio = found.sd[names] / found.prior_sd
        means = (ratio[:, columns].mean() for columns in (slice(0, 1), slice(1, 4), slice(4, 7)))
        counts = (str(count) for count in found.counts(names).values())
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
        ready = read_prepared(wanted, progress)
        bandwidth = Bandwidth.of(ready.kinematics, wanted.settings.cutoff_hz)
        found = cross_validate(ready, bandwidth, progress)
    _report_crossval(found)
    with complete_folder(output) as work:
        told = json.dumps({"kinertia": __version__, "held_out": [asdict(held) for held in found]}, indent=2)
        (work / "crossval.json").write_text(told + "\n", encoding="utf-8")
    out.print(f"results in {output / 'crossval.json'}")


def _report_crossval(found: tuple[HeldOut, ...]) -> None:
    table = plain_table("held out", "", "objective", "force\n(N)", "moment\n(N m)", "markers\n(mm)")
    for held in found:
        for source, told in (("literature", held.literature), ("others", held.estimate)):
            cells = (f"{told.objective:.0f}", f"{told.force_rms_n:.1f}", f"{told.moment_rms_nm:.1f}")
            table.add_row(held.trial, source, *cells, f"{told.marker_rms_m * 1e3:.1f}")
    out.print("\nMotion and calibration estimated with frozen BSPs: the literature's, and those from the other trials.")
    out.print(table)
    better = sum(held.estimate.objective < held.literature.objective for held in found)
    out.print(f"the BSPs from the other trials explain {better} of {len(found)} held-out trials better")
