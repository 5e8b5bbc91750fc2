from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments.plates import PLATE_ERRORS, PLATE_UNKNOWNS
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.terms.instrument_term import CLOCK, TRIAL_DELAYS, InstrumentErrors
from kinertia.settings import Instruments
from tests.small_problem import INSTRUMENTS, small_problem

PRIOR = InstrumentPrior()
EACH = len(PLATE_UNKNOWNS)


def shown(plates, seed=0):
    rng = np.random.default_rng(seed)
    size = EACH * len(plates) + 4
    root = rng.normal(size=(size, size)) * 1e3
    return InstrumentInformation(plates, root @ root.T, rng.normal(size=size) * 1e3)


def test_what_a_posterior_adds_is_what_was_put_in():
    session, rng = shown(("a", "b")), np.random.default_rng(1)
    before = [(np.diag(rng.uniform(1e4, 1e6, 14)), rng.normal(size=14)) for _ in range(2)]
    covariance = np.linalg.inv(session.information + sum(known for known, _ in before))
    mean = covariance @ (session.rhs + sum(known_rhs for _, known_rhs in before))
    added = InstrumentInformation.of_posterior(("a", "b"), mean, covariance, before)
    np.testing.assert_allclose(added.information, session.information, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(added.rhs, session.rhs, rtol=1e-6, atol=1e-3)


def test_a_posterior_that_knows_less_than_before_adds_nothing_negative():
    before = [(np.diag([1e6] * 9), np.zeros(9))]
    covariance = np.linalg.inv(np.diag([4e6, 0.9e6, *[2e6] * 7]))
    added = InstrumentInformation.of_posterior(("a",), np.full(9, 1e-3), covariance, before)
    np.testing.assert_allclose(np.linalg.eigvalsh(added.information), [0.0, *[1e6] * 7, 3e6], atol=1.0)


@pytest.mark.parametrize("plates", [("a", "b"), ("b", "a"), ("b",), ("c", "b"), ("c",)])
def test_plates_that_are_not_there_are_marginalised(plates):
    """Against the dense posterior of all plates."""
    session = shown(("a", "b"))
    every = tuple(dict.fromkeys([*plates, "a", "b"]))
    wide = session.among(every, PRIOR)
    sd = np.array([*[PRIOR.plate[name].sd for _ in every for name in PLATE_UNKNOWNS], *[1e-3] * 4])
    precision = np.diag(1.0 / np.square(sd))
    covariance = np.linalg.inv(wide.information + precision)
    kept = [*range(EACH * len(plates)), *range(len(sd) - 4, len(sd))]
    narrow = session.among(plates, PRIOR)
    inverse = np.linalg.inv(narrow.information + precision[np.ix_(kept, kept)])
    np.testing.assert_allclose(inverse, covariance[np.ix_(kept, kept)], rtol=1e-6, atol=1e-14)
    mean = covariance @ wide.rhs
    np.testing.assert_allclose(inverse @ narrow.rhs, mean[kept], rtol=1e-6, atol=1e-12)


def test_what_trials_have_of_their_own_is_marginalised():
    """Against the dense posterior of everything."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(11, 11))
    whole = InstrumentInformation(("a",), root @ root.T, rng.normal(size=11))
    sd = np.array([0.7, 0.6])
    without = whole.without_own(sd)
    before = np.diag([*[1.0] * 9, *sd**-2.0])
    covariance = np.linalg.inv(whole.information + before)
    inverse = np.linalg.inv(without.information + np.eye(9))
    np.testing.assert_allclose(inverse, covariance[:9, :9])
    np.testing.assert_allclose(inverse @ without.rhs, (covariance @ whole.rhs)[:9])
    assert np.linalg.eigvalsh(without.information).min() > -1e-12


@pytest.mark.parametrize("clock_sd_ms", [None, 1.0, 10.0])
def test_a_stated_synchronisation_holds_in_every_trial(clock_sd_ms):
    prior = InstrumentPrior.stated(Instruments(clock_sd_ms=clock_sd_ms))
    several = small_problem(3)
    calibration = replace(several.calibration, instruments=prior)
    unknowns = InstrumentErrors.unknowns(replace(several.given, calibration=calibration))
    priors = {unknown.name: unknown.prior.individual for unknown in unknowns}
    (clock,), delays = priors[CLOCK], priors[TRIAL_DELAYS]
    assert len(delays) == 3
    assert clock.nominal_sd == (0.0003 if clock_sd_ms is None else pytest.approx(clock_sd_ms / 1e3))
    fault = (0.010, 0.04) if clock_sd_ms is None else (0.00003, 0.0)
    assert all((delay.nominal_sd, delay.faulty_sd, delay.fault_probability) == (0.00003, *fault) for delay in delays)


def test_what_the_laboratory_states_replaces_the_literature():
    stated = InstrumentPrior.stated(Instruments(plate_sd_mm=2.0, clock_sd_ms=1.0))
    assert (stated.plate["x"].sd, stated.plate["z"].fault_probability, stated.delay_s.sd) == (0.002, 0.0, 0.001)
    assert stated.plate["gain"] == PRIOR.plate["gain"]
    gain = InstrumentPrior.stated(Instruments(gain_sd_percent=0.2))
    assert (gain.plate["gain"].sd, gain.plate["gain"].fault_probability) == (0.002, 0.0)
    assert (gain.plate["x"], gain.delay_s) == (PRIOR.plate["x"], PRIOR.delay_s)
    assert np.hypot(stated.plate["x"].sd, stated.floor["x"].sd) == pytest.approx(0.002, rel=0.01)
    assert (
        InstrumentPrior.stated(Instruments()) == replace(PRIOR) or InstrumentPrior.stated(Instruments()).session == ()
    )


def test_columns_of_the_same_name_have_faults_in_common():
    prior = InstrumentPrior()
    names = ("right (walk)", "left (walk)", "right (stand)", "left (stand)")
    covariance = prior.of_unknowns(names).covariance
    correlation = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    for unknown in range(len(PLATE_UNKNOWNS)):
        rhs, left, again = (unknown + len(PLATE_UNKNOWNS) * plate for plate in (0, 1, 2))
        assert 0.4 < correlation[rhs, again] < 0.5
        assert correlation[rhs, left] == 0.0
    assert prior.of_unknowns(("plate 1", "plate 2")).common == ()
    assert InstrumentPrior.stated(Instruments(plate_sd_mm=1.0, gain_sd_percent=0.5)).of_unknowns(names).covariance[
        0, 10
    ] == pytest.approx(0.0)


def test_the_session_counts_in_the_normal_equations():
    """Cost, right-hand side and information go together: by finite differences."""
    problem = small_problem(2)
    session = shown(problem.given.plates)
    calibration = replace(problem.calibration, instruments=replace(INSTRUMENTS, session=(session, session)))
    with_session = type(problem)(problem.skeleton, problem.prior, calibration, problem.trials)
    places, static = problem.layout.laboratory, problem.layout.start.copy()
    static[places] = np.random.default_rng(2).normal(0.0, 0.01, places.stop - places.start)
    before, information = (posed.prior_information(static) for posed in (problem, with_session))
    (right_before, cost_before), (rhs, cost) = (posed.prior_slope(static) for posed in (problem, with_session))
    np.testing.assert_allclose((information - before)[places, places], 2.0 * session.information)

    def extra(values):
        moved = static.copy()
        moved[places] = values
        return with_session.prior_slope(moved)[1] - problem.prior_slope(moved)[1]

    assert cost - cost_before == pytest.approx(extra(static[places]))
    for i in range(places.stop - places.start):
        h = np.zeros(places.stop - places.start)
        h[i] = 1e-4
        slope = (extra(static[places] + h) - extra(static[places] - h)) / 2e-4
        assert slope == pytest.approx(-(rhs - right_before)[places][i], rel=1e-6, abs=1e-3)


def test_who_has_checked_the_gain_has_checked_that_of_the_trial():
    assert InstrumentPrior().trial_gain.fault_probability > 0.0
    checked = InstrumentPrior.stated(Instruments(gain_sd_percent=0.5)).trial_gain
    assert checked.sd < 0.002


@pytest.mark.parametrize(("clock_sd_ms", "expected"), [(None, 1), (0.5, 0)])
def test_a_single_trial_may_be_late_by_itself_unless_its_clock_has_been_checked(clock_sd_ms, expected):
    single = small_problem()
    known = InstrumentPrior.stated(Instruments(clock_sd_ms=clock_sd_ms))
    problem = type(single)(single.skeleton, single.prior, replace(single.calibration, instruments=known), single.trials)
    assert problem.layout[TRIAL_DELAYS].stop - problem.layout[TRIAL_DELAYS].start == expected


@pytest.mark.parametrize(
    ("clock_sd_ms", "trials", "expected"), [(None, 1, ["clock", "delays"]), (0.5, 1, []), (None, 2, [])]
)
def test_the_delay_of_a_single_trial_is_profiled_where_it_is_open(clock_sd_ms, trials, expected):
    several = small_problem(trials)
    known = InstrumentPrior.stated(Instruments(clock_sd_ms=clock_sd_ms))
    calibration = replace(several.calibration, instruments=known)
    problem = type(several)(several.skeleton, several.prior, calibration, several.trials)
    assert problem.profiled() == [problem.layout[name].start for name in expected]


def test_a_gain_of_a_trial_is_that_of_its_plates_in_it_only():
    pair = small_problem(2)
    static = pair.layout.start.copy()
    instruments = pair.term(InstrumentErrors)
    static[instruments.gains_of(1)] = [0.01, 0.02, 0.03]
    gains = list(PLATE_ERRORS).index("gain")
    np.testing.assert_allclose(instruments.plates_in(1, static)[:, gains], [0.01, 0.02, 0.03])
    assert not instruments.plates_in(0, static).any()
