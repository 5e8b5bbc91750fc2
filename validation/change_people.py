"""Measures synthetic people on three days, markers put on anew each day: without a change, and with a known one.

Of each person, three walks a day. Walks of a day differ as strides of a person do. Markers are off by 5 mm each and by
5 mm that all of a segment share, in the static trial and the walks alike: medial and lateral markers of knees and
ankles then tilt their axes by about 4 degrees. Plates and synchronisation of each day have errors of their own. On the
third day the person walks otherwise, by a change of known size.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from kinertia.estimation.changes.change import Change, named_outcome
from kinertia.estimation.changes.session_changes import changes_between, session, session_features
from kinertia.estimation.changes.stride_features import Rows, stride_means
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import JointCurves, TrialFit
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.motion.dynamics import inverse_dynamics
from kinertia.motion.gait_cycle import Stride
from kinertia.motion.joint_moments import joint_moments
from kinertia.report.comparison.what_changed import with_markers_anew
from kinertia.settings import Settings, Subject
from kinertia.synthetic.laboratory import PERFECT, ClusterMotion, SkinMotion, camera_noise, record
from kinertia.synthetic.walk import Manner, SyntheticSubject, SyntheticTrial, walk, walking_subject
from kinertia.trial.data import LOAD_THRESHOLD_N, Markers
from kinertia.trial.sampled_data import runs
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate
from kinertia.workflow.person import Person as Recorded
from kinertia.workflow.prepare import prepare

MARKER_SD_M, SEGMENT_SD_M = 0.005, 0.005
DRAWS = 40
"""Posterior draws of each day, half of what `kinertia compare` takes."""
WALKS, WALK_S, PLATES_HZ, SAMPLES_PER_FRAME = 3, 2.5, 1000.0, 10
CAMERA_SD_M, FORCE_SD_N, MOMENT_SD_NM = 0.0005, 1.0, 0.2
STRIDE_DEG = {
    "hip_flexion": 0.8,
    "hip_adduction": 0.8,
    "hip_rotation": 1.4,
    "knee_angle": 1.6,
    "ankle_angle": 1.2,
    "subtalar_angle": 1.2,
    "lumbar_extension": 1.0,
    "lumbar_bending": 1.0,
    "lumbar_rotation": 1.0,
}
"""Standard deviations of postures from walk to walk."""
CHANGE_DEG = {"hip_adduction": 3.0, "hip_rotation": -8.0, "knee_angle": -6.0, "lumbar_bending": 4.0}
"""What is added to the angles on the third day: positive about the model's axes on both sides."""
PUT_IN = ("shared", "own", "skin", "instruments", "stride")
"""What each day has of its own: displacements that markers of a segment share, those of each marker, skin motion,
errors of plates and synchronisation, and how walks differ."""
LINEAR_SHARE = 2.0 / 3.0
"""Of the variance of skin motion that follows the joints; the rest moves as rigid clusters."""


@dataclass(frozen=True)
class Judged:
    """One outcome of two days, with its true difference."""

    change: Change
    truth: float

    @property
    def covered(self) -> bool:
        """Whether the interval of the difference holds the true one."""
        return abs(self.change.difference - self.truth) <= self.change.mdc95


@dataclass(frozen=True, eq=False)
class Person:
    """One person on three days, as far as changes are judged by it.

    Attributes:
        seed: of the person.
        unchanged, changed: features of the strides of the first and the second, or the first and the third day.
        truth: true value of each outcome on each day.
    """

    seed: int
    unchanged: tuple[Rows, Rows]
    changed: tuple[Rows, Rows]
    truth: tuple[Mapping[str, float], ...]

    def judged(self, other_day: int) -> list[Judged]:
        """Judge the changes from the first to the second or third day (1, 2); none where a day has one stride only."""
        found = changes_between(*(self.unchanged, self.changed)[other_day - 1], fixed_axes=False)
        before, after = self.truth[0], self.truth[other_day]
        known = [change for change in found if change.verdict != "cannot be judged"]
        return [Judged(change, after[name] - before[name]) for change in known if (name := outcome(change)) in before]


@dataclass(frozen=True, eq=False)
class Day:
    """A fit of a day, and the true value of each outcome, the mean over its strides."""

    fit: Fit
    truth: Mapping[str, float]


def person(seed: int) -> Person:
    """Measure a person on three days."""
    rng = np.random.default_rng(seed)
    subject = drawn_subject(rng)
    days = [day(subject, manner, str(k), rng) for k, manner in enumerate((Manner(), Manner(), changed()), start=1)]
    pairs = []
    for later in days[1:]:
        before, after = session_features(session(days[0].fit), session(later.fit), draws=DRAWS)
        pairs.append((before.events, after.events))
    return Person(seed, pairs[0], pairs[1], tuple(recorded_day.truth for recorded_day in days))


def drawn_subject(rng: np.random.Generator) -> SyntheticSubject:
    """Draw the body of a person."""
    subject = walking_subject()
    return replace(subject, bsp=literature_prior(subject.literature).draw(rng))


