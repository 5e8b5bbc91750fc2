"""Projects the forces of virtual axes on the axes of joint coordinate systems, with their derivatives.

A component is M . e: the moment about the joint's centre, in the axes of the segment that carries the virtual axes,
times an axis that is fixed in the proximal segment, fixed in the distal one, or perpendicular to both. Where
coordinates change, so does the axis in that segment: an angle that is wrong by 2 degrees makes adduction out of 3 % of
flexion.

A load f on a segment reduces the force of every axis S that moves the segment by S . f.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.model.compiled import Bool2, Float2, Float3, Float4, Int1, compiled
from kinertia.model.skeleton import Pose, Skeleton
from kinertia.motion.joint_moments import VirtualAxes, joint_axes


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
        turned_axes = [
            joint_axes(parent[:, k], child[:, k], long_axis=joint.long_axis) for k, joint in enumerate(virtual.joints)
        ]
        axes = np.stack(
            [
                np.reshape(turned_axes, (len(turned_axes), *parent[:, 0].shape)).swapaxes(0, 1)
                if turned_axes
                else parent,
                child.swapaxes(2, 3),
            ],
            axis=2,
        )
        return cls(virtual, pose, first, axes, turned[:, virtual.bases])

    def turned(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (d, r, ...) with those of the virtual axes (forces, moments) projected on the joints' axes.

        The moments come first.
        """
        result, (d, j) = rows.copy(), self.bases.shape[:2]
        if j:
            pairs = rows[:, self.first :].reshape(d, j, 2, 3, -1)[:, :, ::-1]
            within = self.axes @ self.bases[:, :, None]
            result[:, self.first :] = (within @ pairs).reshape(d, 6 * j, *rows.shape[2:])
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


@compiled
def add_bodies(
    axes: Float3,
    slopes: Float2,
    rows: Int1,
    moved: Bool2,
    by_parameter: Float4,
    segments: Int1,
    chain: Float3,
    out: Float3,
) -> None:
    """Add the derivatives of generalised forces by the bodies' unknowns to the first columns of `out` (n, c, s).

    Args:
        axes: (n, a, 6) motion axes, in ground axes at the ground origin.
        slopes: (n, a) derivative of every axis value by its coordinate.
        rows: (a,) row of `out` of each axis' coordinate; -1 for none.
        moved: (b, a) whether the axis moves the body.
        by_parameter: (n, 6, s, 10) derivatives of the segments' loads at the ground origin by dynamic parameters.
        segments: (b,) indices of the bodies.
        chain: (b, 10, 10) derivatives of each body's dynamic parameters by its ten unknowns.
        out: written.
    """
    load = np.empty((6, 10 * len(segments)))
    for i in range(axes.shape[0]):
        for b in range(len(segments)):
            for r in range(6):
                by_body = by_parameter[i, r, segments[b]]
                for k in range(10):
                    total = 0.0
                    for p in range(10):
                        total += by_body[p] * chain[b, p, k]
                    load[r, 10 * b + k] = total
        for j in range(axes.shape[1]):
            if rows[j] < 0:
                continue
            row, slope, b = out[i, rows[j]], slopes[i, j], 0
            x, y, z = slope * axes[i, j, 0], slope * axes[i, j, 1], slope * axes[i, j, 2]
            u, v, w = slope * axes[i, j, 3], slope * axes[i, j, 4], slope * axes[i, j, 5]
            while b < len(segments):
                first = b
                while b < len(segments) and moved[b, j]:
                    b += 1
                for k in range(10 * first, 10 * b):
                    force = x * load[0, k] + y * load[1, k] + z * load[2, k]
                    row[k] += force + u * load[3, k] + v * load[4, k] + w * load[5, k]
                b += 1


@compiled
def take_load(
    axes: Float3,
    slopes: Float2,
    rows: Int1,
    moved: Int1,
    loads: Float2,
    by_load: Float3,
    first: int,
    tau: Float2,
    by_place: Float3,
    out: Float3,
) -> None:
    """Subtract a load on a segment from the forces of the axes that move the segment.

    Args:
        axes, slopes, rows: as in `add_bodies`.
        moved: (k,) the axes, in order; each rotates those after it.
        loads: (n, 6) at the ground origin.
        by_load: (n, 6, s) derivatives of the load by the static unknowns, from the column `first` on; zero before.
        first: the column.
        tau: (n, a) forces of the axes, written.
        by_place: (n, a, a) their derivatives by the axis positions (columns), written.
        out: (n, c, s) derivatives of generalised forces by the static unknowns, written.
    """
    carried = np.empty(6)
    for i in range(axes.shape[0]):
        by, fx, fy, fz = by_load[i], loads[i, 0], loads[i, 1], loads[i, 2]
        mx, my, mz = loads[i, 3], loads[i, 4], loads[i, 5]
        for at in range(len(moved)):
            j = moved[at]
            x, y, z, u, v, w = axes[i, j, 0], axes[i, j, 1], axes[i, j, 2], axes[i, j, 3], axes[i, j, 4], axes[i, j, 5]
            tau[i, j] -= x * fx + y * fy + z * fz + u * mx + v * my + w * mz
            # (S_j x S_l) . f = S_l . (f moved along with j)
            carried[0], carried[1], carried[2] = fy * w - fz * v, fz * u - fx * w, fx * v - fy * u
            carried[3] = my * w - mz * v + fy * z - fz * y
            carried[4] = mz * u - mx * w + fz * x - fx * z
            carried[5] = mx * v - my * u + fx * y - fy * x
            for after in range(at + 1, len(moved)):
                later = moved[after]
                change = 0.0
                for r in range(6):
                    change += axes[i, later, r] * carried[r]
                by_place[i, later, j] -= change
            if rows[j] < 0:
                continue
            row, slope = out[i, rows[j]], slopes[i, j]
            for k in range(first, out.shape[2]):
                force = x * by[0, k] + y * by[1, k] + z * by[2, k] + u * by[3, k] + v * by[4, k] + w * by[5, k]
                row[k] -= slope * force
