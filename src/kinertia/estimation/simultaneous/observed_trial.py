"""Holds the observations of a trial, and the prior of the calibration; `observation` makes the former."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.instruments.plates import FootPlates
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.markers.marker_errors import ErrorProcess
from kinertia.estimation.simultaneous.markers.skin import SkinPatterns
from kinertia.motion.kinematics import AROUND_WINDOW_S
from kinertia.trial.sampled_time import within


@dataclass(frozen=True)
class Observation:
    """Observations of one trial, as the estimator uses them.

    Attributes:
        time: (n,) s, uniform.
        markers: (n, m, 3) m in the order of the skeleton's markers; NaN where not seen.
        marker_sd: (m,) effective standard deviation of each marker coordinate in one frame, m.
        marker_frames: number of neighbouring frames over which these errors are correlated (`marker_errors`).
        q: (n, c) coordinates from which the search starts.
        spacing_s: knot spacing of the splines of its motion (`bandwidth`).
        dynamic: (n,) frames whose ground contacts are all measured.
        ground: the loads on the feet, and the plates that measured them.
        force_sd, moment_sd: effective standard deviations of the root residual, N and N m.
        impact: (n,) factor by which these are larger in each frame (`impacts`).
        displacement_sd_m: (m,) prior standard deviation of each marker's displacement in this trial (`displacement`),
            each axis.
        repeats: factor by which recurring errors have raised all variances (`repeated`).
        skin: patterns that the skin may follow; None: it does not move with the joints.
        frame_products: (k, 3, 3) mean products of the errors of a frame and of the two before it, over their standard
            deviations, for several kinds of errors; None: those of a process with a double pole.
        name: of the trial.
        reported: (n,) frames whose curves are reported, the dynamic ones among them; None: these alone.
        on_ground: (n, 2) whether right and left foot are on the ground, on a plate or not; None: while loaded.
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
    reported: np.ndarray | None = None
    on_ground: np.ndarray | None = None

    @cached_property
    def curve_frames(self) -> np.ndarray:
        """Indices (d,) of the frames whose curves are reported."""
        return np.flatnonzero(self.dynamic if self.reported is None else self.dynamic | self.reported)

    @cached_property
    def near_windows(self) -> slice:
        """The frames from the first to the last dynamic one and just around them; all if there is none."""
        dynamic = np.flatnonzero(self.dynamic)
        if not dynamic.size:
            return slice(0, len(self.time))
        start, end = self.time[dynamic[[0, -1]]]
        near = np.flatnonzero(within(self.time, start - AROUND_WINDOW_S, end + AROUND_WINDOW_S))
        return slice(int(near[0]), int(near[-1]) + 1)

    @cached_property
    def marker_process(self) -> tuple[np.ndarray, ErrorProcess]:
        """Standard deviations (m,) of the markers' errors, m, and the process that they follow from frame to frame."""
        if self.frame_products is None:
            return self.marker_sd, ErrorProcess.double_over(self.marker_frames)
        process, variance = ErrorProcess.read(self.marker_frames, self.frame_products)
        return np.sqrt(variance) * self.marker_sd, process

    def root_sd(self, frames: np.ndarray) -> np.ndarray:
        """Return standard deviations (d, 6) of the root residual in these frames: N, N m."""
        larger = np.broadcast_to(self.impact, len(self.time))[frames]
        return np.outer(larger, np.repeat([self.force_sd, self.moment_sd], 3))

    def repeated(self, times: float) -> Self:
        """Return the observation with standard deviations for errors that recur so many times in the estimate's data.

        Larger standard deviations leave more room for the innovation of a frame, the cameras' noise: it does not recur.
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
    """Prior standard deviations of the calibration, whose mean is the skeleton as it is.

    Attributes:
        coordinates: static coordinate (locked in the skeleton) -> standard deviation, rad or m.
        marker_sd_m: (m,) of each marker's position in its segment, each axis.
        instruments: priors of plates and synchronisation.
        before: static coordinate -> its value before the trials changed it; for others the skeleton's.
    """

    coordinates: Mapping[str, float]
    marker_sd_m: np.ndarray
    instruments: InstrumentPrior
    before: Mapping[str, float] = field(default_factory=dict)
