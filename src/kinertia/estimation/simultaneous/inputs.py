"""Holds the input of the simultaneous estimate, the vector of its static unknowns, and the model made of them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self

import numpy as np

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.instruments.plates import FootPlates
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.markers.skin import SkinPatterns
from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observation
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.log_cholesky import from_log_cholesky
from kinertia.model.skeleton import Skeleton

BSP, STILL, PLACES, SKIN = "bsp", "static coordinates", "marker places", "skin"
"""Names of the model's unknowns. Those of `BSP` are ten for each segment of the prior, the first of them the logarithm
of its mass (`model/log_cholesky`)."""
_SEEN_BY = ("root", "both", "markers")


@dataclass(frozen=True, eq=False, kw_only=True)
class Unknowns:
    """Defines k unknowns of one kind that a cost term adds to the estimate: their name, unit and prior.

    Attributes:
        name: by which `Layout` finds them.
        unit: of each.
        start: (k,) where the search begins, and the mean of a normal prior.
        prior: fault-free or faulty, for unknowns that only the ground reactions depend on; (k,) standard deviations of
            a normal prior; None: the term has a prior of its own.
        seen_by: what depends on them: the root equations, the markers or both.
        of_laboratory: whether other people of a session share them.
        in_models: whether a model of rigid segments, as in OpenSim's subsequent tools, can represent them. The exported
            motion absorbs the effect of the others on the forces.
        displaced_sd: per trial (k,) prior standard deviations of their offsets in it; empty if they have none.
    """

    name: str
    unit: str
    start: np.ndarray
    prior: ErrorPriors | np.ndarray | None
    seen_by: Literal["root", "both", "markers"] = "root"
    of_laboratory: bool = False
    in_models: bool = True
    displaced_sd: tuple[np.ndarray, ...] = ()

    @classmethod
    def errors(
        cls, name: str, unit: str, prior: ErrorPriors, *, of_laboratory: bool = False, in_models: bool = True
    ) -> Self:
        """Define errors of the ground reactions, all zero at the start."""
        start = np.zeros(len(prior.individual))
        return cls(name=name, unit=unit, start=start, prior=prior, of_laboratory=of_laboratory, in_models=in_models)

    @property
    def _order(self) -> tuple[int, bool, bool]:
        return _SEEN_BY.index(self.seen_by), isinstance(self.prior, ErrorPriors), not self.of_laboratory


@dataclass(frozen=True, eq=False)
class Layout:
    """Order of all unknowns in the vector.

    First come the unknowns that only root equations depend on, ending with errors of the ground reactions (the
    laboratory's before others), then those that markers depend on, too, and last those that only markers depend on.

    Attributes:
        unknowns: in this order; otherwise in the order of the terms.
        places: slices of the vector, by name.
    """

    unknowns: tuple[Unknowns, ...]
    places: Mapping[str, slice]

    @classmethod
    def of(cls, unknowns: Iterable[Unknowns]) -> Self:
        """Arrange the terms' unknowns."""
        ordered = tuple(sorted(unknowns, key=lambda unknown: unknown._order))
        ends = np.cumsum([len(unknown.start) for unknown in ordered]).tolist()
        places = {
            unknown.name: slice(end - len(unknown.start), end) for unknown, end in zip(ordered, ends, strict=True)
        }
        return cls(ordered, places)

    def __getitem__(self, name: str) -> slice:
        return self.places[name]

    def _span(self, chosen: Iterable[Unknowns]) -> slice:
        """Return the slice from the first to the last of these unknowns, which are contiguous."""
        places = [self[unknown.name] for unknown in chosen]
        return slice(places[0].start, places[-1].stop) if places else slice(0, 0)

    @cached_property
    def errors(self) -> slice:
        """Slice of the errors of the ground reactions: all unknowns with a prior of being fault-free or faulty."""
        return self._span(unknown for unknown in self.unknowns if isinstance(unknown.prior, ErrorPriors))

    @cached_property
    def error_priors(self) -> ErrorPriors:
        """Priors of the unknowns in `errors`."""
        return ErrorPriors.joined(
            [unknown.prior for unknown in self.unknowns if isinstance(unknown.prior, ErrorPriors)]
        )

    @cached_property
    def laboratory(self) -> slice:
        """Slice of the errors that other people of a session share."""
        return self._span(unknown for unknown in self.unknowns if unknown.of_laboratory)

    @cached_property
    def displaced(self) -> slice:
        """Slice of the unknowns that have an offset in each trial."""
        return self._span(unknown for unknown in self.unknowns if unknown.displaced_sd)

    @cached_property
    def in_root(self) -> slice:
        """Slice of the unknowns that the root equations depend on."""
        return slice(0, self._span(unknown for unknown in self.unknowns if unknown.seen_by != "markers").stop)

    @cached_property
    def in_markers(self) -> slice:
        """Slice of the unknowns that the markers depend on."""
        return self._span(unknown for unknown in self.unknowns if unknown.seen_by != "root")

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return sum(len(unknown.start) for unknown in self.unknowns)

    @cached_property
    def start(self) -> np.ndarray:
        """Values (S,) from which the search starts."""
        return np.concatenate([unknown.start for unknown in self.unknowns])

    @cached_property
    def weight(self) -> np.ndarray:
        """Information (S,) of normal priors about the start; zero for unknowns that have another prior."""
        return np.concatenate(
            [
                1.0 / np.square(unknown.prior)
                if isinstance(unknown.prior, np.ndarray)
                else np.zeros(len(unknown.start))
                for unknown in self.unknowns
            ]
        )

    def rigid(self, static: np.ndarray) -> np.ndarray:
        """Return the unknowns (S,) with those set to zero that rigid segments cannot represent."""
        result = static.copy()
        for unknown in self.unknowns:
            if not unknown.in_models:
                result[self[unknown.name]] = 0.0
        return result


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
