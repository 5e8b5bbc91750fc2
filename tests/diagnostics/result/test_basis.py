"""What a result is based on, and one person of a session against the others."""

from dataclasses import replace

import pytest

from kinertia.diagnostics.result.basis import basis, filters
from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.session import session_contradictions
from kinertia.findings.finding import Severity
from kinertia.settings import Settings
from results import codes, error


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
    assert {one.severity for one in found} == {Severity.INFO}
    assert "R403" not in codes(found)
    few = {one.where.part: one for one in found if one.code == "R404"}
    inertias = few["moments of inertia"].evidence
    assert inertias["count"].value == 36
    assert inertias["shown"].value < 18
    assert codes(basis(ResultContext(two_level, None))) == ["R402"] * len(two_level.trials) + ["R403"]


def offset(value, plate="left"):
    return error("position", value, 0.004, 0.001, "m", plate, axis="x")


@pytest.mark.parametrize(("other", "expected"), [(0.010, []), (0.002, ["S501"])])
def test_one_person_against_the_others_of_the_session(other, expected):
    own, others = ([offset(value), offset(0.0, "right")] for value in (0.012, other))
    found = list(session_contradictions("Anna", own, others))
    assert codes(found) == expected
    for one in found:
        assert one.where.plate == "left"
        assert [one.evidence[name].value for name in ("error", "other_error")] == [0.012, 0.002]
        assert [one.evidence[name].value for name in ("person", "instrument")] == ["Anna", "plate left: position x"]


def test_a_person_without_others_contradicts_nobody():
    assert list(session_contradictions("Anna", [offset(0.1)], [])) == []
