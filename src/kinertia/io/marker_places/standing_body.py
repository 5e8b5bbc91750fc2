"""Expresses the markers of a standing person in body axes, with the sagittal plane found from their symmetry."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from kinertia.io.marker_places.usual_places import Usual, by_label
from kinertia.trial.data import BoolArray, FloatArray

_STEP_DEG, _FINE_DEG = 6.0, 1.0
_OFFSETS_M = np.linspace(-0.15, 0.15, 31)
_ON_PLANE_M = 0.015
_FOOT_MARKER_M, _MARKER_M = 0.08, 0.02
"""The lowest marker of a foot is lower than the former; above a floor of unknown height it is about the latter."""
_UNMATCHED_M, _MIDDLE_M = 0.08, 0.04
"""Cost of a marker without a mirror image, and of one on the plane itself, which mirrors no other."""


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


@dataclass(frozen=True, eq=False)
class BodyAxes:
    """Axes of a standing person: forward, up and to the right, from the middle of the body on the floor.

    Attributes:
        rotation: (3, 3), body = rotation @ (ground - origin).
        origin: (3,) m in ground axes; its height is the floor's.
        asymmetry_m: mean distance of a marker from the mirror image of another.
    """

    rotation: FloatArray
    origin: FloatArray
    asymmetry_m: float

    def places(self, points: FloatArray) -> FloatArray:
        """Transform points (m, 3) from ground to body axes."""
        return (points - self.origin) @ self.rotation.T

    def turned(self) -> "BodyAxes":
        """Return the axes of the person facing the other way."""
        return BodyAxes(np.diag([-1.0, 1.0, -1.0]) @ self.rotation, self.origin, self.asymmetry_m)


def body_axes(points: FloatArray) -> BodyAxes:
    """Find the axes in which the markers best match their mirror image; which way is forward remains open.

    Args:
        points: (m, 3) m in ground axes, Y up.
    """
    best = min(_mirrored(points, angle) for angle in np.arange(0.0, 180.0, _STEP_DEG))
    near = best[1] + np.arange(-_STEP_DEG, _STEP_DEG + _FINE_DEG, _FINE_DEG)
    cost, angle, offset = min(_mirrored(points, one) for one in near)
    right = _direction(angle)
    forward = np.cross([0.0, 1.0, 0.0], right)
    middle = np.median(points, axis=0)
    origin = middle + (offset - middle @ right) * right
    lowest = float(points[:, 1].min())
    origin[1] = 0.0 if 0.0 <= lowest < _FOOT_MARKER_M else lowest - _MARKER_M
    return BodyAxes(np.array([forward, [0.0, 1.0, 0.0], right]), origin, cost)


def _direction(angle_deg: float) -> FloatArray:
    return np.array([np.cos(np.radians(angle_deg)), 0.0, np.sin(np.radians(angle_deg))])


def _mirrored(points: FloatArray, angle_deg: float) -> tuple[float, float, float]:
    """Return the lowest cost (m) of a mirror plane normal to this direction, the angle (deg), and its position (m)."""
    across = _direction(angle_deg)
    along = points @ across
    tree = cKDTree(points)
    own = np.arange(len(points))[:, None]
    best = (np.inf, angle_deg, 0.0)
    for offset in float(np.median(along)) + _OFFSETS_M:
        images = points - 2 * (along - offset)[:, None] * across
        distances, found = tree.query(images, k=2)
        cost = np.minimum(np.where(found == own, np.inf, distances).min(axis=1), _UNMATCHED_M)
        cost[np.abs(along - offset) < _ON_PLANE_M] = _MIDDLE_M
        if cost.mean() < best[0]:
            best = (float(cost.mean()), angle_deg, float(offset))
    return best
