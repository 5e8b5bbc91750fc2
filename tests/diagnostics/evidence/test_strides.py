import numpy as np
import pytest

from kinertia.diagnostics.evidence.strides import periods
from kinertia.trial.data import FootLoads

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


@pytest.mark.parametrize("late_s", [0.0, 0.02, 0.08, 0.15])
def test_one_landing_and_one_leaving_of_both_feet_are_no_steps(late_s):
    """A drop jump whose second landing is not in the file, and standing up from a chair with the feet off the floor."""
    assert periods(loads([(1.0, 1.8)], [(1.0 + late_s, 1.8 - late_s)])) == ([], [])
    assert periods(loads([(1.0, 3.0)], [(1.0 + late_s, 3.0)])) == ([], [])


def test_two_steps_of_a_run():
    assert periods(loads([(1.0, 1.2)], [(1.3, 1.5)])) == ([], pytest.approx([0.3, 0.3]))


def test_one_foot_on_plates_is_enough_for_strides():
    strides, steps = periods(loads([(0.1, 0.7), (1.1, 1.7)], []))
    np.testing.assert_allclose(strides, 1.0)
    assert steps == []
