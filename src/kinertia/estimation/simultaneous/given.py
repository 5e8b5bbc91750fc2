"""Holds the inputs of the simultaneous estimate, and the person's model as its unknowns have it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.layout import Layout
from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.observed_trial import CalibrationPrior, Observation
from kinertia.estimation.simultaneous.plates import FootPlates
from kinertia.estimation.simultaneous.skin import SkinPatterns
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.log_cholesky import from_log_cholesky
from kinertia.model.skeleton import Skeleton

BSP, STILL, PLACES, SKIN = "bsp", "static coordinates", "marker places", "skin"
"""Names of the model's unknowns."""


@dataclass(frozen=True, eq=False)
class Given:
    """Recordings of a person and what is known before.

    Attributes:
        skeleton: calibrated.
        prior: of the body segment parameters.
        calibration: priors of everything else that does not move.
        trials: as the estimate sees them.
        phase: share of an interval by which knots of the motion's splines lie earlier.
    """

    skeleton: Skeleton
    prior: BspPrior
    calibration: CalibrationPrior
    trials: Sequence[Observation]
    phase: float = 0.0

    @cached_property
    def free(self) -> Skeleton:
        """The skeleton with static coordinates free."""
        return self.skeleton.free(self.calibration.coordinates)

    @cached_property
    def moving(self) -> np.ndarray:
        """Indices of its coordinates that move in time."""
        return self._columns(self.skeleton.coordinates)

    @cached_property
    def still(self) -> np.ndarray:
        """Indices of its coordinates that do not."""
        return self._columns(tuple(self.calibration.coordinates))

    def _columns(self, coordinates: Sequence[str]) -> np.ndarray:
        names = list(self.free.coordinates)
        return np.array([names.index(name) for name in coordinates], dtype=int)

    @cached_property
    def bases(self) -> tuple[MotionBasis, ...]:
        """Splines of every trial's motion."""
        return tuple(MotionBasis(trial.time, trial.spacing_s, self.phase) for trial in self.trials)

    @cached_property
    def start(self) -> tuple[np.ndarray, ...]:
        """Per trial the coefficients where its motion begins."""
        return tuple(basis.fit(trial.q) for basis, trial in zip(self.bases, self.trials, strict=True))

    @cached_property
    def skin(self) -> tuple[SkinPatterns, ...]:
        """Per trial what the skin may follow."""
        count = len(self.skeleton.markers)
        return tuple(trial.skin or SkinPatterns.none(len(trial.time), count) for trial in self.trials)

    @cached_property
    def plates(self) -> tuple[str, ...]:
        """Names of all trials' plates."""
        return tuple(dict.fromkeys(name for trial in self.trials for name in trial.ground.plates))

    @cached_property
    def grounds(self) -> tuple[FootPlates, ...]:
        """Ground reactions of every trial, which count `plates`."""
        return tuple(trial.ground.among(self.plates) for trial in self.trials)


@dataclass(frozen=True, eq=False)
class FreedModel:
    """Skeleton and body segment parameters for static unknowns (S,).

    Attributes:
        given: to the estimate.
        layout: of the unknowns.
    """

    given: Given
    layout: Layout

    @property
    def segments(self) -> tuple[str, ...]:
        """That are estimated."""
        return self.given.prior.mean.segments

    def bsp(self, static: np.ndarray) -> BodySegmentParameters:
        """Body segment parameters."""
        return from_log_cholesky(self.segments, static[self.layout[BSP]])

    def placed(self, static: np.ndarray) -> Skeleton:
        """The freed skeleton with its markers where they are."""
        return self.given.free.with_places(static[self.layout[PLACES]].reshape(-1, 3))

    def locked(self, static: np.ndarray) -> Skeleton:
        """The skeleton, calibrated by the unknowns."""
        values = static[self.layout[STILL]].tolist()
        markers = self.placed(static).markers
        locked = dict(zip(self.given.calibration.coordinates, values, strict=True))
        return self.given.skeleton.with_markers(markers).lock(locked)

    def skin(self, k: int, static: np.ndarray, frames: slice) -> tuple[SkinPatterns, np.ndarray]:
        """What the skin follows in these frames of trial k, and the coefficients."""
        return self.given.skin[k].cut(frames), static[self.layout[SKIN]]

    def full(self, parts: Sequence[np.ndarray], static: np.ndarray) -> list[np.ndarray]:
        """Coordinates and derivatives of the freed skeleton: the static ones do not move."""
        result = []
        for order, part in enumerate(parts):
            every = np.zeros((len(part), len(self.given.free.coordinates)))
            every[:, self.given.moving] = part
            if order == 0:
                every[:, self.given.still] = static[self.layout[STILL]]
            result.append(every)
        return result
