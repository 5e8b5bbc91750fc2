"""An OpenSim model as an oracle for a `Skeleton` read from the same file."""

from pathlib import Path

import numpy as np
import opensim as osim

from kinertia.model.imported_model import OsimModel

osim.Logger.removeFileSink()
osim.Logger.setLevelString("Off")


class OsimOracle:
    """Evaluates the file at coordinates in the skeleton's order, coupled coordinates included.

    OpenSim's inverse dynamics treats a coupled coordinate as one of its own; its force is added to that of the
    coordinate that leads it, times the derivative, which is what the constraint does.
    """

    def __init__(self, path: Path, ours: OsimModel) -> None:
        self.ours = ours
        self.model = osim.Model(str(path))
        coordinate_set = self.model.getCoordinateSet()
        self.names = [coordinate_set.get(i).getName() for i in range(coordinate_set.getSize())]
        for name in self.names:
            coordinate_set.get(name).set_locked(False)
        forces = self.model.updForceSet()
        for i in range(forces.getSize()):
            forces.get(i).set_appliesForce(False)
        self.state = self.model.initSystem()
        self.coordinates = [self.model.getCoordinateSet().get(name) for name in self.names]
        for i, coordinate in enumerate(self.coordinates):
            coordinate.setSpeedValue(self.state, i + 1.0)
        speeds = self.state.getU().to_numpy().tolist()
        self.columns = [speeds.index(i + 1.0) for i in range(len(self.coordinates))]

    def _chain(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k, c) derivative of the file's coordinates by the skeleton's, and (k, c) its derivative along each."""
        free = self.ours.skeleton.coordinates
        first, second = np.zeros((2, len(self.names), len(free)))
        order = [c.name for c in self.ours.coordinates]
        values = self.ours.all_coordinates(self.ours.skeleton, q[None])[0]
        for column, name in enumerate(free):
            first[self.names.index(name), column] = 1.0
        for coupling in self.ours.couplings:
            row, leader = self.names.index(coupling.dependent), self.names.index(coupling.independent)
            at = values[[order.index(coupling.independent)]]
            slope, curve = coupling.function(at, 1), coupling.function(at, 2)
            first[row] = slope * first[leader]
            second[row] = curve * first[leader] ** 2 + slope * second[leader]
        return first, second

    def pose(self, q: np.ndarray, qd: np.ndarray) -> None:
        """Set all coordinates and speeds."""
        values = self.ours.all_coordinates(self.ours.skeleton, q[None])[0]
        order = [c.name for c in self.ours.coordinates]
        first, _ = self._chain(q)
        for name, coordinate, speed in zip(self.names, self.coordinates, first @ qd, strict=True):
            coordinate.setValue(self.state, float(values[order.index(name)]), False)
            coordinate.setSpeedValue(self.state, float(speed))
        self.model.realizeVelocity(self.state)

    def markers(self) -> np.ndarray:
        """(m, 3) m in ground."""
        marker_set = self.model.getMarkerSet()
        labels = self.ours.skeleton.labels
        return np.array([marker_set.get(label).getLocationInGround(self.state).to_numpy() for label in labels])

    def inverse_dynamics(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """(c,) generalised forces without external loads, at the pose that was set."""
        first, second = self._chain(q)
        udot = osim.Vector(self.state.getNU(), 0.0)
        for column, value in zip(self.columns, first @ qdd + second @ qd**2, strict=True):
            udot.set(column, float(value))
        tau = osim.InverseDynamicsSolver(self.model).solve(self.state, udot).to_numpy()[self.columns]
        return first.T @ tau

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """(c, c) at the pose that was set."""
        matrix = osim.Matrix()
        self.model.getMatterSubsystem().calcM(self.state, matrix)
        first, _ = self._chain(q)
        return first.T @ matrix.to_numpy()[np.ix_(self.columns, self.columns)] @ first

    def coriolis(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """(c,) velocity terms by Lagrange's equations, d/dt(M) qd - 1/2 grad(qd' M qd), from OpenSim's mass matrices.

        `InverseDynamicsSolver` itself is off there where several rotations of a CustomJoint follow one coordinate: its
        forces do not do the work by which its own energies change (0.1 N m at 3 rad/s on a walker knee).
        """
        h = 1e-5

        def mass(at: np.ndarray) -> np.ndarray:
            self.pose(at, np.zeros_like(qd))
            return self.mass_matrix(at)

        moved = (mass(q + h * qd) - mass(q - h * qd)) @ qd / (2 * h)
        steps = h * np.eye(len(q))
        energy = [qd @ (mass(q + step) - mass(q - step)) @ qd / (2 * h) for step in steps]
        return moved - 0.5 * np.array(energy)
