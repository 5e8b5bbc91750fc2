"""Projects the forces of virtual axes on the axes of joint coordinate systems, with their derivatives.

A component is M . e: the moment about the joint's centre, in the axes of the segment that carries the virtual axes,
times an axis that is fixed in the proximal segment, fixed in the distal one, or perpendicular to both. Where
coordinates change, so does the axis in that segment: an angle that is wrong by 2 degrees makes adduction out of 3 % of
flexion.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.model.skeleton import Pose, Skeleton
from kinertia.motion.joint_moments import joint_axes
from kinertia.motion.joint_wrench import VirtualAxes


@dataclass(frozen=True, eq=False)
class JointRows:
    """Axes of j joints at d frames.

    Attributes:
        virtual: the skeleton with its virtual axes.
        pose: (d frames) of that skeleton.
        first: number of rows before those of the joints.
        axes: (d, j, 2, 3, 3) unit axes of the moments, then of the forces, in rows, in ground.
        bases: (d, j, 3, 3) axes of the segments that carry the virtual axes, in columns, in ground.
    """

    virtual: VirtualAxes
    pose: Pose
    first: int
    axes: np.ndarray
    bases: np.ndarray

    @classmethod
    def of(cls, virtual: VirtualAxes, pose: Pose, first: int) -> Self:
        """Make the axes at these poses."""
        turned = pose.rotation
        parent, child = turned[:, virtual.parents], turned[:, virtual.children]
        own = [joint_axes(parent[:, k], child[:, k], long_axis=each.long_axis) for k, each in enumerate(virtual.joints)]
        axes = np.stack(
            [np.reshape(own, (len(own), *parent[:, 0].shape)).swapaxes(0, 1) if own else parent, child.swapaxes(2, 3)],
            axis=2,
        )
        return cls(virtual, pose, first, axes, turned[:, virtual.bases])

    def turned(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (d, r, ...) with those of the virtual axes (forces, moments) projected on the joints' axes.

        The moments come first.
        """
        result, (d, j) = rows.copy(), self.bases.shape[:2]
        if j:
            own = rows[:, self.first :].reshape(d, j, 2, 3, -1)[:, :, ::-1]
            within = self.axes @ self.bases[:, :, None]
            result[:, self.first :] = (within @ own).reshape(d, 6 * j, *rows.shape[2:])
        return result

    def by_axes(self, forces: np.ndarray) -> np.ndarray:
        """Return what the axes' own changes add to the derivatives (d, r, c) by all coordinates of the skeleton.

        Args:
            forces: (d, r) of coordinates and virtual axes, not yet projected.
        """
        skeleton, (d, j) = self.virtual.skeleton, self.bases.shape[:2]
        result = np.zeros((d, forces.shape[1], len(skeleton.coordinates)))
        if not j:
            return result
        in_base = forces[:, self.first :].reshape(d, j, 2, 3)[:, :, ::-1]
        load = (self.bases[:, :, None] @ in_base[..., None])[..., 0]
        by = np.empty((d, j, 2, 3, len(skeleton.tree.parent)))
        for k in range(j):
            from_parent, from_child = _relative(skeleton, self.virtual, k)
            long, floating = (2, 1) if self.virtual.joints[k].long_axis else (1, 2)
            axes = self.axes[:, k, 0]
            by[:, k, 0, 0] = self._turning(axes[:, 0], load[:, k, 0]) * from_parent
            by[:, k, 0, long] = self._turning(axes[:, long], load[:, k, 0]) * from_child
            by[:, k, 0, floating] = self._of_floating(
                axes[:, floating], axes[:, 0], axes[:, long], load[:, k, 0], from_parent, from_child
            )
            for axis in range(3):
                by[:, k, 1, axis] = self._turning(self.axes[:, k, 1, axis], load[:, k, 1]) * from_child
        result[:, self.first :] = skeleton.map.to_coordinates(by.reshape(d, 6 * j, -1), self.pose.slopes)
        return result

    def _turning(self, axis: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Return load . (a x axis) (d, a) for rotation with each axis a of the skeleton."""
        result: np.ndarray = (self.pose.axes[:, :, 3:] @ np.cross(axis, load)[..., None])[..., 0]
        return result

    def _of_floating(
        self, floating: np.ndarray, first: np.ndarray, last: np.ndarray, load: np.ndarray, *turned: np.ndarray
    ) -> np.ndarray:
        """Return the same for the floating axis, the normalised product of the parent's (first) and child's (last).

        Args:
            floating, first, last, load: (d, 3) axes, and the load.
            turned: how (a,) each axis turns parent and child.
        """
        from_parent, from_child = turned
        product = np.cross(last, first)
        across = load - floating * np.einsum("dk,dk->d", load, floating)[:, None]
        across /= np.einsum("dk,dk->d", product, floating)[:, None]
        # across . (da x first + last x db) with da = a x last, db = a x first
        of_last = self._turning(last, np.cross(first, across)) * from_child
        result: np.ndarray = of_last + self._turning(first, np.cross(across, last)) * from_parent
        return result


def _relative(skeleton: Skeleton, virtual: VirtualAxes, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return how (a,) each axis turns parent and child of a joint relative to the segment of its virtual axes."""
    support = skeleton.support.astype(float)
    base = support[virtual.bases[k]]
    return support[virtual.parents[k]] - base, support[virtual.children[k]] - base
