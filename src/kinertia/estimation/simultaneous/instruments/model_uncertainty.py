"""Defines what the simultaneous estimate may change besides the segments of its prior."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.gait27 import AXIS_TILTS, HIP_OFFSETS, LUMBAR_OFFSETS, SHOULDER_OFFSETS

JOINT_CENTRE_SD_M = 0.010
JOINT_AXIS_SD_RAD = float(np.radians(5.0))
MARKER_SD_M = 0.005
"""The calibrated skeleton has its markers from these trials already; what remains is the error of that calibration."""
WITHOUT_STATIC = 2.0
"""Factor on the uncertainty of joint centres and markers of a model that is made from a walk."""


@dataclass(frozen=True, eq=False)
class ModelUncertainty:
    """Joint centres, markers and instruments that may change, and segments that are not estimated.

    Attributes:
        centres: static coordinate of the skeleton (locked) -> prior standard deviation, m.
        marker_sd_m: prior standard deviation of marker positions in their segments, each axis; None: they are fixed.
        held: parameters of the segments that are not in the prior; None if it has all.
        source: where the prior's mean comes from, for messages.
        axes: static coordinate that tilts a joint's axis -> prior standard deviation, rad.
        instruments: priors of plates and synchronisation.
        before: static coordinate -> its value before the trials changed it; for others the skeleton's.
    """

    centres: Mapping[str, float]
    marker_sd_m: float | None
    held: BodySegmentParameters | None
    source: str
    axes: Mapping[str, float] = field(default_factory=dict)
    instruments: InstrumentPrior = field(default_factory=InstrumentPrior)
    before: Mapping[str, float] = field(default_factory=dict)

    @property
    def coordinates(self) -> dict[str, float]:
        """All static coordinates that may change -> prior standard deviation, m or rad."""
        return {**self.centres, **self.axes}

    def with_axes(self) -> Self:
        """Return the uncertainty with the axes of knees, ankles and elbows of the 27-DOF model free."""
        return replace(self, axes=dict.fromkeys(AXIS_TILTS, JOINT_AXIS_SD_RAD))

    @property
    def held_kg(self) -> float:
        """Mass (kg) of the segments that are not estimated."""
        return 0.0 if self.held is None else self.held.total_mass_kg

    def whole(self, estimate: BodySegmentParameters) -> BodySegmentParameters:
        """Append the segments that are not estimated to the estimate."""
        if self.held is None:
            return estimate
        table = np.concatenate([estimate.table(), self.held.table()])
        return BodySegmentParameters.from_table((*estimate.segments, *self.held.segments), table)

    def whole_covariance(self, covariance: np.ndarray) -> np.ndarray:
        """Return the covariance (10 s, 10 s) in the order of `whole`, zero for segments that are not estimated."""
        return np.pad(covariance, (0, 0 if self.held is None else 10 * len(self.held.segments)))


GAIT27_UNCERTAINTY = ModelUncertainty(
    dict.fromkeys((*HIP_OFFSETS, *LUMBAR_OFFSETS, *SHOULDER_OFFSETS), JOINT_CENTRE_SD_M),
    MARKER_SD_M,
    None,
    "the literature",
)
"""Uncertainty of the 27-DOF model: hip, lumbar and shoulder centres, and all markers."""
