"""The 27-DOF skeleton as an OpenSim model, by way of the file we write: an oracle for kinematics and dynamics."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import opensim as osim

from kinertia.io.osim.exporter import export_osim
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton

osim.Logger.removeFileSink()
osim.Logger.setLevelString("Off")


def build_opensim(skeleton: Skeleton, bsp: BodySegmentParameters) -> osim.Model:
    """The model that OpenSim reads from our file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.osim"
        export_osim(path, skeleton, bsp)
        return osim.Model(str(path))


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
        marker_set = self.model.getMarkerSet()
        return np.array(
            [marker_set.get(label).getLocationInGround(self.state).to_numpy() for label in self.skeleton.labels]
        )

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
