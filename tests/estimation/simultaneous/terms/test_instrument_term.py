"""Zeros of horizontal forces that a tilt of the plates makes."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments.priors import SOFT_TISSUE_LAG_S, InstrumentInformation
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.terms.instrument_term import (
    GAINS,
    MISSING,
    PLATES,
    TILT_SD_RAD,
    ZEROS,
    InstrumentErrors,
    MissingLoads,
    mean_loads_n,
)
from small_problem import point, small_problem


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


def test_soft_tissue_lags_unless_others_show_the_delay():
    alone = small_problem()
    assert alone.imitated() == SOFT_TISSUE_LAG_S
    plates = len(alone.given.plates)
    known = np.zeros((5 * plates + 4,) * 2)
    known[-1, -1] = 1e6
    session = (InstrumentInformation(tuple(alone.given.plates), known, np.zeros(len(known))),)
    instruments = replace(alone.calibration.instruments, session=session)
    calibration = replace(alone.calibration, instruments=instruments)
    assert MapProblem(alone.skeleton, alone.prior, calibration, alone.trials).imitated() == (0.0, 0.0)


STEP = 1e-5


@pytest.fixture(scope="module")
def problem():
    """The plate under the left foot has incomplete loads."""
    complete = small_problem()
    instruments = replace(complete.calibration.instruments, incomplete=frozenset({"second"}))
    calibration = replace(complete.calibration, instruments=instruments)
    return MapProblem(complete.skeleton, complete.prior, calibration, complete.trials)


def test_complete_loads_have_no_unknowns():
    complete = small_problem()
    assert complete.term(MissingLoads).parts == []
    assert complete.layout[MISSING].start == complete.layout[MISSING].stop


def test_only_contacts_of_the_incomplete_plate_have_parts_and_only_in_measured_frames(problem):
    parts, dynamic = problem.term(MissingLoads).parts, problem.trials[0].dynamic
    assert [part.vertical for part in parts].count(True) == 1
    assert {(part.foot, part.plate) for part in parts} == {(1, 1)}
    assert not any((part.frames & ~dynamic).any() for part in parts)


def test_gain_of_an_incomplete_plate_stays_nominal(problem):
    layout, complete = problem.layout, small_problem().layout
    sds = [[prior.sd for prior in priors.error_priors.individual] for priors in (layout, complete)]
    for name, at in ((PLATES, 5 + 2), (GAINS, 1)):
        incomplete, other = (sd[layout[name].start - layout.errors.start + at] for sd in sds)
        assert incomplete <= other
        assert layout.error_priors.individual[layout[name].start - layout.errors.start + at].fault_probability == 0.0


def test_derivatives_by_missing_loads_are_those_of_the_cost(problem):
    coefficients, static = point(problem)
    at = np.arange(len(static))[problem.layout[MISSING]]
    static[at] = np.linspace(0.05, 0.2, len(at))
    exact = problem.gradient(0, coefficients[0], static)
    normal = problem.normal(0, coefficients[0], static)
    np.testing.assert_allclose(normal.static_rhs[at], exact.static_rhs[at], rtol=1e-6)
    for place in at:
        costs = []
        for sign in (-1.0, 1.0):
            moved = static.copy()
            moved[place] += sign * STEP
            costs.append(problem.gradient(0, coefficients[0], moved).cost)
        slope = (costs[1] - costs[0]) / (2.0 * STEP)
        assert -exact.static_rhs[place] == pytest.approx(slope, rel=1e-5, abs=1e-3)
        assert slope != 0.0
