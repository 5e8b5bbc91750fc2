"""An OpenSim model as a person who can be posed and asked for forces, feet and markers."""

import numpy as np
import opensim

from validation.opensim_runs import vector

SIDES = ("r", "l")


class Person:
    """An OpenSim model that can be posed and computes forces, feet and markers."""

    def __init__(self, model: opensim.Model) -> None:
        self.model, self.state = model, model.initSystem()
        coordinates = model.getCoordinateSet()
        self.coordinates = [coordinates.get(k) for k in range(coordinates.getSize())]
        for coordinate in self.coordinates:
            coordinate.setLocked(self.state, False)
        self.names = [coordinate.getName() for coordinate in self.coordinates]
        self.root = [k for k, name in enumerate(self.names) if name.startswith("pelvis_")]
        self.speeds = [self._speed_index(coordinate) for coordinate in self.coordinates]
        self.solver = opensim.InverseDynamicsSolver(model)
        self.pelvis = model.getBodySet().get("pelvis")
        self.feet = {side: model.getBodySet().get(f"calcn_{side}") for side in SIDES}

    def _speed_index(self, coordinate: opensim.Coordinate) -> int:
        """Return the index of the coordinate in OpenSim's vector of generalised speeds."""
        before, old = self.state.getU().to_numpy(), coordinate.getSpeedValue(self.state)
        coordinate.setSpeedValue(self.state, old + 1)
        change = np.abs(self.state.getU().to_numpy() - before)
        coordinate.setSpeedValue(self.state, old)
        return int(np.argmax(change))

    def pose(self, q: np.ndarray, qd: np.ndarray | None = None) -> None:
        """Take a pose, at rest or at the given speeds."""
        for coordinate, value in zip(self.coordinates, q, strict=True):
            coordinate.setValue(self.state, value, False)
        self._move(np.zeros_like(q) if qd is None else qd)

    def _move(self, qd: np.ndarray) -> None:
        for coordinate, speed in zip(self.coordinates, qd, strict=True):
            coordinate.setSpeedValue(self.state, speed)
        self.model.realizeVelocity(self.state)

    def ground_wrench(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Compute force and moment about the ground's origin that the ground has to supply for this motion."""
        self.pose(q, qd)
        accelerations = opensim.Vector(len(q), 0.0)
        for k, index in enumerate(self.speeds):
            accelerations[index] = qdd[k]
        forces = self.solver.solve(self.state, accelerations).to_numpy()
        root_forces = forces[[self.speeds[k] for k in self.root]]
        return np.linalg.solve(self._root_jacobian().T, root_forces)

    def _root_jacobian(self) -> np.ndarray:
        """Compute velocity at the ground's origin and angular velocity of the pelvis, per speed of each root
        coordinate.
        """
        jacobian = np.zeros((6, 6))
        place = array(self.pelvis.getTransformInGround(self.state).p())
        for column, k in enumerate(self.root):
            self._move(np.eye(len(self.names))[k])
            velocity = self.pelvis.getVelocityInGround(self.state)
            turning, moving = array(velocity.get(0)), array(velocity.get(1))
            jacobian[:, column] = np.r_[moving - np.cross(turning, place), turning]
        return jacobian

    def foot_points(self) -> dict[str, np.ndarray]:
        """Return a point of each foot, 0.1 m in front of the heel, in the ground."""
        point = vector([0.1, 0, 0])
        return {side: array(foot.findStationLocationInGround(self.state, point)) for side, foot in self.feet.items()}

    def marker(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the position of a marker, and the orientation of the body that carries it."""
        marker = self.model.getMarkerSet().get(name)
        turned = marker.getParentFrame().getTransformInGround(self.state).R()
        orientation = np.array([[turned.get(row, column) for column in range(3)] for row in range(3)])
        return array(marker.getLocationInGround(self.state)), orientation


def array(values: opensim.Vec3) -> np.ndarray:
    """Convert a Vec3 to an array."""
    return np.array([values.get(k) for k in range(3)])
