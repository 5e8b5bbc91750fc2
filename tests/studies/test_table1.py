import json
from dataclasses import asdict, astuple
from functools import partial
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from kinertia.estimation.identifiability import ParameterVector
from kinertia.studies.parallel import in_parallel
from kinertia.studies.table1 import (
    CONDITIONS,
    PUBLISHED,
    Table1,
    errors_by_class,
    run_draw,
    run_table1,
    study_trial,
    table1_json,
)
from one_process import in_one_process

CLEAN = [condition for condition in CONDITIONS if condition.endswith("no_noise")]
NOISY = [condition for condition in CONDITIONS if condition not in CLEAN]


@pytest.fixture(scope="module")
def trial():
    return study_trial()


@pytest.fixture(scope="module")
def one_draw(trial):
    """One draw, without the seconds of estimating: its start is what is found."""

    def given_back(skeleton, start, windows, correct):
        return SimpleNamespace(bsp=start, cost=(1.0, 1.0), converged=True)

    with in_one_process(), mock.patch("kinertia.studies.table1.estimate_two_level", given_back):
        return run_table1(trial, repeats=1, seed=1)


def assert_exact(errors, published):
    assert errors.mass_rms_kg < 1e-7
    assert errors.com_rms_m < 1e-8
    assert errors.inertia_rms_kgm2 < 3e-5
    for ours, theirs in zip(astuple(errors), astuple(published), strict=True):
        assert ours <= theirs


@pytest.mark.slow
@in_one_process()
@mock.patch("kinertia.studies.table1.CONDITIONS", CLEAN)
@mock.patch.multiple("kinertia.estimation.two_level", _FREE_EVALUATIONS=100, _MAX_EVALUATIONS=30)
def test_every_parameter_is_found_without_noise(trial):
    shares = []
    (draw,) = run_table1(trial, repeats=1, seed=3, progress=shares.append).draws
    assert shares == [0.0, 1.0]
    for condition in CLEAN:
        assert draw.converged[condition]
        assert_exact(draw.errors[condition], PUBLISHED[condition])


@pytest.mark.slow
@in_one_process()
@mock.patch("kinertia.studies.table1.CONDITIONS", NOISY)
@mock.patch.multiple("kinertia.estimation.two_level", _FREE_EVALUATIONS=20, _MAX_EVALUATIONS=5)
def test_parameters_stay_wrong_with_noise(trial):
    """Stopped early, since no more is told than that correction shrinks the residual."""
    (draw,) = run_table1(trial, repeats=1, seed=3).draws
    raw, corrected = (draw.errors[condition] for condition in NOISY)
    assert raw.force_rms_N > 5.0
    assert raw.torque_rms_Nm > 1.0
    assert corrected.force_rms_N < 1.0
    assert corrected.torque_rms_Nm < 1.0
    for errors in (raw, corrected):
        assert errors.mass_rms_kg > 0.5
        assert errors.com_rms_m > 0.02
        assert errors.inertia_rms_kgm2 > 0.05


@pytest.mark.slow
@in_one_process()
@mock.patch("kinertia.studies.table1.CONDITIONS", CLEAN)
def test_without_noise_every_parameter_is_found_from_every_start(trial):
    for draw in run_table1(trial, repeats=2, seed=2).draws:
        for condition in CLEAN:
            assert_exact(draw.errors[condition], PUBLISHED[condition])


def test_starts_are_off_by_up_to_a_half(one_draw):
    (draw,) = one_draw.draws
    share = draw.start_errors / one_draw.truth
    assert len(share) == 49
    assert 0.4 < np.abs(share).max() <= 0.5
    assert np.abs(share).mean() == pytest.approx(0.25, abs=0.08)


