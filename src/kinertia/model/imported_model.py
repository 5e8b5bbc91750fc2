"""Holds a model that was read from a file, and locates the joints and axes of any model with all coordinates at zero.

Mirroring is across the plane between the sides: in ground axes, and in the axes of the joints' parent bodies.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from kinertia.errors import OsimError
from kinertia.model.anatomy import segment_of
from kinertia.model.bsp import BodySegmentParameters, FloatArray
from kinertia.model.coordinate_map import AxisFunction
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Joint, Skeleton
from kinertia.trial.data import Markers


@dataclass(frozen=True)
class OsimCoordinate:
    """A coordinate as defined in the file, in rad or m.

    Attributes:
        name, joint: names.
        default: its default value.
        range: smallest and largest value.
        clamped: whether OpenSim keeps it in its range.
        locked: whether OpenSim fixes it at its default.
        angle: whether motion files give it in degrees; False for lengths and for OpenSim's "coupled" coordinates, which
            move axes by curves only and stay in rad or m.
    """

    name: str
    joint: str
    default: float
    range: tuple[float, float]
    clamped: bool
    locked: bool
    angle: bool


@dataclass(frozen=True)
class OsimJoint:
    """A joint as defined in the file.

    Attributes:
        name: its name.
        coordinates: in the file's order.
        offset: byte span, in the file, of the element whose translation moves the joint in its parent's own axes; None
            if there is none.
    """

    name: str
    coordinates: tuple[OsimCoordinate, ...]
    offset: tuple[int, int] | None


@dataclass(frozen=True)
class Coupling:
    """A coordinate that depends on another by a CoordinateCouplerConstraint."""

    dependent: str
    independent: str
    function: AxisFunction


@dataclass(frozen=True, eq=False)
class OsimModel:
    """A model file as Kinertia represents it.

    Attributes:
        path, content: the file and its bytes.
        skeleton: locked coordinates at their defaults; coupled coordinates depend on their independent ones.
        bsp: of all bodies, in the file's order; a body may be massless.
        joints: in the skeleton's order.
        couplings: dependent coordinates, which are not in the skeleton.
        marker_frames: per label, (3, 3) orientation of the frame in which its location is given, in its body.

    Examples:
        >>> model = kinertia.read_osim("model.osim")  # as `kinertia demo` writes it
        >>> len(model.coordinates), model.skeleton.segments[0]
        (27, 'pelvis')
    """

    path: Path
    content: bytes = field(repr=False)
    skeleton: Skeleton
    bsp: BodySegmentParameters
    joints: tuple[OsimJoint, ...]
    couplings: tuple[Coupling, ...]
    marker_frames: Mapping[str, np.ndarray]

    @cached_property
    def coordinates(self) -> tuple[OsimCoordinate, ...]:
        """All coordinates of the file, joint by joint."""
        return tuple(coordinate for joint in self.joints for coordinate in joint.coordinates)

    def all_coordinates(self, skeleton: Skeleton, q: np.ndarray) -> np.ndarray:
        """Return values (n, k) of all `coordinates`, including locked and coupled ones.

        Args:
            skeleton: the model's, possibly with more coordinates locked.
            q: (n, c) its coordinates.
        """
        known = {name: q[:, i] for i, name in enumerate(skeleton.coordinates)}
        known |= {name: np.full(len(q), value) for name, value in skeleton.locked.items()}
        for coupling in self.couplings:
            known[coupling.dependent] = coupling.function(known[coupling.independent])
        return np.stack([known[coordinate.name] for coordinate in self.coordinates], axis=1)


def markers_of_model(model: OsimModel) -> MarkerSet:
    """Return the marker set of an OpenSim model, by segment and in its default pose.

    It has no landmarks, since no model is built from it.

    Raises:
        OsimError: the model has no markers.
    """
    markers = model.skeleton.markers
    if not markers:
        raise OsimError.found(model.path, "O106")
    owners = {marker.label: segment_of(marker.segment) or marker.segment for marker in markers}
    names = dict.fromkeys(("foot_r", "foot_l", *owners.values()))
    segments = {name: tuple(label for label, owner in owners.items() if owner == name) for name in names}
    skeleton, defaults = model.skeleton, {c.name: c.default for c in model.coordinates}
    q = np.array([[defaults[name] for name in skeleton.coordinates]])
    places = Markers(np.zeros(1), skeleton.labels, skeleton.marker_positions(skeleton.pose(q)))
    return MarkerSet(model.path.name, {}, segments, {}, places)


@dataclass(frozen=True)
class NeutralJoints:
    """Joints by the name of their child body.

    Attributes:
        joints: as in the model.
        rotations: (3, 3) by body, its axes in ground.
        origins: (3,) m by body, its origin in ground.
        centres: (3,) m by body, the centre of its joint in ground.
        turns: by body, by coordinate, (3,) the axis in ground about which the joint rotates; translations are not
            included.
    """

    joints: Mapping[str, Joint]
    rotations: Mapping[str, FloatArray]
    origins: Mapping[str, FloatArray]
    centres: Mapping[str, FloatArray]
    turns: Mapping[str, Mapping[str, FloatArray]]

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Pairs of corresponding bodies of the right and of the left side."""
        pairs = [(name, f"{name[:-2]}_l") for name in self.joints if name.endswith("_r")]
        return [(right, left) for right, left in pairs if left in self.joints]

    @property
    def sideways(self) -> int | None:
        """Ground axis from left to right, 0 or 2 (x or z); None if the sides are not beside each other."""
        across = sum((self.centres[right] - self.centres[left] for right, left in self.pairs), np.zeros(3))
        if not np.abs(across).any() or np.abs(across).argmax() == 1:
            return None
        return int(np.abs(across).argmax())


