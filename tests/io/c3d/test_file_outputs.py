"""Joint angles, moments and powers that other software left in C3D files."""

import numpy as np
import pytest

from c3d_writer import write_c3d
from kinertia.io.c3d.reader import read_c3d


def read(path, names, values, units):
    """A file with a person upright and points of these names whose values are (k, 3)."""
    places = np.tile(np.linspace([200.0, 200.0, 30.0], [300.0, 200.0, 1700.0], 4), (20, 1, 1))
    outputs = np.tile(np.asarray(values, float), (20, 1, 1))
    outputs[:2] = np.nan
    parameters = {"POINT": {"Y_SCREEN": ["+Z"], **{name: [unit] for name, unit in units.items()}}}
    labels = ["RHEE", "RTOE", "RASI", "RFHD", *names]
    return read_c3d(write_c3d(path, np.concatenate([places, outputs], axis=1), labels, None, parameters)).outputs


@pytest.mark.parametrize(
    ("name", "units", "factor"),
    [
        ("RHipMoment", {}, 1e-3),
        ("RHipMoment", {"MOMENT_UNITS": "Nmm"}, 1e-3),
        ("RHipMoment", {"MOMENT_UNITS": "Nm/kg"}, 1.0),
        ("RHipPower", {"POWER_UNITS": "mW"}, 1e-3),
        ("RHipAngles", {"ANGLE_UNITS": "rad"}, 180.0 / np.pi),
    ],
)
def test_units(tmp_path, name, units, factor):
    outputs = read(tmp_path / "x.c3d", [name], [[1.0, 2.0, 3.0]], units)
    np.testing.assert_allclose(outputs.values[name][2:], factor * np.tile([1.0, 2.0, 3.0], (18, 1)), rtol=1e-6)
    assert np.isnan(outputs.values[name][:2]).all()


def test_names(tmp_path):
    names = ["LKneeAngles", "Anna:LViconKneeAngles", "LKneePower", "LShoulderAngles"]
    values = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0], [4.0, 0.0, 0.0]]
    outputs = read(tmp_path / "x.c3d", names, values, {})
    assert list(outputs.values) == ["LKneeAngles"]  # a curve of zeros is none
    assert outputs.values["LKneeAngles"][-1, 0] == 2.0
    assert read(tmp_path / "y.c3d", ["LKneeMoment"], [[1.0, 2.0, 3.0]], {"MOMENT_UNITS": "lbf in"}) is None
