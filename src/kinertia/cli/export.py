"""`kinertia export`: tables of a fit, and draws from its posterior, for other programs."""

from __future__ import annotations

from json import dumps
from pathlib import Path
from typing import Annotated, Any

import typer

from kinertia.cli.options import Overwrite, Quiet, results_folder
from kinertia.cli.outcome import Outcome
from kinertia.cli.terminal import out
from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import VERSION
from kinertia.report.draw_files import write_draws
from kinertia.report.saved_fit import load_fit
from kinertia.report.tables import write_csv, write_json, write_mat


def export(
    results: Annotated[Path, typer.Argument(help="Folder that kinertia fit has written.")],
    csv: Annotated[bool, typer.Option("--csv", help="A file per table, for Excel, R and others.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="One file, tables.json; which files were written is printed as JSON, too.")
    ] = False,
    mat: Annotated[bool, typer.Option("--mat", help="One file, tables.mat, for MATLAB and Octave.")] = False,
    draws: Annotated[
        int,
        typer.Option(
            "--draws", min=0, metavar="N", help="N posterior draws as OpenSim files: model, motion and loads together."
        ),
    ] = 0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Which of the kept draws; 0: the first.")] = 0,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the tables.")] = Path("export"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Write all tables of a fit (segments, calibration, strides, curves), or draws from its posterior.

    [bold]Examples[/]

    kinertia export out --csv

    kinertia export out --mat -o matlab

    kinertia export out --draws 50 -o draws
    """
    if not (csv or as_json or mat or draws):
        raise typer.BadParameter("say in which form: --csv, --json, --mat or --draws N (several at once are fine)")
    results_folder(output, overwrite)
    fit = load_fit(results)
    with complete_folder(output, "export") as work:
        content: dict[str, Any] = {"kinertia": VERSION, "results": str(results), "subject": fit.subject.model_dump()}
        if draws:
            content["draws"] = {"count": draws, "seed": seed}
        (work / "export.json").write_text(dumps(content, indent=2) + "\n", encoding="utf-8")
        if csv:
            write_csv(fit, work)
        if as_json:
            write_json(fit, work / "tables.json")
        if mat:
            write_mat(fit, work / "tables.mat")
        if draws:
            write_draws(fit, work, draws, seed)
    out.print(f"files in {output}", soft_wrap=True)
    files = sorted(path.relative_to(output).as_posix() for path in output.rglob("*.*") if not path.name.startswith("."))
    return Outcome({"folder": str(output), "files": files})
