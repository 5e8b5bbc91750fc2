from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import ndimage

from kinertia.errors import TrialError
from kinertia.trial.data import Markers, PlateLoads, Recording
from kinertia.trial.sampled_data import all_around, even_mean, gaussian_mean, greatest, nearest_samples
from refusals import refused

TIME = np.arange(10) / 100


MARKERS = Markers(TIME, ("HEEL", "TOE"), np.zeros((10, 2, 3)))


PLATES = PlateLoads(TIME, ("one", "two"), *np.zeros((2, 10, 2, 3)), declared_feet=("r", None))


def changed(array, place, value):
    result = array.copy()
    result[place] = value
    return result


@pytest.mark.parametrize(
    ("markers", "code", "evidence"),
    [
        ({"time": changed(TIME, 3, np.nan)}, "T101", {"time_s": 0.02, "after": "no number"}),
        ({"time": changed(TIME, 3, 0.02)}, "T101", {"time_s": 0.02, "after": "0.02 s", "step_s": 0.0, "usual_s": 0.01}),
        ({"time": np.where(TIME < 0.045, TIME, TIME + 0.05)}, "T101", {"time_s": 0.04, "step_s": 0.06}),
        (
            {"positions": changed(MARKERS.positions, (4, 1, 2), -np.inf)},
            "F171",
            {"position_m": -np.inf, "time_s": 0.04},
        ),
    ],
)
def test_markers_that_no_camera_saw(markers, code, evidence):
    with refused(code, error=TrialError, **evidence) as caught:
        Recording("walk", replace(MARKERS, **markers))
    where = caught.value.finding.where
    assert (where.trial, where.markers) == ("walk", ("TOE",) if code == "F171" else ())


@pytest.mark.parametrize(
    ("plates", "code", "plate", "evidence"),
    [
        ({"time": TIME[::-1]}, "T101", None, {"time_s": 0.09, "after": "0.08 s"}),
        ({"names": ("one", "one")}, "F173", None, {"names": "one, one"}),
        ({"declared_feet": ("right", "l")}, "F173", "one", {"problem": "'right'"}),
        ({"force": changed(PLATES.force, (7, 1, 0), np.nan)}, "F172", "two", {"time_s": 0.07}),
        ({"moment": changed(PLATES.moment, (2, 0, 1), np.inf)}, "F172", "one", {"time_s": 0.02}),
    ],
)
def test_plates_that_measured_nothing(plates, code, plate, evidence):
    with refused(code, error=TrialError, **evidence) as caught:
        Recording("walk", MARKERS, replace(PLATES, **plates))
    assert caught.value.finding.where.plate == plate


def test_what_pandas_gives_will_do():
    table = pd.DataFrame(np.zeros((10, 2)), index=TIME, columns=["HEEL", "TOE"])
    markers = Markers(table.index, table.columns, np.zeros((10, 2, 3)))
    assert Recording("walk", markers, PLATES).markers.select(["TOE"]).labels == ("TOE",)
    assert Markers(pd.Series(TIME), ("HEEL", "TOE"), np.full((10, 2, 3), np.nan)).rate_hz == 100.0


SHAPES = [(1,), (2,), (17,), (300, 2, 1), (300, 3)]


SIZES = [1, 3, 21, 101]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("deviation", [0.05, 1.0, 7.77, 60.0])
def test_gaussian_mean(shape, deviation):
    values = np.random.default_rng(100).normal(size=shape)
    expected = ndimage.gaussian_filter1d(values, deviation, axis=0, mode="nearest")
    np.testing.assert_allclose(gaussian_mean(values, deviation), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("size", SIZES)
def test_even_windows(shape, size):
    values = np.random.default_rng(101).normal(size=shape)
    known = values > -2.0
    mean = ndimage.uniform_filter1d(values, size, axis=0, mode="nearest")
    np.testing.assert_allclose(even_mean(values, size), mean, rtol=0, atol=1e-14)
    assert np.array_equal(greatest(values, size), ndimage.maximum_filter1d(values, size, axis=0))
    inside = ndimage.minimum_filter1d(known, size, axis=0, mode="constant", cval=0)
    assert np.array_equal(all_around(known, size), inside)


def test_of_two_samples_equally_near_the_later_one_is_taken_whatever_the_rounding():
    between = TIME[:-1] + 0.005
    for rounding_s in (-1e-9, 0.0, 1e-9):
        np.testing.assert_array_equal(nearest_samples(TIME, between + rounding_s), np.arange(1, 10))
    np.testing.assert_array_equal(nearest_samples(TIME, between - 1e-4), np.arange(9))
    np.testing.assert_array_equal(nearest_samples(TIME, np.array([-1.0, 1.0])), [0, 9])
