"""Expresses the markers of a standing person in body axes, and tabulates where they usually are.

Means and SDs were set by hand from published standing trials of adults and children, with allowance for posture.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from kinertia.trial.data import BoolArray, FloatArray

FOUND = 3.0
"""Score of finding a landmark, in units of half a chi square: without help of its label it is 2.4 SD off at most."""
_NAMED, _NAMED_OTHERWISE = 4.0, -3.0
"""Score of a label that means the landmark, or something else."""


@dataclass(frozen=True)
class Usual:
    """Usual position of a marker relative to another one, or to the middle of the body on the floor.

    Attributes:
        mean, sd: (x, y, z) as shares of the stature.
    """

    mean: tuple[float, float, float]
    sd: tuple[float, float, float]

    def score(self, offsets: FloatArray, stature_m: float) -> FloatArray:
        """Return scores of offsets (..., 3) m: above zero where they are near."""
        off = (offsets / stature_m - np.array(self.mean)) / np.array(self.sd)
        result: FloatArray = FOUND - 0.5 * np.square(off).sum(axis=-1)
        return result


WHERE = {
    "asis": "front corner of the pelvis",
    "psis": "back corner of the pelvis",
    "sacrum": "middle of the pelvis' back",
    "knee_lateral": "outermost at the knee",
    "knee_medial": "inside of it at the same height",
    "thigh_wand": "outermost on the thigh",
    "ankle_lateral": "outermost at the ankle",
    "ankle_medial": "inside of it at the same height",
    "shank_wand": "outermost on the shank",
    "heel": "back end of the foot",
    "metatarsal": "front of the foot",
    "toe": "tip of the foot",
    "acromion": "on top of the shoulder",
    "elbow_lateral": "an upper arm's length below the shoulder",
    "elbow_medial": "across the elbow from it",
    "wrist": "a forearm's length below the elbow",
    "c7": "on the midline behind the shoulders",
    "sternal_notch": "on the midline before the shoulders",
}
"""Descriptions of the landmarks."""
FREE = 1e3
"""SD that leaves a coordinate open."""
ASIS = Usual((0.0, 0.56, 0.0), (FREE, 0.02, FREE))
ASIS_APART = Usual((0.0, 0.0, 0.140), (0.04, 0.015, 0.022))
PSIS_FROM_ASIS = Usual((-0.105, 0.015, 0.028), (0.022, 0.018, 0.012))
SACRUM_FROM_ASIS = Usual((-0.115, 0.008, 0.0), (0.022, 0.022, 0.012))
"""The right ASIS from the left; the others in axes of the pelvis, from the middle of both ASIS."""
KNEE_FROM_ASIS = Usual((-0.065, -0.273, 0.030), (0.03, 0.02, 0.022))
ANKLE_FROM_KNEE = Usual((-0.025, -0.236, -0.003), (0.03, 0.02, 0.025))
INNER_KNEE = Usual((0.0, -0.003, -0.070), (0.018, 0.014, 0.02))
INNER_ANKLE = Usual((0.008, 0.003, -0.050), (0.013, 0.009, 0.01))
FOOT = {
    "heel": Usual((-0.035, -0.025, -0.026), (0.013, 0.013, 0.015)),
    "metatarsal_inner": Usual((0.090, -0.020, -0.045), (0.02, 0.013, 0.015)),
    "metatarsal_outer": Usual((0.068, -0.022, 0.012), (0.02, 0.013, 0.015)),
    "metatarsal_middle": Usual((0.085, -0.018, -0.018), (0.02, 0.013, 0.015)),
    "toe": Usual((0.118, -0.025, -0.022), (0.017, 0.013, 0.017)),
}
"""Positions from the lateral ankle, along the foot."""
ACROMION_FROM_ASIS = Usual((-0.06, 0.26, 0.035), (0.05, 0.03, 0.022))
C7_FROM_ACROMIA = Usual((-0.04, 0.025, 0.0), (0.03, 0.025, 0.012))
NOTCH_FROM_ACROMIA = Usual((0.04, -0.015, 0.0), (0.03, 0.025, 0.008))
ELBOW_FROM_ACROMION = (0.175, 0.025)
WRIST_FROM_ELBOW = (0.145, 0.02)
INNER_ELBOW = (0.055, 0.015)
"""Distances, mean and SD; arms may be anywhere."""


def by_label(meant: frozenset[str], landmark: str) -> float:
    """Return the score of a label, with these roles that it hints at, for a landmark."""
    if not meant:
        return 0.0
    return _NAMED if landmark in meant else _NAMED_OTHERWISE


def by_distance(distance_m: FloatArray, usual: tuple[float, float], stature_m: float) -> FloatArray:
    """Return the score of markers by their distance (m) alone."""
    return FOUND - 0.5 * np.square((distance_m / stature_m - usual[0]) / usual[1])


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
        return np.array([by_label(label_meanings, landmark) for label_meanings in self.meant]) + self.trust

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
    cost, angle, offset = min(_mirrored(points, near_angle) for near_angle in near)
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
    index = np.arange(len(points))[:, None]
    best = (np.inf, angle_deg, 0.0)
    for offset in float(np.median(along)) + _OFFSETS_M:
        images = points - 2 * (along - offset)[:, None] * across
        distances, found = tree.query(images, k=2)
        cost = np.minimum(np.where(found == index, np.inf, distances).min(axis=1), _UNMATCHED_M)
        cost[np.abs(along - offset) < _ON_PLANE_M] = _MIDDLE_M
        if cost.mean() < best[0]:
            best = (float(cost.mean()), angle_deg, float(offset))
    return best
