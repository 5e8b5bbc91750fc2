"""Resamples angles, moments, powers and ground reactions to 0 to 100 % of each gait cycle; finds their peaks.

A curve belongs to the side whose heel strikes begin and end its stride. It has a gap where it is not known
(`joint_curves`). What is no stride has curves over its phase (`contact_phases`), in tables of their own. Clinical
angles (`clinical_angles`) come from inverse kinematics, which covers whole strides: no estimate changes them.

A peak has a value only where its whole phase is known: the largest value of a part is not the peak. A stance has its
peaks whether a heel strike follows or not; a landing has peaks of its own.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np

from kinertia.estimation.result.curve_source import CurveSource, Stage, tracked
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.gait_cycle import PERCENT, FeetUnderPelvis, Stride, feet_under_pelvis
from kinertia.motion.joint_moments import component_names, joint_and_side
from kinertia.motion.model_outputs import clinical_angles
from kinertia.motion.spatiotemporal import MEASURES, spatiotemporal, travelled
from kinertia.trial.data import FEET
from kinertia.trial.file_contents import Belt
from kinertia.trial.sampled_data import within

Kind = Literal["angle", "moment", "joint_moment", "power", "force", "clinical"]
UNITS: Mapping[Kind, str] = {
    "angle": "deg",
    "moment": "N m/kg",
    "joint_moment": "N m/kg",
    "power": "W/kg",
    "force": "% body weight",
    "clinical": "deg",
}
MOST_STRIDES = 100
"""Largest number of strides of a trial and side in tables and figures; of more, this many are taken, evenly spread."""
FORCES = ("ground_force_forward", "ground_force_upward", "ground_force_medial")
_ROOT_COORDINATES = 6


@dataclass(frozen=True, eq=False)
class CycleCurve:
    """One quantity over one stride.

    Attributes:
        trial: its name.
        stride: its side, number and times.
        kind: "angle" (deg), "moment" (of a coordinate, N m/kg, internal), "joint_moment" (about the axes of
            `joint_moments`, N m/kg, internal), "power" (W/kg), "force" (ground reaction, % body weight) or "clinical"
            (deg).
        quantity: "hip_flexion_angle", "knee_angle_moment", "knee_adduction_joint_moment", ..., "ground_force_upward",
            "knee_flexion_clinical".
        value: (101,) at 0, 1, ..., 100 %; NaN where nothing was measured.
        sd: (101,) standard deviation of the estimate; NaN where there is none.
        task: of the trial.
    """

    trial: str
    stride: Stride
    kind: Kind
    quantity: str
    value: np.ndarray
    sd: np.ndarray
    task: str = ""


CurvesByStage = Mapping[Stage, Sequence[CycleCurve]]
"""Curves of all trials, as estimated and conventional."""


def cycle_curves(
    trial: TrialFit, mass_kg: float, stage: Stage = "estimate", strides: Sequence[Stride] | None = None
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
    trials: Sequence[TrialFit],
    mass_kg: float,
    most_strides: int | None = None,
    stages: Sequence[Stage] = ("estimate", "literature"),
) -> dict[Stage, list[CycleCurve]]:
    """Return all curves of these stages, from at most so many strides per trial and side, evenly spread, and from all
    phases of what is no stride (`CycleCurve.stride.phase`).
    """
    result: dict[Stage, list[CycleCurve]] = {stage: [] for stage in stages}
    for trial in trials:
        if chosen := [*spread_evenly(trial.strides, most_strides), *trial.phases]:
            strides = _tracked_strides(trial, chosen)
            for stage, curves in result.items():
                curves += _curves(trial, mass_kg, stage, strides)
    return result


class _TrackedStride(NamedTuple):
    """What inverse kinematics shows of a stride: how far the person went (3,) m, and clinical angles (101,) deg."""

    stride: Stride
    path: np.ndarray
    angles: Mapping[str, np.ndarray]


def _curves(trial: TrialFit, mass_kg: float, stage: Stage, strides: Sequence[_TrackedStride]) -> Iterator[CycleCurve]:
    source, skeleton, kinematics = CurveSource(trial, stage), trial.skeleton, trial.kinematics
    sides = skeleton.sides
    for stride, path, angles in strides:
        time, curve = stride.time, partial(CycleCurve, trial.name, stride, task=kinematics.trial.task)
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
        joints = () if trial.joint_curves is None else trial.joint_curves.joints["estimate"].joints
        three = source.joint_moment(time) / mass_kg
        for k, joint in enumerate(joints if three.shape[1] else ()):
            base, side = joint_and_side(joint)
            if side in ("", stride.side):
                names = [f"{name}_joint_moment" for name in component_names(base)]
                rows = zip(names, three[:, k].T, (sd.joints[:, k, 0] / mass_kg).T, strict=True)
                curves += [curve("joint_moment", *row) for row in rows]
        foot, directions = FEET.index(stride.side), _directions(path, stride.side)
        share = 100.0 / (mass_kg * GRAVITY_M_S2)
        ground = share * source.force(time)[:, foot] @ directions.T
        ground_sd = share * np.sqrt(np.square(sd.ground_forces[:, foot]) @ np.square(directions).T)
        curves += [curve("force", *component) for component in zip(FORCES, ground.T, ground_sd.T, strict=True)]
        curves += [curve("clinical", *named_angle, np.full(len(PERCENT), np.nan)) for named_angle in angles.items()]
        yield from (known_curve for known_curve in curves if np.isfinite(known_curve.value).any())


def _tracked_strides(trial: TrialFit, strides: Sequence[Stride]) -> list[_TrackedStride]:
    skeleton, kinematics = trial.skeleton, trial.kinematics
    paths = _paths(feet_under_pelvis(skeleton, kinematics), strides, kinematics.trial.belt)
    q = tracked(kinematics, np.concatenate([stride.time for stride in strides]), 0)
    heading = np.repeat(np.arctan2(-paths[:, 2], paths[:, 0]), len(PERCENT))
    angles = clinical_angles(skeleton, q, heading)
    return [
        _TrackedStride(
            stride, path, {name: values.reshape(-1, len(PERCENT))[k] for name, values in angles[stride.side].items()}
        )
        for k, (stride, path) in enumerate(zip(strides, paths, strict=True))
    ]


def _paths(feet: FeetUnderPelvis, strides: Sequence[Stride], belt: Belt | None) -> np.ndarray:
    """Return how far the person goes in each stride (k, 3) m; where the pelvis faces in phases that are no stride."""
    moved = iter(travelled(feet, [stride for stride in strides if stride.phase == "stride"], belt))
    result = [
        next(moved)
        if stride.phase == "stride"
        else feet.heading[within(feet.time, stride.start_s, stride.end_s)].mean(axis=0)
        for stride in strides
    ]
    return np.reshape(result, (-1, 3))


def _directions(path: np.ndarray, side: str) -> np.ndarray:
    """Return unit vectors (3, 3) in rows: along the stride, upward, towards the other foot."""
    forward = path / max(float(np.linalg.norm(path)), 1e-9)
    medial = np.array([forward[2], 0.0, -forward[0]]) * (1.0 if side == "r" else -1.0)
    return np.array([forward, [0.0, 1.0, 0.0], medial])


def cycle_columns(trials: Sequence[TrialFit], mass_kg: float, stage: Stage = "estimate") -> dict[str, Any]:
    """Return the columns of `Fit.cycles`, by name."""
    return columns_of(curves_by_stage(trials, mass_kg, None, [stage])[stage])


def columns_of(curves: Sequence[CycleCurve]) -> dict[str, Any]:
    """Return the columns of `Fit.cycles`, by name: of the strides among these curves."""
    of_strides = [curve for curve in curves if curve.stride.phase == "stride"]
    return {name: values for name, values in phase_columns(of_strides).items() if name != "phase"}


def phase_columns(curves: Sequence[CycleCurve]) -> dict[str, Any]:
    """Return the columns of `Fit.contact_phases`, by name, with these curves."""
    samples = len(PERCENT)
    return {
        "trial": [curve.trial for curve in curves for _ in range(samples)],
        "task": [curve.task for curve in curves for _ in range(samples)],
        "phase": [curve.stride.phase for curve in curves for _ in range(samples)],
        "side": [curve.stride.side for curve in curves for _ in range(samples)],
        "stride": np.repeat([curve.stride.number for curve in curves], samples).astype(int),
        "percent": np.tile(PERCENT, len(curves)).astype(int),
        "quantity": [curve.quantity for curve in curves for _ in range(samples)],
        "value": np.concatenate([curve.value for curve in curves]) if curves else np.zeros(0),
        "sd": np.concatenate([curve.sd for curve in curves]) if curves else np.zeros(0),
    }


def spatiotemporal_columns(trials: Sequence[TrialFit]) -> dict[str, list[Any]]:
    """Return the columns of `Fit.spatiotemporal`, by name."""
    rows: list[dict[str, Any]] = []
    for trial in trials:
        feet = feet_under_pelvis(trial.skeleton, trial.kinematics)
        measures = spatiotemporal(feet, trial.strides, trial.kinematics.trial.belt)
        for stride, of_stride in zip(trial.strides, measures, strict=True):
            place = {"trial": trial.name, "side": stride.side, "stride": stride.number}
            times = {"start_s": stride.start_s, "end_s": stride.end_s, "toe_off_s": stride.toe_off_s}
            rows.append({**place, **times, **asdict(of_stride), "on_plates": stride.on_plates})
    names = ["trial", "side", "stride", "start_s", "end_s", "toe_off_s", *MEASURES, "on_plates"]
    return {name: [row[name] for row in rows] for name in names}


def spread_evenly(strides: Sequence[Stride], most: int | None) -> list[Stride]:
    """Select at most so many strides of each side, evenly spread over the trial; all if None."""
    kept = []
    for side in FEET:
        of_side = [stride for stride in strides if stride.side == side]
        if most is not None and len(of_side) > most:
            of_side = [of_side[k] for k in np.linspace(0, len(of_side) - 1, most).round().astype(int)]
        kept += of_side
    return kept


@dataclass(frozen=True)
class Peak:
    """What is read from a curve.

    Attributes:
        name: in tables.
        quantity: of the curve, as in `cycles.csv`.
        sign: of the peak in this curve.
        phase: first and last share of stance, or of the stride if `of_stride`, in which it is.
        of_stride: whether the phase is a share of the stride.
        impulse: integral over time of values of this sign, in place of the peak.
    """

    name: str
    quantity: str
    sign: float
    phase: tuple[float, float]
    of_stride: bool = False
    impulse: bool = False


PEAKS = (
    Peak("knee adduction moment, external, first peak", "knee_adduction_joint_moment", -1.0, (0.0, 0.5)),
    Peak("knee adduction moment, external, second peak", "knee_adduction_joint_moment", -1.0, (0.5, 1.0)),
    Peak("knee adduction impulse, external", "knee_adduction_joint_moment", -1.0, (0.0, 1.0), impulse=True),
    Peak("knee extension moment, internal, early stance", "knee_flexion_joint_moment", -1.0, (0.0, 0.5)),
    Peak("ankle plantarflexion moment, internal, push-off", "ankle_flexion_joint_moment", -1.0, (0.5, 1.0)),
    Peak("ankle power, generated, push-off", "ankle_angle_power", 1.0, (0.5, 1.0)),
    Peak("hip flexion power, generated, pull-off", "hip_flexion_power", 1.0, (0.5, 0.8), of_stride=True),
)
"""Of stance, from heel strike to toe off, unless of the stride."""
LANDING_PEAKS = (
    Peak("knee extension moment, internal, landing", "knee_flexion_joint_moment", -1.0, (0.0, 1.0)),
    Peak("knee adduction moment, external, landing", "knee_adduction_joint_moment", -1.0, (0.0, 1.0)),
    Peak("knee abduction moment, external, landing", "knee_adduction_joint_moment", 1.0, (0.0, 1.0)),
    Peak("hip extension moment, internal, landing", "hip_flexion_joint_moment", -1.0, (0.0, 1.0)),
    Peak("ankle plantarflexion moment, internal, landing", "ankle_flexion_joint_moment", -1.0, (0.0, 1.0)),
)
"""From foot contact until the pelvis is lowest."""


def peak_columns(curves: Sequence[CycleCurve]) -> dict[str, Any]:
    """Return columns of all peaks, by name: trial, task, phase, side, stride, peak, unit, value, sd, percent.

    Values are positive in the direction that the name states. A peak whose phase is not all known is NaN. `percent` is
    where in the stride, stance or landing it is; NaN for impulses, whose SD is that of errors that last through stance.

    Args:
        curves: of the estimate, of all trials.
    """
    rows = []
    for peak in (*PEAKS, *LANDING_PEAKS):
        for curve in curves:
            if curve.quantity == peak.quantity and (curve.stride.phase == "landing") == (peak in LANDING_PEAKS):
                value, sd, percent = _read(peak, curve)
                unit = f"{UNITS[curve.kind]} s".replace("/kg s", " s/kg") if peak.impulse else UNITS[curve.kind]
                place = (curve.trial, curve.task, curve.stride.phase, curve.stride.side, curve.stride.number)
                rows.append((*place, peak.name, unit, value, sd, percent))
    rows.sort(key=lambda row: (row[0], row[2] != "stride", row[3] != "r", row[4]))
    names = ("trial", "task", "phase", "side", "stride", "peak", "unit", "value", "sd", "percent")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def _phase(peak: Peak, curve: CycleCurve) -> np.ndarray:
    """Return the mask (101,) of the phase; nothing without a toe off, nor of a stride where there is none."""
    if peak.of_stride and curve.stride.phase != "stride":
        return np.zeros(len(PERCENT), dtype=bool)
    whole = 100.0 if peak.of_stride else curve.stride.percent(curve.stride.toe_off_s)
    if not np.isfinite(whole):
        return np.zeros(len(PERCENT), dtype=bool)
    first, last = peak.phase
    return np.asarray((whole * first <= PERCENT) & (whole * last >= PERCENT))


def _read(peak: Peak, curve: CycleCurve) -> tuple[float, float, float]:
    """Return value, SD and percent; NaN unless all of the phase is known."""
    phase = _phase(peak, curve)
    if not (phase.any() and np.isfinite(curve.value[phase]).all()):
        return np.nan, np.nan, np.nan
    along, sd = peak.sign * curve.value[phase], curve.sd[phase]
    if peak.impulse:
        step_s = (curve.stride.end_s - curve.stride.start_s) / (len(PERCENT) - 1)
        counted = along > 0.0
        return float(along[counted].sum() * step_s), float(sd[counted].sum() * step_s), float("nan")
    at = int(np.argmax(along))
    return float(along[at]), float(sd[at]), float(PERCENT[phase][at])
