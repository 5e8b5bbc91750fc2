"""The sheet of girths and lengths, as people fill it in."""

import pytest

from kinertia.errors import FileError
from kinertia.io.measures_file import COLUMNS, is_measures_sheet, measures_sheet, read_measures
from kinertia.model.measures import girths_with_widths, measures, usual_build


def sheet(tmp_path, *rows, columns="measure,cm,sd_cm"):
    path = tmp_path / "measures.csv"
    path.write_text("\n".join([columns, *rows]), encoding="utf-8")
    return path


def test_the_sheet_has_every_measure_once_and_the_quick_ones_first():
    header, *rows = measures_sheet().splitlines()
    assert header == ",".join(COLUMNS)
    names = [row.split(",")[0] for row in rows]
    assert sorted(names) == sorted(one.name for one in measures())
    assert [row.endswith(",yes") for row in rows] == sorted((row.endswith(",yes") for row in rows), reverse=True)
    assert len({key for one in measures() for key in one.keys}) == 95
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
    ("rows", "line", "message"),
    [
        (["leg_mid_girht,52,0.7"], 2, "unknown measure 'leg_mid_girht'; did you mean 'leg_mid_girth'?"),
        (["waist,52,0.7"], 2, "unknown measure 'waist'; kinertia init --measures writes"),
        (["leg_mid_girth,525,0.7"], 2, "leg_mid_girth is 525 cm; expected 1 to 250 cm; was it in mm?"),
        (["leg_knee_girth,,", "leg_mid_girth,0.52,0.7"], 3, "was it in m?"),
        (["leg_mid_girth,-52,0.7"], 2, "leg_mid_girth is -52 cm; expected 1 to 250 cm"),
        (['leg_mid_girth,"1,052",0.7'], 2, "cm is '1,052'; expected a number"),
        (["leg_mid_girth,52,0.7", "leg_mid_girth,53,0.7"], 3, "leg_mid_girth stands there twice"),
        (["leg_mid_girth,52,0"], 2, "the sd of leg_mid_girth must be positive"),
        (["leg_mid_girth,about 50,0.7"], 2, "cm is 'about 50'; expected a number"),
        (["leg_mid_girth,,0.7"], None, "no value in the column cm"),
    ],
)
def test_what_cannot_be_is_named_with_its_line(tmp_path, rows, line, message):
    with pytest.raises(FileError) as caught:
        read_measures(sheet(tmp_path, *rows))
    assert message in str(caught.value)
    assert caught.value.line == line
