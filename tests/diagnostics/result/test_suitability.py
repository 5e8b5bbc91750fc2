"""A line per output: findings that affect it lower it, and so does what the data do not inform."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import session_contradictions
from kinertia.diagnostics.result.suitability import basis, filters, informed, suitability
from kinertia.diagnostics.runner import explained
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.settings import Settings
from results import codes, error

OUTPUTS = ["joint moments", "segment masses", "centres of mass", "moments of inertia", "motion"]


def with_information(fit, share, columns, information=0.8):
    """The fit with this information on these columns of so large a share of the segments."""
    sd = fit.posterior.prior_sd.copy()
    rows = round(share * len(sd))
    sd[:rows, columns] *= np.sqrt(1 - information)
    return replace(fit, posterior=replace(fit.posterior, sd=sd))


@pytest.fixture
def clear(fit):
    """A fit of which everything is informed."""
    return with_information(fit, 1.0, slice(0, 10))


def uses(fit, *findings, left_out=()):
    return {rating.output: rating.use for rating in suitability(fit, findings, left_out)}


def only(**lower):
    """All outputs "use", but for these."""
    names = {"moments": 0, "masses": 1, "centres": 2, "inertias": 3, "motion": 4}
    return dict.fromkeys(OUTPUTS, "use") | {OUTPUTS[names[name]]: use for name, use in lower.items()}


def test_every_output_has_a_line_with_a_number(fit, two_level):
    lines = suitability(fit, ())
    assert [line.output for line in lines] == OUTPUTS
    assert all(any(letter.isdigit() for letter in line.reason) for line in lines)
    assert set(list(uses(two_level).values())[1:4]) == {"use with care"}


@pytest.mark.parametrize(("share", "expected"), [(0.0, "do not use"), (0.25, "use with care"), (1.0, "use")])
def test_segments_by_what_the_data_inform(fit, share, expected):
    made = with_information(fit, share, slice(0, 1))
    found = uses(made)
    assert found["segment masses"] == expected
    assert found["centres of mass"] == found["moments of inertia"] == "do not use"
    assert informed(made, "masses")[:2] == (12, round(12 * share))


def test_masses_of_which_none_is_measured_well_need_care(fit):
    """Of two fault-free walks with 7 of 12 masses partly informed it was said: use."""
    assert uses(with_information(fit, 1.0, slice(0, 1), 0.5))["segment masses"] == "use with care"


@pytest.mark.parametrize(("severity", "use"), [("ERROR", "do not use"), ("WARNING", "use with care"), ("INFO", "use")])
def test_findings_lower_what_they_affect(clear, severity, use):
    residual = finding("R301", Where(trial="walk"), Severity[severity])
    assert uses(clear, residual) == only(moments=use)
    moments = suitability(clear, [residual])[0]
    assert moments.codes == (("R301",) if use != "use" else ())


def test_what_is_ignored_lowers_nothing_and_a_waived_error_bars_nothing(clear):
    error = finding("R301", None, Severity.ERROR)
    assert uses(clear, replace(finding("R301"), status="ignored")) == only()
    assert uses(clear, replace(error, status="waived")) == only(moments="use with care")


@pytest.mark.parametrize(("status", "use"), [("open", "do not use"), ("waived", "use with care"), ("ignored", "use")])
def test_a_cause_lowers_what_its_consequences_affect(clear, status, use):
    """A dead channel explains implausible masses: no finding was named beside them, and nothing barred their use."""
    severity = Severity.WARNING if status == "ignored" else Severity.ERROR
    cause = replace(finding("P101", Where(trial="walk", plate="left"), severity), status=status)
    far = finding("R203", Where(part="mass of torso"), severity, parameter=Quantity("mass")).muted("P101")
    assert uses(clear, cause, far) == only(moments=use, centres=use, masses=use)
    assert suitability(clear, [cause, far])[1].codes == (() if use == "use" else ("P101",))


def test_a_correction_lowers_nothing(clear):
    assert uses(clear, finding("P246")) == only()
    resolved = finding("P212", Where(trial="walk"), Severity.CORRECTED).muted("P215")
    assert uses(clear, finding("P215"), resolved, finding("P266", Where(trial="walk")).muted("P212")) == only()


@pytest.mark.parametrize(
    ("parameter", "lower"),
    [
        ("mass", {"masses": "use with care"}),
        ("com_y", {"centres": "use with care"}),
        ("ixy", {"inertias": "use with care"}),
    ],
)
def test_an_implausible_parameter_lowers_its_own_output(clear, parameter, lower):
    far = finding("R203", Where(part=f"{parameter} of shank_l"), parameter=Quantity(parameter))
    assert uses(clear, far) == only(**lower)


def test_of_a_person_unlike_the_prior_nothing_is_used_without_care(clear):
    """Though no single parameter is far: an ankle weight's masses were to be used, 8 error bars from the truth."""
    care = only(masses="use with care", centres="use with care", inertias="use with care")
    assert uses(clear, finding("R204")) == care
    far = finding("R203", Where(part="com_y of shank_l"), parameter=Quantity("com_y"))
    assert uses(clear, far, finding("R204").muted("R203")) == care


