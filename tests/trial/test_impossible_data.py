from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from kinertia.errors import TrialError
from kinertia.trial.data import Markers, PlateLoads, Recording

TIME = np.arange(10) / 100
MARKERS = Markers(TIME, ("HEEL", "TOE"), np.zeros((10, 2, 3)))
PLATES = PlateLoads(TIME, ("one", "two"), *np.zeros((2, 10, 2, 3)), declared_feet=("r", None))


def changed(array, place, value):
    result = array.copy()
    result[place] = value
    return result


@pytest.mark.parametrize(
    ("markers", "problem"),
    [
        ({"time": changed(TIME, 3, np.nan)}, "trial 'walk': the times of the markers must be numbers, each later"),
        ({"time": changed(TIME, 3, 0.02)}, "the times of the markers must be numbers, each later"),
        ({"time": np.where(TIME < 0.045, TIME, TIME + 0.05)}, r"step to the next frame is 0\.06 s at 0\.0400 s"),
        ({"positions": changed(MARKERS.positions, (4, 1, 2), -np.inf)}, "place of TOE at 0.040 s is infinite"),
    ],
)
def test_markers_that_no_camera_saw(markers, problem):
    with pytest.raises(TrialError, match=problem):
        Recording("walk", replace(MARKERS, **markers))


@pytest.mark.parametrize(
    ("plates", "problem"),
    [
        ({"time": TIME[::-1]}, "the times of the plates must be numbers, each later"),
        ({"names": ("one", "one")}, "two plates have one name"),
        ({"declared_feet": ("right", "l")}, "declared_feet has 'right'"),
        ({"force": changed(PLATES.force, (7, 1, 0), np.nan)}, "force or moment of two at 0.0700 s is not a number"),
        ({"moment": changed(PLATES.moment, (2, 0, 1), np.inf)}, "force or moment of one at 0.0200 s is not a number"),
    ],
)
def test_plates_that_measured_nothing(plates, problem):
    with pytest.raises(TrialError, match=problem):
        Recording("walk", MARKERS, replace(PLATES, **plates))


def test_what_pandas_gives_will_do():
    table = pd.DataFrame(np.zeros((10, 2)), index=TIME, columns=["HEEL", "TOE"])
    markers = Markers(table.index, table.columns, np.zeros((10, 2, 3)))
    assert Recording("walk", markers, PLATES).markers.select(["TOE"]).labels == ("TOE",)
    assert Markers(pd.Series(TIME), ("HEEL", "TOE"), np.full((10, 2, 3), np.nan)).rate_hz == 100.0
