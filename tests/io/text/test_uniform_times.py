"""Times that were rounded when they were written are put back on the even grid that they came from."""

from pathlib import Path

import numpy as np
import pytest

from kinertia.errors import FileError
from kinertia.io.text.uniform_times import uniform_times

PATH = Path("walk.mot")


@pytest.mark.parametrize(("rate_hz", "decimals"), [(2000.0, 3), (300.0, 3), (300.0, 2)])
def test_rounded_times_are_restored(rate_hz, decimals):
    true = np.arange(600) / rate_hz
    times, findings = uniform_times(PATH, true.round(decimals))
    assert [one.code for one in findings] == ["T102"]
    assert np.diff(times) == pytest.approx(1.0 / rate_hz, rel=1e-3)


def test_times_in_tenths_of_seconds_show_no_rate():
    with pytest.raises(FileError):
        uniform_times(PATH, (np.arange(600) / 30.0).round(1))


def test_even_times_stay_as_they_are():
    true = np.arange(600) / 1000.0
    times, findings = uniform_times(PATH, true)
    assert findings == ()
    assert times.tolist() == true.tolist()
