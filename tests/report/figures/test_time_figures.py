import numpy as np
import pytest

from kinertia.report.figures.coordinate_titles import Coordinate
from kinertia.report.figures.time_figures import bands, lines_by_side

KNEE = Coordinate("knee_angle", "Knee flexion +", {"r": 0, "l": 1}, True)
TIME = np.arange(40) / 100.0


def test_a_band_is_1_96_standard_deviations_to_either_side_of_its_sides_values():
    values = np.column_stack([np.full(40, 10.0), np.full(40, 20.0)])
    sd = np.column_stack([np.full(40, 1.0), np.full(40, 0.5)])
    drawn = bands(KNEE, TIME, values, sd, slice(None, None, 1))
    assert all(np.ptp(trace["y"]) == 0.0 for trace in drawn)
    assert {trace["name"]: float(trace["y"][0]) for trace in drawn} == pytest.approx(
        {
            "right 95 % band, lower edge": 8.04,
            "right 95 % band": 11.96,
            "left 95 % band, lower edge": 19.02,
            "left 95 % band": 20.98,
        },
        abs=1e-3,
    )


def test_a_line_breaks_where_frames_are_missing():
    time, values = TIME[[*range(10), *range(20, 40)]], np.ones((30, 2))
    right, left = lines_by_side(KNEE, "estimate", time, values, slice(None, None, 1), {})
    assert (right["name"], left["name"]) == ("right, estimate", "left, estimate")
    assert [k for k, y in enumerate(right["y"]) if y is None or np.isnan(y)] == [10]
    assert (right["x"][9:12], len(right["x"])) == ([0.09, 0.09, 0.2], 31)
