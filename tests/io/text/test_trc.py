from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from kinertia.findings.finding import Severity
from kinertia.io.text.trc import read_trc, read_trc_recording, write_trc
from kinertia.trial.data import Markers
from recordings import here
from refusals import codes, only, refused

HEADER = (
    "PathFileType\t4\t(X/Y/Z)\tx.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "100\t100\t3\t2\tmm\t100\t1\t3\n"
    "Frame#\tTime\tR.Heel\t\t\tL Heel\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
)
ROWS = "1\t0.00\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t4\t5\t6\n3\t0.02\t1\t2\t3\t4\t5\t6\n"


@pytest.fixture
def write(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "x.trc"
        path.write_text(text, newline="")
        return path

    return write


REAL = {
    "synthetic/static.trc": (20, 49, 100),
    "synthetic/walk.trc": (270, 41, 100),
    "gait2354/subject01_static.trc": (300, 49, 60),
    "gait2354/subject01_walk1.trc": (151, 41, 60),
    "rajagopal_walk/motion_capture_walk.trc": (238, 41, 100),
    "rajagopal_walk/static_walk_1.trc": (287, 64, 100),
    "subject4/static1.trc": (517, 55, 100),
    "subject4/walking1.trc": (131, 51, 100),
    "subject4/squats1.trc": (1346, 51, 100),
}


@pytest.mark.parametrize("name", here(REAL))
def test_whole_files(file_of, name):
    frames, count, rate = REAL[name]
    markers = read_trc(file_of(name))
    assert markers.positions.shape == (frames, count, 3)
    assert markers.rate_hz == pytest.approx(rate, rel=1e-9)
    height = np.nanmax(markers.positions[..., 1]) - np.nanmin(markers.positions[..., 1])
    assert 1.2 < height < 2.0


@pytest.mark.parametrize("name", here(REAL))
def test_whole_files_as_opensim_reads_them(file_of, opensim, name):
    table = opensim.TimeSeriesTableVec3(str(file_of(name)))
    markers = read_trc(file_of(name))
    assert markers.labels == table.getColumnLabels()
    scale = 1000.0 if "subject4" not in name else 1.0
    for frame in (0, len(markers.time) // 2, len(markers.time) - 1):
        row = table.getRowAtIndex(frame)
        theirs = np.array([row.getElt(0, k).to_numpy() for k in range(row.ncol())])
        np.testing.assert_allclose(scale * markers.positions[frame], theirs, atol=1e-6, equal_nan=True)


@pytest.mark.measured
def test_rounded_times_are_put_back_on_their_grid(file_of):
    recording = read_trc_recording(file_of("gait2354/subject01_walk1.trc"))
    markers = recording.markers
    assert recording.length_unit == "mm"
    np.testing.assert_allclose(markers.time, np.arange(151) / 60, atol=1e-12)
    rounded = only(recording.findings, "T102", rate_hz=60.0)
    assert rounded.evidence["rounding_s"].value == pytest.approx(0.33e-3, rel=0.02)


@pytest.mark.parametrize(("rate", "decimals", "frames"), [(60, 3, 3), (60, 2, 3), (120, 3, 4), (59.94, 3, 10)])
def test_few_frames_whose_times_are_rounded(write, rate, decimals, frames):
    rows = "".join(f"{k}\t{k / rate:.{decimals}f}\t1\t2\t3\t4\t5\t6\n" for k in range(frames))
    header = HEADER.replace("\t3\t2\t", f"\t{frames}\t2\t").replace("\n100\t", f"\n{rate}\t")
    np.testing.assert_allclose(read_trc(write(header + rows)).time, np.arange(frames) / rate, atol=1e-9)


@pytest.mark.parametrize(("rate", "decimals"), [(240, 3), (59.94, 3), (100, 2), (1000, 3)])
def test_rates_whose_times_are_rounded(write, rate, decimals):
    rows = "".join(f"{k}\t{k / rate:.{decimals}f}\t1\t2\t3\t4\t5\t6\n" for k in range(500))
    header = HEADER.replace("\t3\t2\t", "\t500\t2\t").replace("\n100\t", f"\n{rate}\t")
    markers = read_trc(write(header + rows))
    np.testing.assert_allclose(markers.time, np.arange(500) / rate, atol=1e-9)


def test_blanks_do_not_show_which_marker_is_missing(write):
    """Markers behind the missing one would take each other's places."""
    text = (HEADER + ROWS).replace("L Heel", "L.Heel").replace("0.01\t1\t2\t3", "0.01\t\t\t")
    assert np.isnan(read_trc(write(text)).positions[1, 0]).all()
    with refused("F105", 7, found="5 values"):
        read_trc(write(text.replace("\t", " ")))


def test_times_with_many_digits_precede_a_rounded_rate(write):
    """59.94 Hz in the times and 60 in the header: 2.5 ms after as many seconds."""
    rows = "".join(f"{k}\t{k / 59.94:.6f}\t1\t2\t3\t4\t5\t6\n" for k in range(151))
    header = HEADER.replace("\t3\t2\t", "\t151\t2\t").replace("\n100\t", "\n60\t")
    np.testing.assert_allclose(read_trc(write(header + rows)).time, np.arange(151) / 59.94, atol=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        HEADER + ROWS,
        HEADER + "\n" + ROWS,
        HEADER + " \n\n" + ROWS + "\n\n",
        (HEADER + "\n" + ROWS).replace("\n", "\r\n"),
        (HEADER + ROWS).replace("6\n", "6\t\n").replace("\t\t\n", "\t\t\t\t\n"),
        (HEADER + ROWS).replace("L Heel", "L.Heel").expandtabs(8),
        (HEADER + ROWS).replace("100\t100\t3\t2\tmm", "  100.0\t\t 100.0\t\t  3\t\t 2\t\t mm "),
        (HEADER + ROWS).replace("PathFileType\t4\t", "PathFileType  4\t"),
        "\ufeff" + HEADER + ROWS,
        HEADER.replace("\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n", "") + ROWS,
    ],
    ids=["plain", "blank line", "blank lines", "CRLF", "trailing tabs", "blanks", "ragged header", "old first line",
         "byte order mark", "no X1 line"],
)  # fmt: skip
def test_header_variants(write, text):
    markers = read_trc(write(text))
    assert [label.replace(".", " ") for label in markers.labels] == ["R Heel", "L Heel"]
    np.testing.assert_allclose(markers.positions[2], [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]])
    np.testing.assert_allclose(markers.time, [0, 0.01, 0.02])


