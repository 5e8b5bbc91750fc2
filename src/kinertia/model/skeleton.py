"""Defines `Skeleton`: segments, joints, coordinates, markers, and the kinematic tree that they form.

A joint places its child segment in its parent by a constant transform followed by a list of single axes, each a
rotation about or a translation along a fixed direction. Every axis depends on one coordinate and becomes one axis of
the tree, so that `n_q = n_v` and a coordinate is an ordinary function of time. Locked axes are constants: they become
part of the transforms, which is how a calibrated joint-centre offset (a coordinate that does not move in time) or an
arm rotation that no marker determines enters the model.

In the 27-DOF model an axis is its coordinate. In an OpenSim model it may be a function of it, and several may depend on
the same one: `Skeleton.map` converts between coordinates and axes. The tree (`KinematicTree`) contains axes only.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.model.bsp import BodySegmentParameters, transformed_parameters
from kinertia.model.coordinate_map import AxisFunction, CoordinateMap, Root
from kinertia.model.coordinate_range import ANYTHING, Bounds, Range
from kinertia.model.kinematic_tree import KinematicTree, poses

GRAVITY_M_S2 = 9.80665
"""Standard gravity; OpenSim's default models use 9.80665 or 9.8066."""


@dataclass(frozen=True)
class Axis:
    """One degree of freedom of a joint: `coordinate` moves along or about `direction` (unit, in the frame so far).

    With a `function` the axis moves by its value at the coordinate, else by the coordinate itself (rad or m).
    """

    coordinate: str
    kind: Literal["rotation", "translation"]
    direction: tuple[float, float, float]
    function: AxisFunction | None = None


@dataclass(frozen=True)
class Joint:
    """Places segment `child` in segment `parent` ("ground" for the root).

    The joint frame is at `translation` (m) with `rotation` (3, 3) in the parent's frame; the `axes` follow in order;
    after the last one comes the joint's far frame, which is at `child_translation` with `child_rotation` in the child's
    frame.
    """

    parent: str
    child: str
    rotation: np.ndarray
    translation: np.ndarray
    axes: tuple[Axis, ...]
    child_rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    child_translation: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Marker:
    """A marker fixed to a segment: `position` (3,) m in the segment's frame."""

    label: str
    segment: str
    position: np.ndarray


@dataclass(frozen=True)
class Pose:
    """Positions of segments and axes at n frames.

    Attributes:
        rotation: (n, s, 3, 3) segment frames in ground.
        translation: (n, s, 3) m, segment origins in ground.
        axes: (n, a, 6) the spatial velocity in ground axes, at the ground origin, of the segments that each axis moves
            at unit rate: linear first, then angular.
        slopes: (n, a) derivatives of the axes by their coordinates; None if axes are coordinates.
    """

    rotation: np.ndarray
    translation: np.ndarray
    axes: np.ndarray
    slopes: np.ndarray | None


