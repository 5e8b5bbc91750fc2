"""Whole trials through OpenSim's own tools."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest

from kinertia.io.ground_forces import read_forces
from kinertia.io.opensim.reader import read_osim
from kinertia.io.text.sto import read_sto, write_sto
from kinertia.io.text.trc import read_trc
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.smoothing import smooth
from kinertia.trial.data import LOAD_THRESHOLD_N
from osim_tools import inverse_dynamics_tool
from recordings import is_here


class Walk(NamedTuple):
    """Names of files: a model, coordinates by OpenSim or markers for ours, forces, loads; and of the body, without its
    side, on which they act.
    """

    model: str
    motion: str
    forces: str
    loads: str
    foot: str


KNOWN = {
    "synthetic": Walk(
        "synthetic/scaled.osim", "synthetic/walk.trc", "synthetic/walk_grf.mot", "synthetic/walk_grf.xml", "foot"
    ),
    "gait2354": Walk(
        "gait2354/subject01_scaled.osim",
        "gait2354/opensim_results/ik.mot",
        "gait2354/subject01_walk1_grf.mot",
        "gait2354/subject01_walk1_grf.xml",
        "calcn",
    ),
}
WALKS = {name: walk for name, walk in KNOWN.items() if is_here(walk[:-1])}


def loads_above_threshold(forces: Path, loads: Path, into: Path) -> Path:
    """The walk's ExternalLoads with what we take for an empty plate set to zero, as `read_forces` does."""
    table = read_sto(forces)
    for height in [c for c in table.columns if c.endswith("ground_force_vy")]:
        columns = [c for c in table.columns if c.startswith(f"{height.removesuffix('_force_vy')}_")]
        table.loc[table[height] < LOAD_THRESHOLD_N, columns] = 0.0
    write_sto(into / forces.name, table, True, "loads")
    (into / loads.name).write_bytes(loads.read_bytes())
    return into / loads.name


def coordinates_of(path: Path, skeleton: Skeleton) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and coordinates (n, c) in rad and m."""
    if path.suffix == ".trc":
        ik = solve_ik(skeleton, read_trc(path))
        return ik.time, ik.q
    table = read_sto(path)[list(skeleton.coordinates)]
    return table.index.to_numpy(), np.where(skeleton.rotational, np.radians(table), table)


@pytest.mark.parametrize("name", WALKS)
def test_inverse_dynamics_of_a_walk_is_opensims(opensim, file_of, tmp_path, name):
    """The same coordinates (6 Hz) and loads; curves within 1 % of their peak."""
    ours, walk = read_osim(file_of(WALKS[name].model)), WALKS[name]
    skeleton = ours.skeleton
    time, values = coordinates_of(file_of(walk.motion), skeleton)
    spline = smooth(time, values, 6.0)
    motion = Motion(*(spline(time, order) for order in range(3)))
    degrees = np.where(skeleton.rotational, np.degrees(motion.q), motion.q)
    table = pd.DataFrame(degrees, index=pd.Index(time, name="time"), columns=list(skeleton.coordinates))
    write_sto(tmp_path / "q.mot", table, True, "q")

    forces, loads_file = file_of(walk.forces), file_of(walk.loads)
    plates, _ = read_forces(forces, loads_file)
    loads = np.concatenate([plates.force, plates.moment], axis=-1)
    loads[plates.force[..., 1] < LOAD_THRESHOLD_N] = 0.0
    at = np.stack([np.interp(time, plates.time, column) for column in loads.reshape(len(loads), -1).T], axis=1)
    feet = tuple(f"{walk.foot}_{side}" for side in plates.declared_feet)
    joint_loads = inverse_dynamics(skeleton, ours.bsp, motion, at.reshape(len(time), 2, 6), feet)

    file = loads_above_threshold(forces, loads_file, tmp_path)
    theirs = inverse_dynamics_tool(opensim, ours.path, tmp_path / "q.mot", file, tmp_path)
    for column, coordinate in enumerate(skeleton.coordinates):
        kind = "moment" if skeleton.rotational[column] else "force"
        expected = np.interp(time, theirs.index, theirs[f"{coordinate}_{kind}"])
        gap = np.abs(joint_loads[:, column] - expected).max()
        assert gap < 0.01 * np.abs(expected).max(), f"{coordinate}: {gap:.3g}"
