"""Which strides a mean is of."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.result.mean_cycles import common_strides, fits_by_task, main_task, mean_curves, mean_of_common
from kinertia.report.figures.cycle_figures import cycle_figures
from kinertia.report.pages.page import render

PERCENT = np.arange(101)


def curves(*spans, rise=1.0):
    """Ramps whose level is the number of the stride, known from one percent to another."""
    return np.array(
        [
            np.where((low <= PERCENT) & (high >= PERCENT), rise * PERCENT + 50.0 * k, np.nan)
            for k, (low, high) in enumerate(spans)
        ]
    )


def steps(mean):
    return np.abs(np.diff(mean[np.isfinite(mean)], n=2)).max()


def test_complete_strides_alone_are_averaged():
    values = curves((0, 100), (0, 60), (0, 100), (40, 100))
    assert common_strides(values).tolist() == [True, False, True, False]
    np.testing.assert_allclose(mean_of_common(values), PERCENT + 50.0)


def test_a_mean_has_no_step_where_a_stride_ends():
    """The mean of whatever is measured jumps by tens of units here; that of the same strides is a line."""
    values = curves((0, 95), (2, 97), (4, 99), (60, 100))
    known = np.isfinite(values)
    everything = np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0)
    assert steps(everything) > 10.0
    mean = mean_of_common(values)
    assert steps(mean) < 1e-9
    assert common_strides(values).tolist() == [True, True, True, False]
    assert np.flatnonzero(np.isfinite(mean)).tolist() == list(range(4, 96))


def test_strides_of_different_parts_are_not_joined():
    assert common_strides(curves((0, 40), (30, 100))).tolist() == [False, True]
    assert not common_strides(np.full((2, 101), np.nan)).any()
    assert np.isnan(mean_of_common(np.full((2, 101), np.nan))).all()


def of_task(trial, task, name=None):
    k = trial.kinematics
    return replace(trial, kinematics=replace(k, trial=replace(k.trial, name=name or trial.name, task=task)))


@pytest.fixture
def both(fit):
    """A walk, and a turn with twice the angles."""
    (walk,) = fit.trials
    motion = replace(walk.motion, q=2.0 * walk.motion.q)
    curves = replace(walk.joint_curves, motion=replace(walk.joint_curves.motion, q=2.0 * walk.joint_curves.motion.q))
    turn = replace(of_task(walk, "turn", "turn"), motion=motion, joint_curves=curves)
    posterior = replace(fit.posterior, marker_noise=fit.posterior.marker_noise * 2)
    return replace(fit, trials=(turn, of_task(walk, "walk")), posterior=posterior)


def test_walks_come_first(both):
    tasks = fits_by_task(both)
    assert {task: [trial.name for trial in task_fit.trials] for task, task_fit in tasks.items()} == {
        "walk": ["walk"],
        "turn": ["turn"],
    }
    assert list(tasks) == ["walk", "turn"]
    assert [trial.name for trial in main_task(both).trials] == ["walk"]


def test_results_of_earlier_versions_have_one_task(fit):
    (walk,) = fit.trials
    old = replace(fit, trials=(of_task(walk, ""),))
    assert list(fits_by_task(old)) == [""]


def test_a_landing_and_a_squat_have_no_strides(fit):
    (walk,) = fit.trials
    assert walk.strides
    for task in ("landing", "squat"):
        assert of_task(walk, task).strides == ()
        alone = replace(fit, trials=(of_task(walk, task),))
        assert fits_by_task(alone) == {}
        assert main_task(alone) is alone
        assert cycle_figures(alone) == {}


def test_means_are_of_one_task(fit, both):
    walks, alone = mean_curves(both), mean_curves(fit)
    assert walks.keys() == alone.keys()
    for name, curve in alone.items():
        np.testing.assert_array_equal(walks[name], curve)


def test_figures_and_report_show_each_task_by_itself(fit, both):
    drawn, alone = cycle_figures(both), cycle_figures(fit)
    assert [figure.alt for figure in drawn.values()] == [figure.alt for figure in alone.values()]
    assert [len(figure.data) for figure in drawn.values()] == [len(figure.data) for figure in alone.values()]
    page = render(both)
    assert 'id="cycle-turn"' in page
    assert page.count('href="#cycle-turn"') == 1
    assert 'id="cycle-turn"' not in render(fit)


def test_the_report_has_a_table_of_peaks_per_task(fit, both):
    assert render(fit).count("knee adduction impulse, external (N m s/kg)") == 1
    assert render(both).count("knee adduction impulse, external (N m s/kg)") == 2
