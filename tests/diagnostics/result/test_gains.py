"""All plates with the same gain error: the stated mass leaves out what they carried, or one amplifier."""

import pytest

from kinertia.diagnostics.result.plate_errors import gains
from kinertia.diagnostics.runner import explained
from kinertia.findings.finding import Severity
from results import codes, context, error


def found(*errors, mass_kg=82.5, trial=None, sd=0.003):
    """Of plates with these gains in all trials; in a trial, of whole gains there besides uncertain ones of all."""
    plates = [f"plate {k}" for k in range(1, len(errors) + 1)]
    lasting = [
        error("gain", gain if trial is None else gain / 4, 0.007, sd if trial is None else 0.03, "1", plate)
        for gain, plate in zip(errors, plates, strict=True)
    ]
    of_trials = [
        error("gain", gain, 0.018, sd, "1", plate, trial=trial)
        for gain, plate in zip(errors, plates, strict=True)
        if trial is not None
    ]
    return list(gains(context(*lasting, *of_trials, mass_kg=mass_kg)))


@pytest.mark.parametrize("trial", [None, "walk"])
def test_what_was_carried_comes_before_the_plates(trial):
    answers = explained(found(0.101, 0.104, trial=trial))
    (cause,) = [answer for answer in answers if answer.is_open]
    assert (cause.code, cause.severity, cause.where.trial) == ("P224", Severity.WARNING, trial)
    assert cause.evidence["gain_error"].value == (0.101, 0.104)
    assert cause.evidence["mass_by_force_kg"].value == (82.5,)
    assert cause.evidence["stated_kg"].value == 74.6
    assert "carried" in cause.causes[0]
    assert codes(answers) == ["P223", "P223", "P224"]


def test_a_mass_that_is_too_large_comes_before_the_plates():
    (cause,) = [finding for finding in found(-0.037, -0.043, mass_kg=71.5) if finding.code == "P224"]
    assert cause.evidence["gain_error"].value[0] < 0.0
    assert "mass" in cause.causes[0]
    assert "handrail" in cause.causes[1]


@pytest.mark.parametrize("trial", [None, "walk"])
@pytest.mark.parametrize("errors", [(0.09, 0.0), (0.09, -0.09), (0.09, 0.03), (-0.004, -0.004), (0.09,)])
def test_gains_that_are_not_equal_are_each_plates_own(errors, trial):
    limit = 0.014 if trial is None else 0.036
    assert codes(found(*errors, trial=trial)) == ["P223"] * sum(abs(gain) > limit for gain in errors)


def test_an_uncertain_gain_is_not_reported():
    """5 +- 3 % was (D15)."""
    assert found(-0.05, sd=0.03) == []


def test_forces_that_show_no_mass_leave_the_gains():
    (cause,) = [finding for finding in found(0.05, 0.05, mass_kg=None) if finding.code == "P224"]
    assert "mass_by_force_kg" not in cause.evidence


def test_a_gain_of_all_trials_is_reported_once_and_one_of_a_trial_as_the_trials():
    lasting, of_trial = error("gain", -0.1, 0.007, 0.01, "1"), error("gain", -0.1, 0.018, 0.01, "1", trial="walk")
    assert [finding.where.trial for finding in gains(context(lasting, of_trial))] == [None]
    uncertain = error("gain", -0.03, 0.007, 0.03, "1")
    assert [finding.where.trial for finding in gains(context(uncertain, of_trial))] == ["walk"]
