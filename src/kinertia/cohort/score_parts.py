"""Shows a cohort's gait scores on its page: everyone's where people are few, else those farthest from the norms."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinertia.cohort.outcomes import report_of
from kinertia.report import style
from kinertia.report.result_page import Part

if TYPE_CHECKING:
    import pandas as pd

_MOST = 50
_HEADINGS = ("person", "overall", "right", "left", "farthest variable", "remarks")


def score_parts(folder: Path) -> Iterator[Part]:
    """Return a table of Gait Profile Scores (degrees), the largest first; nothing without norms."""
    from pyarrow import parquet

    scores: pd.DataFrame = parquet.read_table(folder / "scores.parquet").to_pandas()
    if not len(scores):
        return
    rows = sorted((_row(str(person), own) for person, own in scores.groupby("person")), key=lambda row: -row[0])
    known = [score for score, _ in rows if score >= 0]
    text = "Gait Profile Score (Baker 2009) against the norms, degrees, the largest first."
    if known:
        text += f" Median {np.median(known):.1f}, from {min(known):.1f} to {max(known):.1f}, of {len(known)} people."
    more = f" {len(rows) - _MOST} more people are in scores.parquet." if len(rows) > _MOST else ""
    yield Part("Gait Profile Score", (text + more,), headings=_HEADINGS, rows=[cells for _, cells in rows[:_MOST]])


def _row(person: str, own: pd.DataFrame) -> tuple[float, tuple[str, ...]]:
    """Return the overall score, -1 where there is none, and the cells."""
    gps = own[own["score"] == "GPS"].set_index("side")["degrees"]
    variables = own[own["score"] == "GVS"].dropna(subset=["degrees"])
    farthest = ""
    if len(variables):
        worst = variables.iloc[int(variables["degrees"].argmax())]
        farthest = f"{worst['variable']}, {style.SIDES[worst['side']][0]}: {worst['degrees']:.1f}"
    overall = float(gps.get("both", np.nan))
    cells = (*(_degrees(float(gps.get(side, np.nan))) for side in ("both", "r", "l")), farthest)
    return overall if np.isfinite(overall) else -1.0, (report_of(person), *cells, str(own["remarks"].iloc[0]))


def _degrees(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else ""
