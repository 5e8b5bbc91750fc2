"""Selects, among equivalent joint angles, those that are continuous from frame to frame.

A full turn changes nothing. And three rotations a, b, c about successively perpendicular axes give the same orientation
as a + pi, s - b, c + pi: s is pi where the first axis is perpendicular to the third (Cardan angles) and 0 where they
are equal (Euler angles). Frame by frame inverse kinematics may find any of them; here each joint gets values that do
not jump unless the segment does, and among these the ones within the coordinates' ranges.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.model.coordinate_range import Bounds
from kinertia.model.skeleton import Axis, Joint, Skeleton

_SQUARE = 1e-6
_END_RAD = 1e-9


@dataclass(frozen=True, eq=False)
class ThreeAngles:
    """Three angles of one joint that have a second, equivalent solution.

    Attributes:
        columns: of the coordinates, in the order of the rotations.
        middles: sum of the middle angles of both solutions, rad.
    """

    columns: tuple[int, ...]
    middles: float

    def equivalent(self, angles: np.ndarray) -> np.ndarray:
        """Return the other three angles (..., 3) for the same orientations."""
        first, middle, last = np.moveaxis(angles, -1, 0)
        return np.stack([first + np.pi, self.middles - middle, last + np.pi], axis=-1)


@dataclass(frozen=True, eq=False)
class EquivalentAngles:
    """Coordinates of a skeleton that have equivalent values.

    Attributes:
        joints: joints that rotate about three axes, the root first.
        single: columns of all other angles with a period of a full turn.
        bounds: of the coordinates.
        neutral: (c,) a typical pose.
    """

    joints: tuple[ThreeAngles, ...]
    single: tuple[int, ...]
    bounds: Bounds
    neutral: np.ndarray

    @classmethod
    def of(cls, model: Skeleton) -> Self:
        """Find the equivalent angles of a skeleton."""
        joints = tuple(angles for joint in model.joints if (angles := _three_angles(model, joint)) is not None)
        taken = {column for joint in joints for column in joint.columns}
        single = tuple(column for column in np.flatnonzero(model.periodic).tolist() if column not in taken)
        neutral = np.array([model.start.get(name, 0.0) for name in model.coordinates])
        return cls(joints, single, model.bounds, neutral)

    def nearest(self, q: np.ndarray, to: np.ndarray) -> np.ndarray:
        """Return the equivalents of poses q (..., c) that are nearest to other poses (..., c)."""
        q = q.copy()
        for joint in self.joints:
            own, goal = q[..., joint.columns], to[..., joint.columns]
            equals = [goal + within_half_a_turn(one - goal) for one in (own, joint.equivalent(own))]
            same, twin = (np.abs(one - goal).sum(axis=-1, keepdims=True) for one in equals)
            q[..., joint.columns] = np.where(twin < same, equals[1], equals[0])
        goal = to[..., self.single]
        q[..., self.single] = goal + within_half_a_turn(q[..., self.single] - goal)
        return q

    def continuous(self, q: np.ndarray) -> np.ndarray:
        """Return the equivalents of the poses q (n, c) that do not jump; NaN stays.

        Where these would leave a clamped range, a joint keeps its values.
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
        """Return equivalents of angles (n, k) that do not jump and leave their ranges least.

        They are the angles of one joint, or of k joints with one angle each.
        """
        paths = angles[None]
        if joint is not None:
            equivalent = joint.equivalent(angles)
            stay, change = (
                np.abs(within_half_a_turn(one[1:] - angles[:-1])).sum(axis=1) for one in (angles, equivalent)
            )
            # changes between second solutions are as large as between the angles themselves
            other = np.concatenate([[False], np.logical_xor.accumulate(change < stay)])[:, None]
            paths = np.stack([np.where(other, equivalent, angles), np.where(other, angles, equivalent)])
        choices = self._whole_turns(np.unwrap(paths, axis=1), columns)
        # the middle angle identifies the solution: the others may differ by full turns
        middle = self._from_neutral(choices, columns)[:, len(columns) // 2]
        best = choices[np.argmin(self._beyond(choices, columns).sum(axis=1) + middle)]
        low, high = self.bounds.least[list(columns)], self.bounds.most[list(columns)]
        leaves = (np.abs(best - np.clip(best, low, high)) > _END_RAD).any(axis=0)
        return np.where(leaves if joint is None else leaves.any(), angles, best)

    def _whole_turns(self, paths: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """Shift every angle of the paths (p, n, k) by the full turns that make it most plausible."""
        usual = np.round((np.median(paths, axis=1, keepdims=True) - self.neutral[list(columns)]) / (2 * np.pi))
        shifted = np.stack([paths - 2 * np.pi * (usual + turns) for turns in (0, 1, -1)])
        badness = self._beyond(shifted, columns) + self._from_neutral(shifted, columns)
        least: np.ndarray = np.take_along_axis(shifted, np.argmin(badness, axis=0)[None, :, None], axis=0)[0]
        return least

    def _beyond(self, path: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """Return the mean square excess (..., k) of angles (..., n, k) beyond their ranges."""
        low, high = self.bounds.low[list(columns)], self.bounds.high[list(columns)]
        result: np.ndarray = np.square(path - np.clip(path, low, high)).mean(axis=-2)
        return result

    def _from_neutral(self, path: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """Return a small penalty (..., k) for the distance from neutral, which decides between values within range."""
        result: np.ndarray = 1e-3 * np.square(path - self.neutral[list(columns)]).mean(axis=-2)
        return result


def within_half_a_turn(angles: np.ndarray) -> np.ndarray:
    """Return the same angles between -pi and pi."""
    return (angles + np.pi) % (2 * np.pi) - np.pi


def _three_angles(model: Skeleton, joint: Joint) -> ThreeAngles | None:
    """Return the joint's angles, if it rotates about three free axes in turn, each perpendicular to the next."""
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