def changed() -> Manner:
    """Return the manner of the third day."""
    return Manner(posture_rad={name: float(np.radians(size)) for name, size in CHANGE_DEG.items()})


def outcome(change: Change) -> str:
    """Return what a change is of, in words."""
    return " ".join((change.quantity, change.joint, change.component, change.event, change.side))


def day(
    subject: SyntheticSubject,
    manner: Manner,
    name: str,
    rng: np.random.Generator,
    put_in: Collection[str] = PUT_IN,
) -> Day:
    """Measure a person on one day with some of PUT_IN, the same whatever else is put in, and fit all walks together."""
    shift = _marker_shifts(subject, rng, put_in)
    standing = replace(subject.static, markers=camera_noise(_standing(subject, shift), CAMERA_SD_M, rng))
    manners = [_varied(manner, rng, "stride" in put_in) for _ in range(WALKS)]
    walks = [walk(subject, WALK_S, PLATES_HZ, manner=day_manner) for day_manner in manners]
    skins = _Skin.draw(walks, rng)
    instruments = _Instruments.draw(rng)
    if "instruments" not in put_in:
        instruments = _Instruments(0.0, np.zeros(2), np.zeros((2, 3)))
    inputs = []
    for number, trial in enumerate(walks):
        read = replace(trial, foot_loads=instruments.read(trial.time, trial.foot_loads))
        noise = replace(PERFECT, force_sd_n=FORCE_SD_N, force_offset_sd_n=FORCE_SD_N, moment_sd_nm=MOMENT_SD_NM)
        lab = record(subject, read, noise, rng, SAMPLES_PER_FRAME)
        placed = trial.skeleton.with_positions(trial.skeleton.marker_locals + shift[_moving(subject)])
        q = trial.motion.q[::SAMPLES_PER_FRAME][: len(lab.walk.markers.time)]
        exact = Markers(lab.walk.markers.time, placed.labels, placed.marker_positions(placed.pose(q)))
        markers = camera_noise(skins.moved(exact, trial, q) if "skin" in put_in else exact, CAMERA_SD_M, rng)
        inputs.append(TrialInput(replace(lab.walk, name=f"{name} walk {number}", markers=markers), condition=name))
    ready = prepare(Recorded(Subject(name="synthetic", sex="male"), inputs, standing), Settings(joint_axes=True))
    fit = estimate(with_markers_anew(ready))
    return Day(fit, _truth(fit, walk(subject, WALK_S, PLATES_HZ, manner=manner)))


def _marker_shifts(subject: SyntheticSubject, rng: np.random.Generator, put_in: Collection[str]) -> np.ndarray:
    """Draw how far each marker (m, 3) is off, in its segment's frame."""
    skeleton = subject.skeleton
    of_segment = rng.normal(0.0, SEGMENT_SD_M, (len(skeleton.segments), 3)) * ("shared" in put_in)
    rows = [skeleton.segments.index(marker.segment) for marker in skeleton.markers]
    return rng.normal(0.0, MARKER_SD_M, (len(rows), 3)) * ("own" in put_in) + of_segment[rows]


def _moving(subject: SyntheticSubject) -> list[int]:
    kept = set(subject.moving_skeleton.labels)
    return [k for k, label in enumerate(subject.skeleton.labels) if label in kept]


def _standing(subject: SyntheticSubject, shift: np.ndarray) -> Markers:
    """Move the markers of the static trial, whose segments stand as the markers show."""
    markers, skeleton = subject.static.markers, subject.skeleton
    positions = markers.positions.copy()
    mean = positions.mean(axis=0)
    for segment in skeleton.segments:
        rows = [k for k, marker in enumerate(skeleton.markers) if marker.segment == segment]
        columns = [markers.labels.index(skeleton.labels[k]) for k in rows]
        turn = np.eye(3)
        if len(rows) > 2:
            local, seen = (points - points.mean(axis=0) for points in (skeleton.marker_locals[rows], mean[columns]))
            u, _, vt = np.linalg.svd(local.T @ seen)
            turn = vt.T @ np.diag([1.0, 1.0, np.linalg.det(vt.T @ u.T)]) @ u.T
        positions[:, columns] += shift[rows] @ turn.T
    return replace(markers, positions=positions)


def _varied(manner: Manner, rng: np.random.Generator, varies: bool) -> Manner:
    """Draw the manner of one walk, and return it if walks vary."""
    posture = {name: manner.posture_rad.get(name, 0.0) for name in {*STRIDE_DEG, *manner.posture_rad}}
    drawn = {
        name: value + float(np.radians(rng.normal(0.0, STRIDE_DEG.get(name, 0.0))))
        for name, value in sorted(posture.items())
    }
    return replace(manner, posture_rad=drawn) if varies else manner


