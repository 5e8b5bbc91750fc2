"""Resamples angles, moments, powers and ground reactions to 0 to 100 % of each gait cycle.

A curve belongs to the side whose heel strikes begin and end its stride. It has a gap where ground contact was not
measured. Clinical angles (`clinical_angles`) come from inverse kinematics, which covers whole strides: no estimate
changes them.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
from scipy.interpolate import make_interp_spline

from kinertia.estimation.simultaneous.curve_deviations import CurveDeviations
from kinertia.model.shared_coordinates import by_side
from kinertia.model.skeleton import GRAVITY_M_S2, Skeleton
from kinertia.motion.clinical_angles import clinical_angles
from kinertia.motion.dynamics import Motion
from kinertia.motion.gait_cycle import PERCENT, Stride, feet_under_pelvis
from kinertia.motion.ground_reactions import GroundReactions, measured_reactions
from kinertia.motion.kinematics import Kinematics, inside
from kinertia.motion.smoothing import interpolate
from kinertia.motion.spatiotemporal import Spatiotemporal, spatiotemporal, travelled
from kinertia.trial.data import FEET
from kinertia.trial.sampled_time import nearest_samples

Stage = Literal["estimate", "literature"]
"""As estimated; or conventional: smoothed inverse kinematics, and inverse dynamics with the parameters before the
estimate."""
Kind = Literal["angle", "moment", "power", "force", "clinical"]
UNITS: Mapping[Kind, str] = {
    "angle": "deg",
    "moment": "N m/kg",
    "power": "W/kg",
    "force": "% body weight",
    "clinical": "deg",
}
FORCES = ("ground_force_forward", "ground_force_upward", "ground_force_medial")
_ROOT_COORDINATES = 6
_Interpolation: TypeAlias = Callable[[np.ndarray, np.ndarray], Callable[[np.ndarray], np.ndarray]]


class Estimated(Protocol):
    """Interface of a fitted trial that the curves need; its attributes are those of `TrialFit`."""

    @property
    def name(self) -> str:
        """Name of the trial."""

    @property
    def kinematics(self) -> Kinematics:
        """Kinematics before the estimate."""

    @property
    def skeleton(self) -> Skeleton:
        """The calibrated model."""

    @property
    def motion(self) -> Motion:
        """Estimated motion at the frames of the measured windows."""

    @property
    def reactions(self) -> GroundReactions:
        """Ground reactions that belong to the estimate."""

    @property
    def joint_loads(self) -> Mapping[str, np.ndarray]:
        """Joint loads (w, c) N m, per stage."""

    @property
    def deviations(self) -> CurveDeviations | None:
        """Standard deviations of the trial's curves, or None."""

    @property
    def strides(self) -> tuple[Stride, ...]:
        """Strides of the whole trial."""


@dataclass(frozen=True, eq=False)
class CycleCurve:
    """One quantity over one stride.

    Attributes:
        trial: its name.
        stride: its side, number and times.
        kind: "angle" (deg), "moment" (N m/kg, internal), "power" (W/kg), "force" (ground reaction, % body weight) or
            "clinical" (deg).
        quantity: "hip_flexion_angle", "knee_angle_moment", ..., "ground_force_upward", "knee_flexion_clinical".
        value: (101,) at 0, 1, ..., 100 %; NaN where nothing was measured.
        sd: (101,) standard deviation of the estimate; NaN where there is none.
    """

    trial: str
    stride: Stride
    kind: Kind
    quantity: str
    value: np.ndarray
    sd: np.ndarray


def cycle_curves(
    trial: Estimated, mass_kg: float, stage: Stage = "estimate", strides: Sequence[Stride] | None = None
) -> Iterator[CycleCurve]:
    """Yield all curves of a trial, stride by stride, except those that were measured nowhere.

    Args:
        trial: fitted.
        mass_kg: of the body; moments, powers and forces are divided by it.
        stage: as estimated, or conventional.
        strides: of the trial; all if None.
    """
    chosen = trial.strides if strides is None else strides
    if chosen:
        yield from _curves(trial, mass_kg, stage, _tracked_strides(trial, chosen))


def curves_by_stage(
    trials: Sequence[Estimated],
    mass_kg: float,
    most_strides: int | None = None,
    stages: Sequence[Stage] = ("estimate", "literature"),
) -> dict[Stage, list[CycleCurve]]:
    """Return all curves of these stages, from at most so many strides per trial and side, evenly spread."""
    result: dict[Stage, list[CycleCurve]] = {stage: [] for stage in stages}
    for trial in trials:
        if chosen := spread_evenly(trial.strides, most_strides):
            strides = _tracked_strides(trial, chosen)
            for stage, curves in result.items():
                curves += _curves(trial, mass_kg, stage, strides)
    return result


