"""Makes a synthetic person and gait trial that are known completely.

There are two ways to an exactly consistent trial, both with root residual P = 0 at every frame and a pelvis whose
position and velocity are the trapezoid integrals of its acceleration (so that the study's pelvis correction, at the
true BSPs, returns the motion itself):

- `walk`: the walk that comes with the package, any length; the ground reactions are those that the motion requires,
  shared between the feet.
- `consistent_trial`: as in the study, any measured window; the ground reactions are kept and the pelvis is modified
  until the residual is zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import resources
from types import MappingProxyType
from typing import Self

import numpy as np
import pandas as pd

from kinertia.errors import KinertiaError
from kinertia.estimation.two_level import Integration, Window
from kinertia.io.marker_set_file import read_marker_set
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.gait27 import build_gait27
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, consistent_root_acceleration, residual
from kinertia.trial.data import Markers, Recording
from kinertia.trial.ground_contact import centre_of_pressure

MASS_KG, HEIGHT_M, SEX = 72.6, 1.803, "male"
"""The walker: the subject of OpenSim's gait2354 example."""
STATIC_ONLY = tuple(
    f"{side}.{joint}.{place}" for side in "RL" for joint in ("Knee", "Ankle") for place in ("Lat", "Med")
)
"""Markers that are removed after the static trial, as in the measured walk; 41 remain."""
UNLIKE_MASS, UNLIKE_COM_M, UNLIKE_INERTIA = 0.1, 0.01, 0.1
"""Variation of people about the literature: standard deviations of masses and moments (share), CoM coordinates (m)."""


@dataclass(frozen=True)
class Manner:
    """Differences of a person's walk from the package's.

    Attributes:
        pace: factor on the speed of the same steps.
        posture_rad: by coordinate without side, added to its mean.
        swing: by coordinate without side, factor on its amplitude about the mean.

    >>> Manner(pace=1.2).of("knee_angle_r")
    (0.0, 1.0)
    """

    pace: float = 1.0
    posture_rad: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    swing: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a manner of walking, the same on both sides."""
        pace = float(np.clip(rng.normal(1.0, _PACE_SD), _SLOWEST, _FASTEST))
        swing = {name: float(np.exp(rng.normal(0.0, _SWING_SD))) for name in _SWUNG}
        return cls(pace, {name: float(rng.normal(0.0, _POSTURE_SD_RAD)) for name in _HELD}, swing)

    def of(self, coordinate: str) -> tuple[float, float]:
        """Return what is added to the mean of a coordinate (rad), and the factor on its amplitude."""
        name = coordinate.removesuffix("_r").removesuffix("_l")
        return self.posture_rad.get(name, 0.0), self.swing.get(name, 1.0)


PACKAGE_MANNER = Manner()
_MAX_ITERATIONS = 100
_RESIDUAL_TOLERANCE = 1e-9
_HANDOVER = 0.3
"""Share of double support over which the shares of the load begin, and over which they end."""
_PACE_SD = 0.12
"""Comfortable speeds of adults of one age and sex differ by 7 to 17 % (Bohannon 1997, Age Ageing 26:15)."""
_SLOWEST, _FASTEST = 0.75, 1.35
_SWING_SD, _POSTURE_SD_RAD = 0.3, float(np.radians(4.0))
"""Standard deviations of the logarithm of an angle's amplitude, and of its mean (no source)."""
_SWUNG = ("lumbar_extension", "lumbar_bending", "lumbar_rotation", "arm_flex", "arm_add", "elbow_flex")
_HELD = ("lumbar_extension", "arm_flex", "arm_add", "elbow_flex")
"""Coordinates of trunk and arms: those of the legs determine where the feet are."""


@dataclass(frozen=True, eq=False)
class SyntheticSubject:
    """A synthetic person.

    Attributes:
        static: standing, with Cleveland Clinic markers.
        marker_set: of these markers.
        skeleton: the model of `static`.
        literature: Dumas' values for this person; CoMs are not on the segment axes.
        bsp: the truth.

    Examples:
        >>> round(kinertia.walking_subject().bsp.total_mass_kg, 1)
        72.6
    """

    static: Recording
    marker_set: MarkerSet
    skeleton: Skeleton
    literature: BodySegmentParameters
    bsp: BodySegmentParameters

    @property
    def moving_skeleton(self) -> Skeleton:
        """The skeleton without the markers `STATIC_ONLY`."""
        return self.skeleton.with_markers([m for m in self.skeleton.markers if m.label not in STATIC_ONLY])


