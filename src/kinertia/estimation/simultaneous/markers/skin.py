"""Predicts errors that markers of a segment share: skin motion by joint angles, and the shoulder girdle.

Skin is displaced by the joints at both ends of its segment (Camomilla et al. 2013, J Biomech 46:2328; Bonci et al.
2014, J Biomech 47:2354). A marker m is at

    x_m = p(q) + R(q) [l_m + C_m phi(t)] + e,

with phi the `patterns` of its segment, directions in the space of the neighbouring angles, taken from inverse
kinematics and constant during the estimate, and C_m (3, p) unknown: as many coefficients as the segment has patterns,
on each axis. They belong to the person, so that all trials share them. The residual e is `marker_errors`.

The prior of each coefficient is a standard normal, since patterns are in metres: all patterns of the segment together
displace a marker by `EXPECTED_SD_M` over the trials, along each axis. Markers of a segment move with the same skin:
their coefficients are correlated.

The models fix the shoulder centre in the trunk. A person's is attached to the clavicle, which elevates and retracts
with the arm: by 6 and 16 degrees while the arm is raised by some 110 (Ludewig et al. 2009, J Bone Joint Surg Am
91:378). Elbow and wrist bend so that the arm's markers fit to millimetres all the same, and seem that accurate. In a
drop jump with arms swung overhead, when they were taken to be, four centimetres of shoulder motion were compensated by
a trunk without any inertia about its long axis, and by a force plate displaced by 36 mm.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Joint, Skeleton, skin_angles
from kinertia.motion.workload import pieces

EXPECTED_SD_M = {"thigh": 0.004, "shank": 0.003, "foot": 0.0015}
"""RMS displacement over a stride along each axis, by segment (Peters et al. 2010, Gait Posture 31:1); others:
`OTHER_EXPECTED_SD_M`. Foot: from 20 degrees up to 30 degrees down, its markers move by at most 1.8 mm (in front) to 4.3
mm (ankle, heel) over the bones (Tranberg and Karlsson 1998, Clin Biomech 13:71); a range of 4.3 mm is an RMS of 1.5 mm.
"""
OTHER_EXPECTED_SD_M = 0.0025
MOST_PATTERNS = 4
"""Largest number of patterns per segment. The angles of a gait are correlated: four directions contain nearly all
motion of three joints."""
ALIKE = 0.5
"""Correlation between two markers of a segment of the same coefficient."""
_STILL_RAD = 1e-3
"""Angles that vary by less do not displace skin."""
_NO_PATTERN_M = 1e-4
CLAVICLE_M = 0.15
CLAVICLE_PER_ARM = 0.16
"""Angle of the clavicle over that of the arm: 17 degrees over 110."""


@dataclass(frozen=True, eq=False)
class SkinPatterns:
    """Patterns that skin motion may follow in one trial.

    Coefficients are ordered by marker, then by pattern of its segment, then by axis (three).

    Attributes:
        values: (n, p) m, all segments' patterns; at `MapProblem` those of a time block.
        first, last: (m,) range of patterns of each marker's segment: first, ..., last - 1.
    """

    values: np.ndarray
    first: np.ndarray
    last: np.ndarray

    @classmethod
    def none(cls, frames: int, markers: int) -> Self:
        """Return skin that follows no pattern."""
        return cls(np.zeros((frames, 0)), *np.zeros((2, markers), dtype=int))

    @cached_property
    def begin(self) -> np.ndarray:
        """Index (m + 1,) at which the coefficients of each marker begin, then their total number."""
        return np.concatenate([[0], np.cumsum(3 * (self.last - self.first))])

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return int(self.begin[-1])

    def cut(self, frames: slice) -> Self:
        """Return the patterns at these frames."""
        result = replace(self, values=self.values[frames])
        vars(result).update(begin=self.begin, _by_segment=self._by_segment)  # worked out once
        return result

    def displaced(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the displacement (n, m, 3) m of the markers by skin motion, along the axes of their segments."""
        result = np.zeros((len(self.values), len(self.first), 3))
        for markers, places in self._by_segment:
            patterns = self.values[:, self.first[markers[0]] : self.last[markers[0]]]
            by_pattern = coefficients[places].transpose(1, 0, 2).reshape(patterns.shape[1], -1)
            result[:, markers] = (patterns @ by_pattern).reshape(-1, len(markers), 3)
        return result

    def information(self) -> np.ndarray:
        """Return the information (k, k) of the coefficients' prior."""
        result = np.zeros((self.size, self.size))
        for markers, places in self._by_segment:
            count = len(markers)
            unshared = np.eye(count) - ALIKE / (1.0 - ALIKE + ALIKE * count)
            flat = places.reshape(count, -1)
            result[flat[:, None], flat[None]] = unshared[:, :, None] / (1.0 - ALIKE)
        return result

    @cached_property
    def _by_segment(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Markers (k,) of each segment that has patterns, and indices of their coefficients (k, patterns, 3)."""
        result = []
        for start in np.unique(self.first[self.last > self.first]):
            markers = np.flatnonzero((self.first == start) & (self.last > self.first))
            count = 3 * int(self.last[markers[0]] - start)
            result.append((markers, self.begin[markers, None] + np.arange(count)))
        return [(markers, places.reshape(len(markers), -1, 3)) for markers, places in result]


def skin_patterns(
    skeleton: Skeleton, trials: Sequence[np.ndarray], adapted: Sequence[bool] | None = None
) -> tuple[SkinPatterns, ...]:
    """Derive the patterns of skin under a skeleton's markers from a person's trials.

    Args:
        skeleton: with these markers.
        trials: coordinates (n, c) of each.
        adapted: whether the skeleton's markers are adapted to each trial: skin is at rest in the mean posture of these
            trials. None: all.
    """
    every = np.concatenate(trials)
    adapted_q = [q for q, counts in zip(trials, adapted or [True] * len(trials), strict=True) if counts]
    rest = np.concatenate(adapted_q) if adapted_q else every
    away, varying = every - rest.mean(axis=0), np.std(every, axis=0)
    turns, first, last = [np.zeros((every.shape[1], 0))], {}, {}
    for segment in np.unique(skeleton.marker_segments):
        directions = _directions(skeleton, skeleton.segments[segment], away, varying)
        first[segment] = sum(turn.shape[1] for turn in turns)
        last[segment] = first[segment] + directions.shape[1]
        turns.append(directions)
    patterns = np.split(away @ np.hstack(turns), np.cumsum([len(trial) for trial in trials])[:-1])
    begin, end = (np.array([part[s] for s in skeleton.marker_segments], dtype=int) for part in (first, last))
    return tuple(SkinPatterns(pattern, begin, end) for pattern in patterns)


def _directions(skeleton: Skeleton, segment: str, away: np.ndarray, varying: np.ndarray) -> np.ndarray:
    """Return the matrix (c, p) m/rad from the coordinates to the patterns of a segment."""
    angles = [i for i in skin_angles(skeleton, segment) if varying[i] > _STILL_RAD]
    if not angles:
        return np.zeros((len(varying), 0))
    kind = (segment_of(segment) or "").rpartition("_")[0]
    expected = EXPECTED_SD_M.get(kind, OTHER_EXPECTED_SD_M)
    # half of the expected variance is proportional to the motion of an angle, half equal for all angles
    square = np.square(varying[angles])
    scale = expected * np.sqrt(0.5 * square / square.sum() + 0.5 / len(angles)) / varying[angles]
    _, size, directions = np.linalg.svd(away[:, angles] * scale, full_matrices=False)
    kept = (size / np.sqrt(len(away)) > _NO_PATTERN_M)[:MOST_PATTERNS].sum()
    result = np.zeros((len(varying), kept))
    result[angles] = scale[:, None] * directions[:kept].T
    return result


def girdle_variance(skeleton: Skeleton, q: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Return the effective variance (m,) m2, along each axis, of marker positions due to the shoulder girdle.

    It is zero for markers that are not on the arms. The variance of a sum of k equal errors is k times that of k
    independent ones: the errors of an arm count as one.

    Args:
        skeleton: with its markers.
        q: (n, c) coordinates of the trial, none missing.
        shown: (m,) True for markers that the trial has.
    """
    result = np.zeros(len(skeleton.markers))
    for joint in skeleton.joints:
        if (segment_of(joint.child) or "").startswith("upper_arm") and _on_rigid_trunk(skeleton, joint):
            moved_m = CLAVICLE_M * CLAVICLE_PER_ARM * _spread_rad(skeleton, joint, q)
            carried = _from(skeleton, joint.child)
            on_segment = shown & np.array([marker.segment in carried for marker in skeleton.markers], dtype=bool)
            result[on_segment] = on_segment.sum() * moved_m**2 / 3.0
    return result


def _on_rigid_trunk(skeleton: Skeleton, shoulder: Joint) -> bool:
    """Decide whether the shoulder is fixed in the trunk, with no clavicle or scapula in the model that moves it."""
    last_axis = dict(zip(skeleton.segments, skeleton.tree.last_axis.tolist(), strict=True))
    above = {joint.child: joint.parent for joint in skeleton.joints}
    body = shoulder.parent
    while segment_of(above[body]) == "torso":
        if last_axis[body] != last_axis[above[body]]:
            return segment_of(body) == "torso" and not body.lower().startswith(("clavicle", "scapula"))
        body = above[body]
    return segment_of(body) == "torso"


def _spread_rad(skeleton: Skeleton, shoulder: Joint, q: np.ndarray) -> float:
    """Return the RMS angle (rad) between the arm's direction in the trunk and its mean."""
    elbow = next((joint for joint in skeleton.joints if joint.parent == shoulder.child), None)
    far = np.array([0.0, -1.0, 0.0]) if elbow is None else elbow.translation - shoulder.child_translation
    direction = np.empty((len(q), 3))
    for some in pieces(len(q)):
        turned = skeleton.pose(q[some]).rotation
        arm, trunk = (turned[:, skeleton.segments.index(name)] for name in (shoulder.child, shoulder.parent))
        direction[some] = np.einsum("nji,njk,k->ni", trunk, arm, far / np.linalg.norm(far))
    return float(np.sqrt(np.square(direction - direction.mean(axis=0)).sum(axis=1).mean()))


def _from(skeleton: Skeleton, segment: str) -> set[str]:
    """Return the segment and all segments beyond it."""
    carried = {segment}
    for joint in skeleton.joints:
        if joint.parent in carried:
            carried.add(joint.child)
    return carried
