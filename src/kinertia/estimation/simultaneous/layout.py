"""Where each kind of unknown that does not move stands in the vector of the simultaneous estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS, ZERO_UNKNOWNS


@dataclass(frozen=True)
class Layout:
    """Where each kind of static unknown stands in the vector; after those of each plate stand the floor's. Of several
    trials each has a delay of its own besides the clock's, and so has one whose clock has not been checked. Zeros and
    gains are those of each trial's plates, the gains beside those of all trials, trunks how much bends in each trial
    (`trunk_bending`).
    """

    theta: slice
    plates: slice
    clock: int
    delays: slice
    zeros: slice
    gains: slice
    trunks: slice
    coordinates: slice
    locals: slice
    skin: slice
    plates_of_trials: tuple[int, ...]

    @classmethod
    def of(
        cls,
        n_bsp: int,
        n_coordinates: int,
        n_markers: int,
        n_plates: int,
        n_delays: int,
        plates_of_trials: Sequence[int],
        n_skin: int,
        n_trunks: int = 0,
    ) -> Layout:
        """The layout for these numbers of unknowns; of trials, how many plates each has."""
        n_instruments = len(PLATE_UNKNOWNS) * n_plates + len(FLOOR_UNKNOWNS)
        n_zeros = len(ZERO_UNKNOWNS) * sum(plates_of_trials)
        own = [n_delays, n_zeros, sum(plates_of_trials), n_trunks]
        counts = [n_bsp, n_instruments, 1, *own, n_coordinates, 3 * n_markers, n_skin]
        ends = np.cumsum(counts).tolist()
        theta, plates, clock, delays, zeros, gains, trunks, coordinates, places, skin = (
            slice(end - count, end) for end, count in zip(ends, counts, strict=True)
        )
        of_trials = delays, zeros, gains, trunks
        return cls(theta, plates, clock.start, *of_trials, coordinates, places, skin, tuple(plates_of_trials))

    @property
    def laboratory(self) -> slice:
        """What all of a laboratory's trials share: the plates' unknowns and the clock."""
        return slice(self.plates.start, self.clock + 1)

    @property
    def instruments(self) -> slice:
        """The same, and what each trial has of its own: a delay, its plates' zeros and gains, and how much
        the trunk bends."""
        return slice(self.plates.start, self.trunks.stop)

    def late(self, trial: int) -> list[int]:
        """Which unknowns add up to the time by which the forces of a trial are late."""
        return [self.clock, *range(self.delays.start, self.delays.stop)[trial : trial + 1]]

    def zeros_of(self, trial: int) -> np.ndarray:
        """(q, 2) where the zeros of the q plates of a trial stand."""
        each = len(ZERO_UNKNOWNS)
        first = self.zeros.start + each * sum(self.plates_of_trials[:trial])
        return np.arange(first, first + each * self.plates_of_trials[trial]).reshape(-1, each)

    def gains_of(self, trial: int) -> np.ndarray:
        """(q,) where the gains of the q plates of a trial stand."""
        first = self.gains.start + sum(self.plates_of_trials[:trial])
        return np.arange(first, first + self.plates_of_trials[trial])

    @property
    def in_root(self) -> slice:
        """What the root equations depend on: all but marker positions and skin."""
        return slice(0, self.coordinates.stop)

    @property
    def in_markers(self) -> slice:
        """What the markers depend on: static coordinates, marker positions and skin."""
        return slice(self.coordinates.start, self.skin.stop)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        result: int = self.skin.stop
        return result