@pytest.mark.parametrize(("unit", "metres"), [("mm", 0.001), ("cm", 0.01), ("m", 1.0), ("MM", 0.001)])
def test_units(write, unit, metres):
    markers = read_trc(write(HEADER.replace("mm", unit) + ROWS))
    np.testing.assert_allclose(markers.positions[0, 0], metres * np.array([1, 2, 3]))


@pytest.mark.parametrize("cells", ["4\t5\t6\t\t\t", "4\t5\t6", "4\t5\t6\tNaN\tnan\tNaN", "4\t5\t6\t0\t0\t0.0"])
def test_missing_markers(write, cells):
    recording = read_trc_recording(write(HEADER + ROWS.replace("1\t2\t3\t4\t5\t6", cells)))
    markers = recording.markers
    assert np.isnan(markers.positions[:, 1]).all()
    np.testing.assert_allclose(markers.positions[0, 0], [0.004, 0.005, 0.006])
    assert codes(recording.findings) == ["F115"] * cells.endswith("0.0")
    for finding in recording.findings:
        assert (finding.evidence["count"].value, finding.where.markers) == (3, ("L Heel",))


def test_a_header_that_miscounts_its_frames_is_a_finding(write):
    recording = read_trc_recording(write(HEADER.replace("\t3\t2\t", "\t4\t2\t") + ROWS))
    assert len(recording.markers.time) == 3
    only(recording.findings, "F111", announced=4, found=3, what="frames")