class _TrackedStride(NamedTuple):
    """What inverse kinematics shows of a stride: how far the person went (3,) m, and clinical angles (101,) deg."""

    stride: Stride
    path: np.ndarray
    angles: Mapping[str, np.ndarray]


def _curves(trial: Estimated, mass_kg: float, stage: Stage, strides: Sequence[_TrackedStride]) -> Iterator[CycleCurve]:
    source, skeleton = _Source(trial, stage), trial.skeleton
    sides = by_side(skeleton.coordinates)
    for stride, path, angles in strides:
        time, curve = stride.time, partial(CycleCurve, trial.name, stride)
        angle, speed, moment = source.angle(time), source.speed(time), source.moment(time) / mass_kg
        sd = source.deviations(time)
        by_kind: dict[Kind, tuple[np.ndarray, np.ndarray]] = {
            "angle": (np.degrees(angle), np.degrees(sd.coordinates)),
            "moment": (moment, sd.moments / mass_kg),
            "power": (moment * speed, sd.powers / mass_kg),
        }
        curves: list[CycleCurve] = []
        for base, columns in sides.items():
            column = columns.get(stride.side, columns.get(""))
            if column is None or not skeleton.rotational[column]:
                continue
            for kind, (values, own_sd) in by_kind.items():
                if kind == "angle" or column >= _ROOT_COORDINATES:
                    curves.append(curve(kind, f"{base}_{kind}", values[:, column], own_sd[:, column]))
        foot, directions = FEET.index(stride.side), _directions(path, stride.side)
        share = 100.0 / (mass_kg * GRAVITY_M_S2)
        ground = share * source.force(time)[:, foot] @ directions.T
        ground_sd = share * np.sqrt(np.square(sd.ground_forces[:, foot]) @ np.square(directions).T)
        curves += [curve("force", *each) for each in zip(FORCES, ground.T, ground_sd.T, strict=True)]
        curves += [curve("clinical", *each, np.full(len(PERCENT), np.nan)) for each in angles.items()]
        yield from (one for one in curves if np.isfinite(one.value).any())


def _tracked_strides(trial: Estimated, strides: Sequence[Stride]) -> list[_TrackedStride]:
    skeleton, kinematics = trial.skeleton, trial.kinematics
    paths = travelled(feet_under_pelvis(skeleton, kinematics), strides, kinematics.trial.belt)
    q = _tracked(kinematics, np.concatenate([stride.time for stride in strides]), 0)
    heading = np.repeat(np.arctan2(-paths[:, 2], paths[:, 0]), len(PERCENT))
    angles = clinical_angles(skeleton, q, heading)
    return [
        _TrackedStride(
            stride, path, {name: values.reshape(-1, len(PERCENT))[k] for name, values in angles[stride.side].items()}
        )
        for k, (stride, path) in enumerate(zip(strides, paths, strict=True))
    ]


def _tracked(kinematics: Kinematics, time: np.ndarray, derivative: int) -> np.ndarray:
    """Return coordinates (n, c) of smoothed inverse kinematics, or their derivatives; NaN where there are none."""
    ik, spline = kinematics.ik, kinematics.spline
    within = (time >= spline.time[0]) & (time <= spline.time[-1])
    known = within[:, None] & np.isfinite(ik.q[nearest_samples(ik.time, time)])
    return np.where(known, spline(np.clip(time, spline.time[0], spline.time[-1]), derivative), np.nan)


def _directions(path: np.ndarray, side: str) -> np.ndarray:
    """Return unit vectors (3, 3) in rows: along the stride, upward, towards the other foot."""
    forward = path / max(float(np.linalg.norm(path)), 1e-9)
    medial = np.array([forward[2], 0.0, -forward[0]]) * (1.0 if side == "r" else -1.0)
    return np.array([forward, [0.0, 1.0, 0.0], medial])


