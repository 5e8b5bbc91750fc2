"""Norms of a laboratory: what is read, and what is said of files that are wrong."""

import numpy as np
import pytest

from kinertia.errors import FileError
from kinertia.io.norms_file import read_norms

PLAIN = (
    "quantity,percent,mean,sd\nknee_angle_angle,50,10.5,4\nknee_angle_angle,0,5.25,3.5\nhip_flexion_moment,0,-0.1,0.2\n"
)


def norms(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "norms.csv"
    path.write_bytes(text.encode(encoding))
    return read_norms(path)


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (PLAIN, "utf-8"),
        (PLAIN.replace("\n", "\r\n").upper().replace("KNEE_ANGLE_ANGLE", "knee_angle_angle"), "utf-8-sig"),
        (PLAIN.replace(",", ";").replace(".", ","), "utf-8"),
        (PLAIN.replace(",", "\t"), "utf-8"),
        ("\n" + PLAIN.replace("\n", "\n\n"), "utf-8"),
        ("\n".join(f"a,{line},b" for line in PLAIN.splitlines()), "utf-8"),
    ],
    ids=["as documented", "Windows", "decimal commas", "tabs", "blank lines", "other columns"],
)
def test_norms_are_read_in_the_order_of_percent(tmp_path, text, encoding):
    by_quantity = norms(tmp_path, text, encoding)
    assert [name.lower() for name in by_quantity] == ["knee_angle_angle", "hip_flexion_moment"]
    knee = by_quantity["knee_angle_angle"]
    np.testing.assert_array_equal([knee.percent, knee.mean, knee.sd], [[0, 50], [5.25, 10.5], [3.5, 4.0]])


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("sd\n", "spread\n", 1, "lacks the column sd; found quantity, percent, mean, spread"),
        ("10.5", "ten", 2, "mean is 'ten'; expected a number"),
        ("10.5", "nan", 2, "mean is 'nan'; expected a finite number"),
        (",3.5\n", "\n", 3, "sd is ''; expected a number"),
        ("5.25,", "5,25,", 3, "5 cells in a row; expected 4 as in the heading; a number has a decimal point"),
        (",3.5\n", ",-3.5\n", 3, "sd is -3.5"),
        ("angle,50", "angle,500", 2, "percent is 500; expected 0 to 100 %"),
        ("angle,50", "angle,0", 3, "knee_angle_angle at 0 % is there already"),
    ],
)
def test_a_wrong_file_is_told_with_its_line(tmp_path, old, new, line, words):
    with pytest.raises(FileError, match=r"norms\.csv") as error:
        norms(tmp_path, PLAIN.replace(old, new, 1))
    assert words in str(error.value)
    assert error.value.line == line


def test_a_file_without_rows_is_told(tmp_path):
    with pytest.raises(FileError, match="a heading and no rows"):
        norms(tmp_path, PLAIN.partition("\n")[0])


def test_percents_that_are_shares_are_told(tmp_path):
    path = tmp_path / "norms.csv"
    path.write_text("quantity,percent,mean,sd\nknee_angle_moment,0.0,0.1,0.05\nknee_angle_moment,1.0,0.1,0.05\n")
    with pytest.raises(FileError, match="percent is at most 1; expected 0 to 100 %"):
        read_norms(path)
