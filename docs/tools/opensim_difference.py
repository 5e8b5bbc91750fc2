"""Why Kinertia's joint moments differ from OpenSim's: the inputs of Inverse Dynamics exchanged one after another.

    PYTHONPATH=. python docs/tools/opensim_difference.py

prints the table of `docs/opensim.md`: RMS differences of joint moments of the two measured walks that come with scaled
models, both sides together, from OpenSim's Inverse Kinematics and Inverse Dynamics at 6 Hz. Needs OpenSim.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import opensim
import pandas as pd

from kinertia.io.text.sto import read_sto
from validation.opensim_runs import (
    inverse_dynamics,
    inverse_kinematics,
    quietly,
    setup_weights,
    with_forces_file,
    without_forces,
)
from validation.peer_cases import MARGIN_S, Case, fit, measured_cases, window_s

MOMENTS = ("hip_flexion", "knee_angle", "ankle_angle")


def moments(case: Case) -> tuple[dict[str, pd.DataFrame], np.ndarray]:
    """Joint moments after each exchange, N m, and the times (s) at which they are compared."""
    _, out = fit(case, "calibrated")
    place = case.folder
    with quietly(place / "log.txt"):
        without_forces(case.model, place / "model.osim", case.mass_kg)
        without_forces(out / "model.osim", place / "estimated.osim")
        inverse_kinematics(
            opensim.Model(str(place / "model.osim")), case.markers, place / "ik.mot", setup_weights(case.ik_setup)
        )
        with_forces_file(case.loads, case.forces, place / "measured.xml")
        with_forces_file(out / "external_loads.xml", out / "ground_reactions.mot", place / "corrected.xml")

        def run(model: str, motion: Path, loads: str, cutoff_hz: float = -1.0) -> pd.DataFrame:
            return inverse_dynamics(place / model, motion, place / loads, place / "id.sto", cutoff_hz)

        steps = {
            "OpenSim": run("model.osim", place / "ik.mot", "measured.xml", 6.0),
            "cutoff 12 Hz": run("model.osim", place / "ik.mot", "measured.xml", 12.0),
            "Kinertia's motion": run("model.osim", out / "kinematics.mot", "measured.xml"),
            "Kinertia's model": run("estimated.osim", out / "kinematics.mot", "measured.xml"),
            "Kinertia's forces": run("estimated.osim", out / "kinematics.mot", "corrected.xml"),
        }
    start, end = window_s(out)
    steps["without impact transients"] = read_sto(out / "inverse_dynamics.sto")
    return steps, np.arange(start + MARGIN_S, end - MARGIN_S, 0.005)


def rows(case: Case) -> list[str]:
    """Of each exchange: how far it moves the moments, N m RMS."""
    steps, time = moments(case)

    def trajectory(table: pd.DataFrame, name: str) -> np.ndarray:
        return np.concatenate([np.interp(time, table.index, table[f"{name}_{side}_moment"]) for side in "rl"])

    tables, lines = list(steps.values()), []
    for title, before, after in zip(list(steps)[1:], tables[:-1], tables[1:], strict=True):
        rms = [np.sqrt(np.mean((trajectory(after, name) - trajectory(before, name)) ** 2)) for name in MOMENTS]
        lines.append(f"| {case.title} | {title} | " + " | ".join(f"{value:.1f}" for value in rms) + " |")
    whole = [np.sqrt(np.mean((trajectory(tables[-1], name) - trajectory(tables[0], name)) ** 2)) for name in MOMENTS]
    return [*lines, f"| {case.title} | all together | " + " | ".join(f"{value:.1f}" for value in whole) + " |"]


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        for measured_case in measured_cases(Path(folder)).values():
            print(*rows(measured_case), sep="\n")
