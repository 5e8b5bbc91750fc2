"""Shows Movement Analysis Profile and Gait Profile Score in the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.estimation.gait_profile import gait_profile
from kinertia.estimation.gait_scores import VARIABLES
from kinertia.estimation.result import Fit
from kinertia.io.norms_file import Norm
from kinertia.trial.data import FEET


class ScoreRow(NamedTuple):
    """One variable in words; per side, degrees."""

    variable: str
    right: str
    left: str


@dataclass(frozen=True)
class ProfileView:
    """Scores in words.

    Attributes:
        rows: of the nine variables, then of each side's score.
        overall: of the person, degrees.
        norm_people: how many people the norms are of, if the file says so.
        convention: of the angles.
    """

    rows: tuple[ScoreRow, ...]
    overall: str
    norm_people: int | None
    convention: str


def profile_view(fit: Fit, norms: Mapping[str, Norm]) -> ProfileView | None:
    """Scores against these norms; None where they lack one of the nine variables."""
    if not set(VARIABLES) <= set(norms):
        return None
    profile = gait_profile(fit, norms)
    rows = [
        ScoreRow(title, *(_degrees(profile.gvs_deg[quantity, side]) for side in FEET))
        for quantity, title in VARIABLES.items()
    ]
    rows.append(ScoreRow("Gait Profile Score", *(_degrees(profile.gps_deg[side]) for side in FEET)))
    return ProfileView(tuple(rows), _degrees(profile.overall_deg), profile.norm_people, profile.convention)


def _degrees(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "–"
