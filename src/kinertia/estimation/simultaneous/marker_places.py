"""Adds the positions of markers in their segments: one for all trials, and offsets in each."""

from __future__ import annotations

from typing import Any

import numpy as np

from kinertia.estimation.simultaneous.cost_term import CostTerm, Solution
from kinertia.estimation.simultaneous.given import PLACES, Given
from kinertia.estimation.simultaneous.layout import Unknowns


class MarkerPlaces(CostTerm):
    """Positions of the markers in their segments; of several trials each has displacements of its own besides."""

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Three of each marker, normal about where the skeleton has it."""
        count = len(given.skeleton.markers)
        return (
            Unknowns(
                name=PLACES,
                unit="m",
                start=given.skeleton.marker_locals.ravel(),
                prior=np.broadcast_to(np.repeat(given.calibration.marker_sd_m, 3), 3 * count),
                seen_by="markers",
                displaced_sd=tuple(
                    np.repeat(np.broadcast_to(trial.displacement_sd_m, count), 3) for trial in given.trials
                ),
            ),
        )

    def read(self, solution: Solution) -> dict[str, Any]:
        """How far the markers of each trial are from their places."""
        return {"displacements_m": tuple(own.reshape(-1, 3) for own in solution.displaced)}
