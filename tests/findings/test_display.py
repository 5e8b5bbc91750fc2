"""SI quantities as people read them, and sentences with them."""

import pytest

from kinertia.findings.display import axis_text, filled, first_few, outlined, shown
from kinertia.findings.quantity import Quantity, Where


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (-0.0231, "m", "-23 mm"),
        (0.0046, "m", "4.6 mm"),
        (1.755, "m", "1.75 m"),
        ((0.021, -0.004), "m", "21, -4 mm"),
        ((0.25, 1.31), "m", "0.25, 1.31 m"),
        (0.0071, "s", "7.1 ms"),
        (-0.062, "s", "-62 ms"),
        (1.5, "s", "1.50 s"),
        (0.0349, "rad", "2.0 degrees"),
        (-0.0078, "N m/N", "-7.8 N m per kN"),
        (-23.1, "N", "-23 N"),
        (6.34, "N", "6.3 N"),
        (12.34, "N m", "12.3 N m"),
        (0.494, "kg m2", "0.494 kg m2"),
        (72.64, "kg", "72.6 kg"),
        (1234.4, "kg/m3", "1234 kg/m3"),
        (1.234, "m/s", "1.23 m/s"),
        (50.0, "Hz", "50 Hz"),
        (9.0, "a", "9 years"),
        (1.2345, "1", "1.23"),
        ("rotated", "", "rotated"),
    ],
)
def test_units_are_those_of_the_field(value, unit, text):
    assert shown(Quantity(value, unit)) == text


@pytest.mark.parametrize(
    ("value", "style", "text"),
    [
        (0.0914, "%", "9.14 %"),
        (-0.02, "+%", "-2 %"),
        ((0.091, -0.088), "+%", "+9.1, -8.8 %"),
        (12.0, "#", "12"),
        (1e6, "#", "1000000"),
        (2.5, "+", "+2.5"),
        ("half", "%", "half"),
    ],
)
def test_styles(value, style, text):
    assert shown(Quantity(value, "1"), style) == text


@pytest.mark.parametrize(("value", "unit"), [((-0.0002, 0.025), "m"), ((-0.3, 25.0), "N"), (-1e-9, "rad")])
def test_what_rounds_to_zero_has_no_sign(value, unit):
    assert "-0 " not in shown(Quantity(value, unit)).replace(",", " ").replace(".0", "")


def test_a_sentence_is_filled_with_evidence_and_places():
    where = Where("walk.c3d", 7, "walk", "plate 1", "fore-aft", "X", ("RKNE", "LKNE"), "shank", (0.5, 1.25))
    evidence = {"level_n": Quantity(-23.1, "N"), "share": Quantity(0.25, "1"), "frames": Quantity(12.0, "1")}
    template = (
        "{file} {line} {trial} {plate} {axis} {marker} {other} {markers} {part} {start} {end} "
        "{level_n} {level_n:+} {share:%} {frames:#} {unknown}"
    )
    assert filled(template, where, evidence) == (
        "walk.c3d 7 walk plate 1 fore-aft (X) RKNE LKNE RKNE, LKNE shank 0.50 s 1.25 s -23 N -23 N 25 % 12 {unknown}"
    )


def test_evidence_comes_before_a_place_of_the_same_name():
    assert filled("{other}", Where(markers=("A", "B")), {"other": Quantity("plate 2")}) == "plate 2"


def test_a_place_that_is_not_stated_has_a_word():
    assert filled("{plate}, {trial}, {file}, {part}", Where(), {}) == "all plates, the trial, the file, the model"


def test_an_axis_is_shown_as_the_person_moves_and_as_the_file_has_it():
    assert axis_text(Where(axis="vertical", file_axis="Z")) == "vertical (Z)"
    assert axis_text(Where(axis="vertical")) == "vertical"
    assert axis_text(Where(file_axis="Z")) == "Z"


def test_long_lists_are_cut():
    assert first_few(["a", "b"]) == "a, b"
    assert first_few(list("abcdefg")) == "a, b, c, d and 3 more"


def test_a_template_without_evidence_is_readable():
    assert outlined("{level_n} {error_nm_n:+} {mass_by_force_kg} {plate}") == "<level> <error> <mass by force> <plate>"
    assert outlined("{share:%}", "*{}*") == "*share*"