@pytest.mark.slow
def test_bit_for_bit_whatever_the_workers_and_the_number_of_draws(trial, monkeypatch):
    """Draw 0 of two draws in two processes is the only draw in one process; with noise, which is drawn, too."""
    quick = [condition for condition in NOISY if condition != "correction_noise"]

    def without_it(task, *given):
        return in_parallel(partial(task, conditions=quick), *given)

    monkeypatch.setattr("kinertia.studies.table1.in_parallel", without_it)
    monkeypatch.setattr("kinertia.studies.table1.CONDITIONS", quick)
    single, two = (run_table1(trial, repeats=count, seed=1, workers=count) for count in (1, 2))
    first, alone = table1_json(two)["draws"][0], table1_json(single)["draws"][0]
    assert json.dumps(first) == json.dumps(alone)
    assert two.draws[0].start_errors.tolist() != two.draws[1].start_errors.tolist()


def test_draws_depend_on_seed_and_number_only(trial, monkeypatch):
    """The short form of the test above: what goes into the estimator, bit for bit."""
    seen = []

    class Stop(Exception):
        pass

    def stop(skeleton, start, windows, correct):
        seen[-1].append((start.table().tobytes(), windows[0].motion.qdd.tobytes(), windows[0].wrench.tobytes()))
        if len(seen[-1]) == 2:
            raise Stop
        return SimpleNamespace(bsp=start, cost=(1.0, 1.0), converged=True)

    monkeypatch.setattr("kinertia.studies.table1.estimate_two_level", stop)
    for seed, number in ((1, 0), (1, 1), (1, 0), (2, 0)):
        seen.append([])
        with pytest.raises(Stop):
            run_draw(trial, seed, number)
    assert seen[0] == seen[2]
    for other in (seen[1], seen[3]):
        assert seen[0][0][0] != other[0][0]
        assert seen[0][1][1] != other[1][1]


def test_truth_is_symmetric_and_off_axis(trial):
    vector = ParameterVector(trial.bsp, True)
    np.testing.assert_array_equal(vector.bsp(vector.values(trial.bsp)).table(), trial.bsp.table())
    assert len(vector.names) == 49
    assert np.abs(trial.bsp.com_m[:, [0, 2]]).max(axis=1).min() > 1e-3
    np.testing.assert_array_equal(trial.bsp.table()[:, 7:], 0.0)


def test_errors_are_rms_and_largest_by_class():
    parameters = np.tile([2.0, 0.1, -0.3, 0.2, 1.0, -2.0, 2.0], 7)
    residual = np.array([[3.0, -4.0, 0.0, 0.0, 0.0, 6.0]])
    errors = errors_by_class(parameters, residual)
    assert errors.mass_rms_kg == errors.mass_max_kg == pytest.approx(2.0)
    assert errors.com_rms_m == pytest.approx(np.sqrt(0.14 / 3))
    assert errors.com_max_m == pytest.approx(0.3)
    assert errors.inertia_rms_kgm2 == pytest.approx(np.sqrt(3.0))
    assert errors.inertia_max_kgm2 == pytest.approx(2.0)
    assert (errors.force_rms_N, errors.force_max_N) == pytest.approx((np.sqrt(25 / 3), 4.0))
    assert (errors.torque_rms_Nm, errors.torque_max_Nm) == pytest.approx((np.sqrt(12.0), 6.0))


def test_mean_and_spread_are_over_draws(one_draw):
    (draw,) = one_draw.draws
    twice = Table1(one_draw.parameters, one_draw.truth, (draw, draw), one_draw.seed, one_draw.trial)
    for condition in CONDITIONS:
        assert asdict(twice.mean(condition)) == pytest.approx(asdict(draw.errors[condition]))
        assert set(asdict(one_draw.spread(condition)).values()) == {0.0}


def test_json_has_the_promised_form(one_draw):
    content = json.loads(json.dumps(table1_json(one_draw)))
    assert list(content["conditions"]) == list(CONDITIONS)
    quantities = ("inertia", "mass", "com", "force", "torque")
    units = ("kgm2", "kg", "m", "N", "Nm")
    keys = {f"{q}_{s}_{u}" for q, u in zip(quantities, units, strict=True) for s in ("rms", "max")}
    for condition in CONDITIONS:
        assert set(content["conditions"][condition]) == keys
        assert keys <= set(content["draws"][0]["conditions"][condition])
    assert len(content["draws"]) == 1
