import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from kinertia.io.text.sto import read_sto, read_table, write_sto
from recordings import here
from refusals import only, refused

HEADER = "walk\nversion=1\nnRows=2\nnColumns=3\ninDegrees=yes\nendheader\n"
TABLE = "time\ta\tb\n0\t1\t2\n0.5\t3\t4\n"


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "x.sto"
        path.write_text(text)
        return path

    return write


REAL = {
    "synthetic/walk_grf.mot": (2700, 18, False),
    "gait2354/opensim_results/ik.mot": (73, 23, True),
    "gait2354/opensim_results/inverse_dynamics.sto": (73, 23, False),
    "gait2354/subject01_walk1_grf.mot": (1501, 18, True),
    "rajagopal_walk/grf_walk.mot": (4778, 18, False),
    "subject4/addbiomechanics_walking1_ik.mot": (131, 33, False),
    "subject4/squats1_grf.mot": (1346, 27, None),
}


@pytest.mark.parametrize("name", here(REAL))
def test_whole_files_as_opensim_reads_them(file_of, opensim, name):
    rows, columns, in_degrees = REAL[name]
    table = read_sto(file_of(name))
    assert table.shape == (rows, columns)
    assert table.attrs["in_degrees"] is in_degrees
    theirs = opensim.TimeSeriesTable(str(file_of(name)))
    assert tuple(table.columns) == theirs.getColumnLabels()
    np.testing.assert_array_equal(table.to_numpy(), theirs.getMatrix().to_numpy())
    np.testing.assert_array_equal(table.index, theirs.getIndependentColumn())


@pytest.mark.parametrize(
    ("text", "in_degrees"),
    [
        (HEADER + TABLE, True),
        (HEADER + "\n" + TABLE + "\n", True),
        (HEADER.replace("walk\n", ""), True),
        ("name walk\ndatacolumns 3\ndatarows 2\notherdata 1\nrange 0 0.5\nendheader\n", None),
        ("nColumns=3\nnRows=2\nDataType=double\nversion=3\nOpenSimVersion=4.1\nendheader\n", None),
        ("inDegrees=no\nendheader\n", False),
        (HEADER.replace("endheader", "\nUnits are S.I. units (second, meters, ...)\n\nendheader"), True),
        (HEADER.replace("\n", "\t\t\n"), True),
        (HEADER.replace("nRows=2", "nRows = 2"), True),
    ],
)
def test_header_variants(write, text, in_degrees):
    table = read_sto(write(text if "time" in text else text + TABLE))
    assert list(table.columns) == ["a", "b"]
    assert table.index.name == "time"
    np.testing.assert_array_equal(table.to_numpy(), [[1, 2], [3, 4]])
    np.testing.assert_array_equal(table.index, [0, 0.5])
    assert table.attrs["in_degrees"] is in_degrees


@pytest.mark.parametrize(
    "rows", [TABLE.replace("\n", "\t\t\n"), TABLE.replace("\t", "   "), TABLE.replace("time", "Time ")]
)
def test_row_variants(write, rows):
    np.testing.assert_array_equal(read_sto(write(HEADER + rows)).to_numpy(), [[1, 2], [3, 4]])


def test_empty_cell_is_nan(write):
    table = read_sto(write(HEADER + TABLE.replace("\t1\t", "\t\t")))
    np.testing.assert_array_equal(table.to_numpy(), [[np.nan, 2], [3, 4]])


@pytest.mark.parametrize(
    ("right", "wrong", "line", "announced", "found"),
    [
        ("nRows=2", "nRows=901", 3, 901, 2),
        ("nRows=2", "datarows 1", 3, 1, 2),
        ("nRows=2", "nRows=two", 3, "two", 2),
        ("nColumns=3", "nColumns=4", 4, 4, 3),
    ],
)
def test_a_header_that_miscounts_is_a_finding(write, right, wrong, line, announced, found):
    table = read_table(write(HEADER.replace(right, wrong) + TABLE))
    np.testing.assert_array_equal(table.values, [[1, 2], [3, 4]])
    assert only(table.findings, "F111", announced=announced, found=found).where.line == line
    assert read_table(write(HEADER + TABLE)).findings == ()


