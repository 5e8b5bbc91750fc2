"""OpenSim's residual reduction (RRA), set up as in its gait2354 example: residual actuators, tracking weights, 6 Hz.

Two passes, as its guide recommends: the first moves the centre of mass of the torso and recommends masses; with these
applied to the model, the second reduces the residuals by changing the motion.
"""

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import opensim
import pandas as pd

from kinertia.io.text.sto import read_sto, write_sto

CUTOFF_HZ = 6.0
LIMIT_S = 300.0
RESIDUALS = {
    "FX": (4.0, 20.0),
    "FY": (8.0, 20.0),
    "FZ": (4.0, 20.0),
    "MX": (2.0, 50.0),
    "MY": (2.0, 50.0),
    "MZ": (2.0, 50.0),
}
"""Optimal force (N, N m) and largest excitation of the residual actuators."""
OPTIMAL_NM = {"hip_flexion": 300.0, "hip_adduction": 200.0, "knee_angle": 300.0, "ankle_angle": 300.0, "lumbar": 200.0}
"""Optimal moments of joint actuators; 100 N m elsewhere."""
WEIGHTS = {"pelvis_tilt": 1000.0, "pelvis_list": 500.0, "pelvis_rotation": 100.0, "lumbar_extension": 50.0,
           "lumbar_bending": 50.0, "lumbar_rotation": 10.0}  # fmt: skip
"""Tracking weights; 20 elsewhere."""
MASS = re.compile(r"(\w+):\s*orig mass = ([-+.\deE]+), new mass = ([-+.\deE]+)")


class RRAFailed(RuntimeError):
    """Error: RRA gave no result."""


@dataclass(frozen=True)
class Reduced:
    """Files that RRA leaves."""

    model: Path
    motion: Path


def reduce_residuals(model: Path, motion: Path, loads: Path, span_s: tuple[float, float], folder: Path) -> Reduced:
    """Run both passes of RRA.

    Args:
        model: a model without forces.
        motion: motion by inverse kinematics.
        loads: ExternalLoads file.
        span_s: time span to reduce, within the motion.
        folder: folder for all files.

    Raises:
        RRAFailed: a pass failed, took too long or did not reach the end.
    """
    folder.mkdir(exist_ok=True)
    adjusted, applied = folder / "adjusted.osim", folder / "applied.osim"
    log = one_pass(model, motion, loads, span_s, folder / "pass1", adjusted)
    apply_masses(adjusted, recommended_masses(log), applied)
    one_pass(applied, motion, loads, span_s, folder / "pass2", None)
    kinematics = resampled(folder / "pass2" / "rra_Kinematics_q.sto", folder / "rra.mot", span_s)
    return Reduced(applied, kinematics)


def recommended_masses(log: str) -> dict[str, float]:
    """Return the mass factor of each body that RRA printed."""
    return {body: float(new) / float(old) for body, old, new in MASS.findall(log) if float(old) > 0}


def apply_masses(model: Path, factors: dict[str, float], out: Path) -> None:
    """Scale masses, and inertias with them."""
    if not factors:
        raise RRAFailed("no masses recommended")
    changed = opensim.Model(str(model))
    changed.updForceSet().clearAndDestroy()
    for body, factor in factors.items():
        changed.updBodySet().get(body).scaleMass(factor)
    changed.finalizeConnections()
    changed.printToXML(str(out))


def one_pass(
    model: Path, motion: Path, loads: Path, span_s: tuple[float, float], folder: Path, adjusted: Path | None
) -> str:
    """Run RRATool in a separate process; return its output. `adjusted`: where the new model shall go."""
    folder.mkdir(exist_ok=True)
    free = free_coordinates(model)
    write_actuators(model, free, folder / "actuators.xml")
    write_tasks(free, folder / "tasks.xml")
    tool = opensim.RRATool()
    tool.setName("rra")
    tool.setModelFilename(str(model))
    tool.setReplaceForceSet(True)
    files = opensim.ArrayStr()
    files.append(str(folder / "actuators.xml"))
    tool.setForceSetFiles(files)
    tool.setTaskSetFileName(str(folder / "tasks.xml"))
    tool.setDesiredKinematicsFileName(str(motion))
    tool.setExternalLoadsFileName(str(loads))
    tool.setLowpassCutoffFrequency(CUTOFF_HZ)
    tool.setInitialTime(span_s[0])
    tool.setFinalTime(span_s[1])
    tool.setResultsDir(str(folder))
    tool.setAdjustCOMToReduceResiduals(adjusted is not None)
    tool.setAdjustedCOMBody("torso")
    tool.setOutputModelFileName(str(adjusted or folder / "unused.osim"))
    tool.printToXML(str(folder / "setup.xml"))
    return run_apart(folder, span_s[1])


