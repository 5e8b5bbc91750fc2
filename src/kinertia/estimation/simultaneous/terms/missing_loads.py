"""Models loads that act on the body but not on a plate, in part of a contact.

A forefoot beyond the edge takes load off the plate once the heel is lifted; a stick or a handrail takes vertical force.
Each contact has a share of the vertical load, and each third of it a share of the whole load, that is missing. They are
unknowns for plates whose loads the prior calls incomplete; the loads on the feet, for joint moments, stay as measured.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.simultaneous.inputs import FreedModel, Given
from kinertia.estimation.simultaneous.layout import Unknowns
from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm
from kinertia.estimation.simultaneous.terms.root_terms import RootFrames
from kinertia.trial.sampled_time import runs

MISSING = "missing loads"
MISSING_SD = 0.12
"""Standard deviation of each share."""
_LOADED, _FEWEST, _PARTS = 0.1, 4, 3
"""Share of a foot's largest load from which it is a contact; fewest frames of a part; number of parts."""


@dataclass(frozen=True, eq=False)
class LoadPart:
    """Part of a contact: trial, foot, index of the plate, frames (n,) of the trial; of vertical loads only, or all."""

    trial: int
    foot: int
    plate: int
    frames: np.ndarray
    vertical: bool

    def of(self, loads: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Return this part (d, 6) of loads on the feet (d, 2, 6) at these frames (d,)."""
        result: np.ndarray = loads[:, self.foot] * self.frames[frames][:, None]
        if self.vertical:
            # of the moments about the ground origin, those about horizontal axes are the vertical force's
            result = result * [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]
        return result


def _parts(given: Given) -> Iterator[LoadPart]:
    """Yield the parts of all contacts of plates with incomplete loads."""
    incomplete = [k for k, name in enumerate(given.plates) if name in given.calibration.instruments.incomplete]
    for k, (trial, ground) in enumerate(zip(given.trials, given.grounds, strict=True)):
        if not incomplete or not trial.ground.plates:
            continue
        vertical = ground.loads(trial.time).reshape(-1, 2, 6)[..., 1]
        for foot, load in enumerate(vertical.T):
            for plate in incomplete:
                on = (load > _LOADED * load.max()) & (ground.carrier[:, foot] == plate)
                for first, last in runs(on):
                    yield from _of_contact(k, foot, plate, trial.dynamic, np.arange(first, last + 1))


def _of_contact(k: int, foot: int, plate: int, dynamic: np.ndarray, contact: np.ndarray) -> Iterator[LoadPart]:
    """Yield the vertical load of a contact, and its thirds; only parts of which enough frames are measured."""
    thirds = ((some, False) for some in np.array_split(contact, _PARTS))
    for some, vertical in ((contact, True), *thirds):
        frames = np.zeros(len(dynamic), dtype=bool)
        frames[some] = dynamic[some]
        if frames.sum() >= _FEWEST:
            yield LoadPart(k, foot, plate, frames, vertical)


class MissingLoads(CostTerm):
    """Loads that act on the body but not on plates with incomplete loads, as shares of what the plates measured."""

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return the share of each part; none if all loads are complete."""
        prior = FaultMixture.certain(MISSING_SD)
        return (Unknowns.errors(MISSING, "1", ErrorPriors((prior,) * len(list(_parts(given))))),)

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        self.parts = list(_parts(self.given))

    def in_root(self, root: RootFrames, k: int, static: np.ndarray) -> RootFrames:
        """Add the missing loads of trial k."""
        own = [index for index, part in enumerate(self.parts) if part.trial == k]
        if not own:
            return root
        loads = self.given.grounds[k].loads(self.given.trials[k].time[root.frames]).reshape(-1, 2, 6)
        by = np.stack([self.parts[index].of(loads, root.frames) for index in own], axis=2)
        at = self.layout[MISSING].start + np.array(own)

        def add(by_static: np.ndarray, by: np.ndarray) -> None:
            by_static[:, :, at] += by

        return replace(root, wrench=root.wrench + by @ static[at], by_errors=(*root.by_errors, (by, add)))
