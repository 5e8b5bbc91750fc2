"""Adds the positions of markers in their segments: common to all trials, with offsets in each."""

from typing import Any

import numpy as np

from kinertia.estimation.simultaneous.inputs import PLACES, Given
from kinertia.estimation.simultaneous.layout import Unknowns
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, Solution


class MarkerPlaces(CostTerm):
    """Positions of the markers in their segments; with several trials each has displacements of its own."""

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return three unknowns per marker, normal about its position in the skeleton."""
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
        """Return the displacements of the markers of each trial from their positions."""
        return {"marker_offsets_m": tuple(own.reshape(-1, 3) for own in solution.displaced)}
