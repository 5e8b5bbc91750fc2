"""Converts curves and posterior draws of a fit to xarray Datasets, for netCDF, ArviZ and others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from kinertia.errors import KinertiaError, how_to_install
from kinertia.estimation.result.cycles import UNITS, cycle_curves
from kinertia.estimation.result.drawn_fit import chosen_draws, drawn_fit
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.io.versions import VERSION
from kinertia.model.bsp import PARAMETERS
from kinertia.trial.data import FEET

if TYPE_CHECKING:
    from xarray import Dataset

_OVER_TIME = {"angle": "deg", "moment": "N m", "joint_moment": "N m"}
_DRAWN_ALONG = {"angle": "joint", "moment": "joint", "joint_moment": "component"}
"""Names of the dimension of draws that stands for joints, or for the components of their moments."""
_TIME_DIGITS = 6
"""Decimals of times (s): times that differ by less are the same frame."""


def curve_dataset(fit: Fit, kind: str, over: str) -> Dataset:
    """Convert curves as `Fit.to_xarray` returns them."""
    units = {str(name): unit for name, unit in UNITS.items()} if over == "percent" else _OVER_TIME
    if over not in ("percent", "time") or kind not in units:
        hint = f"over='percent' has {', '.join(UNITS)}; over='time' {', '.join(_OVER_TIME)}"
        raise KinertiaError(f"no curves of {kind!r} over {over!r}: {hint}")
    build = _over_percent if over == "percent" else _over_time
    return _dataset(fit, kind, units[kind], *build(fit, kind))


def draw_dataset(fit: Fit, count: int, seed: int) -> Dataset:
    """Convert draws as `Fit.draws_to_xarray` returns them."""
    xarray = _xarray()
    drawn = [drawn_fit(fit, number) for number in chosen_draws(fit, count, seed)]
    times, sample = _times(fit.trials), ("chain", "draw")
    names = {kind: shown for kind in _OVER_TIME if (shown := _names(fit, kind))}
    variables: dict[str, Any] = {}
    for kind, shown in names.items():
        values = np.full((1, count, len(fit.trials), len(times), len(shown)), np.nan)
        for n, draw in enumerate(drawn):
            for k, trial in enumerate(draw.trials):
                curves = _over_own_time(trial, kind)
                values[0, n, k, _rows(curves.time, times)] = curves.values
        variables[kind] = (*sample, "trial", "time", _DRAWN_ALONG[kind]), values, {"units": _OVER_TIME[kind]}
    tables = np.array([draw.estimate.table() for draw in drawn])[None]
    by_parameter = "kg (mass), m (com), kg m2 (inertia)"
    variables["bsp"] = ((*sample, "segment", "parameter"), tables, {"units": by_parameter})
    coordinates = {
        "chain": [0],
        "draw": np.arange(count),
        "trial": [trial.name for trial in fit.trials],
        "time": ("time", times, {"units": "s"}),
        **{_DRAWN_ALONG[kind]: shown for kind, shown in names.items()},
        "segment": list(fit.estimate.segments),
        "parameter": list(PARAMETERS),
    }
    return xarray.Dataset(variables, coordinates, _attributes(fit))


def _over_percent(fit: Fit, kind: str) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Return coordinates, values and SDs by trial, side, stride, percent and joint."""
    curves = [curve for trial in fit.trials for curve in cycle_curves(trial, fit.mass_kg) if curve.kind == kind]
    if not curves:
        raise KinertiaError('there are no strides, and no curves over the gait cycle: ask for over="time"')
    trials = [trial.name for trial in fit.trials]
    strides = list(range(1, 1 + max(curve.stride.number for curve in curves)))
    joints = list(dict.fromkeys(curve.quantity.removesuffix(f"_{kind}") for curve in curves))
    percent = np.arange(len(curves[0].value))
    value, sd = np.full((2, len(trials), len(FEET), len(strides), len(percent), len(joints)), np.nan)
    for curve in curves:
        joint = joints.index(curve.quantity.removesuffix(f"_{kind}"))
        at = trials.index(curve.trial), FEET.index(curve.stride.side), curve.stride.number - 1, slice(None), joint
        value[at], sd[at] = curve.value, curve.sd
    along = {"percent": ("percent", percent, {"units": "% of the gait cycle"})}
    return {"trial": trials, "side": list(FEET), "stride": strides, **along, "joint": joints}, value, sd


