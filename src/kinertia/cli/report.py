"""Defines `kinertia report`: writes the report of a fit again, from its results alone."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from kinertia.cli.options import Outcome, Quiet
from kinertia.cli.terminal import out
from kinertia.errors import FileError
from kinertia.estimation.result.cycles import columns_of
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.gait_scores import with_norms
from kinertia.estimation.result.mean_cycles import check_convention, gait_profile
from kinertia.io.norms_file import Norm, read_norms
from kinertia.io.results.output_folder import updated_files
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.report.exports.files import write_columns
from kinertia.report.exports.saved_fit import read_saved
from kinertia.report.figures.cycle_figures import CurvesByStage, drawn_curves
from kinertia.report.pages.page import Template, render

LETTER = "letter.html"


def report(
    results: Annotated[Path, typer.Argument(help="Folder written by kinertia fit.")],
    norms: Annotated[
        Path | None, typer.Option(help="CSV file with norms, drawn as bands: quantity,percent,mean,sd.")
    ] = None,
    letter: Annotated[
        bool, typer.Option("--letter", help="Write letter.html, too: two pages for a patient's file.")
    ] = False,
    quiet: Quiet = False,
) -> Outcome:
    """Write the report of a fit again, without the recordings: report.html in its folder is replaced.

    With --norms, gait-cycle figures show your laboratory's normative bands in
    grey. Bands made by kinertia norms add the Gait Profile Score (gps.csv, and
    of each stride in cycles.csv).

    [bold]Examples[/]

    kinertia report out

    kinertia report out --norms adults.csv --letter
    """
    saved = read_saved(results)
    curves = drawn_curves(saved.fit)
    bands, without_curve = ({}, []) if norms is None else _norms_for(saved.fit, curves, norms)
    profile = gait_profile(saved.fit, bands) if set(CLINICAL_ANGLES) <= set(bands) else None
    content = (saved.fit, saved.provenance, saved.versions, bands, saved.truth, curves)
    pages: dict[str, Template] = {"report.html": "report"}
    if letter:
        pages[LETTER] = "letter"
    with updated_files(results, "fit", ["gps.csv", LETTER]) as work:
        for name, template in pages.items():
            (work / name).write_text(render(*content, template), encoding="utf-8", newline="\n")
        cycles = bands or (results / "cycles.csv").is_file()
        if cycles and any(trial.strides for trial in saved.fit.trials):
            columns = columns_of(curves["estimate"])
            columns = with_norms(columns, bands, saved.fit.skeleton) if bands else columns
            write_columns(work / "cycles.csv", columns, "%.6g")
        if profile:
            write_columns(work / "gps.csv", profile.columns(), "%.6g")
    for name, template in pages.items():
        out.print(f"{template} in {results / name}", soft_wrap=True)
    summary: dict[str, Any] = {template: str(results / name) for name, template in pages.items()}
    summary |= {"norms": list(bands)}
    if profile:
        overall = profile.overall_deg
        out.print(f"Gait Profile Score {score_text(overall)}; {results / 'gps.csv'}", soft_wrap=True)
        for remark in profile.remarks:
            out.print(f"note: {remark}", soft_wrap=True)
        summary |= {"gps_deg": overall if np.isfinite(overall) else None, "remarks": list(profile.remarks)}
    return Outcome({**summary, "without_curve": without_curve})


def score_text(degrees: float) -> str:
    """Format the score for a terminal; without complete curves of both sides there is none."""
    return f"{degrees:.1f} degrees" if np.isfinite(degrees) else "not available: one side has no complete curves"


def _norms_for(fit: Fit, curves: CurvesByStage, path: Path) -> tuple[dict[str, Norm], list[str]]:
    """Read the norms in a file, and list those for which this fit has no curve."""
    norms, known = read_norms(path), {one.quantity for one in curves["estimate"]}
    check_convention(fit, norms)
    other = sorted(set(norms) - known)
    if len(other) == len(norms):
        expected = f"its names are those of cycles.csv, such as {min(known)}" if known else "there are no strides"
        raise FileError(
            path, f"no quantity of it is among the curves of this fit (the first is {other[0]}); {expected}"
        )
    if other:
        out.print(f"note: norms that this fit has no curve for: {', '.join(other)}")
    return {name: norm for name, norm in norms.items() if name in known}, other
