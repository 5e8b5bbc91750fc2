"""`Skeleton`: segments, joints, coordinates and markers, as a Pinocchio model.

A joint places its child segment in its parent by a constant placement followed by a list of single axes, each a
rotation about or a translation along a fixed direction. Every axis follows one coordinate and
becomes one 1-DOF Pinocchio joint, so that `n_q = n_v` and a coordinate is an ordinary function of time. Locked axes are
constants: they are folded into the placements, which is how a calibrated joint-centre offset (a coordinate that
does not move in time) or an arm rotation that no marker shows enters the model.

In the 27-DOF model an axis is its coordinate. In an OpenSim model it may be a function of it, and several may follow
the same one: `Skeleton.map` goes from coordinates to axes and back. Pinocchio sees axes only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
import pinocchio as pin

from kinertia.model.axis_functions import AxisFunction
from kinertia.model.bsp import BodySegmentParameters, inertia_of, second_moments
from kinertia.model.coordinate_map import CoordinateMap
from kinertia.model.root_joint import Root

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

    The joint frame stands at `translation` (m) with `rotation` (3, 3) in the parent's frame; the `axes` follow in
    order; after the last one stands the joint's far frame, which is at `child_translation` with `child_rotation` in the
    child's frame.
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
    """Where everything is at n frames, from one Pinocchio pass per frame.

    Attributes:
        rotation: (n, s, 3, 3) segment frames in ground.
        translation: (n, s, 3) m, segment origins in ground.
        jacobian: (n, 6, a): column j is the spatial velocity in ground axes, at the ground origin, that axis j at
            unit rate gives to what it moves: linear first, then angular.
        slopes: (n, a) derivatives of the axes by their coordinates; None where axes are coordinates.
    """

    rotation: np.ndarray
    translation: np.ndarray
    jacobian: np.ndarray
    slopes: np.ndarray | None

    def cut(self, frames: slice | np.ndarray) -> Pose:
        """The pose at these frames."""
        slopes = None if self.slopes is None else self.slopes[frames]
        return Pose(self.rotation[frames], self.translation[frames], self.jacobian[frames], slopes)


@dataclass(frozen=True)
class Skeleton:
    """Segments connected by joints, with markers on them; the first joint is the root.

    Attributes:
        name: the model's name.
        joints: parents before children.
        markers: all markers, in order.
        locked: coordinates held at a constant value (rad or m).
        gravity_m_s2: downward, along -y.
        feet: the segments that the ground acts on, right and left.
        start: coordinates from which inverse kinematics starts elsewhere than from zero (rad or m).
        carried: parameters of segments that are given once and for all; `model_with` adds others to them.

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

    @property
    def segments(self) -> tuple[str, ...]:
        """Names of all segments, root first."""
        return tuple(joint.child for joint in self.joints)

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates that move, root first (the order of q)."""
        return tuple(dict.fromkeys(axis.coordinate for axis in self._axes if axis.coordinate not in self.locked))

    @cached_property
    def rotational(self) -> np.ndarray:
        """(c,) True where the coordinate is an angle (rad), False where it is a length (m)."""
        angles = {axis.coordinate for axis in self._axes if axis.kind == "rotation"}
        return np.array([name in angles for name in self.coordinates])

    @cached_property
    def periodic(self) -> np.ndarray:
        """(c,) True where the coordinate is an angle and a full turn changes nothing."""
        shaped = {axis.coordinate for axis in self._axes if axis.kind == "translation" or axis.function is not None}
        result: np.ndarray = self.rotational & np.array([name not in shaped for name in self.coordinates])
        return result

    @property
    def _axes(self) -> list[Axis]:
        return [axis for joint in self.joints for axis in joint.axes]

    @cached_property
    def map(self) -> CoordinateMap:
        """From the coordinates to the axes of the Pinocchio model."""
        moving = [axis for axis in self._axes if axis.coordinate not in self.locked]
        followed, functions = [axis.coordinate for axis in moving], [axis.function for axis in moving]
        return CoordinateMap.of(self.coordinates, followed, functions)

    @cached_property
    def root(self) -> Root:
        """The free joint of the first segment: its first three coordinates slide, the next three turn."""
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

    def lock(self, values: Mapping[str, float]) -> Skeleton:
        """The same skeleton with these coordinates held at these values (rad or m)."""
        self._check_names(values)
        return replace(self, locked={**self.locked, **values})

    def free(self, names: Iterable[str]) -> Skeleton:
        """The same skeleton with these coordinates moving again."""
        names = set(names)
        self._check_names(names)
        return replace(self, locked={k: v for k, v in self.locked.items() if k not in names})

    def with_markers(self, markers: Sequence[Marker]) -> Skeleton:
        """The same skeleton with other markers."""
        return replace(self, markers=tuple(markers))

    def with_places(self, positions: np.ndarray) -> Skeleton:
        """The same skeleton with its markers at these positions (m, 3) in their segments."""
        rows = zip(self.markers, positions, strict=True)
        return self.with_markers([replace(marker, position=place) for marker, place in rows])

    def carrying(self, bsp: BodySegmentParameters | None) -> Skeleton:
        """The same skeleton with these parameters given once and for all."""
        return replace(self, carried=bsp)

    def _check_names(self, names: Iterable[str]) -> None:
        unknown = set(names) - {axis.coordinate for axis in self._axes}
        if unknown:
            raise KeyError(f"no such coordinate in {self.name}: {', '.join(sorted(unknown))}")

    @cached_property
    def _built(self) -> tuple[pin.Model, dict[str, int], dict[str, pin.SE3]]:
        """Pinocchio model without masses, the joint that carries each segment, and each segment's place in it."""
        model = pin.Model()
        model.gravity.linear = np.array([0.0, -self.gravity_m_s2, 0.0])
        carrier, offset = {"ground": 0}, {"ground": pin.SE3.Identity()}
        for joint in self.joints:
            parent = carrier[joint.parent]
            place = offset[joint.parent] * pin.SE3(np.asarray(joint.rotation), np.asarray(joint.translation))
            for axis in joint.axes:
                if axis.coordinate in self.locked:
                    place = place * placed_by(axis, self.locked[axis.coordinate])
                    continue
                parent = model.addJoint(parent, _pinocchio_joint(axis), place, f"{axis.coordinate}:{model.njoints}")
                place = pin.SE3.Identity()
            far = pin.SE3(np.asarray(joint.child_rotation), np.asarray(joint.child_translation))
            carrier[joint.child], offset[joint.child] = parent, place * far.inverse()
        return model, carrier, offset

    @property
    def model(self) -> pin.Model:
        """The Pinocchio model, without masses."""
        return self._built[0]

    @cached_property
    def support(self) -> np.ndarray:
        """(s, a) True where axis a moves segment s."""
        model, carrier, _ = self._built
        moves = np.zeros((len(self.segments), model.nv), dtype=bool)
        for i, segment in enumerate(self.segments):
            for joint in model.supports[carrier[segment]]:
                if joint > 0:
                    moves[i, joint - 1] = True
        return moves

    @cached_property
    def marker_segments(self) -> np.ndarray:
        """(m,) index of each marker's segment."""
        index = {name: i for i, name in enumerate(self.segments)}
        return np.array([index[marker.segment] for marker in self.markers], dtype=int)

    @cached_property
    def marker_locals(self) -> np.ndarray:
        """(m, 3) marker positions in their segments' frames, m."""
        return np.array([marker.position for marker in self.markers]).reshape(-1, 3)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of all markers."""
        return tuple(marker.label for marker in self.markers)

    def pose(self, q: np.ndarray) -> Pose:
        """Segment frames and Jacobian at the coordinates q (n, c)."""
        model, carrier, offset = self._built
        data = model.createData()
        at = self.map.axes(q)
        n, s = len(q), len(self.segments)
        # these arrays are Pinocchio's own memory: every pass fills them anew
        frames = [data.oMi[carrier[segment]] for segment in self.segments]
        turns, places, columns = [f.rotation for f in frames], [f.translation for f in frames], data.J
        rotation, translation, jacobian = np.empty((n, s, 3, 3)), np.empty((n, s, 3)), np.empty((n, 6, model.nv))
        for k in range(n):
            pin.computeJointJacobians(model, data, at[k])
            rotation[k], translation[k], jacobian[k] = turns, places, columns
        turned = np.array([offset[segment].rotation for segment in self.segments])
        moved = np.array([offset[segment].translation for segment in self.segments])
        translation += (rotation @ moved[..., None])[..., 0]
        return Pose(rotation @ turned, translation, jacobian, self.map.slopes(q))

    def marker_positions(self, pose: Pose) -> np.ndarray:
        """(n, m, 3) m, model markers in ground at this pose."""
        turned = pose.rotation[:, self.marker_segments] @ self.marker_locals[:, :, None]
        result: np.ndarray = turned[..., 0] + pose.translation[:, self.marker_segments]
        return result

    def model_with(self, bsp: BodySegmentParameters) -> pin.Model:
        """A Pinocchio model that carries these body segment parameters, and those of `carried`."""
        model = self.model.copy()
        total = np.zeros((model.njoints, 10))
        for part in (bsp, self.carried):
            if part is not None:
                joints, place = self.placement_of_parameters(part.segments)
                np.add.at(total, joints, (place @ part.dynamic_parameters().reshape(-1, 10, 1))[..., 0])
        for j, parameters in enumerate(total):
            if parameters[0] != 0.0:  # Pinocchio would divide by it
                model.inertias[j] = pin.Inertia.FromDynamicParameters(parameters)
        return model

    def placement_of_parameters(self, segments: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Joint index (s,) that carries each segment, and (s, 10, 10) its dynamic parameters in that joint's frame.

        Linear, so it also serves the regressor: Y_segment = Y_joint @ this.
        """
        rows = [self.segments.index(segment) for segment in segments]
        joints, place = self._parameter_places
        return joints[rows], place[rows]

    @cached_property
    def _parameter_places(self) -> tuple[np.ndarray, np.ndarray]:
        _, carrier, offset = self._built
        joints = np.array([carrier[segment] for segment in self.segments], dtype=int)
        return joints, _moved_parameters([offset[segment] for segment in self.segments])


