"""Tabulates strides: mean and standard deviation of the spatiotemporal measures, per side."""

from typing import NamedTuple

import numpy as np

from kinertia.estimation.cycles import spatiotemporal_columns
from kinertia.estimation.result import Fit
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


def _mean_and_sd(values: np.ndarray, digits: int) -> str:
    """Format the mean, with the standard deviation if there are several values."""
    known = values[np.isfinite(values)]
    if not len(known):
        return "–"
    if len(known) == 1:
        return f"{known[0]:.{digits}f}"
    return f"{known.mean():.{digits}f} ± {known.std(ddof=1):.{digits}f}"
