"""Zeros of horizontal forces that a tilt of the plates makes."""

import numpy as np

from kinertia.estimation.simultaneous.terms.instrument_term import TILT_SD_RAD, ZEROS, InstrumentErrors, mean_loads_n
from small_problem import small_problem


def test_a_tilt_moves_all_zeros_by_the_load_on_each_plate():
    problem = small_problem()
    (trial,) = problem.trials
    loads = mean_loads_n(trial)
    frames = np.flatnonzero(trial.dynamic)
    vertical = trial.ground.loads(trial.time[frames]).reshape(-1, 2, 6)[..., 1]
    assert loads.max() < vertical.max()
    assert loads.max() > 0.2 * vertical.max()
    left_out = problem.term(InstrumentErrors).left_out(problem.layout.start)
    assert left_out.shape == (problem.layout.size, 2)
    zeros = left_out[problem.layout[ZEROS]].reshape(-1, 2, 2)
    np.testing.assert_allclose(zeros, TILT_SD_RAD * loads[:, None, None] * np.eye(2))
    assert np.count_nonzero(left_out) == np.count_nonzero(zeros)
    assert problem.left_out(problem.layout.start).shape == (problem.layout.size, 3)