def placed_by(axis: Axis, value: float) -> pin.SE3:
    """Where an axis puts what follows it when its coordinate has this value (rad or m)."""
    direction = np.array(axis.direction)
    if axis.function is not None:
        value = float(axis.function(np.array([value]))[0])
    if axis.kind == "translation":
        return pin.SE3(np.eye(3), direction * value)
    return pin.SE3(pin.exp3(direction * value), np.zeros(3))


_ALIGNED = {
    ("rotation", (1.0, 0.0, 0.0)): pin.JointModelRX,
    ("rotation", (0.0, 1.0, 0.0)): pin.JointModelRY,
    ("rotation", (0.0, 0.0, 1.0)): pin.JointModelRZ,
    ("translation", (1.0, 0.0, 0.0)): pin.JointModelPX,
    ("translation", (0.0, 1.0, 0.0)): pin.JointModelPY,
    ("translation", (0.0, 0.0, 1.0)): pin.JointModelPZ,
}


def _pinocchio_joint(axis: Axis) -> pin.JointModel:
    aligned = _ALIGNED.get((axis.kind, axis.direction))
    if aligned is not None:
        return aligned()
    unaligned = pin.JointModelRevoluteUnaligned if axis.kind == "rotation" else pin.JointModelPrismaticUnaligned
    return unaligned(*axis.direction)


