"""Walking speed of two conditions: each walk counts once, and a changed speed is pointed out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.estimation.changes import change
from kinertia.estimation.changes.change import NOTABLE, profile_changes, speed_change
from kinertia.estimation.result.gait_scores import with_norms
from kinertia.io.norms_file import Norm
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.report.comparison.change_tables import change_rows, speed_sentence


@pytest.fixture
def walks(monkeypatch):
    """Walks of which the speed of each stride is stated."""
    monkeypatch.setattr(change, "_speeds", lambda trial: np.array(trial.speeds, dtype=float))

    monkeypatch.setattr(change, "_on_belt", lambda trial: trial.belt)

    def made(*speeds, belt=False):
        return [SimpleNamespace(speeds=speed, belt=belt) for speed in speeds]

    return made


def test_strides_of_one_walk_are_no_repeats(walks):
    found = speed_change(walks([1.0] * 9, [1.2] * 9), walks([1.1] * 9, [1.3] * 9))
    assert found.strides == (2, 2)
    assert found.difference == pytest.approx(0.1)
    assert found.sd == pytest.approx(np.sqrt(0.02 / 2 + 0.02 / 2))
    assert found.verdict == "not shown"
    assert found.mdc95 == pytest.approx(4.303 * found.sd, rel=1e-3), "2 degrees of freedom"


def test_one_walk_on_a_treadmill_counts_its_strides(walks):
    found = speed_change(*(walks([v, v + 0.02, v - 0.02], belt=True) for v in (1.0, 1.5)))
    assert (found.strides, found.verdict) == ((3, 3), "changed")
    assert "Moments change with speed" in speed_sentence(found)


def test_strides_of_one_walk_over_ground_do_not_show_how_walks_differ(walks):
    """Overlapping strides of one walk are alike; another walk of the same day differs more."""
    found = speed_change(walks([1.0, 1.02, 0.98]), walks([1.1, 1.12, 1.08]))
    assert (found.strides, found.verdict) == ((1, 1), "cannot be judged")
    (row,) = change_rows([found])
    assert row["needed"] == "–"
    assert found.walks_needed(0.1) is None
    mixed = speed_change(walks([1.0] * 3, belt=True), walks([1.1] * 3))
    assert mixed.verdict == "cannot be judged"


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


def test_who_stays_in_place_walks_on_a_treadmill(fit):
    (trial,) = fit.trials
    assert not change._on_belt(trial)
    names = trial.skeleton.coordinates
    still = trial.trajectory.copy()
    still[:, [names.index("pelvis_tx"), names.index("pelvis_tz")]] = 0.0
    assert change._on_belt(replace(trial, trajectory=still))


def test_the_gait_profile_score_of_each_side_is_compared(fit):
    """Each stride's score against norms of zero, as in `cycles.csv`; other norms give other scores."""
    norms = {name: Norm(np.array([0.0, 100.0]), np.zeros(2), np.ones(2)) for name in CLINICAL_ANGLES}
    columns = with_norms(fit.cycles().to_dict("list"), norms, fit.skeleton)
    known = {side: [g for s, g in zip(columns["side"], columns["gps"], strict=True) if s == side] for side in "rl"}
    found = {profile_change.side: profile_change for profile_change in profile_changes(fit.trials, fit.trials, norms)}
    assert found
    for side, changed in found.items():
        assert changed.before == pytest.approx(np.mean(list(dict.fromkeys(g for g in known[side] if np.isfinite(g)))))
        assert changed.difference == pytest.approx(0.0, abs=1e-12)
        assert (changed.quantity, changed.joint, changed.component, changed.unit) == (
            "gait",
            "gait profile",
            "score",
            "degrees",
        )
    higher = {name: replace(norm, mean=norm.mean + 30.0) for name, norm in norms.items()}
    (other, *_) = profile_changes(fit.trials, fit.trials, higher)
    assert other.before != pytest.approx(found[other.side].before)
