"""Reads joint angles, moments and powers in a C3D file that Vicon or another program computed."""

from __future__ import annotations

import re
from collections.abc import Sequence, Set
from typing import Any

import numpy as np

from kinertia.io.ezc3d_library import parameter_values
from kinertia.trial.data import FloatArray
from kinertia.trial.file_outputs import FileOutputs

_NAME = re.compile(r"(?:.*:)?([LR])(Vicon)?((?:Hip|Knee|Ankle)(?:Angles|Moment|Power))")
_UNITS = {
    "Angles": ("ANGLE_UNITS", {"deg": 1.0, "degrees": 1.0, "rad": 180.0 / np.pi}),
    "Moment": ("MOMENT_UNITS", {"nmm": 1e-3, "n.mm": 1e-3, "nm": 1.0, "n.m": 1.0}),
    "Power": ("POWER_UNITS", {"w": 1.0, "mw": 1e-3}),
}


def file_outputs(
    parameters: Any, labels: Sequence[str], points: FloatArray, time: FloatArray, ours: Set[str]
) -> FileOutputs | None:
    """Outputs of hips, knees and ankles, in SI units and degrees; None where there are none.

    Where a file has "LViconHipAngles" beside "LHipAngles" of another model, Vicon's count. Those in unknown units are
    left out.

    Args:
        parameters: of the file.
        labels: of its points.
        points: (f, p, 3) in the file's units.
        time: (f,) s.
        ours: labels of what Kinertia wrote.
    """
    found: dict[str, tuple[bool, FloatArray]] = {}
    for k, label in enumerate(labels):
        match = None if label in ours else _NAME.fullmatch(label)
        if match is None:
            continue
        name, vicon = match[1] + match[3], match[2] is not None
        factor = _factor(parameters, name)
        values = np.where((points[:, k] == 0.0).all(axis=1)[:, None], np.nan, points[:, k])
        if factor is not None and np.isfinite(values).any() and (vicon or name not in found):
            found[name] = vicon, factor * values
    return FileOutputs(time, {name: values for name, (_, values) in found.items()}) if found else None


def _factor(parameters: Any, name: str) -> float | None:
    parameter, known = next(units for kind, units in _UNITS.items() if name.endswith(kind))
    unit = str(parameter_values(parameters, "POINT", parameter, [""])[0]).strip().lower().removesuffix("/kg")
    return known.get(unit) if unit else next(iter(known.values()))
