"""Chooses, of angles that mean the same pose, those that continue from frame to frame.

A full turn changes nothing. And three rotations a, b, c about axes of which each is square to the next turn a segment
as a + pi, s - b, c + pi do: s is pi where the first axis is square to the third (Cardan angles) and 0 where they are
the same (Euler's). Frame by frame inverse kinematics finds any of them; here each joint gets values that do not jump
unless the segment does, and of these the ones within the coordinates' ranges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.model.coordinate_range import Bounds
from kinertia.model.skeleton import Axis, Joint, Skeleton

_SQUARE = 1e-6
_END_RAD = 1e-9


@dataclass(frozen=True, eq=False)
class ThreeAngles:
    """Three angles of one joint that have a twin.

    Attributes:
        columns: of the coordinates, in the order of the rotations.
        middles: what the middle angle and its twin add up to, rad.
    """

    columns: tuple[int, ...]
    middles: float

    def twins(self, angles: np.ndarray) -> np.ndarray:
        """The other three angles (..., 3) for the same orientations."""
        first, middle, last = np.moveaxis(angles, -1, 0)
        return np.stack([first + np.pi, self.middles - middle, last + np.pi], axis=-1)


@dataclass(frozen=True, eq=False)
class EqualAngles:
    """Which coordinates of a skeleton have equals.

    Attributes:
        joints: those that turn about three axes, the root first.
        single: columns of all other angles that a full turn does not change.
        bounds: of the coordinates.
        neutral: (c,) a usual pose.
    """

    joints: tuple[ThreeAngles, ...]
    single: tuple[int, ...]
    bounds: Bounds
    neutral: np.ndarray

    @classmethod
    def of(cls, model: Skeleton) -> EqualAngles:
        """The equal angles of a skeleton."""
        joints = tuple(angles for joint in model.joints if (angles := _three_angles(model, joint)) is not None)
        taken = {column for joint in joints for column in joint.columns}
        single = tuple(column for column in np.flatnonzero(model.periodic).tolist() if column not in taken)
        neutral = np.array([model.start.get(name, 0.0) for name in model.coordinates])
        return cls(joints, single, model.bounds, neutral)

    def nearest(self, q: np.ndarray, to: np.ndarray) -> np.ndarray:
        """The equals of poses q (..., c) that are nearest to other poses (..., c)."""
        q = q.copy()
        for joint in self.joints:
            own, goal = q[..., joint.columns], to[..., joint.columns]
            equals = [goal + within_half_a_turn(one - goal) for one in (own, joint.twins(own))]
            same, twin = (np.abs(one - goal).sum(axis=-1, keepdims=True) for one in equals)
            q[..., joint.columns] = np.where(twin < same, equals[1], equals[0])
        goal = to[..., self.single]
        q[..., self.single] = goal + within_half_a_turn(q[..., self.single] - goal)
        return q

    def continuous(self, q: np.ndarray) -> np.ndarray:
        """The equals of the poses q (n, c) that do not jump; NaN stays.

        Where those would leave a clamped range, a joint keeps the values that it has.
        """
        q = q.copy()
        always = np.isfinite(q).all(axis=0)
        known_together = tuple(column for column in self.single if always[column])
        alone = [((column,), None) for column in self.single if not always[column]]
        for columns, joint in [*((joint.columns, joint) for joint in self.joints), (known_together, None), *alone]:
            known = np.flatnonzero(np.isfinite(q[:, columns]).all(axis=1))
            if known.size and columns:
                some = np.ix_(known, np.array(columns))
                q[some] = self._one_branch(q[some], columns, joint)
        return q

    def _one_branch(self, angles: np.ndarray, columns: Sequence[int], joint: ThreeAngles | None) -> np.ndarray:
        """The equals of the angles (n, k) of one joint, or of k joints of one angle, that do not jump and leave their
        ranges least.
        """
        paths = angles[None]
        if joint is not None:
            twins = joint.twins(angles)
            stay, change = (np.abs(within_half_a_turn(one[1:] - angles[:-1])).sum(axis=1) for one in (angles, twins))
            # a change from twin to twin is as large as one between the angles themselves
            other = np.concatenate([[False], np.logical_xor.accumulate(change < stay)])[:, None]
            paths = np.stack([np.where(other, twins, angles), np.where(other, angles, twins)])
        choices = self._whole_turns(np.unwrap(paths, axis=1), columns)
        # which twin is meant shows in the middle angle: the others may have come round
        middle = self._from_neutral(choices, columns)[:, len(columns) // 2]
        best = choices[np.argmin(self._beyond(choices, columns).sum(axis=1) + middle)]
        low, high = self.bounds.least[list(columns)], self.bounds.most[list(columns)]
        leaves = (np.abs(best - np.clip(best, low, high)) > _END_RAD).any(axis=0)
        return np.where(leaves if joint is None else leaves.any(), angles, best)

    def _whole_turns(self, paths: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """The same paths (p, n, k), every angle shifted by the whole turns that make it least strange."""
        usual = np.round((np.median(paths, axis=1, keepdims=True) - self.neutral[list(columns)]) / (2 * np.pi))
        shifted = np.stack([paths - 2 * np.pi * (usual + turns) for turns in (0, 1, -1)])
        badness = self._beyond(shifted, columns) + self._from_neutral(shifted, columns)
        least: np.ndarray = np.take_along_axis(shifted, np.argmin(badness, axis=0)[None, :, None], axis=0)[0]
        return least

    def _beyond(self, path: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """(..., k) how far angles (..., n, k) are out of their ranges, mean square."""
        low, high = self.bounds.low[list(columns)], self.bounds.high[list(columns)]
        result: np.ndarray = np.square(path - np.clip(path, low, high)).mean(axis=-2)
        return result

    def _from_neutral(self, path: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """(..., k) a little for being far from neutral, which decides between equals within their ranges."""
        result: np.ndarray = 1e-3 * np.square(path - self.neutral[list(columns)]).mean(axis=-2)
        return result


def within_half_a_turn(angles: np.ndarray) -> np.ndarray:
    """The same angles between -pi and pi."""
    result: np.ndarray = (angles + np.pi) % (2 * np.pi) - np.pi
    return result


def _three_angles(model: Skeleton, joint: Joint) -> ThreeAngles | None:
    """The joint's angles, if it turns about three free axes one after the other, each square to the next."""
    turns = [axis for axis in joint.axes if axis.kind == "rotation" and not _still(model, axis)]
    if len(turns) != 3 or len({axis.coordinate for axis in turns}) != 3:
        return None
    first = joint.axes.index(turns[0])
    between = [axis for axis in joint.axes[first : joint.axes.index(turns[2])] if not _still(model, axis)]
    followed = [axis.coordinate for other in model.joints for axis in other.axes]
    free = all(
        axis.function is None and axis.coordinate not in model.locked and followed.count(axis.coordinate) == 1
        for axis in turns
    )
    a, b, c = (np.array(axis.direction) for axis in turns)
    if len(between) != 2 or not free or max(abs(a @ b), abs(b @ c)) > _SQUARE:
        return None
    columns = tuple(model.coordinates.index(axis.coordinate) for axis in turns)
    # half a turn about the third axis and half a turn about the first are one about the second
    return ThreeAngles(columns, 2 * float(np.arctan2(np.cross(c, a) @ b, c @ a)))


def _still(model: Skeleton, axis: Axis) -> bool:
    return axis.function is None and model.locked.get(axis.coordinate) == 0.0
