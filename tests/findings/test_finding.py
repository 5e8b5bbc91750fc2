"""Findings: where they are, what they say, and how they are written down."""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.findings.rule import all_rules, rule

_LABELS = st.lists(st.sampled_from("ABCD"), max_size=3, unique=True).map(tuple)
_SPANS = st.tuples(st.floats(0, 9), st.floats(0, 9)).map(lambda ends: tuple(sorted(ends)))
PLACES = st.builds(
    Where,
    trial=st.none() | st.sampled_from(["walk", "run"]),
    plate=st.none() | st.sampled_from(["plate 1", "plate 2"]),
    axis=st.none() | st.sampled_from(["fore-aft", "vertical"]),
    markers=_LABELS,
    part=st.none() | st.sampled_from(["shank", "foot"]),
    span_s=st.none() | _SPANS,
)
ZERO = finding(
    "P213",
    Where("walk.c3d", plate="plate 1", axis="vertical", file_axis="Z"),
    level_n=Quantity(-23.1, "N", limit=15.0, usual=(-3.0, 3.0), sd=0.4),
)


@given(PLACES, PLACES)
def test_overlap_is_mutual(where, other):
    assert where.overlaps(where)
    assert where.overlaps(Where())
    assert where.overlaps(other) == other.overlaps(where)


@given(PLACES, PLACES, st.sampled_from(["trial", "plate", "axis", "markers", "part", "span_s"]))
def test_what_is_stated_less_overlaps_no_less(where, other, name):
    if where.overlaps(other):
        assert replace(where, **{name: getattr(Where(), name)}).overlaps(other)


@given(PLACES, st.sampled_from([("trial", "jump"), ("plate", "plate 3"), ("axis", "mediolateral"), ("part", "hand")]))
def test_places_that_differ_in_one_respect_do_not_overlap(place, changed):
    name, value = changed
    if getattr(place, name) is not None:
        assert not place.overlaps(replace(place, **{name: value}))


def test_markers_overlap_by_a_common_one_and_spans_by_a_common_time():
    assert Where(markers=("A", "B")).overlaps(Where(markers=("B", "C")))
    assert not Where(markers=("A", "B")).overlaps(Where(markers=("C",)))
    assert Where(span_s=(0.0, 1.0)).overlaps(Where(span_s=(1.0, 2.0)))
    assert not Where(span_s=(0.0, 1.0)).overlaps(Where(span_s=(1.1, 2.0)))


def test_the_severity_is_the_rules_unless_another_is_given():
    assert ZERO.severity == Severity.WARNING
    assert finding("P213", severity=Severity.ERROR).severity == Severity.ERROR
    assert ZERO.at(Severity.ERROR).severity == Severity.ERROR
    assert Severity.ERROR > Severity.WARNING > Severity.CORRECTED > Severity.INFO


def test_an_unknown_code_makes_no_finding():
    with pytest.raises(KeyError):
        finding("P999")


def test_it_is_open_until_it_is_explained_or_overruled():
    assert ZERO.is_open
    assert not ZERO.muted("P101").is_open
    assert not replace(ZERO, status="waived").is_open
    assert ZERO.muted("P101").muted_by == "P101"


def test_sentences_are_the_rules_filled_in():
    assert ZERO.message == "The zero of plate 1 is off: it reads -23 N along the vertical (Z) axis while unloaded."
    assert ZERO.effect == rule("P213").effect
    assert ZERO.remedy == rule("P213").remedy
    assert ZERO.name == "plate-zero-offset"
    assert ZERO.line() == f"walk.c3d  P213 {ZERO.message}"
    assert replace(ZERO, where=Where("walk.c3d", 7)).line().startswith("walk.c3d, line 7  P213 ")
    assert replace(ZERO, where=Where()).line().startswith("P213 ")
    assert ZERO.in_trial("walk").line() == f"walk  P213 {ZERO.message}"


def test_the_dictionary_is_json_in_si_units():
    content = json.loads(json.dumps(ZERO.in_trial("walk").to_dict(), allow_nan=False))
    places = {"file": "walk.c3d", "trial": "walk", "plate": "plate 1", "axis": "vertical", "file_axis": "Z"}
    assert content["where"] == places
    level = {"value": -23.1, "unit": "N", "limit": 15.0, "usual": [-3.0, 3.0], "sd": 0.4}
    assert content["evidence"]["level_n"] == level
    assert (content["code"], content["severity"], content["status"]) == ("P213", "WARNING", "open")
    assert content["muted_by"] is None
    assert content["causes"] == list(rule("P213").causes)


def test_causes_that_depend_on_what_was_measured_replace_the_rules():
    assert finding("P213", causes=("a cable",)).to_dict()["causes"] == ["a cable"]


def test_every_rule_makes_a_finding_that_can_be_written():
    where = Where("f", 1, "walk", "plate 1", "vertical", "Y", ("A", "B"), "shank", (0.0, 1.0))
    for code in all_rules():
        content = finding(code, where, size=Quantity((0.01, -0.02), "m")).to_dict()
        assert json.loads(json.dumps(content, allow_nan=False)) == content
