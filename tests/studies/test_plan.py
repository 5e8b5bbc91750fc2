from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from threadpoolctl import threadpool_limits

from command_line import run
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.fit import fit_simultaneous
from kinertia.motion.dynamics import residual
from kinertia.studies.plan import Plan, plan_measured, plan_synthetic
from kinertia.synthetic.motions import MOTIONS, Faults, measured, squat
from kinertia.synthetic.walk import centre_of_pressure, walk, walking_subject


@pytest.fixture(scope="module")
def prior():
    return literature_prior(walking_subject().literature)


@pytest.fixture(scope="module")
def trials(prior):
    """A walk and squats of a person of the prior, as measured."""
    person = replace(walking_subject(), bsp=prior.draw(np.random.default_rng(2)))
    motions = [walk(person, 1.5, trapezoid=False), squat(person)]
    skeleton, kinematics = measured(motions, Faults("artefact"), np.random.default_rng(3))
    return skeleton, [
        replace(k, trial=replace(k.trial, name=name)) for name, k in zip(("walk", "squat"), kinematics, strict=True)
    ]


@pytest.fixture(scope="module")
def planned(prior, trials):
    return plan_measured(trials[0], prior, trials[1], "gcv")


@pytest.mark.slow
@pytest.mark.parametrize("chosen", [("walk",), ("walk", "squat")])
def test_prediction_is_what_a_fit_then_reports(prior, trials, planned, chosen):
    """A prediction is made at the literature and at the motion of inverse kinematics, a report at the estimate."""
    skeleton, kinematics = trials
    with threadpool_limits(1):
        fit = fit_simultaneous(skeleton, prior, [k for k in kinematics if k.trial.name in chosen])
    ratio = planned.sd[chosen] / fit.posterior.sd
    assert np.median(np.abs(ratio[:, :4] - 1.0)) < 0.03
    assert np.abs(np.log(ratio[:, :4])).max() < np.log(1.35)
    learnt, reported = planned.information(chosen), fit.posterior.information
    assert np.abs(learnt - reported)[:, :4].max() < 0.2
    assert planned.counts(chosen)["measured"] == pytest.approx((reported > 0.75).sum(), abs=3)


@pytest.mark.slow
def test_a_walk_shows_more_than_squats_and_both_more_than_one(planned):
    walked, squatted, both = (planned.information(names).mean() for names in (("walk",), ("squat",), ("walk", "squat")))
    assert squatted < walked < both


def test_more_recordings_never_say_less(planned):
    both = planned.sd["walk", "squat"]
    for alone in (("walk",), ("squat",)):
        # each set of recordings reads its own noise
        assert (both <= planned.sd[alone] * (1 + 1e-4)).all()
    assert (both < planned.prior_sd).all()


def test_table(planned):
    assert isinstance(planned, Plan)
    table = planned.table
    assert list(table.columns) == ["segment", "parameter", "unit", "prior_sd", "walk", "squat", "walk + squat"]
    assert len(table) == 120
    assert sum(planned.counts(("walk",)).values()) == 120


@pytest.mark.parametrize("name", MOTIONS)
def test_synthetic_motions_are_possible(name):
    """P = 0 throughout, derivatives that belong together, and feet that carry the person on the ground."""
    subject = walking_subject()
    trial = MOTIONS[name](subject)
    left = residual(trial.skeleton, trial.bsp, trial.motion, trial.foot_loads.sum(axis=1))
    assert np.abs(left).max() < 1e-6
    step = trial.time[1] - trial.time[0]
    inner = slice(2, -2)
    for values, rates in ((trial.motion.q, trial.motion.qd), (trial.motion.qd, trial.motion.qdd)):
        size = np.abs(rates).max()
        assert np.abs(np.gradient(values, step, axis=0) - rates)[inner].max() < 0.05 * size
    weight = trial.foot_loads[:, :, 1].sum(axis=1) / (9.80665 * trial.bsp.total_mass_kg)
    assert 0.3 < weight.min() < 1.0 < weight.max() < 2.0
    assert weight.mean() == pytest.approx(1.0, abs=0.05)
    feet = trial.skeleton.pose(trial.motion.q).translation[
        :, [trial.skeleton.segments.index(f"foot_{side}") for side in "rl"]
    ]
    pressure = centre_of_pressure(trial.foot_loads.sum(axis=1))
    assert (pressure[:, 0] > feet[..., 0].min(axis=1) - 0.15).all()
    assert (pressure[:, 0] < feet[..., 0].max(axis=1) + 0.30).all()


def test_standing_feet_stay():
    trial = squat(walking_subject())
    feet = trial.skeleton.pose(trial.motion.q).translation[
        :, [trial.skeleton.segments.index(f"foot_{side}") for side in "rl"]
    ]
    assert np.ptp(feet.mean(axis=1), axis=0).max() < 1e-9
    assert np.ptp(feet, axis=0).max() < 0.01
    turned = trial.skeleton.pose(trial.motion.q).rotation[:, trial.skeleton.segments.index("foot_r")]
    assert np.abs(turned - turned[0]).max() < 0.35


@pytest.mark.slow
def test_walking_shows_more_than_squats_and_three_motions_more_than_one():
    plan = plan_synthetic()
    assert set(MOTIONS) < set(plan.table.columns)
    mean = {names: plan.information(names).mean() for names in plan.sd}
    assert min(mean["walk",], mean["fast walk",]) > mean["squat",]
    best = [names for names in plan.sd if len(names) == 3]
    assert len(best) == 1
    assert mean[best[0]] > max(mean[name,] for name in best[0])


def test_command(tmp_path, prior, monkeypatch):
    """All but the seconds of planning, which the examples of the pages spend."""
    sets = [*((name,) for name in MOTIONS), ("walk", "squat")]
    plan = Plan(prior.mean.segments, prior.sd, {names: prior.sd / (1 + len(names)) for names in sets})
    monkeypatch.setattr("kinertia.studies.plan.plan_synthetic", lambda: plan)
    outcome = run("plan", "-o", tmp_path / "out")
    assert outcome.status == 0, outcome.err
    table = pd.read_csv(tmp_path / "out" / "plan.csv")
    assert {"walk", "fast walk", "squat", "arm swing", "trunk sway", "walk + squat"} < set(table.columns)
    assert "fast walk" in outcome.out
    again = run("plan", "-o", tmp_path / "out")
    assert again.status == 0, again.err
