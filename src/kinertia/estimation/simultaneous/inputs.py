"""Holds the input of the simultaneous estimate, and the person's model as a function of its unknowns."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.instruments.plates import FootPlates
from kinertia.estimation.simultaneous.layout import Layout
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.markers.skin import SkinPatterns
from kinertia.estimation.simultaneous.observed_trial import CalibrationPrior, Observation
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.log_cholesky import from_log_cholesky
from kinertia.model.skeleton import Skeleton

BSP, STILL, PLACES, SKIN = "bsp", "static coordinates", "marker places", "skin"
"""Names of the model's unknowns."""


@dataclass(frozen=True, eq=False)
class Given:
    """Recordings of a person and prior knowledge.

    Attributes:
        skeleton: calibrated.
        prior: of the body segment parameters.
        calibration: priors of everything else that does not move.
        trials: observations of each trial.
        phase: share of an interval by which the knots of the motion's splines are earlier.
    """

    skeleton: Skeleton
    prior: BspPrior
    calibration: CalibrationPrior
    trials: Sequence[Observation]
    phase: float = 0.0

    @cached_property
    def free(self) -> Skeleton:
        """The skeleton with its static coordinates freed."""
        return self.skeleton.free(self.calibration.coordinates)

    @cached_property
    def moving(self) -> np.ndarray:
        """Indices in the freed skeleton of the coordinates that change over time."""
        return self._columns(self.skeleton.coordinates)

    @cached_property
    def still(self) -> np.ndarray:
        """Indices in the freed skeleton of the coordinates that do not change over time."""
        return self._columns(tuple(self.calibration.coordinates))

    def _columns(self, coordinates: Sequence[str]) -> np.ndarray:
        names = list(self.free.coordinates)
        return np.array([names.index(name) for name in coordinates], dtype=int)

    @cached_property
    def bases(self) -> tuple[MotionBasis, ...]:
        """Spline bases of every trial's motion."""
        return tuple(MotionBasis(trial.time, trial.spacing_s, self.phase, trial.near_windows) for trial in self.trials)

    @cached_property
    def start(self) -> tuple[np.ndarray, ...]:
        """Spline coefficients from which the search starts, per trial."""
        return tuple(basis.fit(trial.q) for basis, trial in zip(self.bases, self.trials, strict=True))

    @cached_property
    def skin(self) -> tuple[SkinPatterns, ...]:
        """Patterns that skin motion may follow, per trial."""
        count = len(self.skeleton.markers)
        return tuple(trial.skin or SkinPatterns.none(len(trial.time), count) for trial in self.trials)

    @cached_property
    def plates(self) -> tuple[str, ...]:
        """Names of all trials' plates."""
        return tuple(dict.fromkeys(name for trial in self.trials for name in trial.ground.plates))

    @cached_property
    def grounds(self) -> tuple[FootPlates, ...]:
        """Ground reactions of every trial, with plates numbered as in `plates`."""
        return tuple(trial.ground.among(self.plates) for trial in self.trials)


@dataclass(frozen=True, eq=False)
class FreedModel:
    """Skeleton and body segment parameters as a function of the static unknowns (S,).

    Attributes:
        given: input of the estimate.
        layout: order of the unknowns.
    """

    given: Given
    layout: Layout

    @property
    def segments(self) -> tuple[str, ...]:
        """Names of the estimated segments."""
        return self.given.prior.mean.segments

    def bsp(self, static: np.ndarray) -> BodySegmentParameters:
        """Return the body segment parameters."""
        return from_log_cholesky(self.segments, static[self.layout[BSP]])

    def placed(self, static: np.ndarray) -> Skeleton:
        """Return the freed skeleton with its estimated marker positions."""
        return self.given.free.with_positions(static[self.layout[PLACES]].reshape(-1, 3))

    def locked(self, static: np.ndarray) -> Skeleton:
        """Return the skeleton as calibrated by the unknowns."""
        values = static[self.layout[STILL]].tolist()
        markers = self.placed(static).markers
        locked = dict(zip(self.given.calibration.coordinates, values, strict=True))
        return self.given.skeleton.with_markers(markers).lock(locked)

    def skin(self, k: int, static: np.ndarray, frames: slice) -> tuple[SkinPatterns, np.ndarray]:
        """Return the patterns of skin motion in these frames of trial k, and their coefficients."""
        return self.given.skin[k].cut(frames), static[self.layout[SKIN]]

    def full(self, parts: Sequence[np.ndarray], static: np.ndarray) -> list[np.ndarray]:
        """Return coordinates and derivatives of the freed skeleton; static coordinates have zero derivatives."""
        result = []
        for order, part in enumerate(parts):
            every = np.zeros((len(part), len(self.given.free.coordinates)))
            every[:, self.given.moving] = part
            if order == 0:
                every[:, self.given.still] = static[self.layout[STILL]]
            result.append(every)
        return result
