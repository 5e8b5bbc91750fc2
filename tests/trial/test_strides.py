import numpy as np

from kinertia.trial.data import FootLoads
from kinertia.trial.strides import periods

TIME = np.arange(3000) / 1000.0


def loads(right, left) -> FootLoads:
    """Feet that carry 400 N from the first to the second of these times (s)."""
    force = np.zeros((len(TIME), 2, 3))
    for foot, spans in enumerate((right, left)):
        for start, end in spans:
            force[(start <= TIME) & (end > TIME), foot, 1] = 400.0
    return FootLoads(TIME, force, np.zeros_like(force))


def test_a_walk_has_strides_and_steps():
    strides, steps = periods(loads([(0.1, 0.7), (1.1, 1.7)], [(0.6, 1.2), (1.6, 2.2)]))
    np.testing.assert_allclose(strides, 1.0)
    assert len(strides) == 4
    np.testing.assert_allclose(steps, 0.5)


def test_a_limp_has_them_too():
    strides, _ = periods(loads([(0.1, 0.7), (1.1, 1.7)], [(0.4, 1.2), (1.4, 2.2)]))
    np.testing.assert_allclose(strides, 1.0)


def test_jumps_on_both_feet_have_none():
    assert periods(loads([(0.1, 0.5), (1.1, 1.5)], [(0.12, 0.49), (1.05, 1.52)])) == ([], [])


def test_one_foot_on_plates_is_enough_for_strides():
    strides, steps = periods(loads([(0.1, 0.7), (1.1, 1.7)], []))
    np.testing.assert_allclose(strides, 1.0)
    assert steps == []
