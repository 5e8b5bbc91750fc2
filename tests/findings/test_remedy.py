"""Settings that mend or overrule findings: from the rule's names, the place and the evidence."""

import pytest

from kinertia.findings.finding import Severity, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.findings.remedy import SHORTEST_S, Remedy, remedies
from kinertia.findings.rule import all_rules
from kinertia.io.subject.tables import TABLES

WINDOWS = {"walk": [(0.4, 1.4)], "walk 2": [(0.2, 0.9)]}
KG = Quantity(46.123456, "kg")


def proposed(code, where=None, severity=None, windows=WINDOWS, **evidence):
    found = [with_evidence(code, where or Where(), evidence, severity)]
    return [remedy for remedy in remedies(found, windows) if not remedy.overrules]


def test_every_setting_of_the_catalogue_is_one_of_the_subject_file():
    named = {name.partition(" = ")[0] for entry in all_rules().values() for name in entry.settings}
    assert {"trial", "trial.window_s", "trial.leave_out", "subject.mass_kg", "model.static"} <= named
    for name in named:
        table, _, key = name.partition(".")
        assert key in TABLES[table].model_fields or (table, key) == ("trial", "")


def test_what_the_evidence_has_is_the_value():
    assert proposed("S111", mass_kg=KG) == [Remedy("subject", "mass_kg", 46.12)]
    assert proposed("S111", mass_by_force_kg=KG) == [], "nobody knows what the scale would show"
    plates = proposed("P287", Where(trial="walk"), names=Quantity('"plate 1", "plate 2"'))
    assert plates[0] == Remedy("instruments", "plates", ["plate 1", "plate 2"])
    assert proposed("P216", Where(trial="walk")) == [Remedy("instruments", "zeroed", True)]
    assert proposed("S401", population=Quantity("obese")) == [Remedy("subject", "population", "obese")]
    advice = {"advice": Quantity("Let markers and joint centres move (--calibrate)")}
    assert proposed("R304", Where(trial="walk"), **advice) == [Remedy("model", "calibrate", True)]
    assert proposed("R304", Where(trial="walk"), advice=Quantity("Check all labels")) == []


@pytest.mark.parametrize(
    ("span", "rest"),
    [
        ((0.3, 0.6), [0.6, 1.4]),
        ((1.0, 1.2), [0.4, 1.0]),
        ((1.5, 1.7), None),  # outside what is used already
        ((0.4 + 0.9 * SHORTEST_S, 1.4), None),
    ],
)
def test_the_longest_rest_of_what_is_used_is_the_window(span, rest):
    wanted = [] if rest is None else [Remedy("trial", "window_s", rest, "walk")]
    assert proposed("P276", Where(trial="walk", span_s=span)) == wanted


def test_several_windows_and_several_spans():
    alike = [finding("P282", Where(trial="walk", span_s=span)) for span in ((0.5, 0.6), (1.1, 1.2))]
    assert remedies(alike, WINDOWS)[0].value == [0.6, 1.1]
    outside = finding("P282", Where(trial="walk", span_s=(0.0, 0.1)))
    assert remedies([outside], {"walk": [(0.4, 1.4), (2.0, 2.5)]})[0].value == [0.4, 1.4]


def test_markers_trials_and_the_static_trial_are_left_out():
    alike = [finding("M113", Where(trial="walk", markers=(label,))) for label in ("LANK", "LTOE", "LANK")]
    assert remedies(alike, WINDOWS)[0] == Remedy("trial", "leave_out", ["LANK", "LTOE"], "walk")
    assert proposed("M113", Where(trial="static", markers=("LANK",))) == [], "not among the trials of the subject file"
    assert proposed("S203", Where(trial="static")) == [Remedy("model", "static")]
    assert proposed("L202", Where(trial="walk"), Severity.ERROR) == [Remedy("trial", "", None, "walk")]
    assert proposed("L202", Where(trial="walk"), Severity.ERROR, {"walk": ()}) == [], "nothing would be left"
    assert proposed("L202", Where(trial="walk"), Severity.WARNING) == []
    pair = Where(trial="walk", markers=("RANK", "LANK"))
    assert proposed("L202", pair, Severity.WARNING) == [Remedy("trial", "leave_out", ["RANK", "LANK"], "walk")]


def test_what_can_be_overruled_is_last():
    *_, last = remedies([finding("P276", Where(trial="walk", span_s=(0.3, 0.6)))], WINDOWS)
    assert last == Remedy("diagnostics", "ignore", "P276", "walk")
    assert last.text == 'ignore = ["P276"] under [trial.diagnostics] of walk'
    *_, last = remedies([finding("P244", Where(trial="walk"))], WINDOWS)
    assert (last.key, last.value) == ("waive", "P244")
    assert [remedy.key for remedy in remedies([finding("S206", Where(trial="static"))], WINDOWS)] == ["static"], "hard"
    assert remedies([finding("R111", Where(trial="walk"))], WINDOWS) == (), "an INFO counts for nothing"


@pytest.mark.parametrize(
    ("remedy", "text"),
    [
        (Remedy("subject", "mass_kg", 46.12), "mass_kg = 46.12 under [subject]"),
        (Remedy("model", "static"), "no static under [model]"),
        (Remedy("trial", "", None, "walk"), "no [[trial]] walk"),
        (Remedy("trial", "leave_out", ["LANK"], "walk"), 'leave_out = ["LANK"] under [[trial]] walk'),
    ],
)
def test_a_setting_is_shown_as_it_would_be_written(remedy, text):
    assert remedy.text == text
    assert Remedy(**remedy.to_dict()) == remedy
