"""Other trials of the synthetic laboratory's person, all ground contact measured: squats, a walk, a run.

They complete what a walk over two plates cannot show: many contacts, flight, a trunk that bends.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.pose_fit import Stop, fit_poses
from kinertia.synthetic.laboratory import camera_noise
from kinertia.synthetic.motions import squat
from kinertia.synthetic.walk import SyntheticSubject, SyntheticTrial, walk
from kinertia.trial.data import LOAD_THRESHOLD_N, Markers, PlateLoads, Recording
from kinertia.trial.ground_contact import centre_of_pressure

CAMERA_SD_M, FORCE_SD_N, MOMENT_SD_NM = 0.0005, 1.0, 0.2
LONG_WALK_S, LONG_WALK_START, LOAD_RATE_HZ, SAMPLES_PER_FRAME = 3.7, 0.75, 1000.0, 10
NAMES = ("1_ground_force", "2_ground_force")


def measured(name: str, markers: Markers, plates: PlateLoads, rng: np.random.Generator) -> Recording:
    """By careful cameras and plates, whose errors act where the load does: these plates are as long as the way."""
    error = rng.normal(0.0, FORCE_SD_N, plates.force.shape)
    twist = rng.normal(0.0, MOMENT_SD_NM, plates.force.shape)
    force = plates.force + error
    moment = plates.moment + np.cross(centre_of_pressure(plates.wrench), error) + twist
    loaded = np.minimum(plates.force[..., 1:2], force[..., 1:2]) >= LOAD_THRESHOLD_N
    noisy = replace(plates, force=np.where(loaded, force, 0.0), moment=np.where(loaded, moment, 0.0))
    return Recording(name, camera_noise(markers, CAMERA_SD_M, rng), noisy)


def _plates(time: np.ndarray, loads: np.ndarray) -> PlateLoads:
    """Wrenches (n, 2, 6) of the right and left foot, each on a plate of its own."""
    return PlateLoads(time, NAMES, loads[..., :3], loads[..., 3:], (None, None))


def squats(person: SyntheticSubject, rng: np.random.Generator) -> Recording:
    """Two squats, a foot on each plate; loads at the rate of the markers."""
    trial = squat(person)
    return measured("squats", trial.markers, _plates(trial.time, _under_each_foot(trial)), rng)


def _under_each_foot(trial: SyntheticTrial) -> np.ndarray:
    """Both feet bear as much as puts each load's centre as far in front of its heel as the other's."""
    positions, labels = trial.markers.positions, trial.markers.labels
    right, left = (positions[:, labels.index(f"{side}.Heel")] * [1.0, 0.0, 1.0] for side in "RL")
    both = trial.foot_loads.sum(axis=1)
    force, point = both[:, :3], centre_of_pressure(both)
    free = both[:, 3:] - np.cross(point, force)
    apart = right - left
    share = np.einsum("ni,ni->n", point - left, apart) / np.einsum("ni,ni->n", apart, apart)
    ahead = point - left - share[:, None] * apart
    loads = [
        np.hstack([part * force, np.cross(heel + ahead, part * force) + 0.5 * free])
        for heel, part in ((right, share[:, None]), (left, 1.0 - share[:, None]))
    ]
    return np.stack(loads, axis=1)


def long_walk(person: SyntheticSubject, with_feet: SyntheticSubject, rng: np.random.Generator) -> Recording:
    """Three strides of the package's walk, every right step on the first plate and every left one on the second.

    Args:
        person: who walks.
        with_feet: the same with markers that show where the feet are.
        rng: of the noise.
    """
    trial = walk(with_feet, LONG_WALK_S, LOAD_RATE_HZ, LONG_WALK_START)
    trial = replace(trial, skeleton=person.moving_skeleton)
    seen = slice(0, len(trial.time), SAMPLES_PER_FRAME)
    markers = Markers(trial.time[seen], trial.markers.labels, trial.markers.positions[seen])
    return measured("long", markers, _plates(trial.time, trial.foot_loads), rng)


def run(person: SyntheticSubject, rng: np.random.Generator) -> Recording:
    """Seven strides on a treadmill with a belt for each foot."""
    return measured("run", *_Run(person).trial(), rng)


class _Run:
    """The centre of mass goes as the forces ask for, and the limbs swing about it; on a belt, both feet alike.

    Only forces are exact: moments about the centre of mass are those of loads under the feet.
    """

    STRIDES, STRIDE_S, STANCE_S, SPEED_M_S, FRAME_RATE_HZ = 7, 0.72, 0.25, 2.6, 100.0
    LANDS_M, LOWER_M, LIFT_M = 0.25, 0.1, 0.12
    """The toe in front of where it is in standing, the pelvis below, and how high the toe swings."""
    BRAKE, INWARDS = 0.3, 0.05
    """Largest horizontal force in body weights, and as a share of the vertical one."""
    PITCH_DEG = ((0.0, 0.0), (0.2, 0.0), (0.35, -35.0), (0.55, -70.0), (0.85, 0.0), (1.0, 0.0))
    """Of the foot over the stride that begins with its landing."""
    LOADED = (0.3, 0.85)
    """From heel to tip of the toe, where the load begins and ends."""
    FREE_NM = 4.0
    ROUNDS = 4

    def __init__(self, person: SyntheticSubject) -> None:
        self.skeleton, self.bsp = person.moving_skeleton, person.bsp
        standing = person.static.markers
        self.labels = self.skeleton.labels
        self.at_rest = standing.select(list(self.labels)).positions.mean(axis=0)
        self.standing_q = solve_ik(self.skeleton, Markers(np.zeros(1), self.labels, self.at_rest[None])).q[0]

    @cached_property
    def weight_n(self) -> float:
        return self.bsp.total_mass_kg * GRAVITY_M_S2

    def since_landing(self, time: np.ndarray, foot: int) -> np.ndarray:
        return (time - 0.5 * foot * self.STRIDE_S) % self.STRIDE_S

    def force(self, time: np.ndarray) -> np.ndarray:
        """(n, 2, 3) N on the right and left foot."""
        force = np.zeros((len(time), 2, 3))
        for foot, inwards in enumerate((-1.0, 1.0)):
            share = self.since_landing(time, foot) / self.STANCE_S
            vertical = np.pi / 4 * self.STRIDE_S / self.STANCE_S * np.sin(np.pi * np.minimum(share, 1.0))
            push = np.where(share < 1.0, -self.BRAKE * np.sin(2 * np.pi * share), 0.0)
            force[:, foot] = np.column_stack([push, vertical, inwards * self.INWARDS * vertical])
        return self.weight_n * force

    def toe_path(self, time: np.ndarray, foot: int) -> tuple[np.ndarray, np.ndarray]:
        """How far it is in front of its place in standing, and how high."""
        since, way = self.since_landing(time, foot), self.SPEED_M_S
        swing_s = self.STRIDE_S - self.STANCE_S
        leaves = self.LANDS_M - way * self.STANCE_S
        swings = CubicHermiteSpline([0.0, swing_s], [leaves, self.LANDS_M], [-way, -way])
        after = np.maximum(since - self.STANCE_S, 0.0)
        forward = np.where(since < self.STANCE_S, self.LANDS_M - way * since, swings(after))
        return forward, self.LIFT_M * np.sin(np.pi * after / swing_s) ** 2

    def of_foot(self, foot: int) -> list[int]:
        segment = self.skeleton.segments.index(f"foot_{'rl'[foot]}")
        return [k for k, marker in enumerate(self.skeleton.marker_segments) if marker == segment]

    def tip(self, foot: int) -> np.ndarray:
        return self.at_rest[self.labels.index(f"{'RL'[foot]}.Toe.Tip")] * [1.0, 0.0, 1.0]

    def foot_markers(self, time: np.ndarray, foot: int) -> np.ndarray:
        """(n, k, 3) m."""
        forward, up = self.toe_path(time, foot)
        shares, degrees = np.transpose(self.PITCH_DEG)
        pitch = np.radians(PchipInterpolator(shares, degrees)(self.since_landing(time, foot) / self.STRIDE_S))
        from_tip = self.at_rest[self.of_foot(foot)] - self.tip(foot)
        c, s = np.cos(pitch)[:, None], np.sin(pitch)[:, None]
        x, y = from_tip[:, 0], from_tip[:, 1]
        turned = np.stack([c * x - s * y, s * x + c * y, np.broadcast_to(from_tip[:, 2], (len(time), len(x)))], axis=2)
        shift = np.column_stack([forward, up, np.zeros_like(up)])
        return self.tip(foot) + shift[:, None] + turned

    def upper_body(self, time: np.ndarray) -> np.ndarray:
        """(n, c) coordinates as in standing, but for pelvis, trunk and arms."""
        q = np.tile(self.standing_q, (len(time), 1))
        sway = np.sin(2 * np.pi * time / self.STRIDE_S)
        swings = {"pelvis_rotation": (0.0, -8.0), "lumbar_rotation": (0.0, 16.0), "lumbar_extension": (-8.0, 0.0)}
        for side, sign in (("r", -1.0), ("l", 1.0)):
            swings |= {f"hip_flexion_{side}": (20.0, 30.0 * sign), f"knee_angle_{side}": (50.0, 30.0 * sign)}
            swings |= {f"arm_flex_{side}": (-5.0, 40.0 * sign), f"elbow_flex_{side}": (85.0, 15.0 * sign)}
        for name, (middle, size) in swings.items():
            q[:, self.skeleton.coordinates.index(name)] = np.radians(middle + size * sway)
        q[:, 1] -= self.LOWER_M
        return q

    def centre_of_mass(self, q: np.ndarray) -> np.ndarray:
        pose = self.skeleton.pose(q)
        rows = [self.skeleton.segments.index(segment) for segment in self.bsp.segments]
        places = pose.translation[:, rows] + np.einsum("nsij,sj->nsi", pose.rotation[:, rows], self.bsp.com_m)
        return np.einsum("s,nsi->ni", self.bsp.mass_kg, places) / self.bsp.total_mass_kg

    def centre_path(self, time: np.ndarray) -> np.ndarray:
        """(n, 3) m, about its mean: the acceleration that the forces ask for, integrated harmonic by harmonic."""
        force = self.force(time).sum(axis=1)
        harmonics = np.fft.rfft(force - force.mean(axis=0), axis=0) / self.bsp.total_mass_kg
        rate = 2 * np.pi * np.fft.rfftfreq(len(time), time[1] - time[0])
        harmonics[1:] /= -(rate[1:, None] ** 2)
        return np.fft.irfft(harmonics, len(time), axis=0)

    def stride(self) -> np.ndarray:
        """(n, markers, 3) m over one stride, in the order of the skeleton's labels."""
        time = np.arange(round(self.STRIDE_S * self.FRAME_RATE_HZ)) / self.FRAME_RATE_HZ
        upper, path = self.upper_body(time), self.centre_path(time)
        upper[:, :3] += path
        for _ in range(self.ROUNDS):
            q = self.on_feet(time, upper)
            centre = self.centre_of_mass(q)
            upper[:, :3] += path - (centre - centre.mean(axis=0))
        return self.skeleton.marker_positions(self.skeleton.pose(q))

    def on_feet(self, time: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """(n, c) coordinates with legs that reach where the feet are."""
        places = self.skeleton.marker_positions(self.skeleton.pose(upper))
        legs = [self.skeleton.segments.index(f"{name}_{side}") for name in ("thigh", "shank") for side in "rl"]
        places[:, np.isin(self.skeleton.marker_segments, legs)] = np.nan
        for foot in range(2):
            places[:, self.of_foot(foot)] = self.foot_markers(time, foot)
        return fit_poses(self.skeleton, places, upper, Stop(0.0, 200)).q

    def trial(self) -> tuple[Markers, PlateLoads]:
        places = np.tile(self.stride(), (self.STRIDES, 1, 1))
        markers = Markers(np.arange(len(places)) / self.FRAME_RATE_HZ, self.labels, places)
        time = np.arange(round(self.STRIDES * self.STRIDE_S * LOAD_RATE_HZ)) / LOAD_RATE_HZ
        force = self.force(time)
        moment = np.zeros_like(force)
        for foot in range(2):
            tip = self.tip(foot)
            heel = self.at_rest[self.labels.index(f"{'RL'[foot]}.Heel")] * [1.0, 0.0, 1.0]
            share = np.minimum(self.since_landing(time, foot) / self.STANCE_S, 1.0)
            along = self.LOADED[0] + (self.LOADED[1] - self.LOADED[0]) * share
            point = heel + along[:, None] * (tip - heel)
            point[:, 0] += self.toe_path(time, foot)[0]
            moment[:, foot] = np.cross(point, force[:, foot])
            moment[:, foot, 1] += self.FREE_NM * (1 - 2 * foot) * np.sin(np.pi * share) ** 2
        return markers, PlateLoads(time, NAMES, force, moment, (None, None))