def test_findings_that_correct_and_explain_one_another_end_somewhere(clear):
    """A zero of one plate, an unknown force of all, and corrected zeros of each plate: it recursed without end."""
    zero, force = finding("P212", Where(trial="walk", plate="left")), finding("P214", Where(trial="walk"))
    zeros = [finding("P215", Where(trial="walk", plate=plate)) for plate in ("right", "left")]
    assert uses(clear, *explained([*zeros, zero, force])) == only()
    circle = [zero.muted("P215"), force.muted("P212"), *(zero_found.muted("P214") for zero_found in zeros)]
    assert uses(clear, *circle)["joint moments"] in ("use", "use with care")


def test_nothing_is_used_that_did_not_converge(fit):
    assert set(uses(replace(fit, converged=False)).values()) == {"do not use"}


def test_with_a_trial_left_out_everything_needs_care(clear):
    assert set(uses(clear, left_out=["run"]).values()) == {"use with care"}
    assert all("1 of 2 trials" in rating.reason for rating in suitability(clear, (), ["run"]))


def test_a_chosen_cutoff_and_frames_that_count_less(fit):
    (trial,) = fit.trials
    found = list(filters(ResultContext(replace(fit, posterior=replace(fit.posterior, down_weighted=(0.2,))), None)))
    assert codes(found) == ["R111", "R112"]
    assert found[0].evidence["cutoff_hz"].value == trial.kinematics.cutoff_hz
    assert found[1].evidence["share"].value == 0.2
    stated = replace(fit, settings=Settings(cutoff_hz=6.0), posterior=replace(fit.posterior, down_weighted=(0.001,)))
    assert list(filters(ResultContext(stated, None))) == []


def test_what_the_prior_decides(fit, two_level):
    found = list(basis(ResultContext(fit, None)))
    assert {reported.severity for reported in found} == {Severity.INFO}
    assert "R403" not in codes(found)
    few = {reported.where.part: reported for reported in found if reported.code == "R404"}
    inertias = few["moments of inertia"].evidence
    assert inertias["count"].value == 36
    assert inertias["shown"].value < 18
    assert codes(basis(ResultContext(two_level, None))) == ["R402"] * len(two_level.trials) + ["R403"]


def offset(value, plate="left"):
    return error("position", value, 0.004, 0.001, "m", plate, axis="x")


@pytest.mark.parametrize(("other", "expected"), [(0.010, []), (0.002, ["S501"])])
def test_one_person_against_the_others_of_the_session(other, expected):
    of_person, others = ([offset(value), offset(0.0, "right")] for value in (0.012, other))
    found = list(session_contradictions("Anna", of_person, others))
    assert codes(found) == expected
    for reported in found:
        assert reported.where.plate == "left"
        assert [reported.evidence[name].value for name in ("error", "other_error")] == [0.012, 0.002]
        assert [reported.evidence[name].value for name in ("person", "instrument")] == [
            "Anna",
            "plate left: position x",
        ]


def test_a_person_without_others_contradicts_nobody():
    assert list(session_contradictions("Anna", [offset(0.1)], [])) == []
