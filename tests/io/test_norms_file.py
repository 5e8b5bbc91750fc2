"""Norms of a laboratory: what is read, and what is said of files that are wrong."""

import numpy as np
import pytest

from kinertia.io.norms_file import read_norms
from refusals import refused

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
    ("old", "new", "line", "code", "evidence"),
    [
        ("sd\n", "spread\n", 1, "F103", {"expected": "sd", "found": "quantity, percent, mean, spread"}),
        ("mean,sd\n", "mean,mean,sd\n", 1, "F113", {"label": "mean", "count": 2}),
        ("10.5", "ten", 2, "F105", {"cell": "ten", "column": "mean"}),
        ("10.5", "nan", 2, "F105", {"cell": "nan", "expected": "finite"}),
        (",3.5\n", "\n", 3, "F105", {"cell": "", "column": "sd"}),
        ("5.25,", "5,25,", 3, "F105", {"cells": 5, "columns": 4, "expected": "decimal points"}),
        (",3.5\n", ",-3.5\n", 3, "F187", {"sd": -3.5}),
        ("angle,50", "angle,500", 2, "F187", {"percent": 500.0}),
        ("angle,50", "angle,0", 3, "F187", {"problem": "twice"}),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(tmp_path, old, new, line, code, evidence):
    with refused(code, line, **evidence):
        norms(tmp_path, PLAIN.replace(old, new, 1))


def test_a_file_without_rows_or_text_is_refused(tmp_path):
    with refused("F104", 1, rows=0):
        norms(tmp_path, PLAIN.partition("\n")[0])
    with refused("F104", None):
        norms(tmp_path, " \n")
    with refused("F103", None, expected="UTF-8"):
        norms(tmp_path, PLAIN, "utf-16")


def test_percents_that_are_shares_are_refused(tmp_path):
    path = tmp_path / "norms.csv"
    path.write_text("quantity,percent,mean,sd\nknee_angle_moment,0.0,0.1,0.05\nknee_angle_moment,1.0,0.1,0.05\n")
    with refused("F187", None, percent=1.0):
        read_norms(path)
