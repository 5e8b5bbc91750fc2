"""The rigid-body core next to Pinocchio's bare calls in the same process, and their section of the speed page."""

import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from kinertia.motion.dynamics import axis_motion, regressor
from kinertia.motion.rigid_body import axis_force_derivatives
from kinertia.synthetic.walk import walk, walking_subject
from validation.measured_trials import table
from validation.pinocchio_skeleton import pinocchio_model

DURATION_S = 2.4


def best(work: Callable[[], object], runs: int) -> float:
    """Return the seconds of the fastest of `runs` runs, after one that compiles."""
    work()
    times = []
    for _ in range(runs):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def core_section(runs: int) -> str:
    """Return microseconds per frame of the package's walk, for both cores."""
    trial = walk(walking_subject(), DURATION_S, trapezoid=False)
    skeleton, state = trial.skeleton, axis_motion(trial.skeleton, trial.motion)
    core = (skeleton.tree, skeleton.gravity_m_s2, skeleton.bodies(trial.bsp), *state)
    origin, every = np.zeros((len(trial.time), 3)), np.ones(len(skeleton.tree.parent), dtype=bool)
    model = pinocchio_model(skeleton, trial.bsp)
    data, rows = model.createData(), list(zip(*state, strict=True))

    def looped(call: Callable[..., object]) -> Callable[[], object]:
        return lambda: [call(model, data, *row) for row in rows]

    def places() -> None:
        for row in rows:
            pin.computeJointJacobians(model, data, row[0])

    spent = {
        "root": best(lambda: axis_force_derivatives(*core, origin, ~every), runs),
        "regressor": best(lambda: regressor(*core[:2], *state, origin), runs),
        "all axes": best(lambda: axis_force_derivatives(*core, origin, every), runs),
        "poses": best(lambda: skeleton.pose(trial.motion.q), runs),
    }
    derivatives, torque = (
        best(looped(pin.computeRNEADerivatives), runs),
        best(looped(pin.computeJointTorqueRegressor), runs),
    )
    pairs = [
        ("poses and axes, `computeJointJacobians`", spent["poses"], best(places, runs)),
        ("root load and derivatives, `computeRNEADerivatives`", spent["root"], derivatives),
        ("regressor, `computeJointTorqueRegressor`", spent["regressor"], torque),
        ("**root load, derivatives and regressor**", spent["root"] + spent["regressor"], derivatives + torque),
        ("all axes' forces and derivatives, `computeRNEADerivatives`", spent["all axes"], derivatives),
    ]
    scale = 1e6 / len(trial.time)
    cells = [[name, f"{scale * a:.1f}", f"{scale * b:.1f}", f"{a / b:.2f}"] for name, a, b in pairs]
    return table(["task", "Kinertia (us)", "Pinocchio (us)", "Kinertia / Pinocchio"], cells)
