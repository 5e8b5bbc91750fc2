"""Makes synthetic trials for studies: five motions to plan with, and walks with given instrument faults.

The truth is a `SyntheticTrial`; the laboratory has noisy markers, loads measured by its own plates, and its own
skeleton. Only these three are returned, as `Kinematics`; the estimator gets only what files would contain.

The two walks are the package's, at its own pace and a third faster. In the others the person stands, both feet on the
ground, each with half of the load: squats, swinging arms, and a swaying trunk. Amplitudes and paces are those of an
unhurried adult.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from kinertia.estimation.simultaneous.instruments.plates import plate_middles, turned_loads
from kinertia.estimation.simultaneous.instruments.priors import JOINT_CENTRE_SD_M, MARKER_SD_M, InstrumentPrior
from kinertia.model.gait27 import HIP_OFFSETS, LUMBAR_OFFSETS, SHOULDER_OFFSETS
from kinertia.model.skeleton import GRAVITY_M_S2, Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.kinematics import Kinematics, solve_kinematics
from kinertia.settings import Instruments
from kinertia.synthetic.laboratory import ClusterMotion, SkinMotion, camera_noise, study_noise
from kinertia.synthetic.walk import Manner, SyntheticSubject, SyntheticTrial, balancing_wrench, walk
from kinertia.trial.data import LOAD_THRESHOLD_N, FootLoads, Markers, Trial

CAMERA_SD_M = 0.0005
LINEAR_SHARE = {"artefact": 1.0, "mixed": 2.0 / 3.0, "clusters": 0.0}
"""Share of the variance of skin motion that follows the joints."""
WOBBLE_HZ, WOBBLE_DAMPING = 10.0, 0.3
"""Thigh soft tissue on springs: natural frequency and damping ratio (Gruber et al. 1998, J Biomech 31)."""


@dataclass(frozen=True)
class Faults:
    """Faults of a laboratory, and the noise of the markers.

    Attributes:
        noise: "study" (`noise.study_noise`); or skin and 0.5 mm of camera noise: "artefact" follows the joints
            (`noise.SkinMotion`), "clusters" the stride (`noise.ClusterMotion`), "mixed" has two thirds of the
            variance from the first and one third from the second.
        amplitude: factor on that noise, except the cameras'.
        calibration: joint centres, markers, plates and synchronisation have errors drawn from the estimator's own
            prior.
        instruments: what the laboratory states about plates and synchronisation, which then applies to those errors.
        axes_rad: the axes of knees, ankles and elbows are tilted by this much, each in its own direction.
        hips_m: both hip centres are too far forward by this.
        wobbling: share of the thighs' mass that wobbles on springs.
        gain: relative error of the right foot's plate.
        plate_m: the left foot's plate reads too far forward by this.
        delay_s: delay of the forces.
    """

    noise: Literal["study", "artefact", "clusters", "mixed"]
    amplitude: float = 1.0
    calibration: bool = False
    instruments: Instruments = field(default_factory=Instruments)
    axes_rad: float = 0.0
    hips_m: float = 0.0
    wobbling: float = 0.0
    gain: float = 0.0
    plate_m: float = 0.0
    delay_s: float = 0.0


def measured(
    trials: Sequence[SyntheticTrial], faults: Faults, rng: np.random.Generator
) -> tuple[Skeleton, list[Kinematics]]:
    """Return the skeleton that the laboratory assumes, and the kinematics by it of all trials of one person.

    Skin motion that follows the joints, skeleton, plates and synchronisation are the same in all trials; the study's
    noise, zero offsets of plates and trial delays are not. Sizes of skin motion are those of the first.
    """
    markers, skeleton = _disturbed(trials, faults, rng), trials[0].skeleton
    instruments, prior = _Instruments.with_faults(faults), InstrumentPrior.stated(faults.instruments)
    if faults.calibration:
        skeleton = _misplaced(skeleton, rng)
        instruments = _Instruments.draw(rng, prior)
    if faults.hips_m:
        skeleton = skeleton.lock({name: faults.hips_m for name in HIP_OFFSETS if "_x_" in name})
    if faults.axes_rad:
        skeleton = tilted(skeleton, faults.axes_rad, rng)
    kinematics = []
    for trial, seen in zip(trials, markers, strict=True):
        loads = trial.foot_loads.copy()
        if faults.wobbling:
            loads += _wobbled(trial, faults.wobbling)
        if instruments is not None:
            errors = instruments.in_trial(rng, prior, len(trials) > 1) if faults.calibration else instruments
            loads = errors.read(trial.time, loads)
        kinematics.append(_kinematics(skeleton, trial.time, seen, loads))
    return skeleton, kinematics


def _disturbed(trials: Sequence[SyntheticTrial], faults: Faults, rng: np.random.Generator) -> list[Markers]:
    """Add noise to the markers of each trial."""
    first, *others = (trial.motion.q for trial in trials)
    skin: list[tuple[float, SkinMotion | ClusterMotion]] = []
    if faults.noise in LINEAR_SHARE:
        linear = LINEAR_SHARE[faults.noise]
        if linear > 0.0:
            skin.append((np.sqrt(linear), SkinMotion.draw(trials[0].skeleton, first, rng, others)))
        if linear < 1.0:
            skin.append((np.sqrt(1.0 - linear), ClusterMotion.draw(trials[0].skeleton, rng)))
    markers = []
    for trial in trials:
        exact, q = trial.markers, trial.motion.q
        if not skin:
            moved = study_noise(exact, rng).positions - exact.positions
        else:
            parts = (
                share * (motion_of_skin.moved(exact, trial.skeleton, q).positions - exact.positions)
                for share, motion_of_skin in skin
            )
            moved = np.sum(list(parts), axis=0)
        scaled = replace(exact, positions=exact.positions + faults.amplitude * moved)
        markers.append(camera_noise(scaled, CAMERA_SD_M, rng) if skin else scaled)
    return markers


def _kinematics(skeleton: Skeleton, time: np.ndarray, markers: Markers, loads: np.ndarray) -> Kinematics:
    feet = FootLoads(time, loads[..., :3], loads[..., 3:])
    return solve_kinematics(skeleton, Trial("walk", markers, feet, np.ones(len(time), dtype=bool)), 0.0, "gcv")


def _misplaced(skeleton: Skeleton, rng: np.random.Generator) -> Skeleton:
    """Displace joint centres and markers of the skeleton by errors drawn from the prior of `fit_simultaneous`."""
    centres = (*HIP_OFFSETS, *LUMBAR_OFFSETS, *SHOULDER_OFFSETS)
    skeleton = skeleton.lock({name: skeleton.locked[name] + rng.normal(0.0, JOINT_CENTRE_SD_M) for name in centres})
    places = skeleton.marker_locals + rng.normal(0.0, MARKER_SD_M, skeleton.marker_locals.shape)
    return skeleton.with_positions(places)


@dataclass(frozen=True, eq=False)
class _Instruments:
    """Plates and synchronisation of a laboratory.

    The delay of the forces, and per foot's plate its offset (2, 3) m, gain (2, 1), crosstalk (2,) to the free moment,
    zero offset (2, 3) N and rotation (2,) about the vertical.
    """

    delay_s: float
    offset_m: np.ndarray
    gain: np.ndarray
    free_moment: np.ndarray
    zero_offset_n: np.ndarray
    turn_rad: np.ndarray

    @classmethod
    def draw(cls, rng: np.random.Generator, prior: InstrumentPrior) -> Self:
        """Draw the errors from a prior of `fit_simultaneous`."""
        priors = {name: plate_prior for name, plate_prior in prior.plate.items() if name != "turn"}
        plates = np.array([[plate_prior.draw(rng) for plate_prior in priors.values()] for _ in range(2)])
        x, z = (prior.floor[name].draw(rng) for name in "xz")
        offset = np.column_stack([plates[:, 0] + x, np.zeros(2), plates[:, 1] + z])
        delay_s = prior.delay_s.draw(rng)
        # last, so that everything else of a seed does not depend on them
        turn_rad = prior.floor["turn"].draw(rng) + np.array([prior.plate["turn"].draw(rng) for _ in range(2)])
        return cls(delay_s, offset, 1.0 + plates[:, 2:3], plates[:, 3], np.zeros((2, 3)), turn_rad)

    def in_trial(self, rng: np.random.Generator, prior: InstrumentPrior, one_of_several: bool) -> Self:
        """Add the errors of a single trial: zero offsets, gains, and a delay if it is one of several or was not
        checked."""
        zero = np.array([[prior.zero_offset_n.draw(rng), 0.0, prior.zero_offset_n.draw(rng)] for _ in range(2)])
        delayed = one_of_several or prior.delay_s.fault_probability > 0.0
        trial_delay_s = prior.trial_delay_s.draw(rng) if delayed else 0.0
        gain = self.gain + [[prior.trial_gain.draw(rng)] for _ in range(2)]
        return replace(self, zero_offset_n=zero, delay_s=self.delay_s + trial_delay_s, gain=gain)

    @classmethod
    def with_faults(cls, faults: Faults) -> Self | None:
        """Make the instruments of a laboratory without calibration errors; None if they are fault-free."""
        if not (faults.gain or faults.plate_m or faults.delay_s):
            return None
        offset = np.array([[0.0, 0.0, 0.0], [faults.plate_m, 0.0, 0.0]])
        gain = 1.0 + np.array([[faults.gain], [0.0]])
        return cls(faults.delay_s, offset, gain, np.zeros(2), np.zeros((2, 3)), np.zeros(2))

    def read(self, time: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """Return the plates' readings of true loads (n, 2, 6)."""
        middles = plate_middles(FootLoads(time, loads[..., :3], loads[..., 3:]), np.arange(2))
        wrong = turned_loads(np.asarray(CubicSpline(time, loads)(time - self.delay_s)), middles, self.turn_rad)
        wrong[..., 3:] += np.cross(self.offset_m, wrong[..., :3])
        wrong *= self.gain
        wrong[..., 4] += self.free_moment * wrong[..., 1]
        push = np.concatenate([self.zero_offset_n, np.cross(middles, self.zero_offset_n)], axis=-1)
        wrong += (wrong[..., 1:2] > LOAD_THRESHOLD_N) * push
        return wrong


