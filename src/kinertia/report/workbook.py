"""Writes an Excel workbook of a result: strides, peaks, curves side by side, body segments."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.estimation.result import Fit
from kinertia.io.versions import VERSION
from kinertia.report.tables import Table, person_tables

_CURVES = (
    ("_clinical", "Clinical angles", "deg"),
    ("_joint_moment", "Joint moments", "N m/kg"),
    ("_angle", "Model angles", "deg"),
    ("_moment", "Model moments", "N m/kg"),
    ("_power", "Joint powers", "W/kg"),
    ("", "Ground forces", "% body weight"),
)
"""Endings of quantities, the first that fits, with sheet and unit."""
_TITLES = {
    "spatiotemporal": "Spatiotemporal",
    "moment_peaks": "Peaks",
    "contact_phases": "Phases",
    "bsp": "Body segments",
    "calibration": "Calibration",
}
_NAMED_BY = ("quantity", "trial", "task", "side", "stride")
_PERCENT = 101


def write_xlsx(fit: Fit, path: Path) -> None:
    """Write a workbook. Sheets of curves have a row per percent of the gait cycle, and two columns per stride: values
    and standard deviations. What is not known is an empty cell.
    """
    from openpyxl import Workbook

    book, tables = Workbook(write_only=True), person_tables(fit)

    def write(title: str, rows: Iterator[Sequence[Any]], below: str | None) -> None:
        sheet = book.create_sheet(title)
        sheet.freeze_panes = below
        for row in rows:
            sheet.append([_cell(value) for value in row])

    write("About", _about(fit), None)
    for name in ("spatiotemporal", "moment_peaks"):
        if name in tables:
            write(_TITLES[name], _rows(tables[name]), "A2")
    if "cycles" in tables:
        for ending, title, unit in _CURVES:
            if rows := list(_side_by_side(tables["cycles"], ending, unit)):
                write(title, iter(rows), f"B{len(_NAMED_BY) + 2}")
    for name in ("contact_phases", "bsp", "calibration"):
        if name in tables:
            write(_TITLES[name], _rows(tables[name]), "A2")
    book.save(path)


def _about(fit: Fit) -> Iterator[Sequence[Any]]:
    yield "Kinertia", VERSION
    yield "Person", fit.subject.name
    yield "Mass (kg)", fit.mass_kg
    yield "Verdict", fit.overview.line
    yield (
        "Curves",
        "One row per percent of the gait cycle, from heel strike to heel strike of the side named above the column.",
    )
    yield "SD", "Standard deviation; twice as much to either side is a 95 % interval. Empty where nothing is known."


def _rows(table: Table) -> Iterator[Sequence[Any]]:
    yield list(table)
    yield from zip(*table.values(), strict=True)


def _side_by_side(cycles: Table, ending: str, unit: str) -> Iterator[Sequence[Any]]:
    """Yield the rows of a sheet of curves: what each column is, line by line, then a row per percent."""
    first = range(0, len(cycles["quantity"]), _PERCENT)
    chosen = [row for row in first if _ending(str(cycles["quantity"][row])) == ending]
    if not chosen:
        return
    for name in _NAMED_BY:
        yield [name, *(cell for row in chosen for cell in (cycles[name][row], cycles[name][row]))]
    yield ["percent", *(cell for _ in chosen for cell in (unit, f"SD ({unit})"))]
    values, sd = (np.reshape(np.asarray(cycles[name], dtype=float), (-1, _PERCENT)) for name in ("value", "sd"))
    rows = np.array(chosen) // _PERCENT
    columns = np.stack([values[rows], sd[rows]], axis=1).reshape(-1, _PERCENT)
    for percent, cells in enumerate(columns.T):
        yield [percent, *cells]


def _ending(quantity: str) -> str:
    return next(ending for ending, _, _ in _CURVES if quantity.endswith(ending))


def _cell(value: Any) -> Any:
    """Return what Excel shows: plain numbers and texts, nothing where a value is not known."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