@dataclass(frozen=True, eq=False)
class SyntheticTrial:
    """An exactly consistent trial.

    Attributes:
        skeleton, bsp: the truth.
        time: (n,) s, uniform.
        motion: coordinates and derivatives; pelvis integrated by the trapezoid rule.
        foot_loads: (n, 2, 6) on the right and left foot: force (N), moment about the ground origin (N m), ground axes.
        deviation: (6,) largest change of each pelvis coordinate from the start motion (m, rad).

    Examples:
        >>> trial = kinertia.walk(kinertia.walking_subject(), duration_s=0.5)
        >>> trial.markers.positions.shape[0] == len(trial.time) == 51
        True
    """

    skeleton: Skeleton
    bsp: BodySegmentParameters
    time: np.ndarray
    motion: Motion
    foot_loads: np.ndarray
    deviation: np.ndarray

    @cached_property
    def markers(self) -> Markers:
        """Exact marker positions."""
        positions = self.skeleton.marker_positions(self.skeleton.pose(self.motion.q))
        return Markers(self.time, self.skeleton.labels, positions)

    @property
    def window(self) -> Window:
        """Input of the study's estimator: exact coordinates and the sum of the ground reactions."""
        return Window(self.time, self.motion, self.foot_loads.sum(axis=1))


def without_products(bsp: BodySegmentParameters) -> BodySegmentParameters:
    """Set products of inertia to zero, so that principal axes are the segment axes; moments are unchanged."""
    table = bsp.table()
    table[:, 7:] = 0.0
    return BodySegmentParameters.from_table(bsp.segments, table)


def walking_subject() -> SyntheticSubject:
    """Return the person of the package's synthetic walk: 72.6 kg, 1.803 m, male.

    The truth is the literature with zero products of inertia: principal axes along the segment axes, as in the study.
    """
    table = _data("standing.csv").set_index("label")
    rate_hz, n = 100.0, 20
    positions = np.tile(table[["x", "y", "z"]].to_numpy(float), (n, 1, 1))
    static = Recording("static", Markers(np.arange(n) / rate_hz, tuple(table.index), positions))
    marker_set = read_marker_set("cleveland-clinic")
    model = build_gait27(static, marker_set, HEIGHT_M, SEX)
    literature = literature_bsp(MASS_KG, HEIGHT_M, SEX, model.geometry)
    return SyntheticSubject(static, marker_set, model.skeleton, literature, without_products(literature))


def unlike_literature(subject: SyntheticSubject, rng: np.random.Generator) -> SyntheticSubject:
    """Draw a body that differs from the literature as people do, left mirroring right, on the same skeleton.

    Every mass differs by 10 %, every CoM coordinate by 10 mm, every moment of inertia by 10 % (standard deviations of
    normal draws); products of inertia change with their moments. The total mass is unchanged, since it is known from
    the scale. The draw is repeated until every segment is physically possible.
    """
    bsp = subject.literature
    left = np.array([segment.endswith("_l") for segment in bsp.segments])
    while True:
        shape = bsp.com_m.shape
        mass = bsp.mass_kg * (1.0 + rng.normal(0.0, UNLIKE_MASS, len(left)))
        com = bsp.com_m + rng.normal(0.0, UNLIKE_COM_M, shape)
        root = np.sqrt(np.maximum(1.0 + rng.normal(0.0, UNLIKE_INERTIA, shape), 0.01))
        drawn = BodySegmentParameters(bsp.segments, mass, com, bsp.inertia_kgm2 * root[:, :, None] * root[:, None, :])
        table = np.where(left[:, None], drawn.mirrored().table(), drawn.table())
        table[:, 0] *= bsp.total_mass_kg / table[:, 0].sum()
        result = BodySegmentParameters.from_table(bsp.segments, table)
        if result.physically_consistent().all():
            return replace(subject, bsp=result)


