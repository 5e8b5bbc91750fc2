import numpy as np
import pytest

from kinertia.io.subject.body_files import read_bsp
from kinertia.model.bsp import PARAMETERS, UNITS
from refusals import refused

VALUES = [(name, unit, 0.1 * k, 0.01 * (k + 1)) for k, (name, unit) in enumerate(zip(PARAMETERS, UNITS, strict=True))]
ROWS = [f"{side},{name},{unit},9,{value},{sd}\n" for side in ("thigh_r", "thigh_l") for name, unit, value, sd in VALUES]
GOOD = "".join(["segment,parameter,unit,literature,estimate,sd\n", *ROWS])


def test_estimates_and_deviations(tmp_path):
    path = tmp_path / "bsp.csv"
    path.write_text(GOOD)
    table = read_bsp(path)
    assert table.segments == ("thigh_r", "thigh_l")
    np.testing.assert_allclose(table.estimate, [[0.1 * k for k in range(10)]] * 2)
    np.testing.assert_allclose(table.sd[1], [0.01 * (k + 1) for k in range(10)])


def test_as_excel_saves_it_where_decimals_have_commas(tmp_path):
    path = tmp_path / "bsp.csv"
    path.write_text("\ufeff" + GOOD.replace(",", ";").replace(".", ","), encoding="utf-8")
    np.testing.assert_allclose(read_bsp(path).estimate[0], [0.1 * k for k in range(10)])


def test_a_segment_that_was_held_has_no_deviations(tmp_path):
    """Light bodies of an OpenSim model are not estimated; the bsp.csv of such a fit starts the next one too."""
    path = tmp_path / "bsp.csv"
    held = [f"talus_r,{name},{unit},9,{value},0.0\n" for name, unit, value, _ in VALUES]
    path.write_text(GOOD + "".join(held))
    table = read_bsp(path)
    assert table.segments[-1] == "talus_r"
    assert table.sd.any(axis=1).tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("old", "new", "line", "code", "evidence"),
    [
        (",sd\n", ",other\n", 1, "F103", {"expected": "sd", "found": "segment, parameter", "kind": "simultaneous"}),
        ("thigh_r,mass", "thigh_r,weight", 2, "F183", {"parameter": "weight", "problem": "mass, com_x"}),
        ("thigh_r,mass,kg", "thigh_r,mass,lb", 2, "F183", {"problem": "'lb'; expected kg"}),
        ("thigh_l,mass,kg,9,0.0,", "thigh_l,mass,kg,9,,", 12, "F105", {"column": "estimate", "cell": ""}),
        ("kg,9,0.0,0.01", "kg,9,0.0,0", 2, "F183", {"parameter": "mass", "problem": "sd must be positive"}),
        ("m,9,0.1,0.02", "m,9,0.1,-0.02", 3, "F183", {"parameter": "com_x", "problem": "sd must be positive"}),
        ("thigh_r,com_x", "thigh_r,mass", 3, "F183", {"problem": "'m'; expected kg"}),
        ("thigh_r,com_y,m,9,0.2,0.03", "thigh_r,com_x,m,9,0.2,0.03", 4, "F183", {"problem": "twice"}),
        ("thigh_l,com_x,m,9,0.1,0.02\n", "", None, "F183", {"parameter": "com_x", "problem": "missing"}),
        (GOOD[GOOD.index("\n") + 1 :], "", 1, "F104", {"rows": 0}),
    ],
)
def test_what_cannot_be_is_named_with_its_line(tmp_path, old, new, line, code, evidence):
    path = tmp_path / "bsp.csv"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new))
    with refused(code, line, **evidence) as caught:
        read_bsp(path)
    assert code != "F183" or caught.value.finding.where.part in ("thigh_r", "thigh_l")


def test_no_such_file(tmp_path):
    with refused("F101", None):
        read_bsp(tmp_path / "bsp.csv")
