"""Places the static unknowns in the vector of the simultaneous estimate."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self

import numpy as np

from kinertia.estimation.simultaneous.sound_or_faulty import ErrorPriors

_SEEN_BY = ("root", "both", "markers")


@dataclass(frozen=True, eq=False, kw_only=True)
class Unknowns:
    """k unknowns of one kind that a cost term adds to the estimate: what they are called, their unit and their prior.

    Attributes:
        name: by which `Layout` finds them.
        unit: of each.
        start: (k,) where the search begins, and the mean of a normal prior.
        prior: sound or faulty, of what the ground reactions depend on and nothing else; (k,) deviations of a normal
            prior; None: the term has a prior of its own.
        seen_by: what depends on them: the root equations, the markers or both.
        of_laboratory: other people of a session share them.
        in_models: whether rigid segments have them, as OpenSim's next tools know them. The motion that is written
            follows what the others do to the forces.
        displaced_sd: per trial (k,) prior deviations of how far they are elsewhere in it; none where they are not.
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
        """Errors of the ground reactions, none of them at the start."""
        start = np.zeros(len(prior.own))
        return cls(name=name, unit=unit, start=start, prior=prior, of_laboratory=of_laboratory, in_models=in_models)

    @property
    def _order(self) -> tuple[int, bool, bool]:
        return _SEEN_BY.index(self.seen_by), isinstance(self.prior, ErrorPriors), not self.of_laboratory


@dataclass(frozen=True, eq=False)
class Layout:
    """The order of all unknowns: first what only root equations depend on, ending in errors of the ground reactions
    (the laboratory's before others), then what markers depend on, too, and last what only they do.

    Attributes:
        unknowns: in this order; otherwise in that of the terms.
        places: by name.
    """

    unknowns: tuple[Unknowns, ...]
    places: Mapping[str, slice]

    @classmethod
    def of(cls, unknowns: Iterable[Unknowns]) -> Layout:
        """The layout of the terms' unknowns."""
        ordered = tuple(sorted(unknowns, key=lambda one: one._order))
        ends = np.cumsum([len(one.start) for one in ordered]).tolist()
        places = {one.name: slice(end - len(one.start), end) for one, end in zip(ordered, ends, strict=True)}
        return cls(ordered, places)

    def __getitem__(self, name: str) -> slice:
        return self.places[name]

    def _span(self, chosen: Iterable[Unknowns]) -> slice:
        """From the first to the last of these, which stand together."""
        places = [self[one.name] for one in chosen]
        return slice(places[0].start, places[-1].stop) if places else slice(0, 0)

    @cached_property
    def errors(self) -> slice:
        """Of the ground reactions: all with a prior of being sound or faulty."""
        return self._span(one for one in self.unknowns if isinstance(one.prior, ErrorPriors))

    @cached_property
    def error_priors(self) -> ErrorPriors:
        """Of these."""
        return ErrorPriors.joined([one.prior for one in self.unknowns if isinstance(one.prior, ErrorPriors)])

    @cached_property
    def laboratory(self) -> slice:
        """Those errors that other people of a session share."""
        return self._span(one for one in self.unknowns if one.of_laboratory)

    @cached_property
    def displaced(self) -> slice:
        """What is elsewhere in each trial."""
        return self._span(one for one in self.unknowns if one.displaced_sd)

    @cached_property
    def in_root(self) -> slice:
        """What the root equations depend on."""
        return slice(0, self._span(one for one in self.unknowns if one.seen_by != "markers").stop)

    @cached_property
    def in_markers(self) -> slice:
        """What the markers depend on."""
        return self._span(one for one in self.unknowns if one.seen_by != "root")

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return sum(len(one.start) for one in self.unknowns)

    @cached_property
    def start(self) -> np.ndarray:
        """(S,) where the search begins."""
        result: np.ndarray = np.concatenate([one.start for one in self.unknowns])
        return result

    @cached_property
    def weight(self) -> np.ndarray:
        """(S,) information of normal priors about the start; zero for unknowns that have another one."""
        return np.concatenate(
            [
                1.0 / np.square(one.prior) if isinstance(one.prior, np.ndarray) else np.zeros(len(one.start))
                for one in self.unknowns
            ]
        )

    def rigid(self, static: np.ndarray) -> np.ndarray:
        """(S,) the same without what rigid segments do not have."""
        result = static.copy()
        for one in self.unknowns:
            if not one.in_models:
                result[self[one.name]] = 0.0
        return result
