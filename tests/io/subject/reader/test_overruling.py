"""Findings that a subject file overrules."""

import pytest

from kinertia.io.subject.reader import STUDY_FILE, subject_file_in
from kinertia.settings import Overrule
from refusals import refused
from whole_subject_file import GOOD, read

OVERRULED = '[diagnostics]\nignore = ["M102", "R40"]\nwaive = ["P244"]\n'


def test_findings_are_overruled_for_person_trial_and_study(folder):
    text = GOOD.replace("[settings]", '[trial.diagnostics]\nwaive = ["P21"]\n\n[settings]')
    plain, overruled = read(folder, text), read(folder, text + OVERRULED)
    assert plain.diagnostics.overrule == Overrule()
    assert overruled.diagnostics.overrule == Overrule(waive=("P244",), ignore=("M102", "R40"))
    assert [trial.diagnostics.overrule for trial in overruled.trials] == [Overrule(), Overrule(waive=("P21",))]
    (folder.parent / STUDY_FILE).write_text('[diagnostics]\nignore = ["P268"]\n', encoding="utf-8")
    both = read(folder, text + OVERRULED).diagnostics.overrule
    assert both == Overrule(waive=("P244",), ignore=("P268", "M102", "R40"))
    (folder / STUDY_FILE).write_text('[diagnostics]\nwaive = ["M"]\n', encoding="utf-8")
    assert read(folder, text).diagnostics.overrule == Overrule(waive=("M",)), "the nearest one counts"
    (folder / "my.toml").unlink()
    assert subject_file_in(folder) == folder / "subject.toml"


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "expected"),
    [
        ('"M102"', '"M1O2"', 27, "ignore", "M102"),
        ('"M102"', "102", 27, "ignore", "in quotes"),
        ('["P244"]', '"P244"', 28, "waive", "list"),
        ('"P244"', '"P278"', 28, "waive", "nothing can be computed"),
        ("waive", "waives", 28, "waives", "'waive'"),
    ],
)
def test_only_codes_can_be_overruled(folder, old, new, line, key, expected):
    with refused("F191", line, key=key, expected=expected):
        read(folder, GOOD + OVERRULED.replace(old, new))
    (folder / STUDY_FILE).write_text(OVERRULED.replace(old, new), encoding="utf-8")
    with refused("F191", line - GOOD.count("\n"), key=key, expected=expected) as caught:
        read(folder, GOOD)
    assert caught.value.path.name == STUDY_FILE


def test_what_is_overruled_in_a_trial_is_found_in_its_line(folder):
    with refused("F191", 21, key="waive"):
        read(folder, GOOD.replace("[settings]", '[trial.diagnostics]\nwaive = ["X1"]\n\n[settings]'))


def test_the_last_reason_of_a_code_its_question_or_family_is_given():
    of_study, of_person = Overrule(("P244",), reasons=(("P", "new floor"),)), Overrule(reasons=(("P24", "worn shoe"),))
    assert (of_study + of_person).reason("P244") == "worn shoe"
    assert (of_person + of_study).reason("P244") == "new floor"
    assert (of_study + of_person).reason("P213") == "new floor"
    assert (of_study + of_person).reason("M102") == ""