class _Source:
    """Quantities of a trial at any time; NaN where they were not measured."""

    def __init__(self, trial: Estimated, stage: Stage) -> None:
        self.kinematics, self.stage = trial.kinematics, stage
        self.reactions = trial.reactions.whole if stage == "estimate" else measured_reactions(trial.kinematics)
        own, parts = trial.kinematics.time, trial.kinematics.intervals
        self.motion = [interpolate(own[part], trial.motion.q[part]) for part in parts]
        self.loads = self._by_interval(partial(make_interp_spline, k=3), trial.joint_loads[stage])
        spread, linear = trial.deviations if stage == "estimate" else None, partial(make_interp_spline, k=1)
        self.spread = None if spread is None else [self._by_interval(linear, each) for each in spread.curves]

    def angle(self, time: np.ndarray) -> np.ndarray:
        """Return coordinates (n, c); those of IK + ID wherever inverse kinematics determined them."""
        return self._coordinates(time, 0)

    def speed(self, time: np.ndarray) -> np.ndarray:
        """Return derivatives (n, c) of the coordinates."""
        return self._coordinates(time, 1)

    def moment(self, time: np.ndarray) -> np.ndarray:
        """Return joint loads (n, c)."""
        return self._measured(time, self.loads)

    def deviations(self, time: np.ndarray) -> CurveDeviations:
        """Return standard deviations of all curves; NaN if there are none."""
        if self.spread is None:
            return CurveDeviations.filled(len(time), len(self.kinematics.ik.coordinates), 0, np.nan)
        return CurveDeviations(*(self._measured(time, each) for each in self.spread))

    def force(self, time: np.ndarray) -> np.ndarray:
        """Return the ground reaction force (n, 2, 3) N on right and left foot."""
        return self._measured(time, [lambda at: self.reactions.at(at)[..., :3]] * len(self.kinematics.windows_s))

    def _by_interval(self, through: _Interpolation, values: np.ndarray) -> list[Callable[[np.ndarray], np.ndarray]]:
        """Make a curve through the values (w, ...) of each measured window."""
        time = self.kinematics.time
        return [through(time[part], values[part]) for part in self.kinematics.intervals]

    def _coordinates(self, time: np.ndarray, derivative: int) -> np.ndarray:
        if self.stage == "estimate":
            return self._measured(time, [partial(curve, derivative=derivative) for curve in self.motion])
        return _tracked(self.kinematics, time, derivative)

    def _measured(self, time: np.ndarray, curves: Sequence[Callable[[np.ndarray], np.ndarray]]) -> np.ndarray:
        """Return values at these times from the curve of each measured window; NaN outside."""
        windows = self.kinematics.windows_s
        places = [inside(time, [window]) for window in windows]
        values = [
            curve(np.clip(time[here], *window)) for here, window, curve in zip(places, windows, curves, strict=True)
        ]
        result = np.full((len(time), *values[0].shape[1:]), np.nan)
        for here, own in zip(places, values, strict=True):
            result[here] = own
        return result


def cycle_columns(
    trials: Sequence[Estimated], mass_kg: float, stage: Stage = "estimate", most_strides: int | None = None
) -> dict[str, Any]:
    """Return the columns of `Fit.cycles`, by name, from at most so many strides per trial and side, evenly spread."""
    return columns_of(curves_by_stage(trials, mass_kg, most_strides, [stage])[stage])


def columns_of(curves: Sequence[CycleCurve]) -> dict[str, Any]:
    """Return the columns of `Fit.cycles`, by name, with these curves."""
    samples = len(PERCENT)
    return {
        "trial": [one.trial for one in curves for _ in range(samples)],
        "side": [one.stride.side for one in curves for _ in range(samples)],
        "stride": np.repeat([one.stride.number for one in curves], samples).astype(int),
        "percent": np.tile(PERCENT, len(curves)).astype(int),
        "quantity": [one.quantity for one in curves for _ in range(samples)],
        "value": np.concatenate([one.value for one in curves]) if curves else np.zeros(0),
        "sd": np.concatenate([one.sd for one in curves]) if curves else np.zeros(0),
    }


def spatiotemporal_columns(trials: Sequence[Estimated]) -> dict[str, list[Any]]:
    """Return the columns of `Fit.spatiotemporal`, by name."""
    rows: list[dict[str, Any]] = []
    for trial in trials:
        feet = feet_under_pelvis(trial.skeleton, trial.kinematics)
        measures = spatiotemporal(feet, trial.strides, trial.kinematics.trial.belt)
        for stride, one in zip(trial.strides, measures, strict=True):
            place = {"trial": trial.name, "side": stride.side, "stride": stride.number}
            times = {"start_s": stride.start_s, "end_s": stride.end_s, "toe_off_s": stride.toe_off_s}
            rows.append({**place, **times, **asdict(one), "on_plates": stride.on_plates})
    measured = [field.name for field in fields(Spatiotemporal)]
    names = ["trial", "side", "stride", "start_s", "end_s", "toe_off_s", *measured, "on_plates"]
    return {name: [row[name] for row in rows] for name in names}


def spread_evenly(strides: Sequence[Stride], most: int | None) -> list[Stride]:
    """Select at most so many strides of each side, evenly spread over the trial."""
    kept = []
    for side in FEET:
        own = [stride for stride in strides if stride.side == side]
        if most is not None and len(own) > most:
            own = [own[k] for k in np.linspace(0, len(own) - 1, most).round().astype(int)]
        kept += own
    return kept
