"""Mean changes of a group: what is averaged, and how certain it is."""

import numpy as np
import pytest
from scipy import stats

from kinertia.estimation.changes.change import Change, group_changes

NAMED = ("moment", "knee", "adduction", "r", "mid-stance", "N m/kg")


def change(before, after, sd=0.02, mdc95=0.05, doubt="", named=NAMED):
    return Change(*named, before, after, (3, 3), sd, {}, mdc95, doubt=doubt)


def test_means_and_interval_are_those_of_the_paired_t_test():
    random = np.random.default_rng(3)
    before = random.normal(0.5, 0.1, 12)
    after = before - 0.1 + random.normal(0.0, 0.05, 12)
    (found,) = group_changes({str(k): [change(*pair)] for k, pair in enumerate(zip(before, after, strict=True))})
    expected = stats.ttest_rel(after, before)
    low, high = expected.confidence_interval(0.95)
    assert (found.people, found.primary) == (12, True)
    assert (found.before, found.after) == pytest.approx((before.mean(), after.mean()))
    assert (found.p, found.lower, found.upper) == pytest.approx((expected.pvalue, low, high))
    assert found.difference == pytest.approx((after - before).mean())


def test_errors_of_measurement_are_told_from_how_differently_people_change():
    random = np.random.default_rng(5)
    true = random.normal(-0.2, 0.04, 2000)
    measured = true + random.normal(0.0, 0.03, 2000)
    people = {str(k): [change(0.5, 0.5 + measured_change, sd=0.03)] for k, measured_change in enumerate(measured)}
    (found,) = group_changes(people)
    assert found.sd == pytest.approx(0.05, rel=0.05)
    assert found.sd_measurement == pytest.approx(0.03)
    assert found.sd_true == pytest.approx(0.04, rel=0.07)
    assert found.standard_error == pytest.approx(found.sd / np.sqrt(2000))


def test_instrument_findings_leave_a_person_out_and_verdicts_are_counted():
    other = ("angle", "knee", "flexion", "r", "swing", "degrees")
    people = {
        "Anna": [change(0.5, 0.3), change(60.0, 50.0, 2.0, 4.0, named=other)],
        "Ben": [change(0.5, 0.48)],
        "Clara": [change(0.5, 5.0, doubt="P213")],
    }
    moment, angle = group_changes(people)
    assert (moment.people, moment.changed) == (2, 1)
    assert moment.difference == pytest.approx(-0.11)
    assert (angle.people, angle.difference) == (1, -10.0)
    assert np.isnan([angle.sd, angle.sd_true, angle.standard_error, angle.lower, angle.upper, angle.p]).all()
    assert group_changes({}) == ()
