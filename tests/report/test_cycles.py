"""Curves over the gait cycle: the table, its file, and the figures that are drawn from the same numbers."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from kinertia.io.norms_file import Norm
from kinertia.io.sto import read_sto
from kinertia.report.cycle_figures import cycle_figure, cycle_figures
from kinertia.report.cycle_table import stride_rows
from kinertia.report.files import save_fit
from kinertia.report.page import render
from report_page import Elements


@pytest.fixture(scope="module")
def cycles(fit):
    return fit.cycles()


def of(cycles, quantity, side, stride=1):
    rows = cycles[(cycles.quantity == quantity) & (cycles.side == side) & (cycles.stride == stride)]
    return rows.set_index("percent")


def test_columns_and_percents(cycles):
    assert list(cycles.columns) == ["trial", "side", "stride", "percent", "quantity", "value", "sd"]
    sizes = cycles.groupby(["trial", "side", "stride", "quantity"]).percent.agg(["min", "max", "size"])
    assert (sizes == [0, 100, 101]).all().all()


def test_values_are_those_over_time(fit, cycles):
    """At 0 to 100 % of a stride what the tables over time say then, in the units of gait reports."""
    (trial,) = fit.trials
    times = {(stride.side, stride.number): stride.time for stride in trial.strides}
    assert len(times) >= 2
    for (side, number), at in times.items():
        inside = (at >= trial.time[0]) & (at <= trial.time[-1])

        def over_time(table, side=side, at=at[inside]):
            return np.interp(at, table.index, table[f"knee_angle_{side}"])

        moment, angle = of(cycles, "knee_angle_moment", side, number), of(cycles, "knee_angle_angle", side, number)
        gap = moment.value[inside] - over_time(trial.moments["estimate"]) / fit.subject.mass_kg
        scale = np.abs(moment.value).max()
        assert np.abs(gap).max() < 0.05 * scale  # a line between frames cuts a peak off
        assert np.abs(gap).median() < 0.003 * scale
        np.testing.assert_allclose(angle.value[inside], np.degrees(over_time(trial.coordinates)), atol=0.2)
        sd = over_time(trial.moment_sd) / fit.subject.mass_kg
        np.testing.assert_allclose(moment.sd[inside], sd, rtol=1e-9)
        assert np.array_equal(moment.value.notna(), inside)
        assert np.array_equal(angle.value.notna(), inside)


def test_power_is_moment_times_velocity(fit, cycles):
    """Over a measured stretch the work is what the moment does on the way: both are in the table."""
    stride = fit.trials[0].strides[0]
    moment, power = (of(cycles, f"hip_flexion_{kind}", stride.side) for kind in ("moment", "power"))
    angle = np.radians(of(cycles, "hip_flexion_angle", stride.side).value.to_numpy())
    step_s = (stride.end_s - stride.start_s) / 100
    middle = (moment.value.to_numpy()[1:] + moment.value.to_numpy()[:-1]) / 2
    by_path = np.nansum(middle * np.diff(angle))
    by_time = np.nansum((power.value.to_numpy()[1:] + power.value.to_numpy()[:-1]) / 2) * step_s
    assert by_time == pytest.approx(by_path, abs=0.02 * np.nansum(np.abs(middle * np.diff(angle))))


def test_ground_reactions_are_shares_of_body_weight(fit, cycles):
    (trial,) = fit.trials
    usual = fit.cycles("literature")
    for stride in trial.strides:
        upward = of(usual, "ground_force_upward", stride.side, stride.number).value
        if upward.notna().sum() < 60:
            continue
        loads, foot = trial.kinematics.trial.loads, "rl".index(stride.side)
        measured = np.interp(stride.time, loads.time, loads.force[:, foot, 1])
        inside = upward.notna().to_numpy()
        expected = 100 * measured / (fit.subject.mass_kg * 9.80665)
        np.testing.assert_allclose(upward[inside], expected[inside], atol=1.0)
        assert upward.max() > 80
        forward = of(usual, "ground_force_forward", stride.side, stride.number).value
        assert forward[:30].min() < -5 or forward[30:].max() > 5  # brakes first, then pushes


@pytest.mark.slow
def test_frames_that_were_not_measured_are_gaps(short_fit):
    """Windows of 0.3 s in strides of 1 s: the rest is empty, not zero and not invented."""
    cycles = short_fit.cycles()
    share = cycles.value.notna().groupby(cycles.quantity).mean()
    assert share["knee_angle_moment"] < 0.5
    assert (cycles.groupby(["trial", "side", "stride", "quantity"]).value.count() > 0).all()
    assert cycles.sd.isna().all()  # two-level has no error bars
    angles = short_fit.cycles("literature")
    assert angles[angles.quantity == "knee_angle_angle"].value.notna().all()  # markers were seen all the time


def test_files_say_what_the_functions_say(fit, cycles, tmp_path):
    folder = save_fit(fit, tmp_path / "out")
    names = {"cycles.csv": cycles, "cycles_literature.csv": fit.cycles("literature")}
    for name, expected in {**names, "spatiotemporal.csv": fit.spatiotemporal}.items():
        pd.testing.assert_frame_equal(pd.read_csv(folder / name), expected, check_dtype=False, rtol=1e-15, atol=0)


def lines_of(figure, panel, ending):
    """The curves of one panel whose names end so, by side."""
    titles = [note["text"] for note in figure.layout["annotations"]]
    axis = next(f"x{k + 1 if k else ''}" for k, title in enumerate(titles) if panel in title)
    return {
        trace["name"].split(",")[0]: np.asarray(trace["y"])
        for trace in figure.data
        if trace["xaxis"] == axis and trace["name"].endswith(ending)
    }


def test_figures_draw_the_mean_of_the_strides(fit, cycles):
    figure = cycle_figure(fit, "moment")
    drawn = {**lines_of(figure, "Knee moment", ", mean"), **lines_of(figure, "Knee moment", ", one stride")}
    assert set(drawn) == {"right", "left"}
    for side, values in drawn.items():
        rows = cycles[(cycles.quantity == "knee_angle_moment") & (cycles.side == side[0])]
        np.testing.assert_allclose(values, rows.groupby("percent").value.mean(), rtol=1e-5, atol=1e-6)
    usual = lines_of(figure, "Knee moment", ", literature values")
    assert set(usual) == {"right", "left"}


def test_titles_tell_unit_and_sign(fit):
    figures = cycle_figures(fit)
    titles = {kind: [note["text"] for note in figure.layout["annotations"]] for kind, figure in figures.items()}
    assert "<b>Knee moment, flexion + (N m/kg)</b>" in titles["moment"]
    assert "<b>Hip power, flexion + (W/kg)</b>" in titles["power"]
    assert "<b>Knee flexion + (deg)</b>" in titles["angle"]
    assert titles["force"][1] == "<b>Upward + (% body weight)</b>"


def test_table_of_strides(fit):
    rows = {row.measure: row for row in stride_rows(fit)}
    table = fit.spatiotemporal
    right = table[table.side == "r"]
    assert rows["strides"].right == str(len(right))
    assert rows["cadence (steps/min)"].right.startswith(f"{right.cadence_steps_min.mean():.1f}")
    assert 90 < right.cadence_steps_min.mean() < 150


def test_a_motion_without_strides_stays_over_time(fit):
    (trial,) = fit.trials
    standing = replace(trial)
    standing.__dict__["strides"] = ()
    still = replace(fit, trials=(standing,))
    assert cycle_figures(still) == {}
    assert stride_rows(still) == []
    assert still.cycles().empty
    page = render(still)
    assert 'id="cycle"' not in page
    assert page.count('<details class="seconds" open>') == page.count('<details class="seconds"') >= 1
    walking = Elements(render(fit))
    assert "cycle-moment" in str(walking.__dict__)


def test_norms_are_bands_behind_the_curves(fit):
    norm = Norm(np.array([0.0, 50.0, 100.0]), np.array([0.1, 0.5, 0.2]), np.array([0.1, 0.2, 0.1]))
    plain, figure = (cycle_figures(fit, norms)["moment"] for norms in ({}, {"knee_angle_moment": norm}))
    titles = [note["text"] for note in figure.layout["annotations"]]
    knee = next(k for k, title in enumerate(titles) if title.startswith("<b>Knee moment"))
    (band,) = [trace for trace in figure.data if trace["name"] == "norm, mean ± SD"]
    assert band["xaxis"] == f"x{knee + 1}"
    assert band is next(trace for trace in figure.data if trace["xaxis"] == band["xaxis"]), "below all curves"
    np.testing.assert_allclose(band["x"], [0, 50, 100, 100, 50, 0])
    np.testing.assert_allclose(band["y"], [0.0, 0.3, 0.1, 0.3, 0.7, 0.2], atol=1e-7)
    assert len(figure.data) == len(plain.data) + 1
    assert "norms that were given" in render(fit, norms={"knee_angle_moment": norm})
    assert "norms that were given" not in render(fit)


FROM_OPENSIM = {
    "cycles_literature.csv": {"hip_flexion": 0.07, "hip_adduction": 0.07, "knee_angle": 0.04, "ankle_angle": 0.03},
    "cycles.csv": {"hip_flexion": 0.16, "hip_adduction": 0.08, "knee_angle": 0.05, "ankle_angle": 0.07},
}
"""Most RMS distance of moments from OpenSim's, N m/kg: of the usual pipeline since OpenSim's example weighs the markers
of the pelvis tenfold, which turns it by 8 degrees; of the estimate since its pelvis explains the forces, too."""


@pytest.mark.slow
@pytest.mark.parametrize("name", FROM_OPENSIM)
def test_moments_over_the_cycle_are_near_opensims_own(fit_with_model, shared_data, name):
    """OpenSim's inverse dynamics of its own example, which ends at 79 % of the only stride, with the same model."""
    folder = fit_with_model("gait2354", False)
    curves = pd.read_csv(folder / name).set_index(["side", "quantity", "percent"]).sort_index().value
    theirs = read_sto(shared_data / "gait2354" / "opensim_results" / "inverse_dynamics.sto")
    (stride,) = pd.read_csv(folder / "spatiotemporal.csv").itertuples()
    assert stride.side == "r"
    time = stride.start_s + np.arange(101) / 100 * (stride.end_s - stride.start_s)
    known = (time >= theirs.index[0]) & (time <= theirs.index[-1])
    assert 75 < known.sum() < 85
    for quantity, most in FROM_OPENSIM[name].items():
        ours = curves["r", f"{quantity}_moment"].to_numpy()[known]
        expected = np.interp(time, theirs.index, theirs[f"{quantity}_r_moment"])[known] / 72.6
        assert np.sqrt(np.mean((ours - expected) ** 2)) < most, quantity
        assert np.corrcoef(ours, expected)[0, 1] > 0.96, quantity
