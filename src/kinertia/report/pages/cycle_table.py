"""Tabulates strides: spatiotemporal measures, and peaks of joint moments, per side."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kinertia.estimation.result.cycles import CycleCurve, peak_columns, spatiotemporal_columns
from kinertia.estimation.result.fit import Fit
from kinertia.report.wording import INTERVAL_SD
from kinertia.trial.data import FEET

_ROWS = (
    ("speed_m_s", "speed (m/s)", 2),
    ("cadence_steps_min", "cadence (steps/min)", 1),
    ("stride_length_m", "stride length (m)", 3),
    ("step_length_m", "step length (m)", 3),
    ("stride_time_s", "stride time (s)", 3),
    ("step_time_s", "step time (s)", 3),
    ("step_width_m", "step width (m)", 3),
    ("stance_percent", "stance (% of the cycle)", 1),
    ("double_support_percent", "double support (% of the cycle)", 1),
)


class MeasureRow(NamedTuple):
    """One measure in words, with mean and standard deviation per side."""

    measure: str
    right: str
    left: str


def stride_rows(fit: Fit) -> list[MeasureRow]:
    """Return the table's rows; none where no trial has a stride."""
    columns = spatiotemporal_columns(fit.trials)
    if not columns["side"]:
        return []
    sides = np.array(columns["side"])
    rows = [
        MeasureRow(title, *(_mean_and_sd(np.array(columns[name])[sides == side], digits) for side in FEET))
        for name, title, digits in _ROWS
    ]
    return [MeasureRow("strides", *(str(int((sides == side).sum())) for side in FEET)), *rows]


def peak_rows(curves: Sequence[CycleCurve]) -> list[MeasureRow]:
    """Return the table's rows of peaks and impulses: mean over the strides that contain them ± its 95 % interval.

    The errors of the strides of a trial are mostly equal, so that their mean is taken to be as uncertain as each.
    """
    columns = peak_columns(curves)
    values, sds = (np.array(columns[name], dtype=float) for name in ("value", "sd"))
    rows = []
    for peak, unit in dict.fromkeys(zip(columns["peak"], columns["unit"], strict=True)):
        of_peak = np.array(columns["peak"]) == peak
        sides = [of_peak & (np.array(columns["side"]) == side) for side in FEET]
        rows.append(MeasureRow(f"{peak} ({unit})", *(_with_interval(values[some], sds[some]) for some in sides)))
    return rows


def _with_interval(values: np.ndarray, sd: np.ndarray) -> str:
    known = np.isfinite(values)
    if not known.any():
        return "–"
    bar = INTERVAL_SD * float(np.sqrt(np.mean(np.square(sd[known]))))
    return f"{values[known].mean():.2f}" + (f" ± {bar:.2f}" if np.isfinite(bar) else "")


def _mean_and_sd(values: np.ndarray, digits: int) -> str:
    """Format the mean, with the standard deviation if there are several values."""
    known = values[np.isfinite(values)]
    if not len(known):
        return "–"
    if len(known) == 1:
        return f"{known[0]:.{digits}f}"
    return f"{known.mean():.{digits}f} ± {known.std(ddof=1):.{digits}f}"
