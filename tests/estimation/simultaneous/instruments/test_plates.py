"""Loads of plates put right, against the steps one by one, and their derivatives against finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline
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
    down_weighted,
    impact_factors,
    turned_loads,
)
from kinertia.estimation.simultaneous.instruments.priors import SOFT_TISSUE_LAG_S
from kinertia.settings import Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare

N, PLATES = 5, 3


UNITS = np.array([1e-2, 1e-2, 0.1, 1e-2, 0.1, 10.0, 10.0])


@pytest.fixture
def given():
    rng = np.random.default_rng(3)
    loads = rng.standard_normal((N, 2, 6)) * [100.0, 800.0, 100.0, 300.0, 50.0, 300.0]
    loaded, plate_index = rng.integers(0, 2, (N, 2)).astype(float), rng.integers(0, PLATES, (N, 2))
    plates, middles = UNITS * rng.standard_normal((PLATES, 7)), rng.standard_normal((PLATES, 3))
    return loads, loaded, plate_index, plates, middles, Rotation.from_euler("y", 90.0, degrees=True).as_matrix()


def test_the_columns_are_those_of_the_unknowns():
    names = [*PLATE_ERRORS, *ZERO_UNKNOWNS]
    expected = ["x", "z", "gain", "free moment", "turn", "zero x", "zero z"]
    assert names == expected
    columns = [X, Z, GAIN, FREE_MOMENT, TURN]
    assert [*columns, ZERO_X, ZERO_Z] == list(range(len(names)))


def test_loads_are_put_right_step_by_step(given):
    loads, loaded, plate_index, plates, middles, turn = given
    expected = np.empty_like(loads)
    for i, foot in np.ndindex(N, 2):
        plate = plate_index[i, foot]
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
    loads, loaded, plate_index, plates, middles, turn = given
    by = by_plate(corrected_loads(*given), loaded, plate_index, plates, middles, turn)
    assert by.shape == (N, 2, 6, PLATES, len(UNITS))
    step, sides = 1e-4 * UNITS[error], []
    for sign in (1.0, -1.0):
        moved = plates.copy()
        moved[plate, error] += sign * step
        sides.append(corrected_loads(loads, loaded, plate_index, moved, middles, turn))
    np.testing.assert_allclose(by[..., plate, error], (sides[0] - sides[1]) / (2.0 * step), rtol=1e-6, atol=1e-5)


SPACING_S, FORCE_SD = 1.0 / 30.0, 4.0


TIME = np.arange(120) / 100.0


EVERY = np.ones(120, dtype=bool)


def pushed(at_s, size_n=100.0, width_s=0.02):
    force = np.tile([0.0, 700.0, 0.0], (120, 1))
    force[:, 1] += size_n * np.exp(-(((TIME - at_s) / width_s) ** 2))
    return force


def test_forces_of_the_motion_s_bandwidth_are_as_sure_everywhere():
    rng = np.random.default_rng(0)
    knots = np.arange(-5, 20) * 4.0 * SPACING_S
    force = BSpline(knots, rng.normal(0.0, 200.0, (len(knots) - 4, 3)), 3)(TIME)
    assert impact_factors(TIME, force, EVERY, SPACING_S, FORCE_SD).max() < 1.02


@pytest.mark.parametrize("at_s", 0.6 + SPACING_S * np.linspace(0.0, 1.0, 5))
def test_an_impact_counts_alike_wherever_it_lies_between_two_knots(at_s):
    factors = impact_factors(TIME, pushed(at_s), EVERY, SPACING_S, FORCE_SD)
    # with knots that lie in one way only: 2.8 to 7.9
    assert 4.5 < factors.max() < 6.0
    assert factors[np.abs(TIME - at_s) < 0.015].min() > 4.0
    assert factors[np.abs(TIME - at_s) > 0.2].max() < 1.05


def test_frames_that_count_a_quarter_or_less():
    assert down_weighted(np.array([1.0, 1.9, 2.0, 9.0])) == 0.5
    assert down_weighted(np.empty(0)) == 0.0


def test_intervals_count_by_themselves_and_short_ones_not():
    dynamic = EVERY.copy()
    dynamic[70:] = False
    dynamic[[90, 91, 92]] = True
    force = pushed(0.75)
    force[90:93] = 1e6
    factors = impact_factors(TIME, force, dynamic, SPACING_S, FORCE_SD)
    assert (factors[70:] == 1.0).all()
    assert factors[:60].max() < 1.05


def test_knots_are_no_closer_than_every_second_frame():
    assert np.isfinite(impact_factors(TIME, pushed(0.6), EVERY, 0.005, FORCE_SD)).all()


def clock_ms(recording_of, person, *moved_ms):
    """How late the clock is found to be where forces are moved by these times."""
    walk, static = (recording_of(f"{person}{kind}.c3d") for kind in ("walk", "static"))
    late = {}
    for late_ms in moved_ms:
        plates = replace(walk.plates, time=walk.plates.time + late_ms / 1e3)
        fit = estimate(prepare(Person(Subject(sex="male"), [TrialInput(replace(walk, plates=plates))], static)))
        # of a single trial its own is the total
        (total,) = (
            error for error in fit.posterior.calibration if error.quantity == "delay" and error.trial is not None
        )
        late[late_ms] = 1e3 * total.value
    # a delay is known to some 3 ms
    assert (np.diff(list(late.values())) > -1.0).all()
    return late


@pytest.mark.slow
def test_the_clock_follows_forces_that_are_moved(recording_of):
    """Less what soft tissue is expected to lag."""
    late = clock_ms(recording_of, "synthetic/", -20.0, -8.0, 0.0, 8.0, 15.0)
    np.testing.assert_allclose(list(late.values()), np.array(list(late)) - 1e3 * SOFT_TISSUE_LAG_S[0], atol=0.8)


@pytest.mark.slow
@pytest.mark.measured
def test_the_clock_follows_forces_that_are_moved_where_the_heel_strikes_sharply(recording_of):
    """With it as sure as other frames the clock was 12.5 ms late where forces were 8 ms earlier, and 9.8 ms where they
    were 20 ms earlier, +-0.5 ms; 34 ms apart. A clock that may be sound counts as sound: it follows over some
    15 ms by a third.
    """
    late = clock_ms(recording_of, "pig_c3d/subject_a_", -20.0, -8.0, 0.0, 8.0, 15.0)
    assert np.ptp([value - moved_ms for moved_ms, value in late.items()]) < 12.0
    assert late[-20.0] < -5.0 < -3.0 < late[-8.0] < late[0.0] - 5.0
    assert late[15.0] > 10.0
