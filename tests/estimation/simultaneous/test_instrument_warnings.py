import pytest

from kinertia.diagnostics.result.mirrored_free_moments import mirrored_free_moments_warning
from kinertia.estimation.simultaneous.instrument_warnings import (
    accuses,
    instrument_corrections,
    instrument_warnings,
)


def calibration(*free_nm_kn, gain=0.0):
    entries = {
        f"plate {k}: free moment": {"value": value / 1e3, "prior_sd": 0.0007, "sd": 0.002, "unit": "N m/N"}
        for k, value in enumerate(free_nm_kn, start=1)
    }
    return {**entries, "plate 1: gain": {"value": gain, "prior_sd": 0.007, "sd": 0.003, "unit": "1"}}


@pytest.mark.parametrize("values", [(5.0, -5.8), (-3.5, 2.9), (4.0, -4.0, 4.0)])
def test_mirror_images_are_the_body_s(values):
    assert "mirror images" in mirrored_free_moments_warning(calibration(*values))
    assert instrument_warnings(calibration(*values)) == []


@pytest.mark.parametrize("values", [(-2.2, -4.9), (-0.9, -8.0), (6.0, -1.6), (8.0, 0.0, 0.0, 0.0)])
def test_one_plate_or_one_side_is_the_plates(values):
    sentences = instrument_warnings(calibration(*values))
    assert sentences
    assert all("vertical-moment error, corrected by" in sentence for sentence in sentences)
    assert not mirrored_free_moments_warning(calibration(*values))


def test_all_else_that_is_off_is_still_said():
    (plate,) = instrument_warnings(calibration(5.0, -5.0, gain=0.05))
    assert plate.startswith("Plate 1: gain error, corrected by +5.0 % (usual: within 0.7)")
    assert mirrored_free_moments_warning(calibration(5.0, -5.0, gain=0.05))


def test_nothing_is_said_of_sound_plates():
    assert instrument_warnings(calibration(1.0, -1.0)) == []
    assert not mirrored_free_moments_warning(calibration(1.0, -1.0))


def zeros(**values_n):
    return {
        f"plate {plate}: zero x": {"value": value, "prior_sd": 2.4, "sd": 1.5, "unit": "N"}
        for plate, value in values_n.items()
    }


def test_zeros_that_all_plates_have_alike_are_rather_a_force_that_none_measures():
    (said,) = instrument_warnings(zeros(left=-22.0, right=-23.0))
    assert "all plates read too much along x, and alike (-22.0, -23.0 N): rather a force that no plate measures" in said


@pytest.mark.parametrize("other", [23.0, -9.0, -3.0])
def test_zeros_of_plates_that_differ_are_theirs(other):
    said = instrument_warnings(zeros(left=-22.0, right=other))
    assert said[0].startswith(
        "Plate left: offset of the horizontal force along x by -22.0 N (usual: within 2.4), corrected"
    )
    assert not any("all plates" in one for one in said)


def test_the_zero_of_a_single_plate_is_its_own():
    assert "Plate left: offset of the horizontal force along x" in instrument_warnings(zeros(left=-22.0))[0]


PLACE = {"value": 0.02, "prior_sd": 0.0036, "sd": 0.002, "unit": "m", "moved": 3.0, "contradicted_by": ""}


@pytest.mark.parametrize(
    "unsupported",
    [{"value": 0.007}, {"sd": 0.011}, {"moved": 0.9}, {"contradicted_by": "another trial"}],
)
def test_an_accusation_needs_support(unsupported):
    assert accuses(PLACE)
    assert not accuses({**PLACE, **unsupported})


def test_what_is_not_supported_is_a_correction():
    for changed in ({}, {"moved": 0.5}, {"sd": 0.011}, {"contradicted_by": "another trial"}):
        entries = {"plate 1: x": {**PLACE, **changed}, "plate 2: x": {**PLACE, "value": 0.001}}
        warned, corrected = instrument_warnings(entries), instrument_corrections(entries)
        assert (len(warned), len(corrected)) == ((0, 1) if changed else (1, 0))
        assert all("+20.0 mm (usual: within 3.6)" in sentence for sentence in (*warned, *corrected))
    assert corrected[0].endswith("another trial says otherwise")


def test_directions_are_the_person_s():
    named = {"x": "fore-aft", "z": "mediolaterally"}
    assert instrument_warnings({"plate 1: x": PLACE}, named)[0].startswith("Plate 1: displaced fore-aft, ")
    assert instrument_warnings({"plate 1: z": PLACE}, named)[0].startswith("Plate 1: displaced mediolaterally, ")
