"""What pages show of findings: next steps, cards with what they explain, corrections, explanations."""

from dataclasses import replace

import pytest

from found import ASSUMED, CORRECTED, FAULT_FREE, FAULTY, FROZEN, IGNORED, RESIDUAL, UNEXPLAINED, UNUSABLE, WAIVED, ZERO
from kinertia.findings.finding import finding
from kinertia.findings.overview import Overview
from kinertia.findings.quantity import Quantity, Where
from kinertia.report.pages.finding_view import (
    FindingView,
    digest,
    evidence_text,
    evidence_texts,
    lines,
    linked,
    place_text,
    unbroken,
)


def view(*findings):
    return FindingView([Overview(findings, 61, 1)])


def codes(cards):
    return [card.first.code for card in cards]


def test_steps_are_the_three_worst_and_waived_errors_are_among_them():
    assert codes(view(*UNUSABLE).steps) == ["P244", "R301", "M113"]
    assert view(*FAULT_FREE).steps == []


def test_a_remedy_is_one_step():
    elsewhere = replace(ZERO, where=Where(trial="run", plate="plate 2"))
    assert codes(view(ZERO, elsewhere).steps) == ["P213"]


def test_errors_and_warnings_have_sections_of_their_own():
    sections = {title: codes(cards) for title, cards in view(*UNUSABLE).sections}
    assert sections == {"Errors": ["P244", "R301"], "Warnings": ["M113", "P213"]}
    assert view(*FAULT_FREE).sections == []


def test_what_a_finding_explains_is_folded_below_it_to_the_last_consequence():
    last = finding("P246", Where(trial="walk", plate="plate 1")).muted("P214")
    ((_, (card,)),) = view(ZERO, UNEXPLAINED, last).sections
    assert {group.first.code for group in card.muted} == {"P214", "P246"}
    elsewhere = replace(UNEXPLAINED, where=Where(trial="run", plate="plate 1"))
    ((_, (card,)),) = view(ZERO, elsewhere).sections
    assert card.muted == ()


def test_equal_findings_are_one_card_with_the_evidence_of_each():
    ((_, (card,)),) = view(*FROZEN).sections
    assert [place.place for place in card.measured] == ["LANK, 1.20 to 1.70 s", "LTOE, 1.20 to 1.70 s"]


def test_findings_of_several_models_are_told_apart_by_their_files_and_each_explains_its_own():
    models = [
        Overview(
            [reported.in_file(file) for reported in (cause, finding("O302", Where(part="knee")).muted("O301"))], 61, 1
        )
        for file, cause in (("a.osim", finding("O301")), ("b.osim", finding("O301")))
    ]
    ((_, cards),) = FindingView(models).sections
    assert [card.first.place for card in cards] == ["a.osim", "b.osim"]
    assert [[group.first.where.file for group in card.muted] for card in cards] == [["a.osim"], ["b.osim"]]


def test_corrections_have_place_size_and_deviation():
    delay, zero = view(*CORRECTED).corrections
    assert (zero.where, delay.where) == ("walk: plate 1, mediolateral (Z)", "all trials")
    assert zero.size == "+6.5 N ± 0.9 N (SD) (usual within 2.4 N)"
    assert delay.size == "+7.1 ms ± 0.6 ms (SD)"


def test_a_warning_that_a_correction_resolves_is_folded_below_the_correction():
    resolved = finding("P214", Where(trial="walk", plate="plate 1")).muted("P215")
    (zero,) = view(CORRECTED[0], resolved).corrections
    assert [group.first.code for group in zero.muted] == ["P214"]


def test_an_assumption_about_several_trials_is_said_once():
    ((_, trials),) = view(ASSUMED, ASSUMED.in_trial("run")).notes
    assert trials == "walk, run"


