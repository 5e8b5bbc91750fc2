"""Compare fits with and without a functional trial."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np
import typer

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.simultaneous.instruments.instrument_errors import AXIS, CalibrationEntry
from kinertia.motion.dynamics import inverse_dynamics
from kinertia.settings import Settings, Subject
from kinertia.studies.parallel import in_parallel
from kinertia.synthetic.laboratory import PERFECT, SkinMotion, camera_noise, record
from kinertia.synthetic.motions import FAST_PACE, squat
from kinertia.synthetic.walk import Manner, SyntheticSubject, SyntheticTrial, walk, walking_subject
from kinertia.trial.data import Markers, Recording
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare
from validation.joint_accuracy import WITHIN
from validation.measured_trials import table
from validation.page import write_page

FIRST_SEED = 100
TILT_RAD = float(np.radians(5.0))
WALK_S, PLATES_HZ, SAMPLES_PER_FRAME = 2.5, 1000.0, 10
CAMERA_SD_M, FORCE_SD_N, MOMENT_SD_NM = 0.0005, 1.0, 0.2
COORDINATES = {"knee": "knee_angle", "ankle": "ankle_angle", "subtalar joint": "subtalar_angle"}


@dataclass(frozen=True)
class Case:
    """What is recorded beside the walk, and how it is used.

    Attributes:
        squats: whether squats are recorded, without forces.
        fast_walk: whether a faster walk is recorded, over plates.
        joints: whose axes are off.
        joint_axes: the setting of the fit.
    """

    title: str
    squats: bool = False
    fast_walk: bool = False
    joints: tuple[str, ...] = ("knee",)
    joint_axes: bool | None = None


CASES = (
    Case("one walk"),
    Case("one walk, `joint_axes = true`", joint_axes=True),
    Case("two walks, `joint_axes = false`", fast_walk=True, joint_axes=False),
    Case("two walks", fast_walk=True),
    Case("two walks, all axes where the static trial has them", fast_walk=True, joints=()),
    Case("one walk, squats without forces", squats=True),
    Case("walk and squats, ankle axes off, too", squats=True, joints=("knee", "ankle")),
    Case("walk and squats, all axes where the static trial has them", squats=True, joints=()),
)


@dataclass(frozen=True, eq=False)
class Measured:
    """One person in one case.

    Attributes:
        coverage: per joint of COORDINATES, share of frames and sides within the 95 % intervals of its moment.
        errors_nm2, variances_nm2: the same, mean squares of the moment's error and deviation.
        axis_errors_rad, axis_sds_rad: (4,) of both angles of each knee's axis; deviations are zero where it is fixed.
        seconds: that the fit took.
    """

    coverage: Mapping[str, float]
    errors_nm2: Mapping[str, float]
    variances_nm2: Mapping[str, float]
    axis_errors_rad: np.ndarray
    axis_sds_rad: np.ndarray
    seconds: float


@dataclass(frozen=True, eq=False)
class Session:
    """What one person did, and what was recorded of it.

    Attributes:
        truth: the walk.
        tilts_rad: coordinate of the model -> by how much an axis is off.
        static: standing.
        inputs: recordings of the walk and the other motions.
    """

    truth: SyntheticTrial
    tilts_rad: Mapping[str, float]
    static: Recording
    inputs: Sequence[TrialInput]


def session(case: Case, seed: int) -> Session:
    """Of a person whose parameters are drawn from the literature's prior.

    Each axis is tilted into a direction of its own; skin goes with the joints, in all motions alike.
    """
    rng = np.random.default_rng(seed)
    person, tilts = _person(case, rng)
    truth = walk(person, WALK_S, PLATES_HZ)
    fast = walk(person, WALK_S, PLATES_HZ, manner=Manner(FAST_PACE)) if case.fast_walk else None
    squats = squat(person) if case.squats else None
    others = [solved.motion.q for solved in (fast, squats) if solved is not None]
    skin = SkinMotion.draw(truth.skeleton, truth.motion.q, rng, others)

    def seen(trial: SyntheticTrial, markers: Markers, every: int = 1) -> Markers:
        q = trial.motion.q[::every][: len(markers.time)]
        return camera_noise(skin.moved(markers, trial.skeleton, q), CAMERA_SD_M, rng)

    noise = replace(PERFECT, force_sd_n=FORCE_SD_N, force_offset_sd_n=FORCE_SD_N, moment_sd_nm=MOMENT_SD_NM)
    inputs = []
    for name, trial in (("walk", truth), ("fast walk", fast)):
        if trial is not None:
            lab = record(person, trial, noise, rng, SAMPLES_PER_FRAME)
            markers = seen(trial, lab.walk.markers, SAMPLES_PER_FRAME)
            inputs.append(TrialInput(replace(lab.walk, name=name, markers=markers)))
    if squats is not None:
        inputs.append(TrialInput(Recording("squats", seen(squats, squats.markers)), use="kinematics"))
    standing = replace(lab.static, markers=camera_noise(lab.static.markers, CAMERA_SD_M, rng))
    return Session(truth, tilts, standing, inputs)


def _person(case: Case, rng: np.random.Generator) -> tuple[SyntheticSubject, dict[str, float]]:
    """Somebody whose axes are off, and by how much."""
    person = walking_subject()
    bsp = literature_prior(person.literature).draw(rng)
    tilts = {f"knee_tilt_{i}_{side}": 0.0 for side in "rl" for i in "12"}
    for joint in case.joints:
        for side in "rl":
            direction = rng.uniform(0.0, 2.0 * np.pi)
            tilts[f"{joint}_tilt_1_{side}"] = TILT_RAD * float(np.cos(direction))
            tilts[f"{joint}_tilt_2_{side}"] = TILT_RAD * float(np.sin(direction))
    return replace(person, bsp=bsp, skeleton=person.skeleton.lock(tilts)), tilts


def measured(case: Case, seed: int) -> Measured:
    """Fit the person of this seed, and compare with the truth."""
    recorded = session(case, seed)
    started = time.perf_counter()
    fit = estimate(
        prepare(Person(Subject(sex="male"), recorded.inputs, recorded.static), Settings(joint_axes=case.joint_axes))
    )
    return _compared(fit, recorded, time.perf_counter() - started)


def _compared(fit: Fit, recorded: Session, seconds: float) -> Measured:
    truth, trial = recorded.truth, fit.trials[0]
    at = np.searchsorted(truth.time, trial.kinematics.time - 1e-9)
    expected = inverse_dynamics(truth.skeleton, truth.bsp, truth.motion.cut(at), truth.foot_loads[at])
    assert fit.posterior is not None
    assert trial.deviations is not None
    coverage, errors, variances = {}, {}, {}
    for joint, coordinate in COORDINATES.items():
        names = [f"{coordinate}_{side}" for side in "rl"]
        ours, theirs = ([s.coordinates.index(n) for n in names] for s in (fit.skeleton, truth.skeleton))
        wrong, sd = trial.joint_loads["estimate"][:, ours] - expected[:, theirs], trial.deviations.moments[:, ours]
        coverage[joint] = float(np.mean(np.abs(wrong) < WITHIN * sd))
        errors[joint], variances[joint] = float(np.square(wrong).mean()), float(np.square(sd).mean())
    axes = {_tilt(entry): entry for entry in fit.posterior.calibration if entry.quantity == AXIS}
    knees = [name for name in recorded.tilts_rad if name.startswith("knee")]
    found = np.array([(axes[name].value, axes[name].sd) if name in axes else (0.0, 0.0) for name in knees])
    true = np.array([recorded.tilts_rad[name] for name in knees])
    return Measured(coverage, errors, variances, found[:, 0] - true, found[:, 1], seconds)


def _tilt(entry: CalibrationEntry) -> str:
    joint, _, side = str(entry.joint).rpartition("_")
    return f"{joint}_tilt_{entry.axis}_{side}"


def row(case: Case, people: Sequence[Measured]) -> list[str]:
    """One line of the table."""
    cells = [case.title]
    for joint in COORDINATES:
        covered = np.array([person.coverage[joint] for person in people])
        error, sd = (
            np.sqrt(np.mean([getattr(person, name)[joint] for person in people]))
            for name in ("errors_nm2", "variances_nm2")
        )
        deviation = covered.std() / np.sqrt(len(covered))
        cells.append(f"{100 * covered.mean():.1f} ± {100 * deviation:.1f} % ({error:.2f} / {sd:.2f})")
    off, sds = (
        np.concatenate([getattr(person, name) for person in people]) for name in ("axis_errors_rad", "axis_sds_rad")
    )
    error, sd = (np.degrees(np.sqrt(np.mean(np.square(values)))) for values in (off, sds))
    within = 100.0 * np.mean(np.abs(off) < WITHIN * sds)
    cells.append(f"{error:.2f} / {sd:.2f} ({within:.0f} %)" if sds.any() else f"{error:.2f}, fixed")
    return [*cells, f"{np.median([person.seconds for person in people]):.1f}"]


def document(rows: Sequence[Sequence[str]], people: int) -> str:
    """The text of docs/validation/functional-trials.md."""
    headings = ("", *(f"{joint} moment" for joint in COORDINATES), "knee axes (degrees)", "s")
    return f"""# Functional trials

{people} synthetic people in each line, from static trial to error bars as `kinertia fit` goes. Parameters are drawn
from the literature's prior; the axis of each knee is 5 degrees off the static trial's, in a direction of its own; skin
goes with the joints, in squats as in walks; plates and cameras are those of a careful laboratory. Two plates catch one
step of each foot.

Moments: share of the frames within the 95 % interval, with its standard error over people (RMS error / mean deviation,
N m). Knee axes: RMS error of each of the two angles / deviation (share within the 95 % interval). s: median seconds of
a fit, while other programs ran.

{table(headings, rows)}
"""


def main(
    people: Annotated[int, typer.Option(min=2, help="In each line.")] = 40,
    workers: Annotated[int | None, typer.Option(help="Processes (default: one per core).")] = None,
) -> None:
    """Run everything and write the page."""
    rows = []
    for case in CASES:
        rows.append(row(case, in_parallel(partial(measured, case), range(FIRST_SEED, FIRST_SEED + people), workers)))
        print(" | ".join(rows[-1]), flush=True)
    write_page("functional-trials", document(rows, people))
