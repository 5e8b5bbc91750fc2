"""Curves of several draws at once are those of one drawn fit after another."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.changes.stride_features import usual_sources
from kinertia.estimation.result.curve_source import CurveSource
from kinertia.estimation.result.drawn_fit import DrawnCurves, drawn_bodies, drawn_fit, drawn_joints

NUMBERS = [0, 3, 4]


@pytest.mark.parametrize("source", ["all", "body", "instruments"])
def test_curves_of_several_draws(fit, source):
    draws, (trial,) = usual_sources(fit)[source], fit.trials
    models = [(drawn_joints(fit.skeleton, draws, n), drawn_bodies(fit.estimate, draws, n)) for n in NUMBERS]
    found = DrawnCurves.of(trial, draws.trials[0], NUMBERS, models, source == "all")
    time = np.linspace(*trial.joint_curves.time[[0, -1]], 301)
    angles, moments = found.angle(time), found.joint_moment(time)
    drawn = replace(fit, posterior=replace(fit.posterior, draws=draws))
    for place, number in enumerate(NUMBERS):
        single_draw = CurveSource(drawn_fit(drawn, number, source == "all").trials[0], "estimate")
        np.testing.assert_allclose(angles[..., place], single_draw.angle(time), rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(moments[..., place], single_draw.joint_moment(time), rtol=1e-10, atol=1e-9)
    assert np.isfinite(moments).any()
    assert np.nanmax(np.ptp(moments, axis=3)) > 0.1
    assert (np.nanmax(np.ptp(angles, axis=2)) > 1e-4) == (source == "all")


def test_a_displaced_ankle_is_the_same_in_all_curves_of_a_draw(fit):
    """It changes adduction moments in proportion to the force along the shank, and those of no other joint."""
    draws, (trial,) = fit.posterior.draws, fit.trials
    models = [(drawn_joints(fit.skeleton, draws, n), drawn_bodies(fit.estimate, draws, n)) for n in NUMBERS]
    usual, displaced = (
        DrawnCurves.of(trial, draws.trials[0], NUMBERS, models, True, ankles) for ankles in (False, True)
    )
    time = trial.joint_curves.time[::5]
    changes = displaced.joint_moment(time) - usual.joint_moment(time)
    labels = trial.joint_curves.joints["estimate"].joints
    ankles = [k for k, label in enumerate(labels) if label.startswith("ankle")]
    others = np.delete(changes, ankles, axis=1)
    assert not np.nan_to_num(others).any()
    for k in ankles:
        up_n = trial.joint_curves.joints["estimate"].forces[::5, k, 1]
        for place in range(len(NUMBERS)):
            known = np.isfinite(changes[:, k, 1, place] + up_n)
            assert abs(np.corrcoef(changes[known, k, 1, place], up_n[known])[0, 1]) > 0.99
