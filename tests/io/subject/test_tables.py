"""The text of a subject file says what its entries said."""

import tomllib

from kinertia.io.subject.tables import subject_text
from kinertia.settings import Subject


def test_texts_and_keys_of_any_kind_are_written_as_toml():
    content = {
        "subject": {"name": 'A "b" \\ \x7f é\n', "mass_kg": 70, "odd key": [1.5, "x"], "flag": True},
        "trial": [{"markers": "w.trc", "inline": {"a b": 1}}],
        "segment": {"thigh_r": {"mass_kg": "8.9 +- 0.4"}},
        "loose": 3,
    }
    assert tomllib.loads(subject_text(content, "heading")) == content


def test_known_entries_say_what_they_are():
    text = subject_text({"subject": {"mass_kg": 70.0}, "model": {"static": "s.c3d"}}, "heading")
    assert text.startswith("# heading\n\n[subject]\n")
    assert f"mass_kg = 70.0  # {Subject.model_fields['mass_kg'].description}\n" in text
