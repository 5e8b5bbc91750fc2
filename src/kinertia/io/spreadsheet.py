"""Formats cells of CSV files as spreadsheet programs take them."""

from __future__ import annotations

from typing import TypeVar

T = TypeVar("T")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def inert(cell: T) -> T | str:
    """A cell that no spreadsheet program takes for a formula: such text gets an apostrophe in front, numbers stay.

    Names come from files that others made: Excel would run a body called `=cmd|' /C calc'!A0`.
    """
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULA) else cell
