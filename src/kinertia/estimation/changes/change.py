"""Defines the change of one outcome between two conditions, of a person or a group; compares speed, cadence and steps.

They hardly depend on instruments or body, so that strides are all of their deviation.

The deviation of the changes between people contains each person's own error of measurement. What remains without it,

    s_true^2 = max(0, s^2 - mean sd_i^2),

is how differently people changed. The mean change has the standard error s / sqrt(n), errors of measurement included,
as long as they are independent from person to person: an error of plates that everyone shares is not in it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from kinertia.estimation.result.cycles import cycle_columns, spatiotemporal_columns
from kinertia.estimation.result.gait_scores import with_norms
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.io.norms_file import Norm

Names = tuple[str, str, str, str, str, str]
Verdict = Literal["changed", "not shown", "cannot be judged"]
SOURCES = ("instruments", "body", "markers", "stride")
PRIMARY = (
    ("moment", "knee", "adduction", "mid-stance"),
    ("moment", "knee", "adduction", "late stance"),
    ("moment", "ankle", "flexion", "push-off"),
)
"""Outcomes that are named beforehand: quantity, joint, component and event. The first half of single support has the
first peak of the knee adduction moment, the second half the second."""
UNITS = {"moment": "N m/kg", "angle": "degrees"}
MOST_WALKS = 50
"""Strides of each condition beyond which nobody would record more."""
_POWER = 0.8


@dataclass(frozen=True)
class NamedOutcome:
    """What was compared.

    Attributes:
        quantity: "moment" or "angle".
        joint, component, side: as in `joint_moments.sto`: "knee", "adduction", "r".
        event: one of EVENTS.
        unit: of its numbers; moments are internal, over body mass.

    Examples:
        >>> NamedOutcome("moment", "knee", "adduction", "r", "mid-stance", "N m/kg").primary
        True
    """

    quantity: str
    joint: str
    component: str
    side: str
    event: str
    unit: str

    @property
    def names(self) -> Names:
        """The outcome's quantity, joint, component, side, event and unit."""
        return self.quantity, self.joint, self.component, self.side, self.event, self.unit

    @property
    def primary(self) -> bool:
        """Whether it is one of the outcomes that were chosen before any results were seen (`PRIMARY`)."""
        return (self.quantity, self.joint, self.component, self.event) in PRIMARY


@dataclass(frozen=True)
class Change(NamedOutcome):
    """The change of one outcome between two conditions.

    Attributes:
        before, after: means over the strides of each condition.
        strides: number of strides of each.
        sd: standard deviation of the difference.
        sd_by_source: its parts by SOURCES; their squares add up.
        mdc95: smallest change that these recordings can show.
        p: probability of at least this difference without any change.
        stride_sd: spread from stride to stride of each condition, as judged by.
        assumed: whether that spread is at least the usual one, since a condition has fewer than three strides.
        doubt: what keeps it from being judged, besides fewer than two strides of a condition.

    Examples:
        >>> change = Change("moment", "knee", "adduction", "r", "loading", "N m/kg", 0.4, 0.3, (3, 3), 0.02, {}, 0.05)
        >>> round(change.difference, 6), change.verdict
        (-0.1, 'changed')
    """

    before: float
    after: float
    strides: tuple[int, int]
    sd: float
    sd_by_source: Mapping[str, float]
    mdc95: float
    p: float = np.nan
    stride_sd: tuple[float, float] = (np.nan, np.nan)
    assumed: bool = False
    doubt: str = ""

    @property
    def difference(self) -> float:
        """After minus before."""
        return self.after - self.before

    @property
    def verdict(self) -> Verdict:
        """Whether the change is beyond what instruments, body, markers and strides make of none."""
        if self.doubt or not np.isfinite(self.mdc95):
            return "cannot be judged"
        return "changed" if abs(self.difference) > self.mdc95 else "not shown"

    def walks_needed(self, change: float) -> int | None:
        """Return the strides of each condition that show a change of this size in four of five comparisons.

        Instruments, body and markers are taken to be as uncertain with any number; None if MOST do not suffice.
        """
        from scipy import stats  # loaded when it is needed

        spread = float(np.square(self.stride_sd).sum())
        shared = self.sd**2 - self.sd_by_source["stride"] ** 2
        counts = np.arange(2, MOST_WALKS + 1)
        limits = stats.t.ppf(0.975, 2 * (counts - 1)) + stats.norm.ppf(_POWER)
        enough = np.flatnonzero(limits * np.sqrt(max(shared, 0.0) + spread / counts) <= abs(change))
        return int(counts[enough[0]]) if len(enough) else None


def shown_from(difference: float, sd: float, freedom: float) -> tuple[float, float]:
    """Return the smallest change that is beyond 95 % by Student's t, and the p value of a difference.

    Args:
        difference, sd: of the difference.
        freedom: degrees of freedom of `sd`; infinite where it is known, NaN where nothing can be judged.
    """
    from scipy import stats  # loaded when it is needed

    if np.isnan(freedom):
        return np.nan, np.nan
    of_sd = stats.t(freedom)
    return float(of_sd.ppf(0.975)) * sd, float(2.0 * of_sd.sf(abs(difference) / max(sd, 1e-300)))


