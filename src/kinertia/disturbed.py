"""Synthetic walks measured by laboratories with given faults: what the accuracy study estimates from.

The truth is a `SyntheticTrial`; the laboratory has noisy markers, loads by its own plates, and its own idea of the
skeleton. Only the latter three come out, as `Kinematics`; the estimator gets no more than from files.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from kinertia.freedom import JOINT_CENTRE_SD_M, MARKER_SD_M
from kinertia.gait27 import HIP_OFFSETS, LUMBAR_OFFSETS, SHOULDER_OFFSETS
from kinertia.kinematics import Kinematics, solve_kinematics
from kinertia.noise import camera_noise, soft_tissue_artefact, study_noise
from kinertia.simultaneous_fit import CLOCK_SD_S, PLATE_SD
from kinertia.skeleton import GRAVITY_M_S2, Marker, Skeleton
from kinertia.splines import smooth
from kinertia.synthetic import SyntheticTrial
from kinertia.trial import FootLoads, Markers, Trial

CAMERA_SD_M = 0.0005
WOBBLE_HZ, WOBBLE_DAMPING = 10.0, 0.3
"""Soft tissue of the thigh on its springs: natural frequency and damping ratio (Gruber et al. 1998, J Biomech 31)."""
_LOADS_HZ = 40.0


@dataclass(frozen=True)
class Faults:
    """What is wrong in a laboratory beside the noise of the markers.

    Attributes:
        noise: "study" (`noise.study_noise`) or "artefact" (`noise.soft_tissue_artefact` and 0.5 mm of camera noise).
        amplitude: factor on that noise, but for the cameras'.
        calibration: joint centres, markers, plates and clock are off by errors drawn from the estimator's own prior.
        axes_rad: the axes of knees, ankles and elbows are tilted by this much, each in its own direction.
        hips_m: both hip centres are this far forward.
        wobbling: share of the thighs' mass that wobbles on springs.
        gain: relative error of the right foot's plate.
    """

    noise: Literal["study", "artefact"]
    amplitude: float = 1.0
    calibration: bool = False
    axes_rad: float = 0.0
    hips_m: float = 0.0
    wobbling: float = 0.0
    gain: float = 0.0


def measured(trial: SyntheticTrial, faults: Faults, rng: np.random.Generator) -> tuple[Skeleton, Kinematics]:
    """The skeleton that the laboratory believes in, and its kinematics by that skeleton."""
    exact = trial.markers
    if faults.noise == "study":
        moved, camera_sd_m = study_noise(exact, rng), 0.0
    else:
        moved, camera_sd_m = soft_tissue_artefact(exact, trial.skeleton, trial.motion.q, rng), CAMERA_SD_M
    scaled = replace(exact, positions=exact.positions + faults.amplitude * (moved.positions - exact.positions))
    markers = camera_noise(scaled, camera_sd_m, rng)
    loads = trial.foot_loads.copy()
    if faults.wobbling:
        loads += _wobbled(trial, faults.wobbling)
    skeleton = trial.skeleton
    if faults.calibration:
        skeleton, loads = _miscalibrated(trial, loads, rng)
    loads[:, 0] *= 1.0 + faults.gain
    if faults.hips_m:
        skeleton = skeleton.lock({name: faults.hips_m for name in HIP_OFFSETS if "_x_" in name})
    if faults.axes_rad:
        skeleton = tilted(skeleton, faults.axes_rad, rng)
    return skeleton, _kinematics(skeleton, trial.time, markers, loads)


def _kinematics(skeleton: Skeleton, time: np.ndarray, markers: Markers, loads: np.ndarray) -> Kinematics:
    feet = FootLoads(time, loads[..., :3], loads[..., 3:])
    return solve_kinematics(skeleton, Trial("walk", markers, feet, np.ones(len(time), dtype=bool)), 0.0, "gcv")


def _miscalibrated(trial: SyntheticTrial, loads: np.ndarray, rng: np.random.Generator) -> tuple[Skeleton, np.ndarray]:
    """A wrong skeleton and loads (n, 2, 6), errors drawn from the prior of `fit_simultaneous`."""
    skeleton = trial.skeleton
    centres = (*HIP_OFFSETS, *LUMBAR_OFFSETS, *SHOULDER_OFFSETS)
    skeleton = skeleton.lock({name: skeleton.locked[name] + rng.normal(0.0, JOINT_CENTRE_SD_M) for name in centres})
    places = skeleton.marker_locals + rng.normal(0.0, MARKER_SD_M, skeleton.marker_locals.shape)
    placed = [Marker(m.label, m.segment, place) for m, place in zip(skeleton.markers, places, strict=True)]
    late = smooth(trial.time, loads.reshape(len(trial.time), 12), _LOADS_HZ)(trial.time + rng.normal(0.0, CLOCK_SD_S))
    wrong = late.reshape(loads.shape)
    offset = rng.normal(0.0, 1.0, (2, 3)) * [PLATE_SD["x"], 0.0, PLATE_SD["z"]]
    wrong[..., 3:] += np.cross(offset, wrong[..., :3])
    wrong *= 1.0 + rng.normal(0.0, PLATE_SD["gain"], (2, 1))
    wrong[..., 4] += rng.normal(0.0, PLATE_SD["free moment"], 2) * wrong[..., 1]
    return skeleton.with_markers(placed), wrong


def tilted(skeleton: Skeleton, angle_rad: float, rng: np.random.Generator) -> Skeleton:
    """The skeleton with every joint of one rotation tilted by this angle, each in a random direction."""
    joints = []
    for joint in skeleton.joints:
        moving = [axis for axis in joint.axes if axis.coordinate not in skeleton.locked]
        if len(moving) == 1 and moving[0].kind == "rotation":
            direction = np.array(moving[0].direction)
            across = np.cross(direction, rng.standard_normal(3))
            x, y, z = map(float, Rotation.from_rotvec(angle_rad * across / np.linalg.norm(across)).apply(direction))
            turned = replace(moving[0], direction=(x, y, z))
            joint = replace(joint, axes=tuple(turned if axis is moving[0] else axis for axis in joint.axes))
        joints.append(joint)
    return replace(skeleton, joints=tuple(joints))


def _wobbled(trial: SyntheticTrial, share: float) -> np.ndarray:
    """Change of the foot loads (n, 2, 6) when this share of each thigh's mass hangs on springs at the thigh's CoM.

    The springs' own deflection under gravity belongs to the CoM; only what inertia adds counts. The change is divided
    between the feet as the vertical forces are.
    """
    step = trial.time[1] - trial.time[0]
    pose = trial.skeleton.pose(trial.motion.q)
    change = np.zeros((len(trial.time), 6))
    for side in "rl":
        place, row = (names.index(f"thigh_{side}") for names in (trial.skeleton.segments, trial.bsp.segments))
        centre = pose.translation[:, place] + pose.rotation[:, place] @ trial.bsp.com_m[row]
        carried = np.gradient(np.gradient(centre, step, axis=0), step, axis=0)
        moved = _oscillator(carried, step)
        rate = np.gradient(np.gradient(moved, step, axis=0), step, axis=0)
        mass = share * trial.bsp.mass_kg[row]
        pull = carried + np.array([0.0, GRAVITY_M_S2, 0.0])
        change[:, :3] += mass * rate
        change[:, 3:] += mass * (np.cross(centre + moved, pull + rate) - np.cross(centre, pull))
    upward = np.maximum(trial.foot_loads[:, :, 1], 0.0)
    return (upward / upward.sum(axis=1, keepdims=True))[..., None] * change[:, None]


def _oscillator(base: np.ndarray, step: float) -> np.ndarray:
    """(n, 3) displacement x of x'' + 2 d w x' + w^2 x = -base, by the bilinear transform, from rest at balance."""
    w = 2.0 * np.pi * WOBBLE_HZ
    k = 2.0 / step
    a = np.array(
        [k**2 + 2 * WOBBLE_DAMPING * w * k + w**2, 2 * w**2 - 2 * k**2, k**2 - 2 * WOBBLE_DAMPING * w * k + w**2]
    )
    b = -np.array([1.0, 2.0, 1.0])
    swing = base - base[0]
    return lfilter(b / a[0], a / a[0], swing, axis=0) - base[0] / w**2
