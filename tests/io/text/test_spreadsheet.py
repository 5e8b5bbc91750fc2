"""Text that Excel, LibreOffice and others would run is text in CSV files."""

import pytest

from kinertia.io.text.csv_file import inert


@pytest.mark.parametrize("cell", ["=cmd|' /C calc'!A0", "+1", "-1+2", "@SUM(A1)", "\t=1", "\r=1"])
def test_formulas_become_text(cell):
    assert inert(cell) == "'" + cell


@pytest.mark.parametrize("cell", ["pelvis", "a=b", "", -1.0, 3, None])
def test_everything_else_stays(cell):
    assert inert(cell) is cell
