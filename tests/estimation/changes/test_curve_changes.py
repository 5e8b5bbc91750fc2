"""Curves of two conditions: the simultaneous band holds the true difference at all percents together."""

import numpy as np
import pytest

from kinertia.estimation.changes.curve_changes import CurveChange, curve_changes, paired, rows_of
from kinertia.estimation.changes.stride_features import Rows
from kinertia.motion.gait_cycle import PERCENT
from kinertia.report.comparison.change_tables import curve_columns, curve_figures, joint_figure

_PHASE = 2.0 * np.pi * PERCENT / 100.0
SHAPES = np.array([np.ones(101), np.sin(_PHASE), np.cos(_PHASE), np.sin(2 * _PHASE), np.cos(3 * _PHASE)])
TRUTH = 0.1 * np.exp(-np.square((PERCENT - 30.0) / 10.0))


def wavy(rng, sd, count):
    """Smooth random curves (count, 101)."""
    return sd / np.sqrt(3.0) * rng.standard_normal((count, len(SHAPES))) @ SHAPES


def conditions(seed, strides=4, change=1.0, measured_sd=0.01, stride_sd=0.02, contacts_sd=0.0):
    """One curve of both sides in two conditions, each stride with errors of its own and of all."""
    rng = np.random.default_rng(seed)
    rows = []
    common, drawn_common = 0.3 * wavy(rng, 1.0, 1), 0.3 * wavy(rng, 1.0, 60)
    for second in (False, True):
        keys, estimate, drawn = [], [], []
        for side in "rl":
            for k in range(strides):
                truth = second * change * TRUTH + wavy(rng, stride_sd, 1)[0]
                curve = truth + common[0] + wavy(rng, measured_sd, 1)[0]
                keys.append((f"{second} {k}", "moment knee_adduction", side, "stride 1"))
                estimate.append(curve)
                drawn.append(curve + drawn_common + wavy(rng, measured_sd, 60))
        values = np.array(estimate)
        contacts = np.full((1, *values.shape), contacts_sd * second)
        rows.append(Rows(tuple(keys), values, {"all": np.swapaxes(drawn, 0, 1), "contacts": contacts}))
    return rows


def compared(seed, *options, **more):
    """What changed between two conditions; arguments as of `conditions`."""
    return list(curve_changes(*conditions(seed, *options, **more), paired))


def test_the_order_of_conditions_is_the_sign_of_the_change():
    """Although one has twice as many strides as the other."""
    before, after = conditions(0)
    after = rows_of(after, np.array([True, True, False, False] * 2))
    there, back = (next(curve_changes(*pair, paired)) for pair in ((before, after), (after, before)))
    assert (there.strides, back.strides) == ((4, 2), (2, 4))
    np.testing.assert_allclose(back.difference, -there.difference)
    np.testing.assert_allclose(back.sd, there.sd)


def test_an_error_of_contacts_widens_the_band():
    (first, _), (other, _) = compared(0), compared(0, contacts_sd=0.05)
    np.testing.assert_allclose(np.square(other.sd) - np.square(first.sd), 0.05**2)


@pytest.mark.parametrize(
    ("measured_sd", "stride_sd"), [(0.02, 0.005), pytest.param(0.005, 0.02, marks=pytest.mark.slow)]
)
def test_the_band_holds_the_whole_curve(measured_sd, stride_sd):
    """Whether markers or strides vary more; a band of each percent alone would hold it far less often."""
    together, alone = [], []
    for seed in range(150):
        for change in compared(seed, measured_sd=measured_sd, stride_sd=stride_sd):
            low, high = change.band
            together.append(((low <= TRUTH) & (high >= TRUTH)).all())
            alone.append((np.abs(change.difference - TRUTH) <= 1.96 * change.sd).all())
    assert 0.92 <= np.mean(together) <= 0.995
    assert np.mean(alone) < 0.85


@pytest.mark.slow
def test_a_change_is_shown_where_it_is():
    found = [change for seed in range(20) for change in compared(seed, 5, 1.0, 0.005, 0.01)]
    assert np.mean([change.changed[30] for change in found]) > 0.9
    assert np.mean([change.changed[90] for change in found]) < 0.1
    none = [change.changed.any() for seed in range(150) for change in compared(seed, 5, 0.0, 0.005, 0.01)]
    assert np.mean(none) < 0.08


def test_single_strides_have_no_band():
    for change in compared(0, strides=1):
        assert np.isnan(change.factor)
        assert not change.changed.any()
        assert np.isfinite(change.difference).all()


def test_tables_and_figures_have_every_curve():
    found = compared(0)
    columns = curve_columns(found)
    assert {len(values) for values in columns.values()} == {2 * 101}
    assert columns["lower"][130] == pytest.approx(found[1].band[0][29])
    assert [curve_figure["title"] for curve_figure in curve_figures(found, "a", "b")] == ["Knee moments"]
    figure = joint_figure(found, "Knee moments", "a", "<b>")
    assert len([trace for trace in figure.data if trace.get("name") == "difference"]) == 2
    assert "<b>" not in str([trace.get("name") for trace in figure.data])


def test_strides_or_stances_are_chosen_by_their_number():
    rows = []
    for _ in range(2):
        keys = [
            ("walk", "angle knee_angle", "r", "stride 1"),
            *(("walk", "angle knee_angle", "r", f"stance {k}") for k in (2, 3)),
        ]
        values = np.arange(3.0)[:, None] * np.ones(101)
        rows.append(
            Rows(tuple(keys), values, {"all": np.array([values, values + 1.0]), "contacts": 0.0 * values[None]})
        )
    (found,) = curve_changes(*rows, paired)
    assert isinstance(found, CurveChange)
    assert (found.phase, found.strides) == ("stance", (2, 2))
