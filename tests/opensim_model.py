"""The same skeleton as an OpenSim model: an oracle for kinematics and dynamics."""

from __future__ import annotations

import warnings

import numpy as np
import opensim as osim
from scipy.spatial.transform import Rotation

from kinertia.bsp import BodySegmentParameters
from kinertia.skeleton import GRAVITY_M_S2, Axis, Joint, Skeleton

osim.Logger.removeFileSink()
osim.Logger.setLevelString("Off")


def build_opensim(skeleton: Skeleton, bsp: BodySegmentParameters) -> osim.Model:
    """An OpenSim model with one pin or slider per axis; massless bodies between them where a joint has several."""
    model = osim.Model()
    model.setName(skeleton.name)
    model.setGravity(osim.Vec3(0, -GRAVITY_M_S2, 0))
    rows = dict(zip(bsp.segments, range(len(bsp.segments)), strict=True))
    for joint in skeleton.joints:
        mass, com, tensor = 1e-12, np.zeros(3), np.eye(3) * 1e-12
        if joint.child in rows:
            k = rows[joint.child]
            mass, com, tensor = bsp.mass_kg[k], bsp.com_m[k], bsp.inertia_kgm2[k]
        moments = [tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        body = osim.Body(joint.child, float(mass), osim.Vec3(*com), osim.Inertia(*map(float, moments)))
        model.addBody(body)
        _add_joint(model, joint, body, skeleton)
    for marker in skeleton.markers:
        body = model.getBodySet().get(marker.segment)
        model.addMarker(osim.Marker(marker.label, body, osim.Vec3(*map(float, marker.position))))
    model.finalizeConnections()
    return model


def _add_joint(model: osim.Model, joint: Joint, body: osim.Body, skeleton: Skeleton) -> None:
    parent = model.getGround() if joint.parent == "ground" else model.getBodySet().get(joint.parent)
    place = (np.asarray(joint.rotation), np.asarray(joint.translation))
    if not joint.axes:
        unmoved = _vectors((np.eye(3), np.zeros(3)))
        model.addJoint(osim.WeldJoint(f"to_{joint.child}", parent, *_vectors(place), body, *unmoved))
    for i, axis in enumerate(joint.axes):
        last = i == len(joint.axes) - 1
        child = body
        if not last:
            child = osim.Body(f"{joint.child}_{i}", 1e-12, osim.Vec3(0), osim.Inertia(1e-12))
            model.addBody(child)
        model.addJoint(_one_axis(axis, parent, place, child, skeleton))
        parent, place = child, None


def _one_axis(axis: Axis, parent, place, child, skeleton: Skeleton) -> osim.Joint:
    """A pin (about z) or slider (along x) whose frames are turned so that it moves as the axis says."""
    rotation, translation = (np.eye(3), np.zeros(3)) if place is None else place
    turned = _aligned(np.array(axis.direction), 2 if axis.kind == "rotation" else 0)
    kind = osim.PinJoint if axis.kind == "rotation" else osim.SliderJoint
    frames = (*_vectors((rotation @ turned, translation)), child, *_vectors((turned, np.zeros(3))))
    joint = kind(f"joint_{axis.coordinate}", parent, *frames)
    coordinate = joint.upd_coordinates(0)
    coordinate.setName(axis.coordinate)
    coordinate.setRangeMin(-10.0)
    coordinate.setRangeMax(10.0)
    if axis.coordinate in skeleton.locked:
        coordinate.setDefaultValue(skeleton.locked[axis.coordinate])
        coordinate.setDefaultLocked(True)
    return joint


def _aligned(direction: np.ndarray, column: int) -> np.ndarray:
    """A rotation (3, 3) with this direction as the given column."""
    other = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    other /= np.linalg.norm(other)
    return np.roll(np.column_stack([direction, other, np.cross(direction, other)]), column, axis=1)


def _vectors(place) -> tuple[osim.Vec3, osim.Vec3]:
    """Translation and body-fixed X-Y-Z angles, as OpenSim's joints take them."""
    rotation, translation = place
    with warnings.catch_warnings(action="ignore"):  # at gimbal lock one of the possible triples will do
        angles = Rotation.from_matrix(rotation).as_euler("XYZ")
    return osim.Vec3(*map(float, translation)), osim.Vec3(*map(float, angles))


class Oracle:
    """Evaluates the model at coordinates in the skeleton's order."""

    def __init__(self, skeleton: Skeleton, bsp: BodySegmentParameters) -> None:
        self.skeleton = skeleton
        self.model = build_opensim(skeleton, bsp)
        self.state = self.model.initSystem()
        self.coordinates = [self.model.getCoordinateSet().get(name) for name in skeleton.coordinates]
        self.model.realizeVelocity(self.state)
        self.n_all = self.state.getNU()
        for i, coordinate in enumerate(self.coordinates):
            coordinate.setSpeedValue(self.state, i + 1.0)
        speeds = self.state.getU().to_numpy().tolist()
        self.columns = [speeds.index(i + 1.0) for i in range(len(self.coordinates))]

    def pose(self, q: np.ndarray, qd: np.ndarray | None = None) -> None:
        """Set coordinates and speeds."""
        for i, coordinate in enumerate(self.coordinates):
            coordinate.setValue(self.state, float(q[i]), False)
            coordinate.setSpeedValue(self.state, 0.0 if qd is None else float(qd[i]))
        self.model.realizeVelocity(self.state)

    def markers(self) -> np.ndarray:
        """(m, 3) m in ground."""
        found = self.model.getMarkerSet()
        return np.array([found.get(label).getLocationInGround(self.state).to_numpy() for label in self.skeleton.labels])

    def inverse_dynamics(self, qdd: np.ndarray) -> np.ndarray:
        """(c,) generalised forces without external loads."""
        udot = osim.Vector(self.n_all, 0.0)
        for column, value in zip(self.columns, qdd, strict=True):
            udot.set(column, float(value))
        solver = osim.InverseDynamicsSolver(self.model)
        return solver.solve(self.state, udot).to_numpy()[self.columns]

    def mass_matrix(self) -> np.ndarray:
        """(c, c)."""
        matrix = osim.Matrix()
        self.model.getMatterSubsystem().calcM(self.state, matrix)
        return matrix.to_numpy()[np.ix_(self.columns, self.columns)]
