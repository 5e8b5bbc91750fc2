"""A standing person made from geometry, so that models can be built without measured files."""

import numpy as np

from kinertia.io.marker_set_file import read_marker_set
from kinertia.model.gait27 import Gait27, build_gait27
from kinertia.motion.dynamics import Motion
from kinertia.trial.data import Markers, Recording

# (x forward, y up, z right) in shares of the stature; right side of those that come in pairs
_MIDDLE = {"V.Sacral": (-0.065, 0.56, 0.0), "Sternum": (0.06, 0.75, 0.0), "Top.Head": (0.0, 1.0, 0.0)}
_RIGHT = {
    "ASIS": (0.03, 0.56, 0.07),
    "Knee.Lat": (0.0, 0.285, 0.085),
    "Knee.Med": (0.0, 0.285, 0.03),
    "Ankle.Lat": (-0.012, 0.04, 0.078),
    "Ankle.Med": (-0.004, 0.046, 0.035),
    "Heel": (-0.045, 0.015, 0.052),
    "Toe.Lat": (0.065, 0.015, 0.082),
    "Toe.Med": (0.075, 0.02, 0.04),
    "Toe.Tip": (0.105, 0.012, 0.06),
    "Midfoot.Sup": (0.04, 0.04, 0.055),
    "Midfoot.Lat": (0.02, 0.015, 0.08),
    "Thigh.Upper": (0.04, 0.42, 0.07),
    "Thigh.Front": (0.045, 0.36, 0.06),
    "Thigh.Rear": (0.01, 0.37, 0.1),
    "Shank.Upper": (0.035, 0.22, 0.065),
    "Shank.Front": (0.03, 0.15, 0.055),
    "Shank.Rear": (-0.01, 0.16, 0.085),
    "Acromium": (-0.01, 0.82, 0.11),
    "Temple": (0.02, 0.94, 0.045),
    "Bicep": (0.02, 0.71, 0.14),
    "Elbow": (-0.005, 0.635, 0.165),
    "Wrist.Lat": (0.055, 0.5, 0.17),
    "Wrist.Med": (0.045, 0.495, 0.135),
}


def standing_positions(height_m: float = 1.75) -> dict[str, np.ndarray]:
    """Label -> (3,) m in ground axes, of the Cleveland Clinic set; left mirrors right, elbows slightly bent."""
    points = dict(_MIDDLE)
    for name, (x, y, z) in _RIGHT.items():
        points[f"R.{name}"], points[f"L.{name}"] = (x, y, z), (x, y, -z)
    return {label: height_m * np.array(at) for label, at in points.items()}


def recording(positions: dict[str, np.ndarray], frames: int = 5) -> Recording:
    """A recording in which these markers stand still."""
    stack = np.tile(np.array(list(positions.values())), (frames, 1, 1))
    return Recording("static", Markers(np.arange(frames) / 100.0, tuple(positions), stack))


_ROOM = 0.05
"""Rad that poses stay off the ends of their ranges."""


def generic_static(height_m: float = 1.75) -> Recording:
    """A static trial of a symmetric person with medial markers, facing +X."""
    return recording(standing_positions(height_m))


def generic_model(height_m: float = 1.75) -> Gait27:
    """The 27-DOF model of that person."""
    return build_gait27(generic_static(height_m), read_marker_set("cleveland-clinic"), height_m, "male")


def random_coordinates(skeleton, n: int, seed: int = 0, spread: float = 0.5) -> np.ndarray:
    """(n, c) poses with angles within `spread` rad of upright and within their ranges, and the pelvis about 1 m up."""
    rng = np.random.default_rng(seed)
    centre, scale = within_ranges(skeleton, spread)
    q: np.ndarray = centre + scale * rng.uniform(-spread, spread, (n, len(skeleton.coordinates)))
    q[:, 1] += 1.0
    return q


def smooth_motion(skeleton, n: int = 60, rate_hz: float = 60.0, seed: int = 0) -> tuple[np.ndarray, Motion]:
    """Time (n,) s and a motion in which every coordinate is a sum of two slow sinusoids (0.3-2 Hz) within its range."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) / rate_hz
    shape = (2, len(skeleton.coordinates))
    size, omega, phase = rng.uniform(0.1, 0.4, shape), rng.uniform(2.0, 12.0, shape), rng.uniform(0.0, 6.0, shape)
    size[:, :3] *= 0.2
    centre, scale = within_ranges(skeleton, 0.8)
    size *= scale
    angle = omega * time[:, None, None] + phase
    q, qd, qdd = (
        (size * part).sum(axis=1) for part in (np.sin(angle), omega * np.cos(angle), -(omega**2) * np.sin(angle))
    )
    q += centre
    q[:, 1] += 1.0
    return time, Motion(q, qd, qdd)


def within_ranges(skeleton, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres and factors (c,) that bring values within `spread` of zero into the coordinates' ranges."""
    low, high = np.clip([skeleton.bounds.low, skeleton.bounds.high], -10.0, 10.0)
    half = np.minimum(spread, (high - low) / 2 - _ROOM)
    return np.clip(0.0, low + _ROOM + half, high - _ROOM - half), half / spread
