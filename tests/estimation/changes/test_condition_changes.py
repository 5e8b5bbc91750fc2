"""What changed between two conditions: known changes among made-up strides, and none between a walk and itself."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from command_line import run
from kinertia.errors import KinertiaError
from kinertia.estimation.changes import condition_changes
from kinertia.estimation.changes.change import SOURCES
from kinertia.estimation.changes.condition_changes import changes_of_strides
from kinertia.estimation.changes.stride_features import EVENTS, Rows, event_spans, event_weights
from kinertia.motion.gait_cycle import Stride
from kinertia.report.comparison.change_tables import (
    change_columns,
    change_sentences,
    changed_sentence,
    discovered,
    limit_sentences,
)
from kinertia.report.comparison.what_changed import compare
from kinertia.report.exports.saved_fit import write_fit

DRAWS = 1000


def judged(change, strides, shared_sd, own_sd, stride_sd, seed=0, contacts=(0.0, 0.0)):
    """Changes of one outcome: so many strides of two conditions, with errors that all share and that each has."""
    rng = np.random.default_rng(seed)
    count = sum(strides)
    second = np.arange(count) >= strides[0]
    keys = [(f"walk {k}", "moment knee_adduction late stance", "r", "stride 1") for k in range(count)]
    truth = 0.3 + change * second + stride_sd * rng.standard_normal(count)
    errors = shared_sd * rng.standard_normal() + own_sd * rng.standard_normal(count)
    estimate = truth + errors
    departures = shared_sd * rng.standard_normal((DRAWS, 1)) + own_sd * rng.standard_normal((DRAWS, count))
    still = np.broadcast_to(estimate, departures.shape)
    by_contacts = np.where(second, contacts[1], contacts[0])[None]
    drawn = {"all": estimate + departures, "body": still, "instruments": still, "contacts": by_contacts}
    (found,) = changes_of_strides(Rows(tuple(keys), estimate, drawn), [~second, second])
    return found


def test_errors_that_all_strides_share_cancel():
    found = judged(0.0, (4, 4), shared_sd=0.5, own_sd=0.01, stride_sd=0.0)
    assert found.sd_by_source["markers"] == pytest.approx(0.01 * np.sqrt(0.5), rel=0.05)
    assert found.sd < 0.02
    assert (found.joint, found.component, found.side, found.event) == ("knee", "adduction", "r", "late stance")
    np.testing.assert_allclose(np.hypot.reduce(list(found.sd_by_source.values())), found.sd, rtol=1e-6)


@pytest.mark.parametrize(("contacts", "expected"), [((0.03, 0.03), 0.0), ((0.03, -0.01), 0.04)])
def test_an_error_of_contacts_cancels_where_it_does_as_much_in_both_conditions(contacts, expected):
    found = judged(0.0, (4, 4), shared_sd=0.5, own_sd=0.001, stride_sd=0.0, contacts=contacts)
    assert found.sd_by_source["markers"] == pytest.approx(expected, abs=0.001)


@pytest.mark.parametrize("own_sd", [0.005, pytest.param(0.05, marks=pytest.mark.slow)])
def test_no_change_is_rarely_called_one_and_a_true_one_mostly(own_sd):
    """Whether markers or strides vary more."""
    none, some = ([judged(change, (4, 4), 0.3, own_sd, 0.03, seed) for seed in range(1500)] for change in (0.0, 0.2))
    assert np.mean([change.verdict == "changed" for change in none]) < 0.08
    assert np.mean([change.verdict == "changed" for change in some]) > 0.9
    covered = [abs(change.difference - 0.2) <= change.mdc95 for change in some]
    assert 0.93 < np.mean(covered) < 1.0


def test_one_stride_is_not_judged():
    found = judged(0.5, (1, 4), 0.1, 0.01, 0.01)
    assert (found.verdict, found.strides) == ("cannot be judged", (1, 4))
    assert np.isnan(found.mdc95)
    assert found.difference == pytest.approx(0.5, abs=0.1)


def test_few_strides_vary_no_less_than_is_usual():
    few, several = (judged(0.0, (count, count), 0.0, 1e-4, 0.0) for count in (2, 5))
    assert few.sd_by_source["stride"] > 0.015
    assert several.sd_by_source["stride"] < 0.002


def test_a_spread_that_is_assumed_is_said():
    few, several = (judged(0.0, (count, count), 0.0, 1e-4, 0.0) for count in (2, 5))
    assert (few.assumed, several.assumed) == (True, False)
    assert len(list(limit_sentences([few], ""))) == 1
    assert not list(limit_sentences([several], ""))


def test_repeats_needed_show_a_change_and_no_fewer_do():
    """By simulation, with the spread known as well as these repeats show it."""
    found = judged(0.0, (6, 6), 0.0, 0.02, 0.05)
    needed = found.walks_needed(0.1)
    rng = np.random.default_rng(1)
    shared = np.hypot(*(found.sd_by_source[source] for source in ("body", "markers")))

    def power(count):
        first, second = (s * rng.standard_normal((4000, count)) for s in found.stride_sd)
        change = 0.1 + second.mean(axis=1) - first.mean(axis=1) + shared * rng.standard_normal(4000)
        of_strides = first.var(axis=1, ddof=1) + second.var(axis=1, ddof=1)
        limit = stats.t.ppf(0.975, 2 * (count - 1)) * np.sqrt(shared**2 + of_strides / count)
        return np.mean(np.abs(change) > limit)

    assert power(needed) == pytest.approx(0.8, abs=0.12)
    assert power(needed - 1) < power(needed)
    assert found.walks_needed(1e-4) is None


def test_events_lie_between_contacts():
    stride = Stride("r", 1, 10.0, 11.0, 10.6, 10.1, 10.5, True)
    spans = event_spans(stride)
    assert np.ravel(spans) == pytest.approx((0.0, 10.0, 10.0, 30.0, 30.0, 50.0, 50.0, 60.0, 60.0, 100.0))
    assert len(spans) == len(EVENTS)


def test_a_run_has_the_halves_of_stance_and_swing():
    """The other foot left the ground before this one touched it, and comes down after it has left."""
    run = Stride("r", 1, 10.0, 10.8, 10.32, np.nan, 10.4, True)
    weights = event_weights(run)
    assert weights.sum(axis=1) == pytest.approx((0.0, 1.0, 1.0, 0.0, 1.0))
    assert np.flatnonzero(weights[1])[[0, -1]].tolist() == [0, 20]
    assert np.flatnonzero(weights[2])[[0, -1]].tolist() == [20, 40]
    unknown = Stride("r", 1, 10.0, 11.0, 10.6, np.nan, 10.5, True)
    assert event_weights(unknown).sum(axis=1) == pytest.approx((0.0, 0.0, 0.0, 1.0, 1.0))


@pytest.fixture(scope="module")
def twice(fit):
    """A walk under two conditions, which is one walk."""
    (trial,), (draws,) = fit.trials, fit.posterior.draws.trials

    def under(condition):
        walk = replace(trial.kinematics.trial, name=condition, condition=condition)
        return replace(trial, kinematics=replace(trial.kinematics, trial=walk))

    posterior = replace(fit.posterior, draws=replace(fit.posterior.draws, trials=(draws, draws)))
    return replace(fit, trials=(under("barefoot"), under("with shoes")), posterior=posterior)


@pytest.fixture(scope="module")
def found(twice):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(condition_changes, "DRAWS", 6)
        return compare(twice, conditions=("barefoot", "with shoes")).outcomes


def test_a_walk_has_not_changed_from_itself(found):
    assert {change.quantity for change in found} == {"moment", "angle"}
    assert {"hip", "knee", "ankle", "lumbar"} <= {change.joint for change in found}
    assert {change.verdict for change in found} <= {"not shown", "cannot be judged"}
    assert max(abs(change.difference) for change in found) < 1e-9
    for change in found:
        assert set(change.sd_by_source) == set(SOURCES)
        assert max(change.sd_by_source[source] for source in SOURCES[:3]) < 1e-9, "errors of one walk cancel"


def test_tables_and_sentences_have_every_outcome(found):
    table = pd.DataFrame(change_columns(found))
    assert len(table) == len(found)
    assert table["verdict"].tolist() == [change.verdict for change in found]
    primary = [change for change in found if change.primary]
    assert len(primary) == len(list(change_sentences(found))) >= 2
    others = sum(not change.primary and change.verdict != "cannot be judged" for change in found)
    assert f" {others} other" in changed_sentence(found) or others == 0


def test_false_discoveries_are_controlled():
    """By the step-up rule: 0.03 fails its own limit of 0.025, but 0.035 holds that of 0.0375."""
    assert discovered([0.5, 0.001, 0.035, 0.03]) == [False, True, True, True]
    assert discovered([0.5, 0.02, 0.04, 0.04]) == [False] * 4
    assert discovered([]) == []
    rng = np.random.default_rng(0)
    nothing = [any(discovered(rng.random(100))) for _ in range(1000)]
    assert 0.03 < np.mean(nothing) < 0.07


def test_p_and_verdict_agree(found):
    judged_ones = [change for change in found if change.verdict != "cannot be judged"]
    assert judged_ones
    for change in judged_ones:
        assert (change.p < 0.05) == (change.verdict == "changed")


def test_the_command_compares_conditions_of_a_result(twice, fit, tmp_path):
    (tmp_path / "out").mkdir()
    write_fit(twice, None, tmp_path / "out" / "fit.npz")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(condition_changes, "DRAWS", 2)
        outcome = run("compare", tmp_path / "out", "--conditions", "barefoot", "with shoes", "-o", tmp_path / "c")
        assert outcome.status == 0, outcome.err
        table = pd.read_csv(tmp_path / "c" / "changes.csv")
        assert len(table) > 50
        page = (tmp_path / "c" / "compare.html").read_text(encoding="utf-8")
        parts = table["quantity"].isin(["moment", "angle"]).sum()
        assert page.count("<tr") == len(table) + parts + 4, "a row for each change, its parts, and four headings"
        curves = pd.read_csv(tmp_path / "c" / "change_curves.csv")
        assert set(curves["percent"]) == set(range(101))
        assert {"knee", "hip", "ankle"} <= set(curves["joint"])
        assert np.abs(curves["difference"].dropna()).max() < 1e-9
        refused = run("compare", tmp_path / "out", "--conditions", "barefoot", "running", "-o", tmp_path / "d")
    assert refused.status == 2
    assert "stated are: barefoot, with shoes" in refused.err
    with pytest.raises(KinertiaError):
        compare(fit, conditions=("barefoot", "with shoes"))


def test_a_condition_is_not_compared_with_itself(fit):
    with pytest.raises(KinertiaError, match="choose two"):
        condition_changes.condition_features(fit, "", "")