def named_outcome(name: str) -> tuple[str, str, str]:
    """Return quantity, joint and component of "moment knee_adduction" or "angle knee_angle".

    >>> named_outcome("angle knee_angle"), named_outcome("moment hip_rotation"), named_outcome("angle pro_sup")
    (('angle', 'knee', 'flexion'), ('moment', 'hip', 'rotation'), ('angle', 'forearm', 'pronation'))
    """
    quantity, _, rest = name.partition(" ")
    joint, _, component = rest.partition("_")
    return quantity, _JOINTS.get(joint, joint), _COMPONENTS.get(component, component)


_JOINTS = {"arm": "shoulder", "pro": "forearm"}
_COMPONENTS = {"angle": "flexion", "flex": "flexion", "add": "adduction", "rot": "rotation", "sup": "pronation"}
"""Words for parts of the names of coordinates."""
_SHORTEST_S = 0.8
"""Of a walk without a whole stride whose pelvis shows its speed: most of a stride, in which speed varies by 10 %."""
_STANDING_M_S = 0.2
"""Speed of a pelvis below which the walk is on a treadmill, or none."""
NOTABLE = 0.05
"""Relative difference of speed that is pointed out even where it is not shown to be one, chosen here."""


@dataclass(frozen=True)
class Measure:
    """A spatiotemporal measure: column of `Fit.spatiotemporal`, words of it, its unit, and whether sides are apart."""

    column: str
    joint: str
    component: str
    unit: str
    sided: bool = False


MEASURES = (
    Measure("cadence_steps_min", "walking", "cadence", "steps/min"),
    Measure("stride_length_m", "stride", "length", "m"),
    Measure("stance_percent", "stance", "share", "%", sided=True),
    Measure("step_width_m", "step", "width", "m"),
)
GPS = Measure("gps", "gait profile", "score", "degrees", sided=True)


def profile_changes(
    before: Sequence[TrialFit], after: Sequence[TrialFit], norms: Mapping[str, Norm]
) -> tuple[Change, ...]:
    """Compare the Gait Profile Score of each side, each walk counted once as in `speed_change`."""
    tables = [[_stride_scores(trial, norms) for trial in trials] for trials in (before, after)]
    found = []
    for side in ("r", "l"):
        known = [[scores for table in some if (scores := _values(table, GPS, side)).size] for some in tables]
        found.append(_change(GPS, side, known, _on_belts(before, after)))
    return tuple(change for change in found if change is not None)


def _stride_scores(trial: TrialFit, norms: Mapping[str, Norm]) -> dict[str, list[object]]:
    """Return side and score of each stride."""
    columns = cycle_columns([trial], 1.0, "estimate")  # angles are independent of body mass
    scored = with_norms(columns, norms, trial.skeleton)
    keys, values = zip(scored["side"], scored["stride"], strict=True), scored["gps"]
    strides = {key: value for key, value in zip(keys, values, strict=True) if np.isfinite(value)}
    return {"side": [side for side, _ in strides], "gps": list(strides.values())}


def speed_change(before: Sequence[TrialFit], after: Sequence[TrialFit]) -> Change | None:
    """Compare walking speed, with each walk counted once (strides of one walk are alike); None where it is not known.

    Where all walk on a treadmill, and one of them once, strides count instead.
    """
    known = [[speeds for trial in trials if (speeds := _speeds(trial)).size] for trials in (before, after)]
    return _change(Measure("speed_m_s", "walking", "speed", "m/s"), "", known, _on_belts(before, after))


def gait_changes(before: Sequence[TrialFit], after: Sequence[TrialFit]) -> tuple[Change, ...]:
    """Compare MEASURES, each walk counted once as in `speed_change`; those that are known."""
    tables = [[spatiotemporal_columns([trial]) for trial in trials] for trials in (before, after)]
    found = []
    for measure in MEASURES:
        for side in ("r", "l") if measure.sided else ("",):
            known = [
                [of_table for table in some if (of_table := _values(table, measure, side)).size] for some in tables
            ]
            found.append(_change(measure, side, known, _on_belts(before, after)))
    return tuple(change for change in found if change is not None)


def _values(table: dict[str, list[object]], measure: Measure, side: str) -> np.ndarray:
    values = np.array(table[measure.column], dtype=float)
    usable = np.isfinite(values) & (np.array([side in ("", table_side) for table_side in table["side"]], dtype=bool))
    return np.asarray(values[usable])


def _on_belts(before: Sequence[TrialFit], after: Sequence[TrialFit]) -> bool:
    return all(_on_belt(trial) for trial in (*before, *after))


def _on_belt(trial: TrialFit) -> bool:
    """Decide whether a person walks on a treadmill: its speed is stated, or the pelvis stays in its place."""
    return trial.kinematics.trial.belt is not None or _pelvis_speed(trial) < _STANDING_M_S


def _pelvis_speed(trial: TrialFit) -> float:
    """Return how fast the pelvis went from the first to the last frame, m/s; NaN if that is not known."""
    if trial.trajectory is None:
        return np.nan
    time = trial.kinematics.trajectory_time
    first, last = trial.skeleton.root.centre(trial.trajectory[[0, -1]])[:, [0, 2]]
    return float(np.linalg.norm(last - first) / (time[-1] - time[0]))


