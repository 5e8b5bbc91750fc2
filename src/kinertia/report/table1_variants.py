"""Writes the variants of Table 1: `variants.md` (means), `variants.csv` (draws) and a picture."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from kinertia.io.results.output_folder import complete_folder
from kinertia.report.matplotlib_extra import has_matplotlib
from kinertia.report.result_page import Part, drawing, render_parts
from kinertia.report.table1 import QUANTITIES, short
from kinertia.studies.table1 import PUBLISHED, Errors, Table1
from kinertia.studies.table1_variants import CLASSES, LONG, LONG_GROUND, NOISY, distance, helped, stopped_by
from kinertia.trial.rms import rms

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEADINGS = (
    "variant",
    "draws",
    *(heading for heading, *_ in QUANTITIES.values()),
    "correction helps (% of draws): inertia, mass, CoM",
    "inertia without noise (kg m2)",
    "factor from published",
)
_CLEAN = ("no_correction_no_noise", "correction_no_noise")
_MARKS = {1e-2: "v", 1e-4: "s", 1e-6: "o"}
"""Relative change of the cost, and what marks the iteration that falls below it first."""
_SHOWN = {LONG: ("moments about the pelvis", "#0072B2"), LONG_GROUND: ("moments about the ground", "#D55E00")}


def variants_frame(tables: Mapping[str, Table1]) -> pd.DataFrame:
    """Return one row per variant, draw and condition (without noise in the first draw only): iterations and errors."""
    return pd.DataFrame(
        {
            "variant": title,
            "draw": draw.number,
            "condition": condition,
            "iterations": len(draw.costs[condition]) - 1,
            **asdict(errors),
        }
        for title, table in tables.items()
        for draw in table.draws
        for condition, errors in draw.errors.items()
    )


def variants_rows(tables: Mapping[str, Table1]) -> list[list[str]]:
    """Return the table as text, RMS errors "without / with correction"; the published values come first."""
    rows = [_row("published", 1, PUBLISHED.__getitem__, (1.0, 1.0, 1.0), 1.0)]
    for title, table in tables.items():
        rows.append(_row(title, len(table.draws), table.mean, helped(table).values(), distance(table)))
    return rows


def _row(title: str, draws: int, errors: Callable[[str], Errors], shares: Iterable[float], factor: float) -> list[str]:
    noisy, clean = ([asdict(errors(condition)) for condition in conditions] for conditions in (NOISY, _CLEAN))
    pairs = [[each[name] for each in noisy] for _, name, _ in QUANTITIES.values()]
    pairs.append([each["inertia_rms_kgm2"] for each in clean])
    *with_noise, exact = (" / ".join(short(value, 2) for value in pair) for pair in pairs)
    return [title, str(draws), *with_noise, ", ".join(f"{100 * s:.0f}" for s in shares), exact, f"{factor:.2f}"]


def variants_figure(tables: Mapping[str, Table1]) -> Figure:
    """Draw the error along the iterations, geometric mean over draws, with moments about the pelvis and the ground."""
    from matplotlib.figure import Figure  # half a second, which the other commands need not wait

    figure = Figure(figsize=(11, 3.8), layout="constrained")
    axes = figure.subplots(1, len(CLASSES))
    for axis, (name, (field, columns)) in zip(axes, CLASSES.items(), strict=True):
        for title, (named, colour) in _SHOWN.items():
            for line, kind, condition in zip(("--", "-"), ("uncorrected", "corrected"), NOISY, strict=True):
                draws = tables[title].draws
                mean = _along([draw.parameter_errors[condition] for draw in draws], columns)
                axis.plot(np.arange(1, len(mean) + 1), mean, line, color=colour, label=f"{named}, {kind}")
                for tolerance, mark in _MARKS.items():
                    stop = round(float(np.median([stopped_by(draw.costs[condition], tolerance) for draw in draws])))
                    axis.plot(stop + 1, mean[stop], mark, color=colour, markersize=7)
        for line, kind, condition in zip(("--", "-"), ("uncorrected", "corrected"), NOISY, strict=True):
            value = asdict(PUBLISHED[condition])[field]
            axis.axhline(value, color="#999999", linestyle=line, linewidth=1, label=f"published, {kind}")
        axis.set_xscale("log")
        axis.set_yscale("log")
        for formatter in (
            axis.xaxis.set_major_formatter,
            axis.yaxis.set_major_formatter,
            axis.yaxis.set_minor_formatter,
        ):
            formatter("{x:g}")
        axis.set_title(f"{QUANTITIES[name.lower()][0]}, RMS error")
        axis.set_xlabel("iteration, the start being the first")
        axis.grid(True, axis="y", alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return figure


def _along(paths: Sequence[np.ndarray], columns: slice) -> np.ndarray:
    """Return the geometric mean (k,) over paths of errors (k, 49) of the RMS over a class; stopped paths stay as is."""
    errors = [[rms(wrong.reshape(-1, 7)[:, columns]) for wrong in path] for path in paths]
    longest = max(len(each) for each in errors)
    mean: np.ndarray = np.exp(np.log([np.pad(each, (0, longest - len(each)), "edge") for each in errors]).mean(axis=0))
    return mean


def render_variants(tables: Mapping[str, Table1]) -> str:
    """Render the page of the variants."""
    caption = (
        "RMS error of inertia, mass and CoM along the iterations. Dashed: without correction; solid: with. Marks: the "
        "cost changes by less than 1e-2 (triangle), 1e-4 (square), 1e-6 (circle) from one iteration to the next."
    )
    parts = [
        Part(
            "Errors against the truth",
            ("RMS error without / with correction, both with noise: mean over the draws. First the published values.",),
            picture=drawing(variants_figure(tables)) if has_matplotlib() else "",
            caption=caption,
            alt="Errors along the iterations with moments about the pelvis and about the ground, and as published.",
            headings=HEADINGS,
            rows=variants_rows(tables),
        )
    ]
    return render_parts("Table 1, one thing changed at a time", "Every draw is in variants.csv.", parts)


def save_variants(tables: Mapping[str, Table1], folder: str | Path) -> Path:
    """Write `variants.html`, `variants.csv`, `variants.md` and, with matplotlib, `variants.png` into a folder."""
    table = [list(HEADINGS), ["---"] * len(HEADINGS), *variants_rows(tables)]
    with complete_folder(folder, "variants") as work:
        variants_frame(tables).to_csv(work / "variants.csv", index=False, lineterminator="\n")
        (work / "variants.md").write_text("".join(f"| {' | '.join(row)} |\n" for row in table), encoding="utf-8")
        (work / "variants.html").write_text(render_variants(tables), encoding="utf-8")
        if has_matplotlib():
            variants_figure(tables).savefig(work / "variants.png", dpi=150)
    return Path(folder)
