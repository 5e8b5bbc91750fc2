"""A term that is in no list of the package: the one on the page about architecture."""

from dataclasses import replace

import numpy as np
import pytest

from examples import ROOT, blocks
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observation
from kinertia.estimation.simultaneous.search.problem import TERMS, MapProblem, Point
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.estimation.simultaneous.terms.cost_term import in_order
from kinertia.estimation.simultaneous.terms.instrument_term import InstrumentErrors
from kinertia.motion.smoothing import smooth
from kinertia.synthetic.walk import unlike_literature, walk, walking_subject
from small_problem import one_plate_per_foot, point, small_problem

BIAS_NM = 4.0


@pytest.fixture(scope="module")
def page():
    """What the example defines."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    (block,) = (block for block in blocks(text) if block.language == "python" and "LoadTerm" in block.text)
    assert len(block.text.splitlines()) < 60
    names = {}
    exec(compile(block.text, "example of a cost term", "exec"), names)
    return names


@pytest.fixture(scope="module")
def person():
    return unlike_literature(walking_subject(), np.random.default_rng(3))


@pytest.fixture(scope="module")
def trial(person):
    return walk(person, 1.2, 60.0, trapezoid=False)


def observation(trial, bias_nm: float) -> Observation:
    """Of a right plate that reads so much vertical moment too much while somebody stands on it."""
    rng, time, loads = np.random.default_rng(0), trial.time, trial.foot_loads.copy()
    loads[:, 0, 4] += bias_nm * (loads[:, 0, 1] > 20.0)
    markers = trial.markers.positions + rng.normal(0.0, 0.003, trial.markers.positions.shape)
    return Observation(
        time=time,
        markers=markers,
        marker_sd=np.full(markers.shape[1], 0.003),
        marker_frames=1.0,
        q=trial.motion.q,
        spacing_s=0.05,
        dynamic=np.ones(len(time), dtype=bool),
        ground=one_plate_per_foot(smooth(time, loads.reshape(len(time), 12), 25.0), len(time)),
        force_sd=3.0,
        moment_sd=1.0,
    )


def found(page, person, trial, bias_nm: float):
    calibration = CalibrationPrior({}, np.full(len(trial.skeleton.markers), 0.005), InstrumentPrior())
    prior, trials = literature_prior(person.literature), [observation(trial, bias_nm)]
    result = estimate_simultaneous(trial.skeleton, prior, calibration, trials, terms=(*TERMS, page["MomentBias"]))
    return {entry.plate: entry for entry in result.calibration if entry.quantity == page["BIAS"]}


@pytest.mark.parametrize("bias_nm", [BIAS_NM, 0.0])
def test_a_simulated_bias_comes_back(page, person, trial, bias_nm):
    bias = found(page, person, trial, bias_nm)
    assert set(bias) == {"right foot", "left foot"}
    for plate, true_nm in (("right foot", bias_nm), ("left foot", 0.0)):
        assert bias[plate].value == pytest.approx(true_nm, abs=3.0 * bias[plate].sd), plate
        assert bias[plate].sd < bias[plate].prior_sd
        assert bias[plate].found == bool(true_nm)


def test_its_derivatives_are_those_of_the_cost(page):
    """And so are those of the terms after it, which see what it leaves of the loads."""
    small = small_problem()
    problem = MapProblem(
        small.skeleton, small.prior, small.calibration, small.trials, terms=(*TERMS, page["MomentBias"])
    )
    (coefficients,), static = point(problem)
    static[problem.layout[page["BIAS"]]] = [3.0, -2.0, 1.0]
    here = Point((coefficients,), static, problem.beginning.displaced)
    rhs, normal = here.like(problem.slope(here).rhs).static, problem.normal(0, coefficients, static)
    np.testing.assert_allclose(rhs, normal.static_rhs + problem.prior_slope(static)[0], rtol=1e-8, atol=1e-6)
    for name in (page["BIAS"], "plates", "zeros", "gains"):
        step = np.zeros(len(static))
        step[problem.layout[name]] = np.random.default_rng(0).normal(size=len(step[problem.layout[name]]))
        ahead, behind = (problem.slope(replace(here, static=static + h * step)).cost for h in (1e-6, -1e-6))
        assert -rhs @ step == pytest.approx((ahead - behind) / 2e-6, rel=1e-5), name


def test_it_costs_nothing_where_there_is_no_bias(page):
    small = small_problem()
    with_bias = MapProblem(
        small.skeleton, small.prior, small.calibration, small.trials, terms=(*TERMS, page["MomentBias"])
    )
    again = with_bias.of(small.trials)
    kinds = [type(term) for term in with_bias.terms]
    assert [type(term) for term in again.terms] == kinds
    assert kinds.index(page["MomentBias"]) < kinds.index(InstrumentErrors), "although listed last"
    assert small.layout.laboratory.stop - small.layout.laboratory.start == (
        with_bias.layout.laboratory.stop - with_bias.layout.laboratory.start
    )
    cost = small.slope(small.beginning).cost
    assert with_bias.slope(with_bias.beginning).cost == pytest.approx(cost, rel=1e-12)


def test_every_term_states_its_place_and_the_list_is_in_this_order(page):
    assert in_order(TERMS) == TERMS
    assert in_order((page["MomentBias"], *TERMS)) == in_order((*TERMS, page["MomentBias"]))