def run_apart(folder: Path, until_s: float) -> str:
    """Run the set-up of a folder in a separate process, with its output in a file."""
    log = folder / "rra.log"
    with log.open("wb") as file:
        try:
            command = [sys.executable, __file__, str(folder / "setup.xml")]
            done = subprocess.run(command, cwd=folder, stdout=file, stderr=file, timeout=LIMIT_S, check=False)
        except subprocess.TimeoutExpired:
            raise RRAFailed(f"not done after {LIMIT_S:.0f} s") from None
    result = folder / "rra_Kinematics_q.sto"
    if done.returncode != 0 or not result.exists():
        raise RRAFailed(f"exit status {done.returncode}")
    if read_sto(result).index[-1] < until_s - 0.02:
        raise RRAFailed(f"stopped at {read_sto(result).index[-1]:.2f} s")
    return log.read_text(errors="replace")


def free_coordinates(model: Path) -> list[str]:
    """Return the coordinates that are neither locked nor driven by others."""
    loaded = opensim.Model(str(model))
    state = loaded.initSystem()
    coordinates = loaded.getCoordinateSet()
    every = [coordinates.get(k) for k in range(coordinates.getSize())]
    return [c.getName() for c in every if not c.getLocked(state) and not c.isDependent(state)]


def by_prefix(name: str, values: dict[str, float], otherwise: float) -> float:
    """Return the value whose key is a prefix of the name."""
    return next((value for key, value in values.items() if name.startswith(key)), otherwise)


def write_actuators(model: Path, free: list[str], out: Path) -> None:
    """Write residual actuators at the pelvis's centre of mass, and a moment for every other free coordinate."""
    loaded = opensim.Model(str(model))
    centre = " ".join(map(str, loaded.getBodySet().get("pelvis").getMassCenter().to_numpy()))
    objects = []
    for name, (optimal, limit) in RESIDUALS.items():
        axis = " ".join("1" if letter == name[1] else "0" for letter in "XYZ")
        if name[0] == "F":
            where = f"<body>pelvis</body><point>{centre}</point><direction>{axis}</direction>"
            kind, where = "PointActuator", where + "<force_is_global>true</force_is_global>"
        else:
            where = f"<bodyA>pelvis</bodyA><bodyB>ground</bodyB><axis>{axis}</axis>"
            kind, where = "TorqueActuator", where + "<torque_is_global>true</torque_is_global>"
        objects.append(_actuator(kind, name, where, optimal, limit))
    for name in free:
        if not name.startswith("pelvis_"):
            where = f"<coordinate>{name}</coordinate>"
            objects.append(_actuator("CoordinateActuator", name, where, by_prefix(name, OPTIMAL_NM, 100.0), 1.0))
    out.write_text(_document("ForceSet", objects), encoding="utf-8")


def _actuator(kind: str, name: str, where: str, optimal: float, limit: float) -> str:
    limits = f"<min_control>{-limit}</min_control><max_control>{limit}</max_control>"
    return f'<{kind} name="{name}">{limits}{where}<optimal_force>{optimal}</optimal_force></{kind}>'


def write_tasks(free: list[str], out: Path) -> None:
    """Write tracking tasks, critically damped."""
    objects = [
        f'<CMC_Joint name="{name}"><on>true</on><weight>{by_prefix(name, WEIGHTS, 20.0)}</weight>'
        "<active>true false false</active><kp>100 1 1</kp><kv>20 1 1</kv><ka>1 1 1</ka>"
        f"<coordinate>{name}</coordinate><limit>0</limit></CMC_Joint>"
        for name in free
    ]
    out.write_text(_document("CMC_TaskSet", objects), encoding="utf-8")


def _document(kind: str, objects: list[str]) -> str:
    inside = "\n".join(objects)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<OpenSimDocument Version="30000">\n'
        f'<{kind} name="rra">\n<objects>\n{inside}\n</objects>\n</{kind}>\n</OpenSimDocument>\n'
    )


def resampled(motion: Path, out: Path, span_s: tuple[float, float], rate_hz: float = 100.0) -> Path:
    """Resample RRA's motion, which has the integrator's steps, at an even rate."""
    table = read_sto(motion)
    time = pd.Index(np.arange(span_s[0], table.index[-1], 1 / rate_hz), name="time")
    even = pd.DataFrame({column: np.interp(time, table.index, table[column]) for column in table}, time)
    write_sto(out, even, bool(table.attrs["in_degrees"]), "rra")
    return out


if __name__ == "__main__":
    opensim.RRATool(sys.argv[1]).run()
