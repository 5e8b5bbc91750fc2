"""Fits as xarray Datasets: the numbers of the tables, with names, units and error bars; netCDF and ArviZ take them."""

import re

import numpy as np
import pytest

from kinertia.errors import KinertiaError, how_to_install
from kinertia.estimation.result.drawn_fit import drawn_fit

xarray = pytest.importorskip("xarray")


@pytest.mark.parametrize("kind", ["angle", "moment", "power", "force"])
def test_curves_over_the_gait_cycle_are_those_of_cycles(fit, kind):
    dataset = fit.to_xarray(kind)
    assert dataset.value.dims == ("trial", "side", "stride", "percent", "joint")
    cycles = fit.cycles()
    for joint in dataset.joint.values:
        name = str(joint) if kind == "force" else f"{joint}_{kind}"
        for (trial, side, stride), rows in cycles[cycles.quantity == name].groupby(["trial", "side", "stride"]):
            place = {"trial": trial, "side": side, "stride": stride, "joint": joint}
            np.testing.assert_array_equal(dataset.value.sel(place), rows.value)
            np.testing.assert_array_equal(dataset.sd.sel(place), rows.sd)
    assert dataset.value.attrs["units"] == {"angle": "deg", "power": "W/kg", "force": "% body weight"}.get(
        kind, "N m/kg"
    )
    assert dataset.sd.attrs["units"] == dataset.value.attrs["units"]


def test_curves_over_time(fit):
    dataset, (trial,) = fit.to_xarray("moment", over="time"), fit.trials
    curves, column = trial.joint_curves, fit.skeleton.coordinates.index("knee_angle_r")
    knee = dataset.sel(trial="walk", joint="knee_angle_r")
    np.testing.assert_array_equal(knee.value, curves.forces["estimate"][:, column])
    np.testing.assert_array_equal(knee.sd, curves.deviations.moments[:, column])
    np.testing.assert_allclose(dataset.time, curves.time, atol=1e-6)
    measured = knee.sel(time=trial.time, method="nearest")
    np.testing.assert_allclose(measured.value, trial.moments["estimate"].knee_angle_r)
    assert (dataset.value.attrs["units"], dataset.time.attrs["units"]) == ("N m", "s")
    assert "pelvis_tx" not in dataset.joint
    angle = fit.to_xarray("angle", over="time").value.sel(trial="walk", joint="knee_angle_r")
    np.testing.assert_allclose(angle.sel(time=trial.time, method="nearest"), np.degrees(trial.coordinates.knee_angle_r))


def test_joint_moments_over_time_are_those_of_the_trial_with_their_deviations(fit):
    dataset, curves = fit.to_xarray("joint_moment", over="time"), fit.trials[0].joint_curves
    joints = curves.joints["estimate"]
    assert dataset.joint.values.tolist() == list(joints.names)
    knee = dataset.sel(trial="walk", joint="knee_r_adduction")
    row = joints.joints.index("knee_r")
    np.testing.assert_array_equal(knee.value, joints.moments[:, row, 1])
    np.testing.assert_array_equal(knee.sd, curves.moment_sd[:, row, 1])
    known = knee.value.notnull()
    assert known.any()
    assert (knee.sd.where(known).dropna("time") > 0).all()


def test_there_are_no_joint_moments_over_time_without_curves(short_fit):
    with pytest.raises(KinertiaError, match="two-level"):
        short_fit.to_xarray("joint_moment", over="time")


def test_trials_stand_side_by_side(short_fit):
    """Two windows, at other times; without error bars."""
    dataset = short_fit.to_xarray("angle", over="time")
    assert dataset.trial.values.tolist() == ["early", "late"]
    for trial in short_fit.trials:
        curve = dataset.value.sel(trial=trial.name, joint="hip_flexion_l").dropna("time")
        np.testing.assert_allclose(curve, np.degrees(trial.coordinates.hip_flexion_l))
    assert dataset.sd.isnull().all()


def test_netcdf_brings_it_back(fit, tmp_path):
    dataset = fit.to_xarray("moment")
    dataset.to_netcdf(tmp_path / "moments.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "moments.nc", engine="scipy") as again:
        np.testing.assert_array_equal(again.value, dataset.value)
        assert again.value.attrs["units"] == "N m/kg"
        assert again.joint.values.tolist() == dataset.joint.values.tolist()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [(("speed",), "no curves of 'speed'"), (("power", "time"), "over='time' angle, moment, joint_moment")],
)
def test_what_there_is_not_is_refused(fit, arguments, told):
    with pytest.raises(KinertiaError, match=told):
        fit.to_xarray(*arguments)


def test_without_xarray_it_says_what_to_install(fit, without):
    without("xarray")
    with pytest.raises(KinertiaError, match=re.escape(how_to_install("xarray"))):
        fit.to_xarray()


def test_draws_are_those_of_the_fit(fit):
    draws = fit.draws_to_xarray(6, seed=2)
    assert draws.moment.dims == ("chain", "draw", "trial", "time", "joint")
    assert draws.sizes["draw"] == 6
    np.testing.assert_array_equal(fit.draws_to_xarray(6, seed=2).bsp, draws.bsp)
    first = fit.draws_to_xarray(2)
    second = drawn_fit(fit, 1)
    np.testing.assert_array_equal(first.bsp.sel(draw=1, segment="shank_r")[0], second.estimate.table()[3])
    np.testing.assert_array_equal(
        first.moment.sel(draw=1, joint="knee_angle_r")[0, 0],
        second.trials[0].joint_curves.forces["estimate"][:, fit.skeleton.coordinates.index("knee_angle_r")],
    )


@pytest.mark.slow
def test_draws_keep_the_covariance_of_the_components_of_joint_moments(fit):
    """Their spread is the standard deviation; components of one draw are those of one model and motion."""
    draws, curves = fit.draws_to_xarray(200), fit.trials[0].joint_curves
    names = list(curves.joints["estimate"].names)
    assert draws.joint_moment.dims == ("chain", "draw", "trial", "time", "component")
    assert draws.component.values.tolist() == names
    spread = draws.joint_moment.std("draw").values[0, 0]
    stated = curves.moment_sd.reshape(spread.shape)
    ratio = np.sqrt(np.nanmean(spread**2, axis=0) / np.nanmean(stated**2, axis=0))
    assert 0.8 < ratio[names.index("hip_r_flexion")] < 1.25
    assert 0.7 < ratio[names.index("knee_r_adduction")] < 1.3
    drawn = drawn_fit(fit, 1).trials[0].joint_curves.joints["estimate"].moments
    np.testing.assert_array_equal(draws.joint_moment[0, 1, 0].values, drawn.reshape(spread.shape))


@pytest.mark.slow
def test_arviz_summarises_draws(fit):
    arviz = pytest.importorskip("arviz")
    draws = fit.draws_to_xarray(150)[["bsp"]].sel(parameter="mass")
    table = arviz.summary(arviz.convert_to_inference_data(draws), kind="stats")
    np.testing.assert_allclose(table["mean"], fit.estimate.mass_kg, rtol=0.1)
    np.testing.assert_allclose(table["sd"], fit.posterior.sd[:, 0], rtol=0.3, atol=0.01)
