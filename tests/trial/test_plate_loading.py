import numpy as np

from kinertia.trial.data import LOAD_THRESHOLD_N
from kinertia.trial.plate_loading import LONGEST_TAIL_S, without_unloaded_level

RATE_HZ = 1000.0
PLACE = np.array([0.4, 0.0, -0.2])


def plate(vertical: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, force and moment of a plate with this vertical force at PLACE, garbage as moment where it is small."""
    time = np.arange(len(vertical)) / RATE_HZ
    force = vertical[:, None] * [0.1, 1.0, 0.05]
    moment = np.where(vertical[:, None] >= LOAD_THRESHOLD_N, np.cross(PLACE, force), 1e3)
    return time, force, moment


def ramp() -> np.ndarray:
    """A load that rises within 20 ms, stays, and falls within 20 ms."""
    up = np.linspace(0.0, 100.0, 20, endpoint=False)
    return np.concatenate([np.zeros(50), up, np.full(100, 100.0), up[::-1], np.zeros(50)])


def test_a_load_keeps_how_it_begins_and_ends():
    time, force, moment = plate(ramp())
    load = without_unloaded_level(time, force, moment)
    kept = force[:, 1] > 1.0
    np.testing.assert_array_equal(load.force[kept], force[kept])
    np.testing.assert_allclose(load.moment[kept], np.cross(PLACE, force[kept]), atol=1e-12)
    assert not load.force[~kept].any()
    assert not load.moment[~kept].any()


def test_an_offset_or_noise_is_no_load():
    rng = np.random.default_rng(1)
    vertical = ramp() + rng.normal(3.0, 0.5, 240)
    vertical[10] = 15.0
    time, force, moment = plate(vertical)
    load = without_unloaded_level(time, force, moment)
    assert not load.force[:30].any()
    assert not load.force[-30:].any()
    assert 0.35 < load.noise_n < 0.65


def test_a_tail_is_short():
    vertical = np.concatenate([np.zeros(300), np.full(200, 15.0), np.full(100, 100.0), np.zeros(30)])
    time, force, moment = plate(vertical)
    load = without_unloaded_level(time, force, moment)
    begins = 500 - round(LONGEST_TAIL_S * RATE_HZ)
    assert not load.force[: begins - 1].any()
    assert load.force[begins + 1 : 500].all()


def test_what_the_plate_reads_most_of_the_time_is_its_offset():
    vertical = np.concatenate([np.full(60, 15.0), np.full(100, 100.0), np.zeros(30)])
    load = without_unloaded_level(*plate(vertical))
    assert not load.force[:60].any()


def test_a_plate_that_is_never_loaded_is_zero():
    time, force, moment = plate(np.full(100, 5.0))
    load = without_unloaded_level(time, force, moment)
    assert not load.force.any()
    assert not load.moment.any()


def test_a_plate_that_was_not_zeroed_is_not_stood_on():
    """It reads 30 N all day long, and a foot stands on it for a while."""
    rng = np.random.default_rng(2)
    vertical = np.concatenate([np.zeros(400), 7.0 * ramp(), np.zeros(400)]) + rng.normal(30.0, 1.0, 1040)
    load = without_unloaded_level(*plate(vertical))
    assert not load.force[:440].any()
    assert not load.force[-440:].any()
    assert load.force[475:565, 1].min() > 600.0


def test_a_foot_that_lands_slowly_is_no_idle_level():
    vertical = np.concatenate([np.linspace(0.0, 800.0, 400), np.linspace(800.0, 0.0, 400)])
    load = without_unloaded_level(*plate(vertical))
    firm = vertical >= LOAD_THRESHOLD_N
    assert load.force[firm].all()
