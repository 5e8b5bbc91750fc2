"""Computes gait scores variable by variable and stride by stride, and defines `GaitProfile`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kinertia.io.norms_file import Norm
from kinertia.model.skeleton import Skeleton, opposite_on_left
from kinertia.motion.gait_cycle import PERCENT
from kinertia.motion.model_outputs import CLINICAL_ANGLES

if TYPE_CHECKING:
    import pandas as pd

OVERALL = "all fifteen"
"""What the person's score is of."""
_LEAST_MEASURED = 0.95
"""Least share of the cycle in which a curve must be known."""


@dataclass(frozen=True, eq=False)
class GaitProfile:
    """Gait scores of one person, in degrees; NaN where a curve is not known over the cycle.

    Attributes:
        gvs_deg: Gait Variable Score by quantity and side ("r", "l"): the Movement Analysis Profile.
        gps_deg: Gait Profile Score by side.
        overall_deg: overall Gait Profile Score of the person.
        norm_people: number of people in the norms; None where their file does not state it.
        remarks: respects in which the norms are not from people like this one; empty if none is known.
    """

    gvs_deg: Mapping[tuple[str, str], float]
    gps_deg: Mapping[str, float]
    overall_deg: float
    norm_people: int | None
    remarks: tuple[str, ...] = ()

    @property
    def table(self) -> pd.DataFrame:
        """Return a table with one row per score: score ("GVS", "GPS"), variable, side ("r", "l", "both"), degrees."""
        import pandas as pd

        return pd.DataFrame(self.columns())

    def columns(self) -> dict[str, list[Any]]:
        """Return the columns of `table`, by name."""
        rows: list[tuple[str, str, str, float]] = [
            ("GVS", CLINICAL_ANGLES[quantity].title, side, value) for (quantity, side), value in self.gvs_deg.items()
        ]
        rows += [("GPS", "all nine", side, value) for side, value in self.gps_deg.items()]
        rows.append(("GPS", OVERALL, "both", self.overall_deg))
        names = ("score", "variable", "side", "degrees")
        return dict(zip(names, (list(column) for column in zip(*rows, strict=True)), strict=True))


def variable_score(curve: np.ndarray, norm: Norm) -> float:
    """Compute the Gait Variable Score (deg) of a curve (101,); NaN if too little of the cycle is known.

    >>> variable_score(np.full(101, 3.0), Norm(np.array([0.0, 100.0]), np.zeros(2), np.ones(2)))
    3.0
    """
    known = np.isfinite(curve)
    if known.mean() < _LEAST_MEASURED:
        return float("nan")
    return rms_deg(curve[known] - np.interp(PERCENT, norm.percent, norm.mean)[known])


def rms_deg(values: np.ndarray | Sequence[float]) -> float:
    """Return the root mean square (deg); NaN if one of the values is NaN."""
    return float(np.sqrt(np.mean(np.square(values))))


def with_norms(columns: Mapping[str, Any], norms: Mapping[str, Norm], skeleton: Skeleton) -> dict[str, Any]:
    """Add four columns to those of `cycles.csv`, NaN where undefined: norm, norm_sd, gvs and gps.

    The first two are mean and SD of the norms; gvs is the Gait Variable Score of the stride's clinical angle, gps the
    root mean square of the stride's nine scores.
    """
    flipped = {f"{name}_{kind}" for name in opposite_on_left(skeleton) for kind in ("angle", "moment")}
    size, rows = len(PERCENT), len(columns["value"])
    values = np.asarray(columns["value"]).reshape(-1, size)
    quantities = columns["quantity"][::size]
    strides = list(zip(*(columns[name][::size] for name in ("trial", "side", "stride")), strict=True))
    norm, norm_sd, gvs, gps = np.full((4, len(values), size), np.nan)
    of_strides: dict[Any, dict[str, float]] = {}
    for k, quantity in enumerate(quantities):
        if band := norms.get(quantity):
            norm[k], norm_sd[k] = (np.interp(PERCENT, band.percent, curve) for curve in (band.mean, band.sd))
            if band.convention and quantity in flipped and strides[k][1] == "l":
                norm[k] = -norm[k]
            if quantity in CLINICAL_ANGLES:
                gvs[k] = of_strides.setdefault(strides[k], {})[quantity] = variable_score(values[k], band)
    for k, quantity in enumerate(quantities):
        known = of_strides.get(strides[k], {})
        if quantity in CLINICAL_ANGLES and len(known) == len(CLINICAL_ANGLES):
            gps[k] = rms_deg(list(known.values()))
    added = {"norm": norm, "norm_sd": norm_sd, "gvs": gvs, "gps": gps}
    return {**columns, **{name: column.reshape(rows) for name, column in added.items()}}
