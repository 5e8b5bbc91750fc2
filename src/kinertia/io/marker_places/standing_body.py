"""Expresses the markers of a standing person in body axes, with the hints of their labels."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kinertia.io.marker_places.usual_places import Usual, by_label
from kinertia.trial.data import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class StandingBody:
    """Markers of a standing person, for an assumed heading and stature.

    Attributes:
        labels: labels of the m markers.
        places: (m, 3) m, forward, up, right.
        stature_m: assumed stature.
        meant: landmarks and segments that each label hints at.
        trust: (m,) penalty of computed points; minus infinity where they are excluded.
        side: side stated by each label, "r" or "l"; else "".
        other_side: index of the marker with the corresponding label on the other side, or -1.
        mirrored: whether most labels contradict the side of their positions.
    """

    labels: tuple[str, ...]
    places: FloatArray
    stature_m: float
    meant: tuple[frozenset[str], ...]
    trust: FloatArray
    side: tuple[str, ...]
    other_side: tuple[int, ...]
    mirrored: bool

    @cached_property
    def outward(self) -> dict[str, FloatArray]:
        """Positions (m, 3) by side, with the third coordinate lateral on that side."""
        return {"r": self.places, "l": self.places * np.array([1.0, 1.0, -1.0])}

    def named(self, landmark: str) -> FloatArray:
        """Return scores (m,) from labels and trust for a landmark (without its side)."""
        return np.array([by_label(own, landmark) for own in self.meant]) + self.trust

    def scores(self, usual: Usual, side: str, anchor: FloatArray, landmark: str) -> FloatArray:
        """Return scores (m,) of all markers for a landmark of a side, from an anchor (3,) in lateral axes."""
        return usual.score(self.outward[side] - anchor, self.stature_m) + self.named(landmark)

    def is_side(self, side: str) -> BoolArray:
        """Return (m,) whether a marker is on this side, by its label or else by its position."""
        by_place, said = np.where(self.places[:, 2] > 0, "r", "l"), np.array(self.side)
        wanted = {"r": "l", "l": "r"}[side] if self.mirrored else side
        return np.asarray(np.where(said == "", by_place == side, said == wanted))
