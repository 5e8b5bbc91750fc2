"""Shows Movement Analysis Profile and Gait Profile Score in the report."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.estimation.gait_profile import gait_profile
from kinertia.estimation.result import Fit
from kinertia.io.norms_file import Norm
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.trial.data import FEET


class ScoreRow(NamedTuple):
    """One variable in words, with its score per side, degrees."""

    variable: str
    right: str
    left: str


@dataclass(frozen=True)
class ProfileView:
    """Gait profile scores in words.

    Attributes:
        rows: the nine variables, then the score of each side.
        overall: score of the person, degrees.
        norm_people: number of people in the norms, if the file states it.
        remarks: sentences on differences between the norms' people and this person.
    """

    rows: tuple[ScoreRow, ...]
    overall: str
    norm_people: int | None
    remarks: tuple[str, ...]


def profile_view(fit: Fit, norms: Mapping[str, Norm]) -> ProfileView | None:
    """Compute scores against these norms; None where they lack one of the nine variables."""
    if not set(CLINICAL_ANGLES) <= set(norms):
        return None
    profile = gait_profile(fit, norms)
    rows = [
        ScoreRow(one.title, *(_degrees(profile.gvs_deg[quantity, side]) for side in FEET))
        for quantity, one in CLINICAL_ANGLES.items()
    ]
    rows.append(ScoreRow("Gait Profile Score", *(_degrees(profile.gps_deg[side]) for side in FEET)))
    return ProfileView(tuple(rows), _degrees(profile.overall_deg), profile.norm_people, profile.remarks)


def _degrees(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "–"