def test_a_header_that_miscounts_its_markers_is_a_finding_where_labels_and_columns_agree(write):
    recording = read_trc_recording(write(HEADER.replace("\t3\t2\t", "\t3\t12\t") + ROWS))
    assert recording.markers.positions.shape == (3, 2, 3)
    only(recording.findings, "F111", announced=12, found=2, what="markers")


THIRD = ROWS.replace("\t6\n", "\t6\t7\t8\t9\n")
"""Rows with numbers of a third marker."""
BROKEN = {
    "lost label": (HEADER.replace("\t3\t2\t", "\t3\t3\t") + THIRD, 4, "F112", {"labels": 2, "announced": 3}),
    "label too many": (HEADER.replace("L Heel", "X\t\t\tL Heel") + ROWS, 4, "F112", {"labels": 3, "columns": 8}),
    "no labels": (HEADER.replace("R.Heel", "").replace("L Heel", "") + ROWS, 4, "F164", {}),
    "odd count": (HEADER.replace("\t3\t2\t", "\t3.5\t2\t") + ROWS, 3, "F114", {"key": "NumFrames", "value": "3.5"}),
    "unit": (HEADER.replace("mm", "inch") + ROWS, 3, "F121", {"unit": "inch"}),
    "not a number": (HEADER + ROWS.replace("2\t0.01\t1", "2\t0.01\tx"), 7, "F105", {"cell": "x", "column": 3}),
    "decimal comma": (
        HEADER + ROWS.replace("0.01", "0,01"), 7, "F105", {"cell": "0,01", "column": 2, "expected": "decimal point"}
    ),
    "too long": (HEADER + ROWS.replace("2\t0.01\t1", "2\t0.01\t1\t1"), 7, "F105", {"cells": 9, "columns": 8}),
    "half a marker": (HEADER + ROWS.replace("2\t0.01\t1\t2\t3\t4\t5\t6", "2\t0.01\t1\t2\t3\t4\t5"), 7, "F105",
                      {"marker": "L Heel"}),
    "infinite": (HEADER + ROWS.replace("3\t0.02\t1", "3\t0.02\tinf"), 8, "F105", {"column": 3}),
    "no time": (HEADER + ROWS.replace("2\t0.01", "2\t"), 7, "F105", {"found": "without a time"}),
    "time goes back": (HEADER + ROWS.replace("0.02", "0.01"), 8, "T101", {"after": "0.01 s", "step_s": 0.0}),
    "uneven": (HEADER + ROWS.replace("0.01", "0.013"), 7, "T101", {"after": "0.013 s", "usual_s": 0.01}),
    "wrong rate": (HEADER.replace("100\t100\t3", "60\t60\t3") + ROWS, 3, "T103", {"header_hz": 60, "column_hz": 100}),
    "rate nan": (HEADER.replace("100\t100\t3", "nan\t100\t3") + ROWS, 3, "F114", {"key": "DataRate", "value": "nan"}),
    "count nan": (HEADER.replace("\t3\t2\t", "\tnan\t2\t") + ROWS, 3, "F114", {"key": "NumFrames", "value": "nan"}),
    "count inf": (HEADER.replace("\t3\t2\t", "\t3\tinf\t") + ROWS, 3, "F114", {"key": "NumMarkers", "value": "inf"}),
    "no rate": (HEADER.replace("100\t100\t3", "x\t100\t3") + ROWS, 3, "F114", {"key": "DataRate", "value": "x"}),
    "no key": (HEADER.replace("NumMarkers", "Markers") + ROWS, 2, "F114", {"key": "NumMarkers", "value": "missing"}),
    "lost value": (HEADER.replace("100\t100\t3\t2\tmm", "100\t100\t3\t2") + ROWS, 3, "F114", {"expected": "8"}),
    "another file": ("nColumns=3\nendheader\n" + ROWS, 1, "F103", {"found": "nColumns=3", "expected": "PathFileType"}),
    "ends in header": ("\n".join(HEADER.split("\n")[:3]), 3, "F104", {"lines": 3}),
    "no rows": (HEADER, 3, "F104", {"rows": 0, "announced": 3}),
    "truncated": ((HEADER + ROWS)[:-10], 8, "F105", {"marker": "R.Heel"}),
    "cut within a row": ((HEADER.replace("\t3\t2\t", "\t9\t2\t") + ROWS)[:-8], 8, "F104", {"rows": 3, "announced": 9}),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files(write, case):
    text, line, code, evidence = BROKEN[case]
    with refused(code, line, **evidence):
        read_trc(write(text))


def test_the_subjects_name_before_the_labels_is_taken_off(write):
    path = write(HEADER.replace("R.Heel", "Anna:R.Heel").replace("L Heel", "Anna:L Heel") + ROWS)
    recording = read_trc_recording(path)
    assert recording.markers.labels == ("R.Heel", "L Heel")
    assert codes(recording.findings) == ["F163"]
    only(recording.findings, "F163", count=2, what="'Anna:'")
    both = read_trc_recording(write(HEADER.replace("R.Heel", "Anna:A").replace("L Heel", "A") + ROWS))
    assert both.markers.labels == ("Anna:A", "A")


def test_of_repeated_labels_the_one_seen_in_most_frames_is_kept(write):
    header = HEADER.replace("\t3\t2\t", "\t3\t3\t").replace("L Heel", "R.Heel\t\t\tR.Heel")
    first = read_trc_recording(write(header + THIRD))
    assert first.markers.labels == ("R.Heel",)
    np.testing.assert_allclose(first.markers.positions[0, 0], (0.001, 0.002, 0.003))
    assert only(first.findings, "F113", label="R.Heel", count=3).severity is Severity.INFO
    second = read_trc_recording(write(header + THIRD.replace("\t1\t2\t3\t", "\t\t\t\t")))
    np.testing.assert_allclose(second.markers.positions[0, 0], (0.004, 0.005, 0.006))
    row = THIRD.split("\n")[0]
    gap = read_trc_recording(write(header + THIRD.replace(row, row.replace("\t1\t2\t3\t", "\t\t\t\t"), 1)))
    np.testing.assert_allclose(gap.markers.positions[0, 0], (0.004, 0.005, 0.006))


def test_lost_frame_in_the_middle(write):
    rows = "".join(f"{k}\t{0.01 * (k + (k > 50)):.2f}\t1\t2\t3\t4\t5\t6\n" for k in range(100))
    with refused("T101", 57, time_s=0.5, after="0.52 s", usual_s=0.01):
        read_trc(write(HEADER.replace("\t3\t2\t", "\t100\t2\t") + rows))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_text_of_other_programs(write, encoding):
    """Excel's "Unicode text" and PowerShell write UTF-16, with a mark at the beginning; it was called binary."""
    path = write(HEADER + ROWS)
    expected = read_trc(path)
    path.write_bytes(path.read_text(encoding="utf-8").encode(encoding))
    np.testing.assert_array_equal(read_trc(path).positions, expected.positions)


def test_missing_empty_and_binary_files(write, tmp_path):
    path = write("")
    with refused("F104"):
        read_trc(path)
    with refused("F101", folder=str(tmp_path), nearest="x.trc"):
        read_trc(tmp_path / "X.trc")
    with refused("F101", folder="nowhere", hint="folder does not exist"):
        read_trc(tmp_path / "nowhere" / "x.trc")
    with refused("F102", given="folder"):
        read_trc(tmp_path)
    path.write_bytes(b"PathFileType\0\0\1")
    with refused("F103"):
        read_trc(path)


coordinates = st.floats(-100, -1e-6) | st.floats(1e-6, 100)


@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    positions=hnp.arrays(float, st.tuples(st.integers(1, 6), st.integers(1, 4), st.just(3)), elements=coordinates),
    lost=st.integers(0, 2**24 - 1),
    rate_hz=st.sampled_from([50.0, 59.94, 60.0, 100.0, 120.0, 1000.0]),
    start_s=st.floats(0, 100),
)
def test_round_trip(tmp_path, positions, lost, rate_hz, start_s):
    n, m = positions.shape[:2]
    gone = np.array([lost >> k & 1 for k in range(n * m)], bool).reshape(n, m)
    labels = tuple(f"marker {k}" for k in range(m))
    markers = Markers(start_s + np.arange(n) / rate_hz, labels, np.where(gone[..., None], np.nan, positions))
    write_trc(tmp_path / "x.trc", markers)
    back = read_trc(tmp_path / "x.trc")
    assert back.labels == labels
    np.testing.assert_allclose(back.time, markers.time, atol=1e-8)
    np.testing.assert_allclose(back.positions, markers.positions, atol=1e-9)