BROKEN = {
    "short row": (HEADER + TABLE.replace("0.5\t3\t4", "0.5\t3"), 9, "F105", {"cells": 2, "columns": 3}),
    "long row": (HEADER + TABLE.replace("0.5\t3\t4", "0.5\t3\t4\t5"), 9, "F105", {"cells": 4, "columns": 3}),
    "not a number": (HEADER + TABLE.replace("3", "three"), 9, "F105", {"cell": "three", "column": 2}),
    "truth values": (
        HEADER + TABLE.replace("\t1", "\tTrue").replace("\t3", "\tFalse"), 8, "F105", {"cell": "True", "column": 2}
    ),
    "no time": (HEADER + TABLE.replace("0.5", ""), 9, "F105", {"found": "without a time"}),
    "commas": (HEADER + TABLE.replace("\t", ","), 7, "F114", {"key": "between columns", "value": ","}),
    "semicolons": (HEADER + TABLE.replace("\t", "; "), 7, "F114", {"key": "between columns", "value": ";"}),
    "no time column": (HEADER + TABLE.replace("time", "frame"), 7, "F114", {"value": "frame"}),
    "repeated": (HEADER + TABLE.replace("a\tb", "a\ta"), 7, "F113", {"label": "a", "count": 2}),
    "no label": (HEADER + TABLE.replace("a\tb", "\tb"), 7, "F114", {"key": "column 2", "value": "missing"}),
    "no endheader": (TABLE, None, "F103", {"found": "endheader"}),
    "nothing after": (HEADER, 6, "F104", {}),
    "no rows": (HEADER.replace("nRows=2", "").replace("nColumns=3", "") + "time\ta\n", None, "F104", {"rows": 0}),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files(write, case):
    text, line, code, evidence = BROKEN[case]
    with refused(code, line, **evidence):
        read_sto(write(text))


@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    values=hnp.arrays(
        float,
        st.tuples(st.integers(1, 6), st.integers(1, 4)),
        elements=st.floats(allow_infinity=False, allow_nan=True),
    ),
    in_degrees=st.booleans(),
)
def test_round_trip(tmp_path, values, in_degrees):
    time = pd.Index(np.arange(len(values)) / 3, name="time")
    table = pd.DataFrame(values, index=time, columns=[f"column {k}/value" for k in range(values.shape[1])])
    write_sto(tmp_path / "x.sto", table, in_degrees, "table")
    back = read_sto(tmp_path / "x.sto")
    pd.testing.assert_frame_equal(back, table, check_exact=True)
    assert back.attrs["in_degrees"] is in_degrees
    assert [path.name for path in tmp_path.iterdir()] == ["x.sto"]


def test_opensim_reads_what_we_write(tmp_path, opensim):
    values = np.random.default_rng(0).standard_normal((4, 2))
    table = pd.DataFrame(values, index=pd.Index(np.arange(4) / 60, name="time"), columns=["a", "/b/value"])
    for name in ("x.mot", "x.sto"):
        path = str(tmp_path / name)
        write_sto(path, table, in_degrees=True, name="motion")
        theirs = opensim.TimeSeriesTable(path)
        assert theirs.getColumnLabels() == ("a", "/b/value")
        np.testing.assert_array_equal(theirs.getMatrix().to_numpy(), values)
        assert theirs.getTableMetaDataString("inDegrees") == "yes"
        storage = opensim.Storage(path)
        assert storage.getSize() == 4
        assert storage.isInDegrees()


def test_failed_write_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError("disk full")))
    table = pd.DataFrame({"a": [1.0]}, index=[0.0])
    with pytest.raises(OSError, match="disk full"):
        write_sto(tmp_path / "x.sto", table, in_degrees=False, name="x")
    assert not list(tmp_path.iterdir())
