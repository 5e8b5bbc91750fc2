"""Shows Movement Analysis Profile and Gait Profile Score in the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.estimation.gait_profile import gait_profile
from kinertia.estimation.result import Fit
from kinertia.io.norms_file import Norm
from kinertia.motion.clinical_angles import CLINICAL_ANGLES
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
        remarks: in which way the norms are not of people like this one, in sentences.
    """

    rows: tuple[ScoreRow, ...]
    overall: str
    norm_people: int | None
    remarks: tuple[str, ...]


def profile_view(fit: Fit, norms: Mapping[str, Norm]) -> ProfileView | None:
    """Scores against these norms; None where they lack one of the nine variables."""
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