def test_opensim_reads_what_we_write(tmp_path, opensim):
    positions = np.random.default_rng(0).standard_normal((5, 3, 3))
    positions[2, 1] = np.nan
    positions[4] = np.nan
    markers = Markers(np.arange(5) / 60, ("R.Heel", "r should", "C7"), positions)
    write_trc(tmp_path / "x.trc", markers)
    table = opensim.TimeSeriesTableVec3(str(tmp_path / "x.trc"))
    assert table.getColumnLabels() == markers.labels
    np.testing.assert_allclose(table.getIndependentColumn(), markers.time, atol=1e-9)
    theirs = [[table.getRowAtIndex(k).getElt(0, j).to_numpy() for j in range(3)] for k in range(5)]
    np.testing.assert_allclose(theirs, 1000 * positions, atol=1e-6)


@pytest.mark.parametrize("label", ["a\tb", "a\nb", " "])
def test_labels_that_trc_cannot_hold(tmp_path, label):
    with pytest.raises(ValueError, match="labels"):
        write_trc(tmp_path / "x.trc", Markers(np.zeros(1), (label,), np.zeros((1, 1, 3))))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", ["-9999", "-9999.00000", "-9.999"])
def test_places_that_stand_for_missing_markers(write, number):
    row = "\t".join([number] * 3)
    recording = read_trc_recording(write(HEADER + ROWS.replace("1\t2\t3", row, 1)))
    assert np.isnan(recording.markers.positions).all(axis=2).sum() == 1
    found = only(recording.findings, "F115", count=1, written="-9999 -9999 -9999")
    assert found.where.markers == ("R.Heel",)
    alone = read_trc_recording(write(HEADER + ROWS.replace("1\t2\t3", f"{number}\t2\t3", 1)))
    assert np.isfinite(alone.markers.positions).all()


