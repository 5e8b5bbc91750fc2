"""C3D files that hold 16-bit integers, signed and unsigned."""

import numpy as np
import pytest

from c3d_writer import plate_parameters, write_c3d
from kinertia.io.c3d.reader import read_c3d
from person_on_plate import CORNERS
from refusals import refused

SCALE = np.array([0.05, 0.05, 0.05, 5.0, 5.0, 5.0])
"""N and N mm of one step of the converter."""
RNG = np.random.default_rng(0)
PERSON = 0.1 * RNG.integers((0, 0, 0), (6000, 5000, 18000), (20, 9, 3))
LOADS = SCALE * RNG.integers(-400, 400, (200, 6)) - [0, 0, 600, 0, 0, 0]


def plates_of(path, samples, offset, said, integers=True):
    parameters = {
        "POINT": {"Y_SCREEN": ["+Z"]},
        "FORCE_PLATFORM": plate_parameters(CORNERS),
        "ANALOG": {"SCALE": SCALE, "OFFSET": np.full(6, offset).astype(np.int16), "FORMAT": [said]},
    }
    labels = [f"M{k}" for k in range(9)]
    file = write_c3d(path, PERSON, labels, samples, parameters, integers=integers)
    recording = read_c3d(file)
    np.testing.assert_allclose(recording.markers.positions[:, :, 1], PERSON[:, :, 2] / 1000, atol=1e-6)
    return recording.plates


@pytest.fixture
def expected(tmp_path):
    return plates_of(tmp_path / "floats.c3d", LOADS / SCALE, 0, "SIGNED", integers=False)


@pytest.mark.parametrize(
    ("offset", "said"),
    [
        pytest.param(0, "SIGNED", id="signed"),
        pytest.param(-900, "SIGNED", id="signed below 0"),
        pytest.param(20000, "UNSIGNED", id="unsigned below 32768"),
        pytest.param(32768, "UNSIGNED", id="unsigned around 32768"),
        pytest.param(32767, "unsigned", id="in small letters"),
        pytest.param(50000, "UNSIGNED", id="unsigned above 32768"),
        pytest.param(0, "UNSIGNED", id="signed, though it says otherwise"),
    ],
)
def test_integers(tmp_path, expected, offset, said):
    plates = plates_of(tmp_path / "x.c3d", LOADS / SCALE + offset, offset, said)
    np.testing.assert_allclose(plates.force, expected.force, atol=1e-3)
    np.testing.assert_allclose(plates.moment, expected.moment, atol=1e-3)


def test_samples_that_16_bits_do_not_hold(tmp_path):
    with refused("F106", None, steps=60000, what="ANALOG:OFFSET"):
        plates_of(tmp_path / "x.c3d", np.tile([[60000.0, 50000.0]], (200, 3)), 0, "UNSIGNED")
