"""The sheet of girths and lengths, as people fill it in."""

import pytest

from kinertia.io.subject.body_files import COLUMNS, is_measures_sheet, measures_sheet, read_measures
from kinertia.model.stadium_body import girths_with_widths, measures, usual_build
from refusals import refused


def sheet(tmp_path, *rows, columns="measure,cm,sd_cm"):
    path = tmp_path / "measures.csv"
    path.write_text("\n".join([columns, *rows]), encoding="utf-8")
    return path


def test_the_sheet_has_every_measure_once_and_the_quick_ones_first():
    header, *rows = measures_sheet().splitlines()
    assert header == ",".join(COLUMNS)
    names = [row.split(",")[0] for row in rows]
    assert sorted(names) == sorted(measure.name for measure in measures())
    assert [row.endswith(",yes") for row in rows] == sorted((row.endswith(",yes") for row in rows), reverse=True)
    assert len({key for measure in measures() for key in measure.keys}) == 95
    assert usual_build().median_m.shape == (len(names),)
    assert len(girths_with_widths()) == 11


@pytest.mark.parametrize(
    ("name", "text", "known"),
    [
        ("measures.csv", measures_sheet(), True),
        ("Anna, spring.CSV", "\ufeff\r\n" + measures_sheet().replace(",", ";"), True),
        ("measures.csv", '"Measure","cm"\n', True),
        ("norms.csv", "quantity,percent,mean,sd\n", False),
        ("measures.csv", "", False),
        ("measures.txt", measures_sheet(), False),
    ],
)
def test_a_sheet_is_told_by_its_heading(tmp_path, name, text, known):
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert is_measures_sheet(tmp_path / name) == known
    assert not is_measures_sheet(tmp_path)
    assert not is_measures_sheet(tmp_path / "nowhere.csv")


def test_a_filled_in_sheet_is_read_with_what_it_leaves_out(tmp_path):
    path = tmp_path / "measures.csv"
    text = measures_sheet().replace("between crotch and knee,,0.7", "between crotch and knee,52.5,0.7")
    text = text.replace("girth of the knee,,0.5", "girth of the knee,38,")
    path.write_text(text, encoding="utf-8")
    assert read_measures(path).values == {
        "leg_mid_girth": (0.525, pytest.approx(0.007)),
        "leg_knee_girth": (0.38, 0.005),
    }
    quoted = sheet(tmp_path, 'leg_mid_girth,"52,5","0,7"')
    assert read_measures(quoted).values == {"leg_mid_girth": (0.525, pytest.approx(0.007))}
    excel = sheet(tmp_path, "leg_mid_girth;52,5;0,7", columns="measure;cm;sd_cm")
    assert read_measures(excel).values == {"leg_mid_girth": (0.525, pytest.approx(0.007))}


@pytest.mark.parametrize(
    ("rows", "line", "code", "evidence"),
    [
        (["leg_mid_girht,52,0.7"], 2, "F182", {"measure": "leg_mid_girht", "problem": "'leg_mid_girth'"}),
        (["waist,52,0.7"], 2, "F182", {"measure": "waist", "problem": "kinertia init --measures"}),
        (["leg_mid_girth,525,0.7"], 2, "F182", {"value_m": 5.25, "problem": "in mm?"}),
        (["leg_knee_girth,,", "leg_mid_girth,0.52,0.7"], 3, "F182", {"value_m": 0.0052, "problem": "in m?"}),
        (["leg_mid_girth,-52,0.7"], 2, "F182", {"measure": "leg_mid_girth", "value_m": -0.52}),
        (['leg_mid_girth,"1,052",0.7'], 2, "F105", {"cell": "1,052", "column": "cm"}),
        (["leg_mid_girth,52,0.7", "leg_mid_girth,53,0.7"], 3, "F182", {"problem": "twice"}),
        (["leg_mid_girth,52,0"], 2, "F182", {"problem": "sd must be positive"}),
        (["leg_mid_girth,about 50,0.7"], 2, "F105", {"cell": "about 50", "column": "cm"}),
        (["leg_mid_girth,,0.7"], None, "F182", {"problem": "no value in the column cm"}),
    ],
)
def test_what_cannot_be_is_named_with_its_line(tmp_path, rows, line, code, evidence):
    with refused(code, line, **evidence):
        read_measures(sheet(tmp_path, *rows))