def walk(
    subject: SyntheticSubject,
    duration_s: float | None = None,
    rate_hz: float = 100.0,
    start: float = 0.0,
    trapezoid: bool = True,
    manner: Manner = PACKAGE_MANNER,
) -> SyntheticTrial:
    """Make the package's walk: 1.14 m/s, equal strides of 1.23 s, without the markers `STATIC_ONLY`.

    Args:
        subject: the person.
        duration_s: one stride if None.
        rate_hz: frames per second.
        start: share of the stride at which the trial begins (0: shortly before the left heel strikes).
        trapezoid: integrate the pelvis by the trapezoid rule, as the study's pelvis correction does; False keeps
            position and velocity that are exact integrals of the acceleration.
        manner: differences from the package's walk.
    """
    series = _WalkSeries.read().walked(manner)
    skeleton = subject.moving_skeleton
    duration_s = series.period_s if duration_s is None else duration_s
    time = np.arange(round(duration_s * rate_hz) + 1) / rate_hz
    motion = series.motion(skeleton.coordinates, time + start * series.period_s)
    periodic = motion.q[:, :6]
    if trapezoid:
        motion = motion.with_root(*Integration(time).track(motion.qdd[:, :6], periodic), motion.qdd[:, :6])
    deviation = np.abs(motion.q[:, :6] - periodic).max(axis=0)
    wrench = balancing_wrench(skeleton, subject.bsp, motion)
    loads = _on_feet(skeleton, motion, wrench, *series.support(time + start * series.period_s))
    return SyntheticTrial(skeleton, subject.bsp, time, motion, loads, deviation)


def balancing_wrench(skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion) -> np.ndarray:
    """Compute the ground reaction (n, 6) without residual: force (N), moment about the ground origin (N m)."""
    at_pelvis = residual(skeleton, bsp, motion, np.zeros((len(motion.q), 6)))
    force = at_pelvis[:, :3]
    return np.hstack([force, at_pelvis[:, 3:] + np.cross(motion.q[:, :3], force)])


def consistent_trial(
    skeleton: Skeleton, bsp: BodySegmentParameters, time: np.ndarray, motion: Motion, foot_loads: np.ndarray
) -> SyntheticTrial:
    """Make a trial from a measured window by modifying the pelvis until P = 0 at every frame.

    Equation (2) gives the pelvis acceleration at the current pelvis motion; it is integrated twice by the trapezoid
    rule, tracking the measured pelvis; this is repeated until nothing changes (Picard iteration; some 15 rounds for one
    stride).

    Raises:
        KinertiaError: the iteration does not converge: the window is longer than about two strides, or the BSPs are far
            from the truth.
    """
    wrench = foot_loads.sum(axis=1)
    start, integration, current = motion.q[:, :6], Integration(time), motion
    for _ in range(_MAX_ITERATIONS):
        acceleration, _ = consistent_root_acceleration(skeleton, bsp, current, wrench)
        position, velocity = integration.track(acceleration, start)
        current = motion.with_root(position, velocity, acceleration)
        left = np.abs(residual(skeleton, bsp, current, wrench)).max()
        if left < _RESIDUAL_TOLERANCE:
            deviation = np.abs(position - start).max(axis=0)
            return SyntheticTrial(skeleton, bsp, time, current, foot_loads, deviation)
        if not np.isfinite(left) or left > 1e6:
            break
    raise KinertiaError(
        f"no pelvis motion near the measured one balances the ground reactions over {time[-1] - time[0]:.2f} s "
        f"(a residual of {left:.2g} N remains); use a window of about one stride (window_s)"
    )