def _over_time(fit: Fit, kind: str) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Return coordinates, values and SDs by trial, time and joint."""
    times, names = _times(fit.trials), _names(fit, kind)
    if not names:
        raise KinertiaError(f"no curves of {kind!r}: the two-level method has none")
    value, sd = np.full((2, len(fit.trials), len(times), len(names)), np.nan)
    for k, trial in enumerate(fit.trials):
        curve = _over_own_time(trial, kind)
        rows = _rows(curve.time, times)
        value[k, rows] = curve.values
        if curve.sd is not None:
            sd[k, rows] = curve.sd
    along = {"time": ("time", times, {"units": "s"})}
    return {"trial": [trial.name for trial in fit.trials], **along, "joint": names}, value, sd


def _dataset(
    fit: Fit, kind: str, unit: str, coordinates: Mapping[str, Any], value: np.ndarray, sd: np.ndarray
) -> Dataset:
    named = {"units": unit, "long_name": f"joint {kind}" if kind != "force" else "ground reaction"}
    spread = {"units": unit, "long_name": "posterior standard deviation"}
    dims = tuple(coordinates)
    variables = {"value": (dims, value, named), "sd": (dims, sd, spread)}
    return _xarray().Dataset(variables, coordinates, _attributes(fit))


def _attributes(fit: Fit) -> dict[str, str | float]:
    """Return attributes of the whole Dataset; numbers and texts, as netCDF requires."""
    return {"kinertia": VERSION, "subject": fit.subject.name, "mass_kg": fit.mass_kg, "method": fit.settings.method}


class _OverTime(NamedTuple):
    """Curves (f, r) of a trial at f times (s), in deg or N m, and their SDs, where there are any."""

    time: np.ndarray
    values: np.ndarray
    sd: np.ndarray | None


def _over_own_time(trial: TrialFit, kind: str) -> _OverTime:
    """Return the curves of a trial wherever they are known; NaN between."""
    curves, turns = trial.joint_curves, trial.skeleton.rotational
    deviations = trial.deviations if curves is None else curves.deviations
    if kind == "joint_moment":
        time = _time(trial)
        if curves is None:
            return _OverTime(time, np.empty((len(time), 0)), None)
        sd = None if curves.moment_sd is None else curves.moment_sd.reshape(len(time), -1)
        return _OverTime(time, curves.joints["estimate"].moments.reshape(len(time), -1), sd)
    if kind == "angle":
        q = trial.motion.q
        if curves is not None:
            q = np.where(np.logical_or.reduce(curves.known, axis=1, keepdims=True), curves.motion.q, np.nan)
        sd = None if deviations is None else np.degrees(deviations.coordinates[:, turns])
        return _OverTime(_time(trial), np.degrees(q[:, turns]), sd)
    loads = trial.joint_loads if curves is None else curves.forces
    sd = None if deviations is None else deviations.moments[:, turns]
    return _OverTime(_time(trial), loads["estimate"][:, turns], sd)


def _names(fit: Fit, kind: str) -> list[str]:
    """Return the coordinates that are angles, or the components of joint moments; none of these without any."""
    if kind != "joint_moment":
        return [name for name, turns in zip(fit.skeleton.coordinates, fit.skeleton.rotational, strict=True) if turns]
    curves = [trial.joint_curves for trial in fit.trials if trial.joint_curves is not None]
    return list(curves[0].joints["estimate"].names) if curves else []


def _time(trial: TrialFit) -> np.ndarray:
    """Return the times of a trial's curves, s."""
    return trial.time if trial.joint_curves is None else trial.joint_curves.time


def _times(trials: Sequence[TrialFit]) -> np.ndarray:
    """Return the times (t,) s of all trials."""
    return np.unique(np.concatenate([np.round(_time(trial), _TIME_DIGITS) for trial in trials]))


def _rows(time: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the rows (f,) of a trial's frames among these times."""
    return np.searchsorted(times, np.round(time, _TIME_DIGITS))


def _xarray() -> Any:
    try:
        import xarray
    except ImportError as error:
        message = f"Datasets need xarray, which is not installed: {how_to_install('xarray')}"
        raise KinertiaError(message) from error
    return xarray