def tilted(skeleton: Skeleton, angle_rad: float, rng: np.random.Generator) -> Skeleton:
    """Tilt every joint of one rotation by this angle, each in a random direction."""
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
    """Return the change of foot loads (n, 2, 6) if this share of each thigh's mass is on springs at the thigh's CoM.

    The springs' own deflection under gravity belongs to the CoM; only the effect of inertia counts. The change is
    divided between the feet like the vertical forces.
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
    result: np.ndarray = (upward / upward.sum(axis=1, keepdims=True))[..., None] * change[:, None]
    return result


def _oscillator(base: np.ndarray, step: float) -> np.ndarray:
    """Solve x'' + 2 d w x' + w^2 x = -base for x (n, 3), by the bilinear transform, from rest at equilibrium."""
    from scipy.signal import lfilter  # with scipy.stats, half a second: too much if nothing wobbles

    w = 2.0 * np.pi * WOBBLE_HZ
    k = 2.0 / step
    a = np.array(
        [k**2 + 2 * WOBBLE_DAMPING * w * k + w**2, 2 * w**2 - 2 * k**2, k**2 - 2 * WOBBLE_DAMPING * w * k + w**2]
    )
    b = -np.array([1.0, 2.0, 1.0])
    swing = base - base[0]
    result: np.ndarray = lfilter(b / a[0], a / a[0], swing, axis=0) - base[0] / w**2
    return result


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