def _change(measure: Measure, side: str, known: Sequence[Sequence[np.ndarray]], on_belts: bool) -> Change | None:
    """Compare the values of each walk of both conditions."""
    if not all(known):
        return None
    alone = on_belts and min(map(len, known)) < 2
    values = [
        np.concatenate(samples) if alone else np.array([sample.mean() for sample in samples]) for samples in known
    ]
    means = [float(value.mean()) for value in values]
    counts = [len(value) for value in values]
    spreads = [float(np.std(value, ddof=1)) if len(value) > 1 else np.nan for value in values]
    squares = [spread**2 / count for spread, count in zip(spreads, counts, strict=True)]
    sd = float(np.sqrt(sum(squares)))
    freedom = sum(squares) ** 2 / max(sum(s**2 / max(n - 1, 1) for s, n in zip(squares, counts, strict=True)), 1e-300)
    mdc95, p = shown_from(means[1] - means[0], sd, max(freedom, 1.0) if np.isfinite(freedom) else np.nan)
    return Change(
        quantity="gait",
        joint=measure.joint,
        component=measure.component,
        side=side,
        event="",
        unit=measure.unit,
        before=means[0],
        after=means[1],
        strides=(counts[0], counts[1]),
        sd=sd,
        sd_by_source={source: sd if source == "stride" else 0.0 for source in SOURCES},
        mdc95=mdc95,
        p=p,
        stride_sd=(spreads[0], spreads[1]),
    )


def _speeds(trial: TrialFit) -> np.ndarray:
    """Return the speed of each stride, m/s; without strides that of the pelvis; empty where neither shows it."""
    all_strides = np.array(spatiotemporal_columns([trial])["speed_m_s"], dtype=float)
    strides: np.ndarray = all_strides[np.isfinite(all_strides)]
    if strides.size or trial.kinematics.trial.belt is not None or trial.trajectory is None:
        return strides
    time = trial.kinematics.trajectory_time
    speed = _pelvis_speed(trial)
    return np.array([speed] if time[-1] - time[0] >= _SHORTEST_S and speed > _STANDING_M_S else [])


@dataclass(frozen=True)
class GroupChange(NamedOutcome):
    """The change of one outcome in a group.

    Attributes:
        people: number of people whose change is averaged: not those with a `doubt`.
        changed: number of them whose own change is shown.
        before, after, difference: means over people.
        sd: standard deviation of the changes between people; NaN for one person, as are all numbers below but the next.
        sd_measurement: root mean square of the people's own standard deviations.
        sd_true: standard deviation of the changes without these errors.
        standard_error: of the mean change.
        lower, upper: its 95 % interval, by Student's t.
        p: probability of at least this mean change without any.

    Examples:
        >>> named = "moment", "knee", "adduction", "r", "loading", "N m/kg"
        >>> anna, ben = (Change(*named, 0.4, after, (3, 3), 0.02, {}, 0.05) for after in (0.3, 0.2))
        >>> (found,) = group_changes({"Anna": [anna], "Ben": [ben]})
        >>> round(found.difference, 3), round(found.sd, 3), round(found.sd_true, 3), found.changed
        (-0.15, 0.071, 0.068, 2)
    """

    people: int
    changed: int
    before: float
    after: float
    difference: float
    sd: float
    sd_measurement: float
    sd_true: float
    standard_error: float
    lower: float
    upper: float
    p: float


def group_changes(people: Mapping[str, Sequence[Change]]) -> tuple[GroupChange, ...]:
    """Average the changes of each outcome over the people who have it, in the order of their first appearance."""
    outcomes: dict[Names, list[Change]] = {}
    for changes in people.values():
        for change in changes:
            if not change.doubt:
                outcomes.setdefault(change.names, []).append(change)
    return tuple(_averaged(names, some) for names, some in outcomes.items())


def _averaged(names: Names, some: Sequence[Change]) -> GroupChange:
    from scipy import stats  # loaded when it is needed

    differences = np.array([change.difference for change in some])
    count, mean = len(some), float(differences.mean())
    measured = float(np.sqrt(np.mean([change.sd**2 for change in some])))
    sd = float(differences.std(ddof=1)) if count > 1 else np.nan
    error = sd / np.sqrt(count)
    student = stats.t(max(count - 1, 1))
    half = float(student.ppf(0.975)) * error
    p = float(2.0 * student.sf(abs(mean) / max(error, 1e-300))) if count > 1 else np.nan
    return GroupChange(
        *names,
        people=count,
        changed=sum(change.verdict == "changed" for change in some),
        before=float(np.mean([change.before for change in some])),
        after=float(np.mean([change.after for change in some])),
        difference=mean,
        sd=sd,
        sd_measurement=measured,
        sd_true=float(np.sqrt(max(sd**2 - measured**2, 0.0))) if count > 1 else np.nan,
        standard_error=float(error),
        lower=mean - half,
        upper=mean + half,
        p=p,
    )
