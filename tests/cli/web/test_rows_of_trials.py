"""Conditions and used parts of recordings in the form, and back into the subject file."""

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")

from kinertia.cli.web.rows import TrialFields, conditions, trial_fields, with_trial_fields
from kinertia.errors import SettingsError

CONTENT = {
    "model": {"static": "static.c3d", "window_s": [1, 2.5]},
    "trial": [{"markers": "a.c3d", "condition": "barefoot", "window_s": [0.123456789, 2.0]}, {"markers": "b.c3d"}],
}


def test_what_is_written_is_shown_and_what_is_typed_precedes_it():
    shown = trial_fields(CONTENT, ["static.c3d", "a.c3d", "b.c3d", "list.csv"], {"start:b.c3d": "0,4"})
    assert shown == {
        "static.c3d": TrialFields("", "1", "2.5"),
        "a.c3d": TrialFields("barefoot", "0.123457", "2"),
        "b.c3d": TrialFields("", "0,4", ""),
        "list.csv": TrialFields(),
    }
    assert conditions(CONTENT) == ["barefoot"]


def test_fields_are_written_and_what_nobody_changed_stays():
    form = {
        "start:a.c3d": "0.123457",
        "end:a.c3d": "2",
        "start:b.c3d": "0,4",
        "end:b.c3d": "1.9",
        "condition:b.c3d": " x ",
    }
    changed = with_trial_fields(CONTENT, {**form, "start:static.c3d": "", "end:static.c3d": ""})
    assert changed["model"] == {"static": "static.c3d"}
    assert changed["trial"][0] == CONTENT["trial"][0], "not rounded by being shown"
    assert changed["trial"][1] == {"markers": "b.c3d", "condition": "x", "window_s": [0.4, 1.9]}
    assert with_trial_fields(CONTENT, {}) == CONTENT


@pytest.mark.parametrize(("start", "end"), [("0.4", ""), ("", "1"), ("soon", "1")])
def test_half_a_part_and_words_are_refused(start, end):
    with pytest.raises(SettingsError, match=r"b\.c3d"):
        with_trial_fields(CONTENT, {"start:b.c3d": start, "end:b.c3d": end})


def test_a_wrong_window_of_a_hand_written_file_is_no_failure():
    wrong = {"trial": [{"markers": "a.c3d", "window_s": "all"}, "nonsense"]}
    assert trial_fields(wrong, ["a.c3d"], {})["a.c3d"] == TrialFields()