BLANKS = (
    "PathFileType  4\t(X/Y/Z) x.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "  100.0      100.0         3          2 mm      100.0         1      3\n"
    "Frame#\tTime            R.Heel                       L Heel               \n"
    "             X1         Y1         Z1         X2         Y2         Z2\n"
    "\n"
)


@pytest.mark.parametrize(
    "row", ["\t{0}\t0.0{0}\t1\t2\t3\t4\t5\t6", "  {0}   0.0{0}  1  2  3  4  5  6", "{0}\t0.0{0}\t1 2 3\t4 5 6"]
)
def test_a_header_separated_by_blanks(write, row):
    """Cortex: two blanks or more between labels, a tab before each row, or blanks in it."""
    markers = read_trc(write(BLANKS + "".join(row.format(k) + "\n" for k in (1, 2, 3))))
    assert markers.labels == ("R.Heel", "L Heel")
    assert np.allclose(markers.positions * 1e3, [[[1, 2, 3], [4, 5, 6]]] * 3)
    assert np.allclose(markers.time, [0.01, 0.02, 0.03])


def test_labels_are_separated_by_single_blanks_where_their_number_agrees(write):
    text = BLANKS.replace("R.Heel                       L Heel               ", "R.Heel L.Heel")
    assert read_trc(write(text + "1 0.0 1 2 3 4 5 6\n2 0.01 1 2 3 4 5 6\n3 0.02 1 2 3 4 5 6\n")).labels == (
        "R.Heel",
        "L.Heel",
    )