@dataclass(frozen=True, eq=False)
class _Skin:
    """Skin motion of one day's markers."""

    linear: SkinMotion
    clusters: ClusterMotion

    @classmethod
    def draw(cls, walks: Sequence[SyntheticTrial], rng: np.random.Generator) -> "_Skin":
        first, *others = walks
        linear = SkinMotion.draw(first.skeleton, first.motion.q, rng, [other.motion.q for other in others])
        return cls(linear, ClusterMotion.draw(first.skeleton, rng))

    def moved(self, exact: Markers, trial: SyntheticTrial, q: np.ndarray) -> Markers:
        parts = ((LINEAR_SHARE, self.linear), (1.0 - LINEAR_SHARE, self.clusters))
        moved = sum(
            np.sqrt(share) * (motion.moved(exact, trial.skeleton, q).positions - exact.positions)
            for share, motion in parts
        )
        return replace(exact, positions=exact.positions + moved)


@dataclass(frozen=True, eq=False)
class _Instruments:
    """One day's delay (s), and gain (2,) and position (2, 3) m of the plates of both feet."""

    delay_s: float
    gain: np.ndarray
    offset_m: np.ndarray

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "_Instruments":
        prior = InstrumentPrior()
        drawn = {name: np.array([prior.plate[name].draw(rng) for _ in "rl"]) for name in ("x", "z", "gain")}
        common = [prior.floor[name].draw(rng) for name in "xz"]
        offset = np.column_stack([drawn["x"] + common[0], np.zeros(2), drawn["z"] + common[1]])
        return cls(prior.delay_s.draw(rng), drawn["gain"], offset)

    def read(self, time: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """Return what the plates read of true loads (n, 2, 6)."""
        later = np.asarray(CubicSpline(time, loads)(np.clip(time - self.delay_s, time[0], time[-1])))
        later *= loads[..., 1:2] != 0.0
        later[..., 3:] += np.cross(self.offset_m, later[..., :3])
        return later * (1.0 + self.gain[:, None])


def _truth(fit: Fit, exact: SyntheticTrial) -> dict[str, float]:
    """Return the true value of each outcome, at the phases of the day's strides."""
    exactly = stride_means([_exactly(trial, exact) for trial in fit.trials], fit.mass_kg)
    return {in_words(name, side): float(np.mean(values)) for (name, side), values in exactly.items()}


def in_words(name: str, side: str) -> str:
    """Return as `outcome` does what features are of: "moment knee_adduction loading" and a side."""
    quantity, joint, event = name.split(" ", 2)
    return " ".join((*named_outcome(f"{quantity} {joint}"), event, side))


@dataclass(frozen=True, eq=False, repr=False)
class _Exact(TrialFit):
    """A trial whose curves and contacts are true."""

    true_strides: tuple[Stride, ...] = ()
    true_phases: tuple[Stride, ...] = ()

    @cached_property
    def strides(self) -> tuple[Stride, ...]:
        return self.true_strides

    @cached_property
    def phases(self) -> tuple[Stride, ...]:
        return self.true_phases


def _exactly(trial: TrialFit, exact: SyntheticTrial) -> _Exact:
    """Put the true motion and loads in place of the estimated ones."""
    curves = trial.joint_curves
    assert curves is not None
    at = np.clip(np.searchsorted(exact.time, curves.time - 1e-9), 0, len(exact.time) - 1)
    motion, loads = exact.motion.cut(at), exact.foot_loads[at]
    forces = inverse_dynamics(exact.skeleton, exact.bsp, motion, loads)
    joints = joint_moments(exact.skeleton, exact.bsp, motion, loads)
    known = np.ones_like(curves.known)
    exact_curves = JointCurves(curves.time, known, motion, {"estimate": forces}, {"estimate": joints}, None)
    strides, phases = (tuple(_at_contacts(stride, exact) for stride in some) for some in (trial.strides, trial.phases))
    estimated = {field.name: getattr(trial, field.name) for field in fields(trial)}
    true = {"skeleton": exact.skeleton, "joint_curves": exact_curves, "deviations": None}
    return _Exact(**{**estimated, **true}, true_strides=strides, true_phases=phases)


def _at_contacts(stride: Stride, exact: SyntheticTrial) -> Stride:
    """Put the true contacts in place of those that were found: whole ones, of both feet."""
    landed, left = {}, {}
    for foot, side in enumerate("rl"):
        spans = runs(exact.foot_loads[:, foot, 1] >= LOAD_THRESHOLD_N)
        landed[side] = exact.time[[first for first, _ in spans if first > 0]]
        left[side] = exact.time[[last for _, last in spans if last < len(exact.time) - 1]]
    other = "l" if stride.side == "r" else "r"

    def nearest(times: np.ndarray, time_s: float) -> float:
        return float(times[np.argmin(np.abs(times - time_s))]) if np.isfinite(time_s) else time_s

    return replace(
        stride,
        start_s=nearest(landed[stride.side], stride.start_s),
        end_s=nearest(landed[stride.side] if stride.phase == "stride" else left[stride.side], stride.end_s),
        toe_off_s=nearest(left[stride.side], stride.toe_off_s),
        opposite_toe_off_s=nearest(left[other], stride.opposite_toe_off_s),
        opposite_strike_s=nearest(landed[other], stride.opposite_strike_s),
    )
