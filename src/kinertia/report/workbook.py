"""Writes an Excel workbook of a result: strides, peaks, curves side by side, body segments."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.estimation.cycles import UNITS, Kind
from kinertia.estimation.result import Fit
from kinertia.io.versions import VERSION
from kinertia.motion.gait_cycle import PERCENT
from kinertia.report.tables import Table, cells, person_tables, plain

_CURVES: tuple[tuple[str, str, Kind], ...] = (
    ("_clinical", "Clinical angles", "clinical"),
    ("_joint_moment", "Joint moments", "joint_moment"),
    ("_angle", "Model angles", "angle"),
    ("_moment", "Model moments", "moment"),
    ("_power", "Joint powers", "power"),
    ("", "Ground forces", "force"),
)
"""Endings of quantities, the first that fits, with sheet and kind."""
_TITLES = {
    "spatiotemporal": "Spatiotemporal",
    "moment_peaks": "Peaks",
    "contact_phases": "Phases",
    "bsp": "Body segments",
    "calibration": "Calibration",
}
_NAMED_BY = ("quantity", "trial", "task", "side", "stride")


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
            sheet.append([plain(value) for value in row])

    write("About", _about(fit), None)
    for name in ("spatiotemporal", "moment_peaks"):
        if name in tables:
            write(_TITLES[name], _rows(tables[name]), "A2")
    if "cycles" in tables:
        for ending, title, kind in _CURVES:
            if rows := list(_side_by_side(tables["cycles"], ending, UNITS[kind])):
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
    yield from zip(*map(cells, table.values()), strict=True)


def _side_by_side(cycles: Table, ending: str, unit: str) -> Iterator[Sequence[Any]]:
    """Yield the rows of a sheet of curves: what each column is, line by line, then a row per percent."""
    named = {name: cells(cycles[name])[:: len(PERCENT)] for name in _NAMED_BY}
    chosen = [row for row, quantity in enumerate(named["quantity"]) if _ending(quantity) == ending]
    if not chosen:
        return
    for name in _NAMED_BY:
        yield [name, *(named[name][row] for row in chosen for _ in ("value", "sd"))]
    yield ["percent", *(cell for _ in chosen for cell in (unit, f"SD ({unit})"))]
    values, sd = (np.reshape(np.asarray(cycles[name], dtype=float), (-1, len(PERCENT))) for name in ("value", "sd"))
    columns = np.stack([values[chosen], sd[chosen]], axis=1).reshape(-1, len(PERCENT))
    for percent, row in zip(cells(PERCENT), cells(columns.T), strict=True):
        yield [percent, *row]


def _ending(quantity: str) -> str:
    return next(ending for ending, _, _ in _CURVES if quantity.endswith(ending))
