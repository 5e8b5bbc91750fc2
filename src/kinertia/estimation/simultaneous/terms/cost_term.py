"""Defines a cost term: the unknowns that it adds, its cost, and what it reads from the solution.

`terms.TERMS` lists them. The estimate refers to no term by name; terms interact only through `FreedModel`, the
unknowns' names in `Layout`, and the ground reactions (`GroundLoads`), which terms may change. Each states its place
among the others (`CostTerm.order`): in which order they are listed does not matter.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from kinertia.estimation.simultaneous.inputs import FreedModel, Given, Unknowns
from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import Gradient
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.terms.root_terms import RootFrames
from kinertia.motion.ground_reactions import GroundReactions

Derivative = tuple[np.ndarray, Callable[[np.ndarray, np.ndarray], None]]
"""Derivatives (n, ..., 6, e) of loads by e unknowns of a term, and the function that adds such derivatives, (n, r, e),
to those by all static unknowns (n, r, s)."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Solution of the estimate, from which terms read their results.

    Attributes:
        static: (S,) the unknowns that do not move.
        covariance: (S, S) of them, evaluated at
        there: (S,).
        displaced: per trial (k,) the trial's offsets of the displaced unknowns.
        gaussian: replaces the priors of errors.
        moved, contradicted: (k,) of errors, as in `InstrumentSupport`.
    """

    static: np.ndarray
    covariance: np.ndarray
    there: np.ndarray
    displaced: tuple[np.ndarray, ...]
    gaussian: GaussianPrior
    moved: np.ndarray
    contradicted: np.ndarray

    @cached_property
    def sd(self) -> np.ndarray:
        """Standard deviations (S,)."""
        return np.sqrt(np.diag(self.covariance))

    def pairs(self, at: slice) -> list[tuple[float, float]]:
        """Return values and standard deviations of the unknowns at these indices."""
        return list(zip(self.static[at].tolist(), self.sd[at].tolist(), strict=True))


class CostTerm:
    """A term that adds no unknowns, costs nothing and reads nothing: each term overrides what it needs of these three.

    Attributes:
        order: place among the terms, lowest first: of unknowns of one kind in the vector, of corrections of the loads,
            and of entries that are shown. Terms of equal order stay as they are listed.
        given: input of the estimate.
        model: the model as a function of the unknowns.
        layout: positions of the unknowns in the vector.
    """

    order: ClassVar[int] = 50

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return the unknowns that the term adds."""
        return ()

    def __init__(self, model: FreedModel) -> None:
        self.given, self.model, self.layout = model.given, model, model.layout

    def add(self, into: Gradient, here: "InTrial") -> None:
        """Add half the sum of squares of its residuals in a time block of a trial, and its derivatives."""

    def add_information(self, into: np.ndarray, static: np.ndarray) -> None:
        """Add the information (S, S) of a prior of its own."""

    def add_pull(self, rhs: np.ndarray, static: np.ndarray) -> float:
        """Add minus the derivatives (S,) of half the sum of squares of its own prior; return the sum."""
        return 0.0

    def add_second_derivatives(self, into: np.ndarray, rhs: np.ndarray) -> None:
        """Add what Gauss-Newton leaves out to the diagonal (S,) of the information, from the right-hand side (S,)."""

    def shorten(self, step: np.ndarray) -> None:
        """Shorten a step (S,) that exceeds the range of validity of the quadratic."""

    def in_root(self, root: RootFrames, k: int, static: np.ndarray) -> RootFrames:
        """Return the root equations of trial k, changed by the term's unknowns apart from the ground reactions."""
        return root

    def left_out(self, static: np.ndarray) -> np.ndarray | None:
        """Return the change of the others (S,) that, for the data, equals an unknown of unit SD outside the vector;
        None without one.

        Several such unknowns have (S, u).
        """
        return None

    def profiled(self) -> list[int]:
        """Return indices of errors whose sum gets its posterior from the profile of the cost."""
        return []

    def imitated(self) -> tuple[float, float]:
        """Return mean and SD of the part of the profiled sum that is apparent only: the data show it, but it is no
        error."""
        return 0.0, 0.0

    def read(self, solution: Solution) -> dict[str, Any]:
        """Return this term's fields of `SimultaneousResult`; the "calibration" entries of several terms are joined."""
        return {}


