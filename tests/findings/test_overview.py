"""Many findings at a glance."""

from dataclasses import replace

from kinertia.findings.finding import Severity, finding
from kinertia.findings.overview import DO_NOT_USE, USE, WITH_CARE, Overview, grouped
from kinertia.findings.quantity import Quantity, Where

FROZEN = [finding("M113", Where(trial="walk", markers=(label,))) for label in ("RKNE", "LKNE", "RANK")]
SPIKES = finding("M111", Where(trial="walk", markers=("RTOE",)), Severity.ERROR, distance_m=Quantity(0.3, "m"))
DELAY = finding("T214", Where(), delay_s=Quantity(0.007, "s"))


def test_the_worst_open_finding_decides():
    assert Overview((), 10, 1).verdict == USE
    assert Overview((DELAY,), 10, 1).verdict == USE
    assert Overview((*FROZEN, DELAY), 10, 1).verdict == WITH_CARE
    assert Overview((*FROZEN, SPIKES), 10, 1).verdict == DO_NOT_USE


def test_what_is_waived_or_left_out_calls_for_care():
    waived = replace(SPIKES, status="waived")
    assert Overview((waived,), 10, 1).verdict == WITH_CARE
    assert Overview((), 10, 3, ("walk 2",)).verdict == WITH_CARE
    assert Overview((SPIKES.muted("M121"),), 10, 1).verdict == USE


def test_an_open_error_or_a_trial_left_out_fails():
    assert Overview((SPIKES,), 10, 1).failed
    assert Overview((), 10, 3, ("walk 2",)).failed
    assert not Overview((*FROZEN, replace(SPIKES, status="waived"), SPIKES.muted("M121")), 10, 1).failed


def test_the_line_counts():
    overview = Overview((*FROZEN, DELAY), 61, 3, ("walk 2",))
    assert overview.line == "Use with care. Three warnings; one error was corrected; 2 of 3 trials were used."


def test_the_line_counts_what_is_overruled():
    """Of a recording with an ignored warning it was said that nothing was found."""
    ignored = (
        *(replace(frozen, status="ignored") for frozen in FROZEN),
        replace(DELAY.muted("P243"), status="ignored"),
    )
    assert Overview(ignored, 61, 1).line == "Use. Three findings were ignored; the trial was used."
    waived = replace(SPIKES, status="waived")
    assert (
        Overview((*ignored, waived), 61, 1).line
        == "Use with care. One error was waived; three findings were ignored; the trial was used."
    )


def test_the_worst_comes_first():
    assert [reported.code for reported in Overview((DELAY, *FROZEN, SPIKES), 1, 1).open] == [
        "M111",
        "M113",
        "M113",
        "M113",
        "T214",
    ]


def test_findings_are_a_table():
    table = Overview((DELAY.muted("P243"), *FROZEN, SPIKES), 1, 1).table
    assert list(table.code) == ["M111", "M113", "M113", "M113", "T214"]
    assert list(table.muted_by)[-1] == "P243"
    assert table[["trial", "severity", "status", "value", "unit"]].iloc[0].tolist() == [
        "walk",
        "ERROR",
        "open",
        0.3,
        "m",
    ]
    assert table.message[0] == SPIKES.message


def test_equal_findings_are_one_line():
    (group,) = grouped(FROZEN)
    assert len(group.findings) == 3
    assert "LKNE, RANK" in group.line
    assert group.line.startswith("walk  M113 ")


def test_equal_findings_of_all_plates_differ_by_their_axes():
    (group,) = grouped(finding("P248", Where(axis=axis)) for axis in ("fore-aft", "mediolateral"))
    assert "(also mediolateral)" in group.line


def test_equal_findings_of_one_marker_are_counted():
    spans = [Where(trial="walk", markers=("RTOE", "RHEE"), span_s=(at, at)) for at in (1.0, 2.0)]
    (group,) = grouped(finding("L211", where) for where in spans)
    assert "(1 more)" in group.line


def test_a_model_alone_has_no_trials():
    assert Overview((), 31, 0).line == "Use. No problems were found."


def test_equal_findings_of_one_plate_differ_by_their_axes():
    offsets = [
        finding("P215", Where(trial="walk", plate="plate 1", axis=axis), zero_offset_n=Quantity(5.3, "N"))
        for axis in ("fore-aft", "mediolateral")
    ]
    (group,) = grouped(offsets)
    assert "(also mediolateral on plate 1)" in group.line
