"""Errors of instruments: which are found, which are apparent, and which all plates have alike."""

from dataclasses import replace

import pytest

from kinertia.diagnostics.result.corrections import delays, zero_offsets
from kinertia.diagnostics.result.plate_errors import free_moments, plate_positions
from kinertia.diagnostics.runner import explained
from kinertia.estimation.simultaneous.uncertainty.evidence import FreeMomentSign
from kinertia.findings.finding import Severity
from results import codes, context, error, walking


def moments(*errors_nm_kn, sd=0.6):
    return [
        error("free moment", value / 1e3, 0.0007, sd / 1e3, "N m/N", f"plate {k}")
        for k, value in enumerate(errors_nm_kn, start=1)
    ]


@pytest.mark.parametrize("values", [(5.0, -5.8), (-3.5, 2.9), (4.0, -4.0, 4.0)])
def test_mirror_images_are_the_bodys(values):
    (cause,) = [finding for finding in explained(free_moments(context(*moments(*values)))) if finding.is_open]
    assert cause.code == "P268"
    assert cause.severity < Severity.WARNING
    assert cause.evidence["error_nm_n"].value == pytest.approx([value / 1e3 for value in values])


@pytest.mark.parametrize(
    ("values", "count"), [((-2.2, -4.9), 2), ((-0.9, -8.0), 1), ((6.0, -1.6), 2), ((8.0, 0.0, 0.0, 0.0), 1)]
)
def test_one_plate_or_one_side_is_the_plates(values, count):
    assert codes(free_moments(context(*moments(*values)))) == ["P267"] * count


def test_nothing_is_found_of_fault_free_plates_or_of_uncertain_errors():
    assert codes(free_moments(context(*moments(1.0, -1.0)))) == []
    assert codes(free_moments(context(*moments(5.0, -5.0, sd=3.0)))) == []


@pytest.mark.parametrize(("log_odds", "expected"), [(59.0, ["P269"]), (1.0, ["P260"]), (-20.0, [])])
def test_the_sign_of_free_moments(log_odds, expected):
    found = list(free_moments(context(free_moment_sign=FreeMomentSign(log_odds, 2.0))))
    assert codes(found) == expected
    assert all(
        (finding.evidence["log_odds"].value, finding.evidence["rms_nm"].value) == (log_odds, 2.0) for finding in found
    )


def zeros(trial="walk", axis="x", **values_n):
    return [
        error("zero offset", value, 2.4, 1.5, "N", plate, moved=0.5, trial=trial, axis=axis)
        for plate, value in values_n.items()
    ]


def test_zeros_that_all_plates_have_alike_are_rather_a_force_that_none_measures():
    answers = explained(zero_offsets(context(*zeros(left=-22.0, right=-23.0))))
    (cause,) = [answer for answer in answers if answer.is_open]
    assert (cause.code, cause.severity) == ("P214", Severity.WARNING)
    assert cause.evidence["force_n"].value == -22.5
    assert (cause.where.trial, cause.where.plate, cause.where.axis) == ("walk", None, "fore-aft")
    assert codes(answers) == ["P215", "P215", "P214"]


@pytest.mark.parametrize(("other", "count"), [(23.0, 2), (-9.0, 2), (-3.0, 1)])
def test_zeros_of_plates_that_differ_are_theirs(other, count):
    found = list(zero_offsets(context(*zeros(left=-22.0, right=other))))
    assert codes(found) == ["P215"] * count
    assert found[0].evidence["zero_offset_n"].value == -22.0
    assert found[0].where.plate == "left"


def test_the_zero_of_a_single_plate_is_its_own_also_in_two_trials():
    errors = [*zeros(left=-22.0), *zeros("run", left=-22.0)]
    found = zero_offsets(context(*errors, trials={"walk": walking(), "run": walking()}))
    assert [(finding.code, finding.where.trial) for finding in found] == [("P215", "walk"), ("P215", "run")]


