"""Entries of the catalogue by code, question and family."""

import pytest

from kinertia.findings.rule import FAMILIES, all_rules, matching, nearest, page, questions, rule, rules


def test_a_rule_knows_its_question():
    assert rule("P213").question == "P21"
    assert "P21" in questions("P")


def test_an_unknown_code_is_an_error():
    for code in ("P999", "X101", "", "P21"):
        with pytest.raises(KeyError):
            rule(code)


def test_a_question_stands_for_its_codes_and_a_family_for_all_of_them():
    assert matching("P213") == ("P213",)
    assert set(matching("P21")) == {"P211", "P212", "P213", "P214", "P215", "P216"}
    assert set(matching("P")) == set(rules("P"))
    assert matching("P999") == matching("X") == matching("") == ()


def test_families_make_up_the_catalogue():
    """Which codes there are is in `messages.txt`."""
    assert sum(len(rules(family)) for family in FAMILIES) == len(all_rules())
    assert {code[0] for code in all_rules()} == set(FAMILIES)


def test_the_nearest_codes_of_an_unknown_one():
    assert "P213" in nearest("P2131")
    assert nearest("plate-zero-ofset")[0] == "P213"
    assert nearest("?") == ()


def test_a_code_has_a_place_in_the_documentation():
    assert page("P213") == "findings/force-plates.md#p213"
    assert page("F10") == "findings/files.md#f10"
