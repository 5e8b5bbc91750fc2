"""Converts curves and posterior draws of a fit to xarray Datasets, for netCDF, ArviZ and others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kinertia.errors import KinertiaError, how_to_install
from kinertia.estimation.cycles import UNITS, cycle_curves
from kinertia.estimation.drawn_fit import chosen_draws, drawn_fit
from kinertia.estimation.result import Fit, TrialFit
from kinertia.io.provenance import VERSION
from kinertia.model.bsp import PARAMETERS
from kinertia.trial.data import FEET

if TYPE_CHECKING:
    from xarray import Dataset

_OVER_TIME = {"angle": "deg", "moment": "N m"}
_TIME_DIGITS = 6
"""Decimals of times (s): times that differ by less are the same frame."""


def curve_dataset(fit: Fit, kind: str, over: str) -> Dataset:
    """Convert curves as `Fit.to_xarray` returns them."""
    units = {str(name): unit for name, unit in UNITS.items()} if over == "percent" else _OVER_TIME
    if over not in ("percent", "time") or kind not in units:
        hint = "over='percent' has angle, clinical, moment, power and force, over='time' angle and moment"
        raise KinertiaError(f"no curves of {kind!r} over {over!r}: {hint}")
    build = _over_percent if over == "percent" else _over_time
    return _dataset(fit, kind, units[kind], *build(fit, kind))


def draw_dataset(fit: Fit, count: int, seed: int) -> Dataset:
    """Convert draws as `Fit.draws_to_xarray` returns them."""
    xarray = _xarray()
    drawn = [drawn_fit(fit, number) for number in chosen_draws(fit, count, seed)]
    times, joints = _times(fit.trials), _joints(fit)
    shape = (1, count, len(fit.trials), len(times), len(joints))
    values = {kind: np.full(shape, np.nan) for kind in _OVER_TIME}
    for n, one in enumerate(drawn):
        for k, trial in enumerate(one.trials):
            rows = _rows(trial, times)
            for kind, value in values.items():
                value[0, n, k, rows] = _over_own_time(trial, kind)[:, fit.skeleton.rotational]
    dims, sample = ("trial", "time", "joint"), ("chain", "draw")
    variables: dict[str, Any] = {
        kind: ((*sample, *dims), value, {"units": _OVER_TIME[kind]}) for kind, value in values.items()
    }
    tables = np.array([one.estimate.table() for one in drawn])[None]
    by_parameter = "kg (mass), m (com), kg m2 (inertia)"
    variables["bsp"] = ((*sample, "segment", "parameter"), tables, {"units": by_parameter})
    coordinates = {
        "chain": [0],
        "draw": np.arange(count),
        "trial": [trial.name for trial in fit.trials],
        "time": ("time", times, {"units": "s"}),
        "joint": joints,
        "segment": list(fit.estimate.segments),
        "parameter": list(PARAMETERS),
    }
    return xarray.Dataset(variables, coordinates, _attributes(fit))


def _over_percent(fit: Fit, kind: str) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Return coordinates, values and SDs by trial, side, stride, percent and joint."""
    curves = [one for trial in fit.trials for one in cycle_curves(trial, fit.mass_kg) if one.kind == kind]
    if not curves:
        raise KinertiaError('there are no strides, and no curves over the gait cycle: ask for over="time"')
    trials = [trial.name for trial in fit.trials]
    strides = list(range(1, 1 + max(one.stride.number for one in curves)))
    joints = list(dict.fromkeys(one.quantity.removesuffix(f"_{kind}") for one in curves))
    percent = np.arange(len(curves[0].value))
    value, sd = np.full((2, len(trials), len(FEET), len(strides), len(percent), len(joints)), np.nan)
    for one in curves:
        joint = joints.index(one.quantity.removesuffix(f"_{kind}"))
        at = trials.index(one.trial), FEET.index(one.stride.side), one.stride.number - 1, slice(None), joint
        value[at], sd[at] = one.value, one.sd
    along = {"percent": ("percent", percent, {"units": "% of the gait cycle"})}
    return {"trial": trials, "side": list(FEET), "stride": strides, **along, "joint": joints}, value, sd


def _over_time(fit: Fit, kind: str) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Return coordinates, values and SDs by trial, time and joint."""
    times, joints, turns = _times(fit.trials), _joints(fit), fit.skeleton.rotational
    value, sd = np.full((2, len(fit.trials), len(times), len(joints)), np.nan)
    for k, trial in enumerate(fit.trials):
        rows = _rows(trial, times)
        value[k, rows] = _over_own_time(trial, kind)[:, turns]
        if trial.deviations is not None:
            angle, moment = np.degrees(trial.deviations.coordinates), trial.deviations.moments
            sd[k, rows] = (angle if kind == "angle" else moment)[:, turns]
    along = {"time": ("time", times, {"units": "s"})}
    return {"trial": [trial.name for trial in fit.trials], **along, "joint": joints}, value, sd


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


def _joints(fit: Fit) -> list[str]:
    """Return the coordinates that are angles."""
    return [name for name, turns in zip(fit.skeleton.coordinates, fit.skeleton.rotational, strict=True) if turns]


def _times(trials: Sequence[TrialFit]) -> np.ndarray:
    """Return the times (t,) s of all trials."""
    return np.unique(np.concatenate([np.round(trial.time, _TIME_DIGITS) for trial in trials]))


def _rows(trial: TrialFit, times: np.ndarray) -> np.ndarray:
    """Return the rows (w,) of a trial's frames among these times."""
    return np.searchsorted(times, np.round(trial.time, _TIME_DIGITS))


def _over_own_time(trial: TrialFit, kind: str) -> np.ndarray:
    """Return values (w, c) in deg or N m over the trial's own time."""
    return np.degrees(trial.motion.q) if kind == "angle" else trial.joint_loads["estimate"]


def _xarray() -> Any:
    try:
        import xarray
    except ImportError as error:
        message = f"Datasets need xarray, which is not installed: {how_to_install('xarray')}"
        raise KinertiaError(message) from error
    return xarray
