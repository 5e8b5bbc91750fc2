"""The variants of Table 1 on paper and screen: `variants.json`, `variants.csv`, `variants.md` and a picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import VERSION
from kinertia.report.extras import has_matplotlib
from kinertia.report.table1 import QUANTITIES
from kinertia.studies.table1 import PUBLISHED
from kinertia.studies.table1_variants import BASE, CLASSES, GROUND, NOISY, VariantResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEADINGS = (
    "variant",
    "draws",
    *(heading for heading, *_ in QUANTITIES.values()),
    "correction helps, % of draws: inertia, mass, CoM",
    "inertia without noise (kg m2)",
    "factor from published",
)
_COLOURS = {BASE.title: "#0072B2", GROUND.title: "#D55E00"}


def variants_frame(results: Sequence[VariantResult]) -> pd.DataFrame:
    """One row per variant: RMS errors without and with correction, where correction helps, and the distance."""
    rows = []
    for result in results:
        row: dict[str, object] = {"variant": result.variant.title, "draws": len(result.draws)}
        for _, name, _ in QUANTITIES.values():
            for corrected, condition in enumerate(NOISY):
                row[f"{name}_{condition}"] = asdict(result.mean(bool(corrected)))[name]
        row |= {f"helped_{name}": share for name, share in result.helped.items()}
        row |= {f"clean_inertia_{c}": v.errors.inertia_rms_kgm2 for c, v in zip(NOISY, result.clean, strict=True)}
        rows.append({**row, "factor_from_published": result.distance})
    return pd.DataFrame(rows)


def variants_rows(results: Sequence[VariantResult]) -> list[list[str]]:
    """The table as text, "without / with correction"; the published values come first."""
    pairs = [[asdict(PUBLISHED[c])[name] for c in NOISY] for _, name, _ in QUANTITIES.values()]
    clean = [PUBLISHED[c.replace("noise", "no_noise")].inertia_rms_kgm2 for c in NOISY]
    rows = [["published", "1", *map(_pair, pairs), "100, 100, 100", _pair(clean), "1"]]
    for row in variants_frame(results).to_dict("records"):
        pairs = [[row[f"{name}_{c}"] for c in NOISY] for _, name, _ in QUANTITIES.values()]
        helped = ", ".join(f"{100 * row[f'helped_{name}']:.0f}" for name in CLASSES)
        clean = [row[f"clean_inertia_{c}"] for c in NOISY]
        factor = f"{row['factor_from_published']:.2f}"
        rows.append([row["variant"], str(row["draws"]), *map(_pair, pairs), helped, _pair(clean), factor])
    return rows


def _pair(values: Sequence[float]) -> str:
    return " / ".join(f"{value:.2g}".replace("e-0", "e-") for value in values)


def variants_figure(results: Sequence[VariantResult]) -> Figure:
    """Error along the iterations, geometric mean over the draws, of the base and with moments about the ground."""
    from matplotlib.figure import Figure  # half a second, which the other commands need not wait

    figure = Figure(figsize=(11, 3.8), layout="constrained")
    axes = figure.subplots(1, len(CLASSES))
    shown = [result for result in results if result.variant.title in _COLOURS]
    for column, (axis, (name, field)) in enumerate(zip(axes, CLASSES.items(), strict=True)):
        for result in shown:
            for corrected, condition in enumerate(NOISY):
                courses = [draw[corrected] for draw in result.draws]
                longest = max(len(course.along) for course in courses)
                # what has stopped stays where it is
                held = [np.pad(c.along[:, column], (0, longest - len(c.along)), "edge") for c in courses]
                mean = np.exp(np.log(held).mean(axis=0))
                label = f"{result.variant.title.partition(',')[0]}, {'corrected' if corrected else 'uncorrected'}"
                line, colour = "-" if corrected else "--", _COLOURS[result.variant.title]
                axis.plot(mean, line, color=colour, label=label)
                for tolerance, mark in ((1e-2, "v"), (1e-4, "s")):
                    stop = round(float(np.median([course.stopped_by(tolerance) for course in courses])))
                    axis.plot(stop, mean[stop], mark, color=colour, label=f"below {tolerance:.0e}", markersize=7)
                axis.axhline(asdict(PUBLISHED[condition])[field], color="#999999", linestyle=line, linewidth=1)
        axis.set_yscale("log")
        axis.set_title(f"{QUANTITIES[name.lower()][0]}, RMS error")
        axis.set_xlabel("iteration")
        axis.grid(True, axis="y", alpha=0.3)
    handles = dict(zip(*reversed(axes[0].get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False)
    return figure


def save_variants(results: Sequence[VariantResult], trial: str, seed: int, folder: str | Path) -> Path:
    """Write `variants.json`, `.csv`, `.md` and, with matplotlib, `.png` into a folder; returns it."""
    table = [list(HEADINGS), ["---"] * len(HEADINGS), *variants_rows(results)]
    told = [
        {
            "title": result.variant.title,
            "draws": [{c: asdict(of.errors) for c, of in zip(NOISY, draw, strict=True)} for draw in result.draws],
        }
        for result in results
    ]
    with complete_folder(folder) as work:
        text = json.dumps({"kinertia": VERSION, "trial": trial, "seed": seed, "variants": told}, indent=1)
        (work / "variants.json").write_text(text + "\n", encoding="utf-8")
        variants_frame(results).to_csv(work / "variants.csv", index=False, lineterminator="\n")
        (work / "variants.md").write_text("".join(f"| {' | '.join(row)} |\n" for row in table), encoding="utf-8")
        if has_matplotlib():
            variants_figure(results).savefig(work / "variants.png", dpi=150)
    return Path(folder)
