"""Scores of a gait, variable by variable: what `gait_profile` gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

PELVIS_ROTATION = "pelvis_rotation_angle"
FOOT_PROGRESSION = "foot_progression_angle"
VARIABLES = {
    "pelvis_tilt_angle": "pelvic tilt",
    "pelvis_list_angle": "pelvic obliquity",
    PELVIS_ROTATION: "pelvic rotation",
    "hip_flexion_angle": "hip flexion",
    "hip_adduction_angle": "hip abduction",
    "hip_rotation_angle": "hip rotation",
    "knee_angle_angle": "knee flexion",
    "ankle_angle_angle": "ankle dorsiflexion",
    FOOT_PROGRESSION: "foot progression",
}
"""The nine of the paper, by the quantity of `cycles.csv` and of norms."""


@dataclass(frozen=True, eq=False)
class GaitProfile:
    """Scores of one person, in degrees; NaN where a curve is not known over the cycle.

    Attributes:
        gvs_deg: Gait Variable Score by quantity and side ("r", "l"): the Movement Analysis Profile.
        gps_deg: Gait Profile Score by side.
        overall_deg: of the person.
        norm_people: how many people the norms are of; None where their file does not say.
        convention: of the angles.
    """

    gvs_deg: Mapping[tuple[str, str], float]
    gps_deg: Mapping[str, float]
    overall_deg: float
    norm_people: int | None
    convention: str

    @property
    def table(self) -> pd.DataFrame:
        """A row per score: score ("GVS", "GPS"), variable, side ("r", "l", "both"), degrees."""
        import pandas as pd

        return pd.DataFrame(self.columns())

    def columns(self) -> dict[str, list[Any]]:
        """The columns of `table`, by name."""
        rows: list[tuple[str, str, str, float]] = [
            ("GVS", VARIABLES[quantity], side, value) for (quantity, side), value in self.gvs_deg.items()
        ]
        rows += [("GPS", "all nine", side, value) for side, value in self.gps_deg.items()]
        rows.append(("GPS", "all fifteen", "both", self.overall_deg))
        names = ("score", "variable", "side", "degrees")
        return dict(zip(names, (list(column) for column in zip(*rows, strict=True)), strict=True))