def test_an_assumption_that_differs_between_trials_is_told_for_each():
    at = [
        finding(
            "P270",
            Where(trial=name),
            **{quantity: Quantity(count, "1") for quantity in ("frames", "count", "left_out")},
        )
        for name, count in (("walk", 1), ("run", 2), ("jump", 1))
    ]
    assert [trials for _, trials in view(*at).notes] == ["walk, jump", "run"]


def test_words_that_the_message_has_are_no_evidence_again():
    overhang = finding("P282", Where(plate="plate 1"), overhang_m=Quantity(0.045, "m"), foot=Quantity("right"))
    assert evidence_texts(overhang) == ["overhang 45 mm"]
    assert evidence_texts(finding("P213", level_n=Quantity(-23.0, "N"), other=Quantity("heel"))) == [
        "level -23 N",
        "other heel",
    ]
    mass = finding("S111", mass_by_force_kg=Quantity(27.2, "kg"), action=Quantity("Correct the mass"))
    assert evidence_texts(mass) == ["mass by force 27.2 kg"], "the remedy has it"


def test_ignored_findings_are_counted_and_nowhere_else():
    shown = view(*FAULTY, replace(IGNORED, where=Where(trial="run")))
    assert shown.ignored == "M102 (2)"
    assert "M102" not in [reported.code for reported in shown.rules]
    assert [(group.first.code, trials) for group, trials in shown.notes] == [(ASSUMED.code, "walk")]


def test_every_code_on_the_page_is_explained_there():
    assert [reported.code for reported in view(*UNUSABLE).rules] == [
        "M113", "P213", "P214", "P215", "P244", "R111", "R301", "T214",
    ]  # fmt: skip


def test_explanations_have_limits_in_place_of_their_names():
    assert not [rule_.code for rule_ in view(*UNUSABLE).rules if "{" in rule_.detects + rule_.escalation]


@pytest.mark.parametrize(
    ("quantity", "text"),
    [
        (Quantity(-23.1, "N", limit=15.0, usual=(-3.0, 3.0)), "-23 N (limit 15 N; usual within 3.0 N)"),
        (Quantity(-23.1, "N", usual=(-1.0, 3.0)), "-23 N (usual -1.0 N to 3.0 N)"),
        (Quantity("heel", ""), "heel"),
        (Quantity((0.25, 0.31), "m"), "250, 310 mm"),
    ],
)
def test_evidence_is_read_with_limit_and_usual_range(quantity, text):
    assert evidence_text(finding("P213", level_n=quantity), "level_n") == text


def test_codes_in_sentences_lead_to_their_explanation_and_nothing_else_does():
    html = linked("<b>; see P213, Z999")
    assert html == '&lt;b&gt;; see <a class="code" href="#explain-P213">P213</a>, Z999'


def test_options_of_commands_are_kept_on_one_line():
    html = unbroken("kinertia markers <F> -o set.toml, so-called --markers.")
    option = '<span class="option">{}</span>'.format
    assert html == f"kinertia markers &lt;F&gt; {option('-o')} set.toml, so-called {option('--markers')}."


def test_places_are_named_as_far_as_they_are_known():
    assert place_text(Where()) == ""
    assert place_text(Where(trial="walk"), with_trial=True) == "walk"
    assert place_text(Where(file="scaled.osim", part="tibia_r"), with_trial=True) == "scaled.osim: tibia_r"


def test_the_page_in_the_browser_gets_verdict_and_open_findings():
    told = digest(Overview(UNUSABLE, 61, 1), {})
    assert told["verdict"] == "do not use"
    assert [(reported["code"], reported["severity"], reported["status"]) for reported in told["findings"]] == [
        (WAIVED.code, "ERROR", "waived"),
        (RESIDUAL.code, "ERROR", "open"),
        ("M113", "WARNING", "open"),
        ("P213", "WARNING", "open"),
        ("T214", "CORRECTED", "open"),
        ("P215", "CORRECTED", "open"),
    ]
    for code, line in zip(("M113", "P213", "T214", "P215"), lines(FAULTY), strict=True):
        assert code in line