class LoadTerm(CostTerm):
    """A term whose unknowns are errors of the ground reactions.

    Load terms correct the loads one after the other, by `order`: those of other packages before the plates' own errors,
    which are of what is left.
    """

    order: ClassVar[int] = 10

    def delay_unknowns(self, k: int) -> list[int]:
        """Return the indices of the unknowns whose sum is the delay of the forces of trial k."""
        return []

    def corrected_loads(
        self, k: int, static: np.ndarray, loads: np.ndarray, loaded: np.ndarray, plate_index: np.ndarray
    ) -> np.ndarray:
        """Correct loads on the feet (n, 2, 6) for this term's errors, linearly in the loads and in `loaded`.

        Args:
            k: the trial.
            static: (S,) unknowns.
            loads: (n, 2, 6) force (N) and moment about the ground origin (N m).
            loaded: (n, 2) 1 where the foot stands, else 0; or its derivative, with derivatives of the loads.
            plate_index: (n, 2) index of the plate under each foot.
        """
        return loads

    def by_unknowns(
        self, k: int, static: np.ndarray, loads: np.ndarray, loaded: np.ndarray, plate_index: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives (n, 2, 6, ...) of the output of `corrected_loads` by the unknowns.

        `loads` are corrected by all terms: the derivatives of any but the last must not depend on them.
        """
        raise NotImplementedError

    def add_by_unknowns(self, k: int, by_static: np.ndarray, by: np.ndarray) -> None:
        """Add such derivatives (n, r, ...) to those by all static unknowns (n, r, s)."""
        raise NotImplementedError


def in_order(terms: Iterable[type[CostTerm]]) -> tuple[type[CostTerm], ...]:
    """Sort terms by their `order`."""
    return tuple(sorted(terms, key=lambda term: term.order))


class GroundLoads:
    """Ground reactions of the trials, corrected by the terms that model errors of them."""

    def __init__(self, given: Given, terms: Sequence[CostTerm]) -> None:
        self._trials, self._grounds = given.trials, given.grounds
        self._terms = [term for term in terms if isinstance(term, LoadTerm)]

    def delay_unknowns(self, k: int) -> list[int]:
        """Return the indices of the unknowns whose sum is the delay of the forces of trial k."""
        return [at for term in self._terms for at in term.delay_unknowns(k)]

    def delay_s(self, k: int, static: np.ndarray) -> float:
        """Return the delay (s) of the forces of trial k."""
        return float(static[self.delay_unknowns(k)].sum())

    def on_feet(
        self, k: int, static: np.ndarray, derivative: int = 0, frames: slice | np.ndarray = slice(None)
    ) -> np.ndarray:
        """Return corrected loads (n, 2, 6) on the feet at the frames of trial k, or their time derivatives."""
        ground, at = self._grounds[k], self._trials[k].time[frames] + self.delay_s(k, static)
        loads = ground.loads(at, derivative).reshape(len(at), 2, 6)
        return self._corrected(k, static, loads, ground.loaded(at, derivative), ground.plate_index[frames])

    def reactions(self, k: int, static: np.ndarray) -> GroundReactions:
        """Return corrected loads for the joint moments of trial k, on the time base of the markers."""
        raw = self._grounds[k].reactions
        wrench = self._corrected(k, static, raw.wrench, raw.loaded, raw.plate_index)
        impact = self._corrected(k, static, raw.impact, np.zeros(raw.plate_index.shape), raw.plate_index)
        return replace(raw, time=raw.time - self.delay_s(k, static), wrench=wrench, impact=impact)

    def _corrected(
        self, k: int, static: np.ndarray, loads: np.ndarray, loaded: np.ndarray, plate_index: np.ndarray
    ) -> np.ndarray:
        for term in self._terms:
            loads = term.corrected_loads(k, static, loads, loaded, plate_index)
        return loads

    def by_errors(
        self, k: int, static: np.ndarray, loads: np.ndarray, loaded: np.ndarray, frames: np.ndarray
    ) -> Iterator[Derivative]:
        """Yield the derivatives (n, 2, 6, ...) of corrected loads (n, 2, 6) by each term's unknowns.

        `loaded` (n, 2) is 1 where the foot stands.
        """
        plate_index, nothing = self._grounds[k].plate_index[frames], np.zeros(loaded.shape)
        for place, term in enumerate(self._terms):
            by = term.by_unknowns(k, static, loads, loaded, plate_index)
            for later in self._terms[place + 1 :]:
                columns = np.moveaxis(by.reshape(*loads.shape, -1), -1, 0)
                rhs = [later.corrected_loads(k, static, column, nothing, plate_index) for column in columns]
                by = np.stack(rhs, axis=-1).reshape(by.shape)
            yield by, partial(term.add_by_unknowns, k)

    def root(self, k: int, static: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, tuple[Derivative, ...]]:
        """Return the sum (d, 6) of the loads on both feet, and its derivatives (d, 6, ...) by all errors but delays."""
        loads = self.on_feet(k, static, 0, frames)
        loaded = self._grounds[k].loaded(self._trials[k].time[frames] + self.delay_s(k, static))
        every = self.by_errors(k, static, loads, loaded, frames)
        return loads.sum(axis=1), tuple((by.sum(axis=1), add) for by, add in every)


@dataclass(frozen=True, eq=False)
class InTrial:
    """A time block of a trial at a point of the estimate.

    Attributes:
        model: of the person.
        loads: on the feet.
        terms: all terms.
        k: index of the trial.
        coefficients: of its motion.
        static: (S,) the other unknowns as they are in the trial.
        time_block: the time block.
    """

    model: FreedModel
    loads: GroundLoads
    terms: Sequence[CostTerm]
    k: int
    coefficients: np.ndarray
    static: np.ndarray
    time_block: TimeBlock

    @cached_property
    def near_q(self) -> np.ndarray:
        """Coordinates (f, c) of the freed skeleton in the block with its neighbours, `TimeBlock.with_neighbours`."""
        frames = self.time_block.with_neighbours
        parts = self.model.given.bases[self.k].evaluate(self.coefficients, frames, derivatives=0)
        return self.model.full(parts, self.static)[0]
