"""What the simultaneous estimate may change beside the motion, and how far: segments, joint centres, markers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinertia.bsp import BodySegmentParameters
from kinertia.bsp_prior import BspPrior, literature_prior
from kinertia.gait27 import HIP_OFFSETS, LUMBAR_OFFSETS, SHOULDER_OFFSETS

JOINT_CENTRE_SD_M = 0.010
MARKER_SD_M = 0.005
"""The calibrated skeleton has its markers from these trials already; what is left is how well that was done."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Priors of everything that does not move, but for the instruments.

    Attributes:
        segments: all of them, in the order of tables.
        prior: of the body segment parameters to be estimated.
        held: of the segments that are not estimated; None where all are.
        centres: static coordinate of the skeleton (locked) -> prior deviation, m.
        marker_sd_m: prior deviation of marker positions in their segments, each axis; None: they stay where they are.
        source: where the prior's mean comes from, for messages.
    """

    segments: tuple[str, ...]
    prior: BspPrior
    held: BodySegmentParameters | None
    centres: Mapping[str, float]
    marker_sd_m: float | None
    source: str

    @property
    def total_mass_kg(self) -> float:
        """Body mass by the scale."""
        return self.prior.mass_kg + (0.0 if self.held is None else self.held.total_mass_kg)

    def whole(self, estimate: BodySegmentParameters) -> BodySegmentParameters:
        """The estimate with the segments that are held."""
        parts = [estimate] if self.held is None else [estimate, self.held]
        rows = {name: row for part in parts for name, row in zip(part.segments, part.table(), strict=True)}
        return BodySegmentParameters.from_table(self.segments, np.array([rows[name] for name in self.segments]))

    def whole_covariance(self, covariance: np.ndarray) -> np.ndarray:
        """(10 s, 10 s) of all segments, from that of the estimated ones; zero for those that are held."""
        at = np.concatenate([10 * self.segments.index(name) + np.arange(10) for name in self.prior.mean.segments])
        result = np.zeros((10 * len(self.segments), 10 * len(self.segments)))
        result[np.ix_(at, at)] = covariance
        return result


def gait27_unknowns(literature: BodySegmentParameters) -> Unknowns:
    """Of the 27-DOF model: all segments around the literature; hip, lumbar and shoulder centres; markers."""
    centres = dict.fromkeys((*HIP_OFFSETS, *LUMBAR_OFFSETS, *SHOULDER_OFFSETS), JOINT_CENTRE_SD_M)
    prior = literature_prior(literature)
    return Unknowns(literature.segments, prior, None, centres, MARKER_SD_M, "the literature")
