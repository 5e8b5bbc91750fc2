"""Which findings about instruments keep a change of moments from being judged."""

from dataclasses import replace

import pytest

from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.report.comparison.what_changed import instrument_doubts


def zero(trial):
    where = Where(trial=trial, plate="plate 1", axis="vertical", file_axis="Y")
    return finding("P213", where, level_n=Quantity(-23.1, "N", limit=15.0))


@pytest.fixture(scope="module")
def twice(fit):
    """A walk that was recorded twice, without findings."""
    (trial,) = fit.trials

    def named(name):
        return replace(trial, kinematics=replace(trial.kinematics, trial=replace(trial.kinematics.trial, name=name)))

    return replace(fit, trials=(named("first"), named("second")), findings=())


def doubt(fit, *findings):
    doubted = replace(fit, findings=findings)
    return instrument_doubts((doubted, doubted.trials[:1]), (doubted, doubted.trials[1:])).get("r", "")


def test_an_error_of_one_condition_is_none_of_both(twice):
    assert doubt(twice) == ""
    assert doubt(twice, zero("first")).startswith("P213")
    assert doubt(twice, zero("first"), zero("second")) == ""
    assert doubt(twice, zero("third")) == ""


def test_errors_of_both_that_a_user_waived_remain(twice):
    both = [replace(zero(trial).at(Severity.ERROR), status="waived") for trial in ("first", "second")]
    assert doubt(twice, *both).startswith("P213")


def test_what_is_corrected_explained_or_ignored_is_none(twice):
    assert doubt(twice, zero("first").at(Severity.CORRECTED)) == ""
    assert doubt(twice, zero("first").muted("P201")) == ""
    assert doubt(twice, replace(zero("first"), status="ignored")) == ""


def test_sessions_have_errors_of_their_own(twice):
    days = [replace(twice, findings=(zero(name),)) for name in ("first", "second")]
    found = instrument_doubts((days[0], days[0].trials[:1]), (days[1], days[1].trials[1:]))
    assert set(found) == {"r", "l", ""}
    assert found["l"].startswith("P213")


def test_a_foot_beside_its_plate_leaves_the_other_leg(twice):
    where = Where(trial="first", plate="plate 1")
    beside = finding("P282", where, foot=Quantity("right"), overhang_m=Quantity(0.05, "m"))
    doubted = replace(twice, findings=(beside,))
    assert set(instrument_doubts((doubted, doubted.trials[:1]), (doubted, doubted.trials[1:]))) == {"r"}
