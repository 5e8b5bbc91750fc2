"""Writes Table 1 and its variants: files, pictures, `report.html`, and rows for the terminal."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from kinertia.io.output_folder import complete_folder
from kinertia.io.versions import VERSION
from kinertia.report.figures.plots import has_matplotlib
from kinertia.report.pages.rendering import Part, drawing, render_parts
from kinertia.studies.table1 import CONDITIONS, PUBLISHED, Errors, Table1, table1_json
from kinertia.studies.table1_variants import CLASSES, LONG, LONG_GROUND, NOISY, distance, helped, stopped_by
from kinertia.trial.sampled_data import rms

if TYPE_CHECKING:
    from matplotlib.figure import Figure


QUANTITIES = {
    "inertia": ("inertia (kg m2)", "inertia_rms_kgm2", "inertia_max_kgm2"),
    "mass": ("mass (kg)", "mass_rms_kg", "mass_max_kg"),
    "com": ("CoM (m)", "com_rms_m", "com_max_m"),
    "force": ("pelvis force (N)", "force_rms_N", "force_max_N"),
    "torque": ("pelvis torque (N m)", "torque_rms_Nm", "torque_max_Nm"),
}
_CLASSES = {"mass (kg)": ("mass",), "CoM (m)": ("com_x", "com_y", "com_z"), "inertia (kg m2)": ("ixx", "iyy", "izz")}
# Okabe and Ito's colours, which colour-blind people can distinguish
_COLOURS = {
    "start": "#000000",
    "no_correction_no_noise": "#56B4E9",
    "no_correction_noise": "#E69F00",
    "correction_no_noise": "#009E73",
    "correction_noise": "#D55E00",
}
_MARKS = {"start": "_", **dict(zip(CONDITIONS, "svo^", strict=True))}
HEADINGS = (
    "variant",
    "draws",
    *(heading for heading, *_ in QUANTITIES.values()),
    "correction helps (% of draws): inertia, mass, CoM",
    "inertia without noise (kg m2)",
    "factor from published",
)
_CLEAN = ("no_correction_no_noise", "correction_no_noise")
_VARIANT_MARKS = {1e-2: "v", 1e-4: "s", 1e-6: "o"}
"""Relative change of the cost, and what marks the iteration that falls below it first."""
_SHOWN = {LONG: ("moments about the pelvis", "#0072B2"), LONG_GROUND: ("moments about the ground", "#D55E00")}


def table1_frame(table: Table1) -> pd.DataFrame:
    """Return one row per quantity and statistic; per condition our mean and spread over draws, and published value."""
    rows = []
    for heading, *names in QUANTITIES.values():
        for statistic, name in zip(("RMS", "max"), names, strict=True):
            row: dict[str, object] = {"quantity": heading, "statistic": statistic}
            for condition in CONDITIONS:
                row[f"{condition}_mean"] = asdict(table.mean(condition))[name]
                row[f"{condition}_sd"] = asdict(table.spread(condition))[name]
                row[f"{condition}_published"] = asdict(PUBLISHED[condition])[name]
            rows.append(row)
    return pd.DataFrame(rows)


def table1_rows(table: Table1) -> list[list[str]]:
    """Return the table in the study's form: quantity, then "RMS / max" per condition: mean, spread, published value."""
    rows = []
    for heading, *names in QUANTITIES.values():
        for label, source, digits in (
            (heading, table.mean, 2),
            ("  spread", table.spread, 2),
            ("  published", PUBLISHED.__getitem__, 3),
        ):
            values = [asdict(source(condition)) for condition in CONDITIONS]
            rows.append([label, *(" / ".join(short(value[name], digits) for name in names) for value in values)])
    return rows


def short(value: float, digits: int) -> str:
    """Format a number as printed in the tables."""
    return f"{value:.{digits}g}".replace("e-0", "e-")


def table1_figure(table: Table1) -> Figure:
    """Draw the error per segment and class of parameter, at the start and after estimation, RMS of draws, log axis."""
    from matplotlib.figure import Figure  # half a second, which the other commands need not wait

    figure = Figure(figsize=(11, 3.8), layout="constrained")
    axes = figure.subplots(1, len(_CLASSES))
    segments = list(dict.fromkeys(name.partition(".")[0] for name in table.parameters))
    errors = {"start": np.array([draw.start_errors for draw in table.draws])}
    errors |= {c: np.array([draw.parameter_errors[c][-1] for draw in table.draws]) for c in CONDITIONS}
    for axis, (heading, members) in zip(axes, _CLASSES.items(), strict=True):
        for key, values in errors.items():
            heights = []
            for segment in segments:
                chosen = [table.parameters.index(f"{segment}.{member}") for member in members]
                heights.append(rms(values[:, chosen]))
            label = "start" if key == "start" else CONDITIONS[key]
            axis.plot(
                segments, heights, linestyle="", marker=_MARKS[key], color=_COLOURS[key], label=label, markersize=7
            )
        axis.set_yscale("log")
        axis.set_title(f"{heading}, RMS error")
        axis.tick_params(axis="x", rotation=45)
        axis.grid(True, axis="y", alpha=0.3)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    return figure


def render_table1(table: Table1) -> str:
    """Render the page of Table 1."""
    note = "RMS / max. First row: mean over the draws; then their standard deviation; then the published value."
    picture = drawing(table1_figure(table)) if has_matplotlib() else ""
    alt = (
        "Root mean square error of mass, centre of mass and moments of inertia per segment, at the start and under "
        "each condition; the numbers are in table1.json."
    )
    start = "Start: every parameter off by up to 50 %. The scale is logarithmic."
    parts = [
        Part("Errors against the truth", (note,), headings=("error", *CONDITIONS.values()), rows=table1_rows(table))
    ]
    parts += [Part("Error per segment", picture=picture, caption=start, alt=alt)] if picture else []
    draws = f"{len(table.draws)} draw{'s' if len(table.draws) > 1 else ''}"
    return render_parts("Table 1 repeated", f"{draws} of start and noise, seed {table.seed}, {table.trial}.", parts)


def table1_summary(table: Table1) -> dict[str, Any]:
    """Return the content of `table1.json`."""
    return {"kinertia": VERSION, **table1_json(table)}


def save_table1(table: Table1, folder: str | Path) -> Path:
    """Write `table1.json`, `table1.csv`, `report.html` and, with matplotlib, `table1.png` into a folder; return it."""
    with complete_folder(folder, "table1") as work:
        (work / "table1.json").write_text(json.dumps(table1_summary(table), indent=1) + "\n", encoding="utf-8")
        table1_frame(table).to_csv(work / "table1.csv", index=False, lineterminator="\n")
        (work / "report.html").write_text(render_table1(table), encoding="utf-8")
        if has_matplotlib():
            table1_figure(table).savefig(work / "table1.png", dpi=150)
    return Path(folder)


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
    pairs = [[errors_by_name[name] for errors_by_name in noisy] for _, name, _ in QUANTITIES.values()]
    pairs.append([errors_by_name["inertia_rms_kgm2"] for errors_by_name in clean])
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
                for tolerance, mark in _VARIANT_MARKS.items():
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
    longest = max(len(curve) for curve in errors)
    mean: np.ndarray = np.exp(
        np.log([np.pad(curve, (0, longest - len(curve)), "edge") for curve in errors]).mean(axis=0)
    )
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
