"""The 27-DOF skeleton as an OpenSim model, by way of the file we write: an oracle for kinematics and dynamics."""

import tempfile
from pathlib import Path

import opensim as osim

from kinertia.io.opensim.reader import read_osim
from kinertia.io.opensim.writer import export_osim
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from osim_oracle import OsimOracle


def build_opensim(skeleton: Skeleton, bsp: BodySegmentParameters) -> osim.Model:
    """The model that OpenSim reads from our file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.osim"
        export_osim(path, skeleton, bsp)
        return osim.Model(str(path))


def oracle_of(skeleton: Skeleton, bsp: BodySegmentParameters) -> OsimOracle:
    """The same at coordinates in the skeleton's order."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.osim"
        export_osim(path, skeleton, bsp)
        oracle = OsimOracle(path, read_osim(path))
    assert oracle.ours.skeleton.coordinates == skeleton.coordinates
    assert oracle.ours.skeleton.labels == skeleton.labels
    return oracle