def _moved_parameters(places: Sequence[pin.SE3]) -> np.ndarray:
    """(s, 10, 10) linear maps of dynamic parameters from frames to the one in which they stand at these places.

    The pseudo-inertia of a body moves as J' = T J T^T (Wensing, Kim and Slotine 2018); the parameters are linear in J.
    """
    transform = np.array([place.homogeneous for place in places])[:, None]
    moved = transform @ _PSEUDO @ transform.transpose(0, 1, 3, 2)
    return _from_pseudo(moved).transpose(0, 2, 1)


def _unit_pseudo() -> np.ndarray:
    """(10, 4, 4) pseudo-inertias of dynamic parameters that are one each (mass, first moments, xx xy yy xz yz zz)."""
    pseudo = np.zeros((10, 4, 4))
    pseudo[0, 3, 3] = 1.0
    for axis in range(3):
        pseudo[1 + axis, axis, 3] = pseudo[1 + axis, 3, axis] = 1.0
    for k, (i, j) in enumerate(_INERTIA, start=4):
        inertia = np.zeros((3, 3))
        inertia[i, j] = inertia[j, i] = 1.0
        pseudo[k, :3, :3] = second_moments(inertia)
    return pseudo


def _from_pseudo(pseudo: np.ndarray) -> np.ndarray:
    """(..., 10) dynamic parameters of pseudo-inertias (..., 4, 4)."""
    inertia = inertia_of(pseudo[..., :3, :3])
    rows, columns = zip(*_INERTIA, strict=True)
    return np.concatenate([pseudo[..., 3, 3:], pseudo[..., :3, 3], inertia[..., rows, columns]], axis=-1)


_INERTIA = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
"""Order of the inertia among Pinocchio's dynamic parameters."""
_PSEUDO = _unit_pseudo()