@dataclass(frozen=True)
class Skeleton:
    """Segments connected by joints, with markers on them; the first joint is the root.

    Attributes:
        name: the model's name.
        joints: parents before children.
        markers: all markers, in order.
        locked: coordinates fixed at a constant value (rad or m).
        gravity_m_s2: downward, along -y.
        feet: the segments that the ground acts on, right and left.
        start: nonzero coordinates from which inverse kinematics starts (rad or m).
        carried: parameters of segments that are fixed; `bodies` adds others to them.
        ranges: of coordinates (rad or m), where known.

    Examples:
        >>> skeleton = kinertia.walking_subject().skeleton
        >>> len(skeleton.segments), skeleton.coordinates[:2]
        (14, ('pelvis_tx', 'pelvis_ty'))
    """

    name: str
    joints: tuple[Joint, ...]
    markers: tuple[Marker, ...]
    locked: Mapping[str, float] = field(default_factory=dict)
    gravity_m_s2: float = GRAVITY_M_S2
    feet: tuple[str, str] = ("foot_r", "foot_l")
    start: Mapping[str, float] = field(default_factory=dict)
    carried: BodySegmentParameters | None = None
    ranges: Mapping[str, Range] = field(default_factory=dict)

    @cached_property
    def segments(self) -> tuple[str, ...]:
        """Names of all segments, root first."""
        return tuple(joint.child for joint in self.joints)

    @cached_property
    def sides(self) -> dict[str, dict[str, int]]:
        """Columns of the coordinates, as `by_side` groups their names."""
        return by_side(self.coordinates)

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates that move, root first (the order of q)."""
        return tuple(dict.fromkeys(axis.coordinate for axis in self._axes if axis.coordinate not in self.locked))

    @cached_property
    def rotational(self) -> np.ndarray:
        """Mask (c,): True for angles (rad), False for lengths (m)."""
        angles = {axis.coordinate for axis in self._axes if axis.kind == "rotation"}
        return np.array([name in angles for name in self.coordinates])

    @cached_property
    def periodic(self) -> np.ndarray:
        """Mask (c,) of coordinates that are angles with a period of a full turn."""
        shaped = {axis.coordinate for axis in self._axes if axis.kind == "translation" or axis.function is not None}
        result: np.ndarray = self.rotational & np.array([name not in shaped for name in self.coordinates])
        return result

    @cached_property
    def bounds(self) -> Bounds:
        """Ranges of the coordinates as arrays."""
        return Bounds.of(self.coordinates, self.ranges)

    @property
    def _axes(self) -> list[Axis]:
        return [axis for joint in self.joints for axis in joint.axes]

    @cached_property
    def map(self) -> CoordinateMap:
        """Map from the coordinates to the axes of the tree."""
        moving = [axis for axis in self._axes if axis.coordinate not in self.locked]
        followed, functions = [axis.coordinate for axis in moving], [axis.function for axis in moving]
        return CoordinateMap.of(self.coordinates, followed, functions)

    @cached_property
    def root(self) -> Root:
        """The free joint of the first segment: its first three coordinates translate, the next three rotate."""
        joint = self.joints[0]
        directions = np.array([axis.direction for axis in joint.axes]).T
        return Root(
            np.asarray(joint.rotation),
            np.asarray(joint.translation),
            directions[:, :3],
            directions[:, 3:],
            np.asarray(joint.child_rotation),
            np.asarray(joint.child_translation),
        )

    def lock(self, values: Mapping[str, float]) -> Self:
        """Return the skeleton with these coordinates fixed at these values (rad or m)."""
        self._check_names(values)
        return replace(self, locked={**self.locked, **values})

    def free(self, names: Iterable[str]) -> Self:
        """Return the skeleton with these coordinates freed again."""
        names = set(names)
        self._check_names(names)
        return replace(self, locked={k: v for k, v in self.locked.items() if k not in names})

    def unbounded(self, names: Iterable[str]) -> Self:
        """Return the skeleton with unlimited ranges of these coordinates, disregarding model and anatomy."""
        return replace(self, ranges={**self.ranges, **dict.fromkeys(names, ANYTHING)})

    def with_markers(self, markers: Sequence[Marker]) -> Self:
        """Return the skeleton with other markers."""
        changed = replace(self, markers=tuple(markers))
        changed.__dict__.update(tree=self.tree, map=self.map)  # markers move nothing
        return changed

    def with_positions(self, positions: np.ndarray) -> Self:
        """Return the skeleton with its markers at these positions (m, 3) in their segments."""
        rows = zip(self.markers, positions, strict=True)
        return self.with_markers([replace(marker, position=place) for marker, place in rows])

    def carrying(self, bsp: BodySegmentParameters | None) -> Self:
        """Return the skeleton with these fixed parameters of segments."""
        return replace(self, carried=bsp)

    def _check_names(self, names: Iterable[str]) -> None:
        unknown = set(names) - {axis.coordinate for axis in self._axes}
        if unknown:
            raise KeyError(f"no such coordinate in {self.name}: {', '.join(sorted(unknown))}")

    @cached_property
    def tree(self) -> KinematicTree:
        """The moving axes and the segments as arrays; locked axes are part of the transforms."""
        parents, kinds, directions, places = [], [], [], []
        last_axis, offset = {"ground": -1}, {"ground": np.eye(4)}
        for joint in self.joints:
            parent = last_axis[joint.parent]
            place = offset[joint.parent] @ placed(joint.rotation, joint.translation)
            for axis in joint.axes:
                if axis.coordinate in self.locked:
                    place = place @ placed_by(axis, self.locked[axis.coordinate])
                    continue
                parents.append(parent)
                kinds.append(axis.kind == "translation")
                directions.append(axis.direction)
                places.append(place)
                parent, place = len(parents) - 1, np.eye(4)
            last_axis[joint.child] = parent
            offset[joint.child] = place @ inverse(placed(joint.child_rotation, joint.child_translation))
        at = np.array(places).reshape(-1, 4, 4)
        segments = np.array([offset[segment] for segment in self.segments])
        return KinematicTree(
            np.array(parents, dtype=np.int64),
            np.array(kinds, dtype=np.bool_),
            np.array(directions, dtype=float).reshape(-1, 3),
            np.ascontiguousarray(at[:, :3, :3]),
            np.ascontiguousarray(at[:, :3, 3]),
            np.array([last_axis[segment] for segment in self.segments], dtype=np.int64),
            np.ascontiguousarray(segments[:, :3, :3]),
            np.ascontiguousarray(segments[:, :3, 3]),
        )

    @cached_property
    def support(self) -> np.ndarray:
        """Mask (s, a): True where axis a moves segment s."""
        last_axis = self.tree.last_axis
        carried = np.vstack([self.above.T, np.zeros((1, len(self.above)), dtype=bool)])
        result: np.ndarray = carried[last_axis]  # the last row is that of segments which no axis moves
        return result

    @cached_property
    def above(self) -> np.ndarray:
        """Mask (a, a): True where axis i is axis j or moves it (parents first, so it is upper triangular)."""
        count = len(self.tree.parent)
        above = np.eye(count, dtype=bool)
        for j, parent in enumerate(self.tree.parent):
            if parent >= 0:
                above[:, j] |= above[:, parent]
        return above

    @cached_property
    def marker_segments(self) -> np.ndarray:
        """Index (m,) of each marker's segment."""
        index = {name: i for i, name in enumerate(self.segments)}
        return np.array([index[marker.segment] for marker in self.markers], dtype=int)

    @cached_property
    def marker_locals(self) -> np.ndarray:
        """Marker positions (m, 3) in their segments' frames, m."""
        return np.array([marker.position for marker in self.markers]).reshape(-1, 3)

    @cached_property
    def carried_markers(self) -> tuple[np.ndarray, np.ndarray]:
        """Last axis (m,) that moves each marker, and the markers (m, 3) m in the frames of these axes."""
        tree, segment = self.tree, self.marker_segments
        turned = (tree.segment_rotation[segment] @ self.marker_locals[:, :, None])[..., 0]
        return tree.last_axis[segment], np.ascontiguousarray(turned + tree.segment_translation[segment])

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of all markers."""
        return tuple(marker.label for marker in self.markers)

    def pose(self, q: np.ndarray) -> Pose:
        """Compute segment frames and axes at the coordinates q (n, c)."""
        return Pose(*poses(self.tree, np.ascontiguousarray(self.map.axes(q), dtype=float)), self.map.slopes(q))

    @cached_property
    def neutral(self) -> Pose:
        """Pose (n = 1) where all coordinates are zero."""
        return self.pose(np.zeros((1, len(self.coordinates))))

    def marker_positions(self, pose: Pose) -> np.ndarray:
        """Return model markers (n, m, 3) m in ground at this pose."""
        turned = pose.rotation[:, self.marker_segments] @ self.marker_locals[:, :, None]
        result: np.ndarray = turned[..., 0] + pose.translation[:, self.marker_segments]
        return result

    def bodies(self, bsp: BodySegmentParameters) -> np.ndarray:
        """Return dynamic parameters (a, 10) of bodies attached directly to each axis, in its frame, with `carried`."""
        total = np.zeros((len(self.tree.parent), 10))
        for part in (bsp, self.carried):
            if part is not None:
                rows = np.array([self.segments.index(segment) for segment in part.segments])
                last_axis = self.tree.last_axis[rows]
                of_part = (self._parameter_places[rows] @ part.dynamic_parameters().reshape(-1, 10, 1))[..., 0]
                np.add.at(total, last_axis[last_axis >= 0], of_part[last_axis >= 0])
        return total

    @cached_property
    def _parameter_places(self) -> np.ndarray:
        """Matrices (s, 10, 10) from dynamic parameters of each segment to those in the frame of its last axis."""
        tree = self.tree
        return transformed_parameters(np.array([*map(placed, tree.segment_rotation, tree.segment_translation)]))


def placed(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Return the homogeneous transform (4, 4) of a frame."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation, translation
    return result


def inverse(place: np.ndarray) -> np.ndarray:
    """Return the inverse of a homogeneous transform."""
    rotation = place[:3, :3].T
    return placed(rotation, -rotation @ place[:3, 3])


def placed_by(axis: Axis, value: float) -> np.ndarray:
    """Return the transform (4, 4) of an axis when its coordinate has this value (rad or m)."""
    direction = np.array(axis.direction)
    if axis.function is not None:
        value = float(axis.function(np.array([value]))[0])
    if axis.kind == "translation":
        return placed(np.eye(3), direction * value)
    return placed(Rotation.from_rotvec(direction * value).as_matrix(), np.zeros(3))


def by_side(names: Sequence[str]) -> dict[str, dict[str, int]]:
    """Group names by side: name without its side -> side -> index in `names`; the side is "" for unpaired names.

    Examples:
        >>> from kinertia.model.skeleton import by_side
        >>> by_side(["pelvis_tilt", "knee_angle_r", "knee_angle_l"])
        {'pelvis_tilt': {'': 0}, 'knee_angle': {'r': 1, 'l': 2}}
    """
    columns: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        base, _, side = name.rpartition("_")
        paired = side in ("r", "l") and {f"{base}_r", f"{base}_l"} <= set(names)
        columns.setdefault(base if paired else name, {})[side if paired else ""] = column
    return columns


def mirrored(name: str) -> str:
    """Return the corresponding name of the other side; names without a side are unchanged.

    Examples:
        >>> from kinertia.model.skeleton import mirrored
        >>> mirrored("knee_r"), mirrored("c7")
        ('knee_l', 'c7')
    """
    base, _, side = name.rpartition("_")
    return f"{base}_{'l' if side == 'r' else 'r'}" if side in ("r", "l") else name


def opposite_on_left(skeleton: Skeleton) -> frozenset[str]:
    """Return the coordinates of pelvis and trunk that rotate about an axis in the plane of symmetry."""
    sideless = {name for name, columns in skeleton.sides.items() if "" in columns}
    axes = [axis for joint in skeleton.joints for axis in joint.axes if axis.kind == "rotation"]
    return frozenset(
        axis.coordinate for axis in axes if axis.coordinate in sideless and abs(axis.direction[2]) < np.sqrt(0.5)
    )


def skin_angles(skeleton: Skeleton, segment: str) -> list[int]:
    """Return the columns of the angles of the joints at both ends of a segment.

    A segment without markers in between (a patella, a talus) belongs to the joint. The root's angles are excluded,
    since they rotate the whole body.
    """
    ends = {marker.segment for marker in skeleton.markers} | {"ground"}
    names: set[str] = set()
    reached, left = {segment}, [segment]
    while left:
        here = left.pop()
        for joint in skeleton.joints:
            if here in (joint.child, joint.parent):
                names |= {axis.coordinate for axis in joint.axes if axis.kind == "rotation"}
                other = joint.parent if joint.child == here else joint.child
                if other not in ends | reached:
                    reached.add(other)
                    left.append(other)
    return [i for i, name in enumerate(skeleton.coordinates) if i >= 6 and name in names]
