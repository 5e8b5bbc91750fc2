"""Makes exactly consistent synthetic trials of five motions, for planning.

The two walks are the package's, at its own pace and a third faster. In the others the person stands, both feet on the
ground, each with half of the load: squats, swinging arms, and a swaying trunk. Amplitudes and paces are those of an
unhurried adult.
"""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.interpolate import make_interp_spline

from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.synthetic.walk import Manner, SyntheticSubject, SyntheticTrial, balancing_wrench, walk

DURATION_S, RATE_HZ = 5.0, 100.0
FAST_PACE = 4.0 / 3.0
Angles = Mapping[str, np.ndarray]


def squat(subject: SyntheticSubject) -> SyntheticTrial:
    """Make two squats to 95 degrees of knee flexion, arms forward."""
    down = 0.5 * (1.0 - np.cos(_phase(0.4)))
    both = {"hip_flexion": 80.0, "knee_angle": 95.0, "ankle_angle": 30.0, "arm_flex": 60.0}
    angles = {f"{name}_{side}": size * down for name, size in both.items() for side in "rl"}
    return _standing(subject, {**angles, "pelvis_tilt": -15.0 * down, "lumbar_extension": -20.0 * down})


def arm_swing(subject: SyntheticSubject) -> SyntheticTrial:
    """Make a trial of both arms swinging in turn forward and backward, out to the side, elbows bending."""
    swing, out, bend = np.sin(_phase(0.8)), 0.5 * (1.0 - np.cos(_phase(0.4))), 0.5 * (1.0 - np.cos(_phase(1.2)))
    angles: dict[str, np.ndarray] = {}
    for side, sign in (("r", 1.0), ("l", -1.0)):
        angles |= {f"arm_flex_{side}": 50.0 * sign * swing, f"arm_add_{side}": -40.0 * out}
        angles[f"elbow_flex_{side}"] = 15.0 + 70.0 * bend
    return _standing(subject, angles)


def trunk_sway(subject: SyntheticSubject) -> SyntheticTrial:
    """Make a trial of the trunk bending to the sides, forward and back, and rotating, each at its own pace."""
    angles = {
        "lumbar_bending": 20.0 * np.sin(_phase(0.6)),
        "lumbar_extension": -15.0 + 20.0 * np.cos(_phase(0.4)),
        "lumbar_rotation": 30.0 * np.sin(_phase(0.8)),
    }
    return _standing(subject, angles)


MOTIONS: Mapping[str, Callable[[SyntheticSubject], SyntheticTrial]] = {
    "walk": lambda subject: walk(subject, DURATION_S, trapezoid=False),
    "fast walk": lambda subject: walk(subject, DURATION_S, trapezoid=False, manner=Manner(FAST_PACE)),
    "squat": squat,
    "arm swing": arm_swing,
    "trunk sway": trunk_sway,
}
"""By name; all last `DURATION_S`."""


def _time() -> np.ndarray:
    return np.arange(round(DURATION_S * RATE_HZ) + 1) / RATE_HZ


def _phase(frequency_hz: float) -> np.ndarray:
    return 2.0 * np.pi * frequency_hz * _time()


def _standing(subject: SyntheticSubject, angles_deg: Angles) -> SyntheticTrial:
    """Make the trial of these angles over time (all others zero), with the feet as in the first frame."""
    skeleton = subject.moving_skeleton
    time = _time()
    q = np.zeros((len(time), len(skeleton.coordinates)))
    for name, values in angles_deg.items():
        q[:, skeleton.coordinates.index(name)] = np.radians(values)
    q[:, :3] = _feet_stay(skeleton, q)
    spline = make_interp_spline(time, q, k=5)
    motion = Motion(*(spline(time, order) for order in range(3)))
    half = 0.5 * balancing_wrench(skeleton, subject.bsp, motion)
    loads = np.stack([half, half], axis=1)
    return SyntheticTrial(skeleton, subject.bsp, time, motion, loads, np.zeros(6))


def _feet_stay(skeleton: Skeleton, q: np.ndarray) -> np.ndarray:
    """Return pelvis translations (n, 3) that keep the feet's middle in place, the lowest foot marker on the ground."""
    pose = skeleton.pose(q)
    feet = [skeleton.segments.index(f"foot_{side}") for side in "rl"]
    middle = pose.translation[:, feet].mean(axis=1)
    soles = np.isin(skeleton.marker_segments, feet)
    lowest = skeleton.marker_positions(pose)[0, soles, 1].min()
    result: np.ndarray = middle[0] - middle - np.array([0.0, lowest, 0.0])
    return result
