"""Holds the observations of a trial and of a laboratory: `observation` makes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from kinertia.estimation.simultaneous.instruments import InstrumentPrior
from kinertia.estimation.simultaneous.marker_errors import ErrorProcess
from kinertia.estimation.simultaneous.plates import FootPlates
from kinertia.estimation.simultaneous.skin import SkinPatterns


@dataclass(frozen=True)
class Observation:
    """One trial as the estimator sees it.

    Attributes:
        time: (n,) s, uniform.
        markers: (n, m, 3) m in the order of the skeleton's markers; NaN where not seen.
        marker_sd: (m,) effective deviation of each marker coordinate in one frame, m.
        marker_frames: over how many neighbouring frames these errors are alike (`marker_errors`).
        q: (n, c) start.
        spacing_s: of the splines that its motion is made of (`bandwidth`).
        dynamic: (n,) frames whose ground contacts are all measured.
        ground: the loads on the feet, and the plates that measured them.
        force_sd, moment_sd: effective deviations of the root residual, N and N m, ...
        impact: (n,) ... and by how much they are larger in each frame (`impacts`).
        displacement_sd_m: (m,) prior deviation of each marker's displacement in this trial (`displacement`), each axis.
        repeats: by how much errors that come back have raised all variances (`repeated`).
        skin: what the skin may follow; None: it does not move with the joints.
        frame_products: (k, 3, 3) of several kinds of errors, over their deviations, the mean products of a frame's and
            of the two before it; None: of a process with a double pole.
        name: of the trial.
    """

    time: np.ndarray
    markers: np.ndarray
    marker_sd: np.ndarray
    marker_frames: float
    q: np.ndarray
    spacing_s: float
    dynamic: np.ndarray
    ground: FootPlates
    force_sd: float
    moment_sd: float
    impact: np.ndarray | float = 1.0
    displacement_sd_m: np.ndarray | float = 0.0
    repeats: float = 1.0
    skin: SkinPatterns | None = None
    frame_products: np.ndarray | None = None
    name: str = ""

    @cached_property
    def marker_process(self) -> tuple[np.ndarray, ErrorProcess]:
        """(m,) deviations of the markers' errors, m, and how they go from frame to frame."""
        if self.frame_products is None:
            return self.marker_sd, ErrorProcess.alike_over(self.marker_frames)
        process, variance = ErrorProcess.read(self.marker_frames, self.frame_products)
        return np.sqrt(variance) * self.marker_sd, process

    def root_sd(self, frames: np.ndarray) -> np.ndarray:
        """(d, 6) deviations of the root residual in these frames: N, N m."""
        larger = np.broadcast_to(self.impact, len(self.time))[frames]
        result: np.ndarray = np.outer(larger, np.repeat([self.force_sd, self.moment_sd], 3))
        return result

    def repeated(self, times: float) -> Observation:
        """The same where its errors come back so many times in all that is estimated from.

        Larger deviations leave more room for what is new in a frame, the cameras' noise: it does not come back.
        """
        more = np.sqrt(times)
        return replace(
            self,
            marker_sd=more * self.marker_sd,
            force_sd=more * self.force_sd,
            moment_sd=more * self.moment_sd,
            repeats=times * self.repeats,
            frame_products=None if self.frame_products is None else self.frame_products / times,
        )


@dataclass(frozen=True)
class CalibrationPrior:
    """Prior deviations of the calibration; the skeleton as it stands is the mean.

    Attributes:
        coordinates: static coordinate (locked in the skeleton) -> deviation, rad or m.
        marker_sd_m: (m,) of each marker's position in its segment, each axis.
        instruments: priors of plates and clock.
        before: static coordinate -> its value before the trials moved it; of others the skeleton's.
    """

    coordinates: Mapping[str, float]
    marker_sd_m: np.ndarray
    instruments: InstrumentPrior
    before: Mapping[str, float] = field(default_factory=dict)
