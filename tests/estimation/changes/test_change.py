"""Walking speed of two conditions: each walk counts once, and a changed speed is pointed out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.estimation.changes import change
from kinertia.estimation.changes.change import NOTABLE, speed_change
from kinertia.report.comparison.change_tables import speed_sentence


@pytest.fixture
def walks(monkeypatch):
    """Walks of which the speed of each stride is stated."""
    monkeypatch.setattr(change, "_speeds", lambda trial: np.array(trial.speeds, dtype=float))
    return lambda *speeds: [SimpleNamespace(speeds=own) for own in speeds]


def test_strides_of_one_walk_are_no_repeats(walks):
    found = speed_change(walks([1.0] * 9, [1.2] * 9), walks([1.1] * 9, [1.3] * 9))
    assert found.strides == (2, 2)
    assert found.difference == pytest.approx(0.1)
    assert found.sd == pytest.approx(np.sqrt(0.02 / 2 + 0.02 / 2))
    assert found.verdict == "not shown"
    assert found.mdc95 == pytest.approx(4.303 * found.sd, rel=1e-3), "2 degrees of freedom"


def test_one_walk_counts_its_strides(walks):
    found = speed_change(walks([1.0, 1.02, 0.98]), walks([1.5, 1.52, 1.48]))
    assert (found.strides, found.verdict) == ((3, 3), "changed")
    assert "Moments change with speed" in speed_sentence(found)


def test_a_difference_that_cannot_be_judged_is_still_pointed_out(walks):
    for share in (0.5 * NOTABLE, 2.0 * NOTABLE):
        found = speed_change(walks([1.0]), walks([1.0 + share]))
        assert found.verdict == "cannot be judged"
        assert ("Moments change with speed" in speed_sentence(found)) == (share > NOTABLE)


def test_an_unknown_speed_is_not_compared(walks):
    assert speed_change(walks([1.0]), walks([])) is None
    assert "not known" in speed_sentence(None)


def test_a_walk_without_strides_has_the_speed_of_its_pelvis(fit):
    (trial,) = fit.trials
    with_strides = change._speeds(trial)
    vars(alone := replace(trial))["strides"] = ()
    (speed,) = change._speeds(alone)
    assert speed == pytest.approx(with_strides.mean(), rel=0.05)
