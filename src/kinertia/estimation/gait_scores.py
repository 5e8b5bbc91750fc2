"""Scores of a gait, variable by variable and stride by stride: what `gait_profile` gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kinertia.io.norms_file import Norm
from kinertia.model.shared_coordinates import opposite_on_left
from kinertia.model.skeleton import Skeleton
from kinertia.motion.clinical_angles import CLINICAL_ANGLES
from kinertia.motion.gait_cycle import PERCENT

if TYPE_CHECKING:
    import pandas as pd

OVERALL = "all fifteen"
"""What the person's score is of."""
_LEAST_MEASURED = 0.95
"""Share of the cycle that must be known of a curve."""


@dataclass(frozen=True, eq=False)
class GaitProfile:
    """Scores of one person, in degrees; NaN where a curve is not known over the cycle.

    Attributes:
        gvs_deg: Gait Variable Score by quantity and side ("r", "l"): the Movement Analysis Profile.
        gps_deg: Gait Profile Score by side.
        overall_deg: of the person.
        norm_people: how many people the norms are of; None where their file does not say.
        remarks: in which way the norms are not of people like this one; empty if nothing is known of that.
    """

    gvs_deg: Mapping[tuple[str, str], float]
    gps_deg: Mapping[str, float]
    overall_deg: float
    norm_people: int | None
    remarks: tuple[str, ...] = ()

    @property
    def table(self) -> pd.DataFrame:
        """A row per score: score ("GVS", "GPS"), variable, side ("r", "l", "both"), degrees."""
        import pandas as pd

        return pd.DataFrame(self.columns())

    def columns(self) -> dict[str, list[Any]]:
        """The columns of `table`, by name."""
        rows: list[tuple[str, str, str, float]] = [
            ("GVS", CLINICAL_ANGLES[quantity].title, side, value) for (quantity, side), value in self.gvs_deg.items()
        ]
        rows += [("GPS", "all nine", side, value) for side, value in self.gps_deg.items()]
        rows.append(("GPS", OVERALL, "both", self.overall_deg))
        names = ("score", "variable", "side", "degrees")
        return dict(zip(names, (list(column) for column in zip(*rows, strict=True)), strict=True))


def variable_score(curve: np.ndarray, norm: Norm) -> float:
    """Gait Variable Score (deg) of a curve (101,); NaN where too little of the cycle is known.

    >>> variable_score(np.full(101, 3.0), Norm(np.array([0.0, 100.0]), np.zeros(2), np.ones(2)))
    3.0
    """
    known = np.isfinite(curve)
    if known.mean() < _LEAST_MEASURED:
        return float("nan")
    return rms_deg(curve[known] - np.interp(PERCENT, norm.percent, norm.mean)[known])


def rms_deg(values: np.ndarray | Sequence[float]) -> float:
    """Root mean square; NaN where one of the values is."""
    return float(np.sqrt(np.mean(np.square(values))))


def with_norms(columns: Mapping[str, Any], norms: Mapping[str, Norm], skeleton: Skeleton) -> dict[str, Any]:
    """The columns of `cycles.csv` with four more, NaN where there is none: norm, norm_sd (mean and SD of the norms),
    gvs (Gait Variable Score of the stride's clinical angle) and gps (of the stride: root mean square of its nine).
    """
    flipped = {f"{name}_{kind}" for name in opposite_on_left(skeleton) for kind in ("angle", "moment")}
    size, rows = len(PERCENT), len(columns["value"])
    values = np.asarray(columns["value"]).reshape(-1, size)
    quantities = columns["quantity"][::size]
    strides = list(zip(*(columns[name][::size] for name in ("trial", "side", "stride")), strict=True))
    norm, norm_sd, gvs, gps = np.full((4, len(values), size), np.nan)
    of_strides: dict[Any, dict[str, float]] = {}
    for k, quantity in enumerate(quantities):
        if one := norms.get(quantity):
            norm[k], norm_sd[k] = (np.interp(PERCENT, one.percent, each) for each in (one.mean, one.sd))
            if one.convention and quantity in flipped and strides[k][1] == "l":
                norm[k] = -norm[k]
            if quantity in CLINICAL_ANGLES:
                gvs[k] = of_strides.setdefault(strides[k], {})[quantity] = variable_score(values[k], one)
    for k, quantity in enumerate(quantities):
        known = of_strides.get(strides[k], {})
        if quantity in CLINICAL_ANGLES and len(known) == len(CLINICAL_ANGLES):
            gps[k] = rms_deg(list(known.values()))
    added = {"norm": norm, "norm_sd": norm_sd, "gvs": gvs, "gps": gps}
    return {**columns, **{name: each.reshape(rows) for name, each in added.items()}}
