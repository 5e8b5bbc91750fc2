"""Text that Excel, LibreOffice and others would run is text in CSV files."""

import pytest

from kinertia.io.text.csv_file import has_columns, inert


@pytest.mark.parametrize("cell", ["=cmd|' /C calc'!A0", "+1", "-1+2", "@SUM(A1)", "\t=1", "\r=1"])
def test_formulas_become_text(cell):
    assert inert(cell) == "'" + cell


@pytest.mark.parametrize("cell", ["pelvis", "a=b", "", -1.0, 3, None])
def test_everything_else_stays(cell):
    assert inert(cell) is cell


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_table_is_known_by_its_columns_as_excel_saves_it_too(tmp_path, encoding):
    path = tmp_path / "sheet.csv"
    path.write_text("measure;value\nknee girth;0.36\n", encoding=encoding)
    assert has_columns(path, ["measure", "value"])
    assert not has_columns(path, ["measure", "sd"])