def neutral_joints(skeleton: Skeleton) -> NeutralJoints:
    """Locate the joints of a model whose coordinates are zero, except for those that are locked at another value."""
    pose = skeleton.neutral
    rotations = {name: pose.rotation[0, i] for i, name in enumerate(skeleton.segments)}
    origins = {name: pose.translation[0, i] for i, name in enumerate(skeleton.segments)}
    joints = {joint.child: joint for joint in skeleton.joints}
    centres = {name: origins[name] + rotations[name] @ joint.child_translation for name, joint in joints.items()}
    moving = [
        (joint.child, axis.coordinate)
        for joint in skeleton.joints
        for axis in joint.axes
        if axis.coordinate not in skeleton.locked
    ]
    slopes = np.ones(len(moving)) if pose.slopes is None else pose.slopes[0]
    turns: dict[str, dict[str, FloatArray]] = {name: {} for name in joints}
    for (child, coordinate), velocity, slope in zip(moving, pose.axes[0], slopes, strict=True):
        turns[child][coordinate] = turns[child].get(coordinate, np.zeros(3)) + slope * velocity[3:]
    turning = {
        child: {coordinate: axis / np.linalg.norm(axis) for coordinate, axis in axes.items() if axis.any()}
        for child, axes in turns.items()
    }
    return NeutralJoints(joints, rotations, origins, centres, turning)


def mirrored(axis: int) -> FloatArray:
    """Return the reflection (3, 3) that reverses this axis."""
    reflection = np.eye(3)
    reflection[axis, axis] = -1.0
    return reflection


def angle_deg(axis: FloatArray, other: FloatArray) -> float:
    """Return the angle between two lines of these directions (unit): an axis and its opposite are the same line."""
    return float(np.degrees(np.arccos(min(1.0, abs(float(axis @ other))))))


def centre_offsets(skeleton: Skeleton) -> dict[str, np.ndarray]:
    """Return by joint how far (3,) m its centre offsets move it in its parent, along the parent's axes."""
    names = {name.removesuffix("/offset_x") for name in skeleton.locked if name.endswith("/offset_x")}
    return {name: np.array([skeleton.locked[f"{name}/offset_{axis}"] for axis in "xyz"]) for name in names}


def joint_and_axis(coordinate: str) -> tuple[str, str]:
    """Return joint and axis that a static coordinate moves or tilts, from its name.

    >>> [joint_and_axis(name) for name in ("hip_x_r", "lumbar_y", "knee_tilt_1_l", "hip_l/offset_z")]
    [('hip_r', 'x'), ('lumbar', 'y'), ('knee_l', '1'), ('hip_l', 'z')]
    """
    joint, axis, side = re.fullmatch(r"(.+?)(?:/offset|_tilt)?_([xyz12])(_[rl])?", coordinate).groups("")  # type: ignore[union-attr]
    return f"{joint}{side}", axis
