"""Charts a laboratory's instrument errors over time, on the page of a cohort."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from kinertia.estimation.simultaneous.instruments.instrument_errors import GAIN, SHOWN_UNIT, item_text, quantity_text
from kinertia.report.figures.figure import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION, Panel, plain, small_multiples
from kinertia.report.pages.rendering import Part

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    "person",
    "date",
    "kind",
    "plate",
    "trial",
    "quantity",
    "axis",
    "value",
    "prior_sd",
    "sd",
    "unit",
    "with_session",
)
_COLOURS = (BLUE, VERMILION, GREEN, ORANGE, SKY, BLACK)
_WITHIN = 1.96
_UNDATED = (
    "No date is known: neither the recordings (TRIAL:DATE in C3D files, TIME_STAMP in Qualisys files) nor the subject "
    "files (date = 2026-05-03 under [instruments]) state one."
)


def drift(rows: pd.DataFrame) -> Iterator[Part]:
    """Draw a panel per quantity, with a line per instrument over the days; a day's people are weighted by information.

    Args:
        rows: rows of the table of instruments, `COLUMNS`. Fits that used others of their session are left out: days
            would count people twice. So are delays and zeros, which are each trial's own.
    """
    rows = rows[~rows["with_session"] & (rows["trial"].isna() | (rows["quantity"] == GAIN))]
    dated = rows.dropna(subset=["date"])
    if not len(dated):
        if len(rows):
            yield Part("Instruments over time", (_UNDATED,))
        return
    dated = _named(dated)
    names = sorted(dated["instrument"].unique())
    colours = {name: _COLOURS[k % len(_COLOURS)] for k, name in enumerate(names)}
    panels = [_panel(str(unknown), colours, of_unknown) for unknown, of_unknown in dated.groupby("unknown", sort=False)]
    people, days = dated["person"].nunique(), dated["date"].nunique()
    without = rows["person"].nunique() - people
    counts = f"{people} people on {days} day{'s' if days > 1 else ''}"
    text = (f"{counts}; the date is unknown for {without} more." if without else f"{counts}.",)
    figure = small_multiples(
        panels, "Plate and synchronisation errors over time, one panel for each kind of error.", {"type": "date"}
    )
    caption = (
        "Plate and synchronisation errors of each day, from all its people, with 95 % intervals. The estimate starts "
        "from zero errors: days with little information stay near zero. All numbers: instruments.parquet."
    )
    yield Part("Instruments over time", text, figure, caption)


def _named(rows: pd.DataFrame) -> pd.DataFrame:
    """Add two columns in words: the instrument and the quantity of each error."""
    known = rows.astype(object).where(rows.notna(), None)
    return rows.assign(
        instrument=list(map(item_text, known["kind"], known["plate"])),
        unknown=list(map(quantity_text, known["quantity"], known["axis"], known["trial"])),
    )


def _panel(unknown: str, colours: Mapping[str, str], rows: pd.DataFrame) -> Panel:
    factor, shown = SHOWN_UNIT[str(rows["unit"].iloc[0])]
    traces = [
        _line(str(instrument), colours[str(instrument)], factor, of_instrument)
        for instrument, of_instrument in rows.groupby("instrument", sort=True, observed=True)
    ]
    return Panel(f"{unknown} ({shown})", traces)


def _line(instrument: str, colour: str, factor: float, rows: pd.DataFrame) -> dict[str, Any]:
    """Draw the value of each day and its error bar, from all its people's trials with one prior."""
    days, means, bars, texts = [], [], [], []
    for day, of_day in rows.groupby("date", sort=True):
        value, sd, prior_sd = (of_day[name].to_numpy() for name in ("value", "sd", "prior_sd"))
        information = 1.0 / np.square(sd)
        total = information.sum() - (len(of_day) - 1) / float(np.mean(prior_sd)) ** 2
        days.append(str(day))
        means.append(float(factor * (information @ value) / total))
        bars.append(float(factor * _WITHIN / np.sqrt(total)))
        texts.append(f"{len(of_day)} people")
    return {
        "type": "scatter",
        "mode": "lines+markers",
        "x": days,
        "y": means,
        "error_y": {"type": "data", "array": bars, "thickness": 1, "width": 3},
        "line": {"color": colour, "width": 1},
        "marker": {"color": colour, "size": 7},
        "name": plain(instrument),
        "text": texts,
        "hovertemplate": "%{x}: %{y:.2f}, %{text}<extra>%{fullData.name}</extra>",
    }
