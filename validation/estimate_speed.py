"""Seconds of the simultaneous estimate beside bare Pinocchio calls, and their section of docs/validation/speed.md."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from threadpoolctl import threadpool_limits

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.fit import fit_simultaneous
from kinertia.synthetic.laboratory import SkinMotion, camera_noise
from kinertia.synthetic.walk import SyntheticTrial, unlike_literature, walk, walking_subject
from validation.measured_trials import table
from validation.pinocchio_skeleton import pinocchio_model
from validation.synthetic_walks import BANDWIDTH, FIRST_SEED, kinematics_of


@dataclass(frozen=True)
class Timing:
    """Seconds of the estimate alone (observation, optimisation, error bars) on a walk of this length at 100 Hz."""

    duration_s: float
    frames: int
    iterations: int
    seconds: float
    bare_us: float

    @property
    def each_us(self) -> float:
        """Microseconds per frame and iteration."""
        return 1e6 * self.seconds / (self.frames * self.iterations)


def timed(duration_s: float) -> Timing:
    """Time the estimate from a synthetic walk with skin motion, at the literature prior."""
    rng = np.random.default_rng(FIRST_SEED)
    person = unlike_literature(walking_subject(), rng)
    trial = walk(person, duration_s, trapezoid=False)
    skin = SkinMotion.draw(trial.skeleton, trial.motion.q, rng)
    moved = camera_noise(skin.moved(trial.markers, trial.skeleton, trial.motion.q), 0.0005, rng)
    kinematics = kinematics_of(trial, moved)
    with threadpool_limits(1):
        started = time.perf_counter()
        fitted = fit_simultaneous(trial.skeleton, literature_prior(person.literature), [kinematics], [BANDWIDTH])
        seconds = time.perf_counter() - started
    steps = fitted.result.iterations
    return Timing(duration_s, len(trial.time), steps, seconds, 1e6 * bare_calls(trial) / len(trial.time))


def bare_calls(trial: SyntheticTrial) -> float:
    """Return the seconds of Pinocchio's Jacobian, RNEA derivatives and regressor over all frames, best of three."""
    model = pinocchio_model(trial.skeleton, trial.bsp)
    data, best = model.createData(), np.inf
    rows = list(zip(trial.motion.q, trial.motion.qd, trial.motion.qdd, strict=True))
    for _ in range(3):
        started = time.perf_counter()
        for q, qd, qdd in rows:
            pin.computeJointJacobians(model, data, q)
            pin.computeRNEADerivatives(model, data, q, qd, qdd)
            pin.computeJointTorqueRegressor(model, data, q, qd, qdd)
        best = min(best, time.perf_counter() - started)
    return best


def speed_section(timings: Sequence[Timing]) -> str:
    """Return seconds, and microseconds per frame and iteration beside bare Pinocchio calls."""
    rows = []
    for t in timings:
        rows.append([f"{t.duration_s:.0f} s", str(t.frames), str(t.iterations), f"{t.seconds:.2f}"])
        rows[-1] += [f"{t.each_us:.0f}", f"{t.bare_us:.0f}", f"{t.each_us / t.bare_us:.1f}"]
    headings = ["walk", "frames", "steps", "seconds", "us a frame and step", "bare calls (us)", "ratio"]
    return table(headings, rows)
