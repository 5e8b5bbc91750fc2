"""The variants of Table 1 on paper and screen: `variants.md` (means), `variants.csv` (draws) and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from kinertia.io.output_folder import complete_folder
from kinertia.report.extras import has_matplotlib
from kinertia.report.table1 import QUANTITIES
from kinertia.studies.table1 import PUBLISHED, Errors
from kinertia.studies.table1_variants import BASE, CLASSES, GROUND, NOISY, VariantResult

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
CLEAN = ("no_correction_no_noise", "correction_no_noise")
_MARKS = {1e-2: "v", 1e-4: "s"}
"""Relative change of the cost, and what marks the iteration that falls below it first."""
_SHOWN = {BASE.title: ("moments about the pelvis", "#0072B2"), GROUND.title: ("moments about the ground", "#D55E00")}


def variants_frame(results: Sequence[VariantResult]) -> pd.DataFrame:
    """One row per variant, draw and condition, those without noise too: iterations and errors."""
    rows = []
    for result in results:
        for number, courses in [(0, result.clean), *enumerate(result.draws)]:
            conditions = CLEAN if courses is result.clean else NOISY
            for condition, course in zip(conditions, courses, strict=True):
                told = {"variant": result.variant.title, "draw": number, "condition": condition}
                rows.append({**told, "iterations": len(course.costs) - 1, **asdict(course.errors)})
    return pd.DataFrame(rows)


def variants_rows(results: Sequence[VariantResult]) -> list[list[str]]:
    """The table as text, RMS errors "without / with correction"; the published values come first."""
    rows = [["published", "1", *_pairs([PUBLISHED[c] for c in NOISY]), "100, 100, 100"]]
    rows[0] += [_pairs([PUBLISHED[c] for c in CLEAN])[0], "1"]
    for result in results:
        helped = ", ".join(f"{100 * share:.0f}" for share in result.helped.values())
        means = _pairs([result.mean(False), result.mean(True)])
        clean, factor = _pairs([course.errors for course in result.clean])[0], f"{result.distance:.2f}"
        rows.append([result.variant.title, str(len(result.draws)), *means, helped, clean, factor])
    return rows


def _pairs(errors: Sequence[Errors]) -> list[str]:
    return [_pair([asdict(each)[name] for each in errors]) for _, name, _ in QUANTITIES.values()]


def _pair(values: Sequence[float]) -> str:
    return " / ".join(f"{value:.2g}".replace("e-0", "e-") for value in values)


def variants_figure(results: Sequence[VariantResult]) -> Figure:
    """Error along the iterations, geometric mean over the draws, of the base and with moments about the ground."""
    from matplotlib.figure import Figure  # half a second, which the other commands need not wait

    figure = Figure(figsize=(11, 3.8), layout="constrained")
    axes = figure.subplots(1, len(CLASSES))
    for column, (axis, (name, field)) in enumerate(zip(axes, CLASSES.items(), strict=True)):
        for result in (result for result in results if result.variant.title in _SHOWN):
            named, colour = _SHOWN[result.variant.title]
            for corrected, condition in enumerate(NOISY):
                courses = [draw[corrected] for draw in result.draws]
                longest = max(len(course.along) for course in courses)
                # what has stopped stays where it is
                held = [np.pad(c.along[:, column], (0, longest - len(c.along)), "edge") for c in courses]
                mean = np.exp(np.log(held).mean(axis=0))
                line, kind = ("-", "corrected") if corrected else ("--", "uncorrected")
                axis.plot(mean, line, color=colour, label=f"{named}, {kind}")
                for tolerance, mark in _MARKS.items():
                    stop = round(float(np.median([course.stopped_by(tolerance) for course in courses])))
                    axis.plot(stop, mean[stop], mark, color=colour, markersize=7)
                value = asdict(PUBLISHED[condition])[field]
                axis.axhline(value, color="#999999", linestyle=line, linewidth=1, label=f"published, {kind}")
        axis.set_yscale("log")
        axis.set_title(f"{QUANTITIES[name.lower()][0]}, RMS error")
        axis.set_xlabel("iteration")
        axis.grid(True, axis="y", alpha=0.3)
    handles = dict(zip(*reversed(axes[0].get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False)
    return figure


def save_variants(results: Sequence[VariantResult], folder: str | Path) -> Path:
    """Write `variants.csv`, `variants.md` and, with matplotlib, `variants.png` into a folder; returns it."""
    table = [list(HEADINGS), ["---"] * len(HEADINGS), *variants_rows(results)]
    with complete_folder(folder, "variants") as work:
        variants_frame(results).to_csv(work / "variants.csv", index=False, lineterminator="\n")
        (work / "variants.md").write_text("".join(f"| {' | '.join(row)} |\n" for row in table), encoding="utf-8")
        if has_matplotlib():
            variants_figure(results).savefig(work / "variants.png", dpi=150)
    return Path(folder)