@dataclass(frozen=True)
class _WalkSeries:
    """Fourier series of every coordinate over one stride (`data/walk.csv`)."""

    table: pd.DataFrame
    period_s: float
    speed_m_s: float
    contacts: tuple[tuple[float, float], tuple[float, float]]

    @classmethod
    def read(cls) -> Self:
        text = (resources.files("kinertia.synthetic") / "data" / "walk.csv").read_text(encoding="utf-8")
        entries = dict(line[1:].split(" = ") for line in text.splitlines() if line.startswith("#") and " = " in line)
        numbers = {key.strip(): [float(part) for part in value.split(",")] for key, value in entries.items()}
        contacts = tuple((numbers[f"contact_{side}"][0], numbers[f"contact_{side}"][1]) for side in "rl")
        return cls(
            _data("walk.csv").set_index("coordinate"),
            numbers["period_s"][0],
            numbers["speed_m_s"][0],
            (contacts[0], contacts[1]),
        )

    def walked(self, manner: Manner) -> Self:
        """Return the series in another manner."""
        table = self.table.copy()
        posture, swing = np.transpose([manner.of(coordinate) for coordinate in table.index])
        table.iloc[:, 1:] *= swing[:, None]
        table.iloc[:, 0] += posture
        return replace(self, table=table, period_s=self.period_s / manner.pace, speed_m_s=self.speed_m_s * manner.pace)

    def motion(self, coordinates: tuple[str, ...], time: np.ndarray) -> Motion:
        """Compute coordinates and their derivatives at these times."""
        values = self.table.loc[list(coordinates)].to_numpy(float)
        mean, cosine, sine = values[:, 0], values[:, 1::2], values[:, 2::2]
        rate = 2 * np.pi / self.period_s * np.arange(1, cosine.shape[1] + 1)
        phase = np.outer(time, rate)
        c, s = np.cos(phase), np.sin(phase)
        q = mean + c @ cosine.T + s @ sine.T
        qd = (-s * rate) @ cosine.T + (c * rate) @ sine.T
        qdd = -(c * rate**2) @ cosine.T - (s * rate**2) @ sine.T
        forward = coordinates.index("pelvis_tx")
        q[:, forward] += self.speed_m_s * time
        qd[:, forward] += self.speed_m_s
        return Motion(q, qd, qdd)

    def support(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the supporting foot, and the progress through double support, per frame.

        The foot is that in single support, or trailing in double support (0 right, 1 left); the progress is 0 to 1, and
        0 in single support.
        """
        phase = (time / self.period_s) % 1.0
        (start_r, end_r), (start_l, end_l) = self.contacts
        right, left = _between(phase, start_r, end_r), _between(phase, start_l, end_l)
        right_trails = right & (~left | _between(phase, start_l, end_r))
        begin = np.where(right_trails, start_l, start_r)
        span = np.where(right_trails, (end_r - start_l) % 1.0, (end_l - start_r) % 1.0)
        progress = np.where(right & left, ((phase - begin) % 1.0) / span, 0.0)
        return np.where(right_trails, 0, 1), progress


def _between(phase: np.ndarray, start: float, end: float) -> np.ndarray:
    return (phase - start) % 1.0 <= (end - start) % 1.0


def _on_feet(
    skeleton: Skeleton, motion: Motion, wrench: np.ndarray, behind: np.ndarray, progress: np.ndarray
) -> np.ndarray:
    """Share a wrench (n, 6) between the feet (n, 2, 6): `behind` takes all but what the other foot takes over.

    The shares of force follow from the lever between the trailing forefoot and the leading heel, with a smooth
    transition. As the load is transferred, the leading foot's first share acts at its heel and the trailing foot's last
    at its forefoot, so that both centres of pressure stay under the feet. Only the sum is exact.
    """
    force = wrench[:, :3]
    toe, heel = _foot_points(skeleton, motion, "metatarsal"), _foot_points(skeleton, motion, "heel")
    rows = np.arange(len(wrench))
    tip, strike = toe[rows, behind], heel[rows, 1 - behind]
    along = strike - tip
    lever = np.einsum("ni,ni->n", strike - centre_of_pressure(wrench), along) / np.einsum("ni,ni->n", along, along)
    early = np.where(progress < 0.5, 1.0, 0.0)
    handover = _smooth_step(np.minimum(progress, 1.0 - progress) / _HANDOVER)
    share = (early + handover * (np.clip(lever, 0.0, 1.0) - early))[:, None]
    at_heel = wrench[:, 3:] - np.cross(strike, (1.0 - share) * force)
    at_forefoot = np.cross(tip, share * force)
    blend = _smooth_step(progress)[:, None]
    trailing = np.hstack([share * force, (1.0 - blend) * at_heel + blend * at_forefoot])
    loads = np.empty((len(wrench), 2, 6))
    loads[rows, behind] = trailing
    loads[rows, 1 - behind] = wrench - trailing
    return loads


def _smooth_step(x: np.ndarray) -> np.ndarray:
    x = np.clip(x, 0.0, 1.0)
    return x**2 * (3.0 - 2.0 * x)


def _foot_points(skeleton: Skeleton, motion: Motion, landmark: str) -> np.ndarray:
    """Return a landmark of the right and left foot (n, 2, 3) m, projected to the ground."""
    marker_set = read_marker_set("cleveland-clinic")
    positions = skeleton.marker_positions(skeleton.pose(motion.q))
    points = [
        positions[:, [skeleton.labels.index(label) for label in marker_set.landmarks[f"{landmark}_{side}"]]].mean(
            axis=1
        )
        for side in "rl"
    ]
    result: np.ndarray = np.stack(points, axis=1) * np.array([1.0, 0.0, 1.0])
    return result


def _data(name: str) -> pd.DataFrame:
    with (resources.files("kinertia.synthetic") / "data" / name).open(encoding="utf-8") as file:
        return pd.read_csv(file, comment="#")
