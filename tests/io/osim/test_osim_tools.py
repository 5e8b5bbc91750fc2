"""Whole trials through OpenSim's own tools."""

from pathlib import Path

import numpy as np
import pandas as pd

from kinertia.io.ground_forces import read_forces
from kinertia.io.osim.reader import read_osim
from kinertia.io.sto import read_sto, write_sto
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.smoothing import smooth
from kinertia.trial.data import LOAD_THRESHOLD_N
from osim_tools import inverse_dynamics_tool


def loads_above_threshold(folder: Path, into: Path) -> Path:
    """The walk's ExternalLoads with what we take for an empty plate set to zero, as `read_forces` does."""
    name = "subject01_walk1_grf"
    table = read_sto(folder / f"{name}.mot")
    for plate in ("", "1_"):
        columns = [c for c in table.columns if c.startswith(f"{plate}ground")]
        table.loc[table[f"{plate}ground_force_vy"] < LOAD_THRESHOLD_N, columns] = 0.0
    write_sto(into / f"{name}.mot", table, True, "loads")
    (into / f"{name}.xml").write_bytes((folder / f"{name}.xml").read_bytes())
    return into / f"{name}.xml"


def test_inverse_dynamics_of_a_walk_is_opensims(opensim, measured_folder, tmp_path):
    """gait2354: the same coordinates (6 Hz) and loads; curves within 1 % of their peak."""
    folder = measured_folder / "gait2354"
    ours = read_osim(folder / "subject01_scaled.osim")
    skeleton = ours.skeleton
    table = read_sto(folder / "opensim_results" / "ik.mot")[list(skeleton.coordinates)]
    values = np.where(skeleton.rotational, np.radians(table), table)
    time = table.index.to_numpy()
    spline = smooth(time, values, 6.0)
    motion = Motion(*(spline(time, order) for order in range(3)))
    degrees = np.where(skeleton.rotational, np.degrees(motion.q), motion.q)
    write_sto(tmp_path / "q.mot", pd.DataFrame(degrees, index=table.index, columns=table.columns), True, "q")

    plates = read_forces(folder / "subject01_walk1_grf.mot", folder / "subject01_walk1_grf.xml")
    loads = np.concatenate([plates.force, plates.moment], axis=-1)
    loads[plates.force[..., 1] < LOAD_THRESHOLD_N] = 0.0
    at = np.stack([np.interp(time, plates.time, column) for column in loads.reshape(len(loads), -1).T], axis=1)
    joint_loads = inverse_dynamics(skeleton, ours.bsp, motion, at.reshape(len(time), 2, 6), ("calcn_r", "calcn_l"))

    theirs = inverse_dynamics_tool(
        opensim, ours.path, tmp_path / "q.mot", loads_above_threshold(folder, tmp_path), tmp_path
    )
    for column, name in enumerate(skeleton.coordinates):
        kind = "moment" if skeleton.rotational[column] else "force"
        expected = np.interp(time, theirs.index, theirs[f"{name}_{kind}"])
        gap = np.abs(joint_loads[:, column] - expected).max()
        assert gap < 0.01 * np.abs(expected).max(), f"{name}: {gap:.3g}"
