"""Where each kind of unknown that does not move stands in the vector of the simultaneous estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS


@dataclass(frozen=True)
class Layout:
    """Where each kind of static unknown stands in the vector; after those of each plate stand the floor's. Of several
    trials each has a delay of its own besides the clock's; a single one has none.
    """

    theta: slice
    plates: slice
    clock: int
    delays: slice
    coordinates: slice
    locals: slice
    skin: slice

    @classmethod
    def of(cls, n_bsp: int, n_coordinates: int, n_markers: int, n_plates: int, n_trials: int, n_skin: int) -> Layout:
        """The layout for these numbers of unknowns."""
        n_instruments = len(PLATE_UNKNOWNS) * n_plates + len(FLOOR_UNKNOWNS)
        counts = [n_bsp, n_instruments, 1, n_trials if n_trials > 1 else 0, n_coordinates, 3 * n_markers, n_skin]
        ends = np.cumsum(counts).tolist()
        theta, plates, clock, delays, coordinates, places, skin = (
            slice(end - count, end) for end, count in zip(ends, counts, strict=True)
        )
        return cls(theta, plates, clock.start, delays, coordinates, places, skin)

    @property
    def laboratory(self) -> slice:
        """What all of a laboratory's trials share: the plates' unknowns and the clock."""
        return slice(self.plates.start, self.clock + 1)

    @property
    def instruments(self) -> slice:
        """The same, and the delays of single trials."""
        return slice(self.plates.start, self.delays.stop)

    def late(self, trial: int) -> list[int]:
        """Which unknowns add up to the time by which the forces of a trial are late."""
        return [self.clock, *range(self.delays.start, self.delays.stop)[trial : trial + 1]]

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