PLACE = error("position", -0.02, 0.0036, 0.002, "m", moved=3.0, axis="x")


@pytest.mark.parametrize(
    ("changed", "supported", "found"),
    [
        ({}, True, True),
        ({"value": -0.007}, False, False),
        ({"sd": 0.011}, False, False),
        ({"moved": 0.9}, False, True),
        ({"contradicted_by": "another trial"}, False, True),
    ],
)
def test_an_accusation_needs_support_and_a_finding_two_deviations(changed, supported, found):
    changed_error = replace(PLACE, **changed)
    assert (changed_error.supported, changed_error.found) == (supported, found)
    answers = list(plate_positions(context(changed_error, replace(PLACE, plate="plate 2", value=-0.001))))
    assert codes(answers) == ["P246"] * found
    for answer in answers:
        assert answer.severity is Severity.CORRECTED
        assert answer.evidence["offset_m"].value == changed_error.value
        assert answer.evidence["offset_m"].usual == (-0.0036, 0.0036)
        assert (answer.causes == ("the instrument",)) == supported
        assert ("another trial" in answer.causes[0]) == bool(changed_error.contradicted_by)


@pytest.mark.parametrize(
    ("vertical", "turned_deg", "x", "z"),
    [
        ("+Y", 0.0, ("fore-aft", "X"), ("mediolateral", "Z")),
        ("+Y", 90.0, ("mediolateral", "X"), ("fore-aft", "Z")),
        ("+Z", 0.0, ("fore-aft", "X"), ("mediolateral", "-Y")),
        ("+Z", 180.0, ("fore-aft", "X"), ("mediolateral", "-Y")),
    ],
)
def test_directions_are_the_persons_and_axes_the_files(vertical, turned_deg, x, z):
    made = context(PLACE, replace(PLACE, axis="z"), trials={"walk": walking(turned_deg, vertical)})
    assert [(finding.where.axis, finding.where.file_axis) for finding in plate_positions(made)] == [x, z]


def test_where_people_walk_along_both_axes_a_direction_has_no_name():
    made = context(PLACE, trials={"one": walking(0.0), "two": walking(90.0)})
    (found,) = plate_positions(made)
    assert (found.where.axis, found.where.file_axis) == (None, "X")


def test_delays_of_all_forces_and_of_one_trial():
    late = error("delay", 0.0101, 0.0044, 0.001, "s", plate=None, moved=2.0)
    of_trial = replace(late, trial="run", value=-0.02, prior_sd=0.0017)
    found = list(delays(context(late, of_trial, trials={"walk": walking(), "run": walking()})))
    assert [(finding.code, finding.where.trial, finding.evidence["delay_s"].value) for finding in found] == [
        ("T214", None, 0.0101),
        ("T215", "run", -0.02),
    ]
    assert list(delays(context(replace(late, sd=0.006)))) == []
    alone = replace(
        of_trial, trial="walk", value=-0.03
    )  # its total: there are no other trials that it could differ from
    (found_alone,) = delays(context(late, alone, trials={"walk": walking()}))
    assert (found_alone.code, found_alone.evidence["delay_s"].value) == ("T214", -0.03)


@pytest.mark.parametrize(
    ("value_s", "sd_s", "moved", "reported"),
    [
        (0.0068, 0.0012, 2.7, True),  # within the prior, but joint moments would leave their bars
        (0.0068, 0.0012, 0.9, False),
        (0.0068, 0.0035, 2.7, False),
        (-0.0030, 0.0010, 1.1, True),
    ],
)
def test_a_delay_that_moves_joint_moments_beyond_their_bars_is_reported(value_s, sd_s, moved, reported):
    late = error("delay", value_s, 0.0044, sd_s, "s", plate=None, moved=moved)
    assert codes(delays(context(late, trials={"walk": walking(), "run": walking()}))) == ["T214"] * reported
