"""Measured segments and what is attached, as rows of the form and entries of the subject file."""

import re

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")

from kinertia.cli.web.entries import entries, recognise, trouble, write_form
from kinertia.cli.web.library import Library
from kinertia.cli.web.rows import rows, with_rows
from kinertia.errors import SettingsError
from kinertia.io.subject.reader import read_subject

CONTENT = {
    "segment": {
        "thigh_r": {"mass_kg": "8.9 +- 0.4", "source": "DXA 2026"},
        "shank_l": {"mass_kg": "2.1 +- 0.1", "com_y_mm": "-150 +- 10", "prosthesis": True},
    },
    "attached": [
        {"name": "rucksack", "segment": "torso", "mass_kg": "unknown", "on_scale": False, "com_mm": [-200, 300, 0]},
        {"name": "shoe", "segment": "foot_r", "mass_kg": 0.4, "on_scale": True, "com_mm": [0, -40.5, 0]},
    ],
}


def form_of(content):
    return {field.key: field.value for table in rows(content) for row in table.rows for field in row}


def test_the_form_gives_the_entries_back():
    segments, attached = rows(CONTENT)
    assert (segments.written, attached.written) == (2, 2)
    assert len(segments.rows) == 3, "one more to fill in"
    assert with_rows({"subject": {}}, form_of(CONTENT)) == {"subject": {}, **CONTENT}
    assert with_rows(CONTENT, {"mass_kg": "70"}) == CONTENT, "a form without rows changes none"


def test_a_row_without_its_name_goes():
    form = form_of(CONTENT) | {"segment:0:segment": " ", "attached:0:name": "", "attached:1:name": ""}
    changed = with_rows(CONTENT, form)
    assert list(changed["segment"]) == ["shank_l"]
    assert "attached" not in changed


@pytest.mark.parametrize(
    ("form", "sentence"),
    [
        ({"segment:2:mass_kg": "8,9 +- 0,4"}, "measured: a row with Mass (kg) '8,9 +- 0,4' has no segment; fill it in"),
        ({"attached:2:segment": "torso"}, "carried: a row with Segment 'torso' has no name; fill it in"),
        ({"segment:2:segment": "thigh_r", "segment:2:mass_kg": "9"}, "measured: thigh_r has two rows; give all its"),
    ],
)
def test_what_was_typed_in_a_new_row_is_not_dropped(form, sentence):
    typed = form_of(CONTENT) | form
    with pytest.raises(SettingsError, match=re.escape(sentence)):
        with_rows(CONTENT, typed)
    shown = {field.key: field.value for table in rows(CONTENT, typed) for row in table.rows for field in row}
    assert {key: shown[key] for key in form} == form


def test_a_row_that_was_left_out_between_others_keeps_its_place_until_it_is_saved():
    typed = {"segment:1:segment": "thigh_r", "segment:1:mass_kg": "9 +- 1"}
    assert rows({}, typed)[0].rows[1][0].value == "thigh_r"
    assert with_rows({}, typed) == {"segment": {"thigh_r": {"mass_kg": "9 +- 1"}}}


@pytest.mark.parametrize(
    ("typed", "place"),
    [
        ("-200, 300, 0", [-200.0, 300.0, 0.0]),
        ("-200,300,0", [-200.0, 300.0, 0.0]),
        ("-200 300 0", [-200.0, 300.0, 0.0]),
        ("-12,5; 3,0; 0", [-12.5, 3.0, 0.0]),
        ("[-12,5, 3,0, 0]", [-12.5, 3.0, 0.0]),
        ("behind", ["behind"]),
    ],
)
def test_three_numbers_as_people_write_them(typed, place):
    form = {"attached:0:name": "rucksack", "attached:0:com_mm": typed}
    assert with_rows({}, form)["attached"][0]["com_mm"] == place


def test_other_shapes_stay_for_the_command_lines_message():
    for content in ({"segment": 3}, {"attached": "rucksack"}, {"attached": [1]}, {"segment": {"a": 2}}):
        assert [row.written for row in rows(content)] == [0, 0]


def test_they_reach_the_fit_and_mistakes_have_the_command_lines_message(tmp_path, c3d_lab):
    person = Library(tmp_path / "library").add("Anna")
    for name in ("static.c3d", "walk.c3d"):
        (person.folder / name).write_bytes((c3d_lab / name).read_bytes())
    recognise(person)
    form = {"sex": "male", "mass_kg": "41,5", "height_m": "1,61"}
    form |= {"segment:0:segment": "thigh_r", "segment:0:mass_kg": "4,9 +- 0,4"}
    form |= {"attached:0:name": "rucksack", "attached:0:segment": "torso", "attached:0:mass_kg": "3,5"}
    form |= {"attached:0:on_scale": "no", "attached:0:com_mm": "-150 250 0"}
    write_form(person, form)
    assert trouble(person) == ""
    wanted = read_subject(person.subject)
    assert wanted.segments["thigh_r"].parameters() == {"mass": (4.9, 0.4)}
    assert wanted.attached[0].com_mm == (-150.0, 250.0, 0.0)
    assert wanted.attached[0].mass_kg == pytest.approx((3.5, 0.035))
    write_form(person, {"segment:0:segment": "thigh_r", "segment:0:mass_kg": "4.9"})
    assert 'like "8.9 +- 0.4"' in trouble(person)
    assert entries(person)["segment"]["thigh_r"]["mass_kg"] == 4.9
