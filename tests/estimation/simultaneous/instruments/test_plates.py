"""Loads of plates put right, against the steps one by one, and their derivatives against finite differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.estimation.simultaneous.instruments.plates import (
    FREE_MOMENT,
    GAIN,
    PLATE_ERRORS,
    TURN,
    ZERO_UNKNOWNS,
    ZERO_X,
    ZERO_Z,
    X,
    Z,
    by_plate,
    corrected_loads,
    turned_loads,
)

N, PLATES = 5, 3
UNITS = np.array([1e-2, 1e-2, 0.1, 1e-2, 0.1, 10.0, 10.0])


@pytest.fixture
def given():
    rng = np.random.default_rng(3)
    loads = rng.standard_normal((N, 2, 6)) * [100.0, 800.0, 100.0, 300.0, 50.0, 300.0]
    loaded, carrier = rng.integers(0, 2, (N, 2)).astype(float), rng.integers(0, PLATES, (N, 2))
    plates, middles = UNITS * rng.standard_normal((PLATES, 7)), rng.standard_normal((PLATES, 3))
    return loads, loaded, carrier, plates, middles, Rotation.from_euler("y", 90.0, degrees=True).as_matrix()


def test_the_columns_are_those_of_the_unknowns():
    names = [*PLATE_ERRORS, *ZERO_UNKNOWNS]
    expected = ["x", "z", "gain", "free moment", "turn", "zero x", "zero z"]
    assert names == expected
    columns = [X, Z, GAIN, FREE_MOMENT, TURN]
    assert [*columns, ZERO_X, ZERO_Z] == list(range(len(names)))


def test_loads_are_put_right_step_by_step(given):
    loads, loaded, carrier, plates, middles, turn = given
    expected = np.empty_like(loads)
    for i, foot in np.ndindex(N, 2):
        plate = carrier[i, foot]
        x, z, gain, free, angle, zero_x, zero_z = plates[plate]
        zero = loaded[i, foot] * (zero_x * turn[:, 0] + zero_z * turn[:, 2])
        load = loads[i, foot] - np.concatenate([zero, np.cross(middles[plate], zero)])
        load = turned_loads(load, middles[plate], -angle)
        load[3:] += np.cross(x * turn[:, 0] + z * turn[:, 2], load[:3])
        load[4] += free * load[1]
        expected[i, foot] = (1.0 + gain) * load
    np.testing.assert_allclose(corrected_loads(*given), expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("error", range(len(UNITS)))
@pytest.mark.parametrize("plate", range(PLATES))
def test_derivatives_are_those_of_the_loads(given, plate, error):
    loads, loaded, carrier, plates, middles, turn = given
    by = by_plate(corrected_loads(*given), loaded, carrier, plates, middles, turn)
    assert by.shape == (N, 2, 6, PLATES, len(UNITS))
    step, sides = 1e-4 * UNITS[error], []
    for sign in (1.0, -1.0):
        moved = plates.copy()
        moved[plate, error] += sign * step
        sides.append(corrected_loads(loads, loaded, carrier, moved, middles, turn))
    np.testing.assert_allclose(by[..., plate, error], (sides[0] - sides[1]) / (2.0 * step), rtol=1e-6, atol=1e-5)
