"""One line per output: its level follows what the checks and the error bars say of it, and of nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.result.uses import uses
from kinertia.model.bsp import BodySegmentParameters

OUTPUTS = ["joint moments", "segment masses", "centres of mass", "moments of inertia", "motion"]


def by_output(fit):
    return {use.output: use for use in uses(fit)}


def informed(fit, share, columns):
    """The fit with this information on these columns of so large a share of the segments."""
    sd = fit.posterior.prior_sd.copy()
    rows = round(share * len(sd))
    sd[:rows, columns] *= np.sqrt(1 - 0.5)
    return replace(fit, posterior=replace(fit.posterior, sd=sd), warnings=())


def test_every_output_has_a_line_with_a_number(fit, two_level):
    assert [use.output for use in uses(fit)] == OUTPUTS
    for use in uses(fit):
        assert any(letter.isdigit() for letter in use.reason), use
        assert use.word in ("use", "use with care", "do not use")
    assert [use.level for use in uses(two_level)][1:4] in (["caution"] * 3, ["fail"] * 3)  # impossible or unknown


@pytest.mark.parametrize(("share", "expected"), [(0.0, "fail"), (0.25, "caution"), (1.0, "pass")])
def test_segments_by_what_the_data_show(fit, share, expected):
    outputs = by_output(informed(fit, share, slice(0, 1)))
    assert outputs["segment masses"].level == expected
    assert outputs["centres of mass"].level == outputs["moments of inertia"].level == "fail"
    if expected == "caution":
        assert outputs["segment masses"].reason.startswith("the data show 3 of 12 (0 of them well)")


def test_a_doubted_segment_is_a_caution_for_its_own_output(fit):
    clear = informed(fit, 1.0, slice(0, 10))
    table = clear.literature.table().copy()
    row = clear.literature.segments.index("shank_l")
    table[row, 2] += 3.2 * clear.posterior.prior_sd[row, 2]
    moved = replace(clear, estimate=BodySegmentParameters.from_table(clear.literature.segments, table))
    outputs = by_output(moved)
    assert outputs["centres of mass"].level == "caution"
    assert "shank_l" in outputs["centres of mass"].reason
    assert outputs["segment masses"].level == "pass"


def test_of_a_person_unlike_the_prior_nothing_is_used_without_care(fit):
    """Though no single parameter is far: an ankle weight's masses were to be used, 8 error bars from the truth."""
    clear = informed(fit, 1.0, slice(0, 7))
    whole = replace(clear.posterior.unlikeness, chance=1e-12)
    for use in uses(replace(clear, posterior=replace(clear.posterior, unlikeness=whole)))[1:4]:
        assert use.level == "caution"
        assert "1 of 1,000,000,000 people" in use.reason


def test_what_contradicts_the_model_is_not_used(fit):
    clear = informed(fit, 1.0, slice(0, 10))
    table = clear.literature.table().copy()
    table[:, 3] += 4.5 * clear.posterior.prior_sd[:, 3]
    moved = replace(clear, estimate=BodySegmentParameters.from_table(clear.literature.segments, table))
    outputs = by_output(moved)
    assert outputs["centres of mass"].level == "fail"
    assert "beyond 3 prior SDs" in outputs["centres of mass"].reason
    assert outputs["segment masses"].level == "pass"


def test_nothing_is_used_that_did_not_converge(fit):
    assert {use.level for use in uses(replace(fit, converged=False))} == {"fail"}


def test_warnings_count_for_joint_moments(fit):
    clear, warned = (by_output(replace(fit, warnings=said))["joint moments"] for said in ((), ("a plate is off",)))
    assert clear.level == "pass"
    assert warned.level == "caution"
    assert warned.reason.endswith("1 warning below")
