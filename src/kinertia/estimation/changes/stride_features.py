"""Averages joint moments and angles over phases of each stride, in an estimate and in its posterior draws.

A draw in which only the body, or only plates and synchronisation, depart from the estimate shows what these contribute.
Strides and their phases are those of the estimate, in every draw. Contacts that no plate measured come from the motion,
with an error that all strides of a session share: what it makes of each average is the source "contacts".
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from kinertia.estimation.result.curve_source import CurveSource
from kinertia.estimation.result.cycles import spread_evenly
from kinertia.estimation.result.drawn_fit import AT_ONCE, DrawnCurves, drawn_bodies, drawn_joints, kept_draws
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import PosteriorDraws
from kinertia.motion.gait_cycle import PERCENT, Stride
from kinertia.motion.joint_moments import component_names, joint_and_side
from kinertia.motion.workload import pieces
from kinertia.trial.data import FEET
from kinertia.trial.stances import load_edges

EVENTS = ("loading", "mid-stance", "late stance", "push-off", "swing")
"""Phases of a stride: both feet, the other foot in the air (first half, second half), both feet again, this foot in the
air. A run has the second, the third and the last."""
MOST_CURVES = 20
"""Strides of each trial and side whose curves are compared, evenly spread; features are of all."""
CONTACT_SD_S = 0.010
"""Standard deviation of foot contacts and foot offs that no plate measured, by foot and kind, chosen here. Events of
synthetic people are 2 to 17 ms off, those of 14 recordings (`trial.stances`) up to 17 ms."""
_CONTACTS = tuple((side, kind) for side in FEET for kind in ("heel strike", "toe off"))
_OPPOSITE = {"opposite_toe_off_s": "toe off", "opposite_strike_s": "heel strike"}
_SAME_TIME_S = 0.003
_WHOLE = ("all", "rest")
_FEWER = 2
"""Factor by which draws of parts are fewer than of everything: they mostly divide a variance."""
Key = tuple[str, str, str, str]
"""Trial, outcome, side, phase and number of the stride; of a curve, the outcome has no event."""


class _Curves(Protocol):
    """Curves of a trial in d draws."""

    @property
    def angle(self) -> Callable[[np.ndarray], np.ndarray]:
        """Coordinates (n, c, d) at n times."""

    @property
    def joint_moment(self) -> Callable[[np.ndarray], np.ndarray]:
        """Joint moments (n, j, 3, d), N m."""


@dataclass(frozen=True, eq=False)
class Rows:
    """k values, or curves, in an estimate and in n draws of it.

    Attributes:
        keys: what each is of.
        estimate: (k,) or (k, 101) their values.
        drawn: by source (n, k) or (n, k, 101) their values in each draw; of "contacts" departures, one for each foot
            and kind of contact, whose squares add up.
    """

    keys: tuple[Key, ...]
    estimate: np.ndarray
    drawn: Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class StrideFeatures:
    """Averages over phases, and some of the curves that they are of."""

    events: Rows
    curves: Rows


def stride_features(
    fit: Fit,
    trials: Sequence[TrialFit],
    sources: Mapping[str, PosteriorDraws],
    count: int,
    progress: Callable[[float], None] = lambda share: None,
    centre: PosteriorDraws | None = None,
    anew: bool = False,
) -> StrideFeatures:
    """Compute the features of these trials of a fit.

    Args:
        fit: by the simultaneous estimate.
        trials: some of its trials.
        sources: draws of everything ("all"), of everything with one body ("rest"), or of a part (`only`).
        count: number of draws of each, at least two.
        progress: is told the share done.
        centre: its first draw takes the place of the estimate, if given.
        anew: whether markers are put on anew for what these trials are compared with, by which ankles are drawn, too.
    """
    strides, middle = _Strides.of(trials), _curves_of(trials)
    if centre is not None:
        middle = _drawn(fit, trials, centre, [0], False, False)
    (estimate,) = strides.curves(middle, fit.mass_kg)
    shown = np.isfinite(estimate).any(axis=1)
    keys, weights, few = strides.chosen(shown)
    counts = {source: count if source in _WHOLE else max(2, count // _FEWER) for source in sources}
    events: dict[str, np.ndarray] = {}
    curves: dict[str, np.ndarray] = {}
    done = 0
    for source, draws in sources.items():
        features, rows = [], []
        for some in pieces(counts[source], AT_ONCE):
            numbers = list(range(counts[source]))[some]
            whole = source in _WHOLE
            for drawn in strides.curves(_drawn(fit, trials, draws, numbers, whole, whole and anew), fit.mass_kg):
                features.append(_means(drawn[shown], weights))
                rows.append(drawn[shown][few].astype(np.float32))
            done += len(numbers)
            progress(done / sum(counts.values()))
        events[source], curves[source] = np.array(features), np.array(rows)
    means = _means(estimate[shown], weights)
    moved = [strides.later(trials, side, kind) for side, kind in _CONTACTS]
    others = [moved_strides.curves(middle, fit.mass_kg)[0][shown] for moved_strides in moved]
    departed = [
        _means(moved_curves, moved_strides.chosen(shown)[1]) - means
        for moved_curves, moved_strides in zip(others, moved, strict=True)
    ]
    events["contacts"] = np.nan_to_num(np.array(departed))
    curves["contacts"] = np.nan_to_num(np.array([other[few] - estimate[shown][few] for other in others]))
    known = np.isfinite(means)
    named = [(trial, f"{name} {event}", side, stride) for trial, name, side, stride in keys for event in EVENTS]
    of_events = tuple(key for key, is_known in zip(named, known, strict=True) if is_known)
    few_keys = tuple(key for key, is_one in zip(keys, few, strict=True) if is_one)
    return StrideFeatures(
        Rows(of_events, means[known], {source: rows[:, known] for source, rows in events.items()}),
        Rows(few_keys, estimate[shown][few], curves),
    )


def event_means(trials: Sequence[TrialFit], mass_kg: float) -> dict[Key, float]:
    """Return the features of all strides of these trials; moments over this mass."""
    strides = _Strides.of(trials)
    keys, weights, _ = strides.chosen(np.ones(len(strides.keys), dtype=bool))
    means = _means(strides.curves(_curves_of(trials), mass_kg)[0], weights)
    named = ((trial, f"{name} {event}", side, stride) for trial, name, side, stride in keys for event in EVENTS)
    return {key: float(mean) for key, mean in zip(named, means, strict=True) if np.isfinite(mean)}


def stride_means(trials: Sequence[TrialFit], mass_kg: float) -> dict[tuple[str, str], list[float]]:
    """Return `event_means` by name ("moment knee_adduction loading") and side, one for each stride."""
    found: dict[tuple[str, str], list[float]] = {}
    for (_, name, side, _), value in event_means(trials, mass_kg).items():
        found.setdefault((name, side), []).append(value)
    return found


@dataclass(frozen=True, eq=False)
class _Strides:
    """Strides of several trials, and the curves that they have.

    Attributes:
        strides: of each trial.
        keys: of all curves, trial by trial.
        columns: of each trial's strides, of which each curve is: an angle or else a moment, and its column.
        of_curve: the stride of each.
        few: curves of the strides that `MOST_CURVES` keeps.
    """

    strides: Sequence[Sequence[Stride]]
    keys: Sequence[Key]
    columns: Sequence[Sequence[Sequence[tuple[bool, int]]]]
    of_curve: Sequence[Stride]
    few: np.ndarray

    @classmethod
    def of(cls, trials: Sequence[TrialFit]) -> "_Strides":
        strides = [
            [candidate for candidate in (*trial.strides, *trial.phases) if candidate.phase != "landing"]
            for trial in trials
        ]
        keys: list[Key] = []
        of_curve: list[Stride] = []
        few: list[bool] = []
        columns: list[list[list[tuple[bool, int]]]] = []
        for trial, of_trial in zip(trials, strides, strict=True):
            kept = spread_evenly(of_trial, MOST_CURVES)
            columns.append([])
            for stride in of_trial:
                columns[-1].append([])
                for name, is_angle, column in _columns(trial, stride.side):
                    columns[-1][-1].append((is_angle, column))
                    keys.append((trial.name, name, stride.side, f"{stride.phase} {stride.number}"))
                    of_curve.append(stride)
                    few.append(stride in kept)
        return cls(strides, keys, columns, of_curve, np.array(few, dtype=bool))

    def curves(self, sources: Sequence[_Curves], mass_kg: float) -> np.ndarray:
        """Return the curves (d, k, 101) of these trials in d draws, degrees and N m/kg."""
        rows: list[np.ndarray] = []
        for source, of_trial, columns in zip(sources, self.strides, self.columns, strict=True):
            if not of_trial:
                continue
            time, whole = np.concatenate([stride.time for stride in of_trial]), (len(of_trial), len(PERCENT))
            angles, moments = np.degrees(source.angle(time)), source.joint_moment(time) / mass_kg
            count = angles.shape[2]
            angles, moments = (values.reshape(*whole, -1, count) for values in (angles, moments))
            for k, some in enumerate(columns):
                rows += [(angles if is_angle else moments)[k, :, column] for is_angle, column in some]
        return np.array(rows).reshape(len(self.keys), len(PERCENT), -1).transpose(2, 0, 1)

    def later(self, trials: Sequence[TrialFit], side: str, kind: str) -> "_Strides":
        """Return the strides with this kind of contact of a foot later by CONTACT_SD_S where no plate measured it."""
        moved: list[list[Stride]] = []
        for trial, of_trial in zip(trials, self.strides, strict=True):
            edges = [
                load_edge.time_s
                for load_edge in load_edges(trial.kinematics.trial.loads)
                if load_edge[1:] == (side, kind)
            ]
            moved.append([_later(stride, side, kind, edges) for stride in of_trial])
        later_by_id = {
            id(stride): later
            for of_trial, new in zip(self.strides, moved, strict=True)
            for stride, later in zip(of_trial, new, strict=True)
        }
        return replace(self, strides=moved, of_curve=[later_by_id[id(stride)] for stride in self.of_curve])

    def chosen(self, shown: np.ndarray) -> tuple[list[Key], np.ndarray, np.ndarray]:
        """Return keys, weights (k, 5, 101) of EVENTS, and which are kept as curves, of the curves shown."""
        rows = np.flatnonzero(shown).tolist()
        weights = np.array([event_weights(self.of_curve[row]) for row in rows]).reshape(-1, len(EVENTS), len(PERCENT))
        return [self.keys[row] for row in rows], weights, self.few[rows]


def _later(stride: Stride, side: str, kind: str, edges: Sequence[float]) -> Stride:
    """Return a stride with this kind of contact later where it is at none of the edges (s) of loads."""
    end = "toe off" if stride.phase == "stance" else "heel strike"
    same_foot, other_foot = {"start_s": "heel strike", "end_s": end, "toe_off_s": "toe off"}, _OPPOSITE
    names = [
        name for name, edge_kind in (same_foot if stride.side == side else other_foot).items() if edge_kind == kind
    ]
    times = {name: float(getattr(stride, name)) for name in names}
    later: dict[str, Any] = {
        name: time + CONTACT_SD_S
        for name, time in times.items()
        if not any(abs(time - edge) < _SAME_TIME_S for edge in edges)
    }
    return replace(stride, **later)


def _columns(trial: TrialFit, side: str) -> Iterator[tuple[str, bool, int]]:
    """Yield name and column of each angle, and of each component of joint moments, of a leg or of neither."""
    skeleton = trial.skeleton
    for base, columns in skeleton.sides.items():
        column = columns.get(side, columns.get(""))
        if column is not None and skeleton.rotational[column]:
            yield f"angle {base}", True, column
    joints = () if trial.joint_curves is None else trial.joint_curves.joints["estimate"].joints
    for k, joint in enumerate(joints):
        base, joint_side = joint_and_side(joint)
        if joint_side in ("", side):
            for component, name in enumerate(component_names(base)):
                yield f"moment {name}", False, 3 * k + component


def _means(curves: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the mean (k * 5,) of each curve (k, 101) over EVENTS; NaN where some of it, or the event, is unknown."""
    unknown = np.einsum("kep,kp->ke", (weights > 0.0).astype(float), np.isnan(curves).astype(float)) > 0.0
    means = np.einsum("kep,kp->ke", weights, np.nan_to_num(curves))
    return np.where(unknown | ~(weights.sum(axis=2) > 0.0), np.nan, means).reshape(-1)


def _curves_of(trials: Sequence[TrialFit]) -> list[_Curves]:
    """Return the curves of trials, which are one draw of each."""
    return [_Single(CurveSource(trial, "estimate")) for trial in trials]


@dataclass(frozen=True, eq=False)
class _Single:
    """The curves of a trial, arranged like `DrawnCurves` with a single draw."""

    source: CurveSource

    def angle(self, time: np.ndarray) -> np.ndarray:
        return self.source.angle(time)[..., None]

    def joint_moment(self, time: np.ndarray) -> np.ndarray:
        return self.source.joint_moment(time)[..., None]


def _drawn(
    fit: Fit, trials: Sequence[TrialFit], draws: PosteriorDraws, numbers: Sequence[int], knees: bool, ankles: bool
) -> list[_Curves]:
    joints = {draws.coordinate_values[n].tobytes(): n for n in numbers}  # in draws of parts they are all the same
    skeletons = {values: drawn_joints(fit.skeleton, draws, n) for values, n in joints.items()}
    models = [(skeletons[draws.coordinate_values[n].tobytes()], drawn_bodies(fit.estimate, draws, n)) for n in numbers]
    of_trials = [(trial, draws.trials[fit.trials.index(trial)]) for trial in trials]
    return [DrawnCurves.of(*of_trial, numbers, models, knees, ankles) for of_trial in of_trials]


def only(draws: PosteriorDraws, body: bool) -> PosteriorDraws:
    """Return draws in which only the body, or only plates and synchronisation, differ from draw to draw."""
    trials = tuple(
        replace(
            trial,
            coefficients=np.zeros_like(trial.coefficients),
            **({"plates": np.zeros_like(trial.plates), "delay_s": np.zeros_like(trial.delay_s)} if body else {}),
            **({"impact": np.zeros_like(trial.impact)} if body else {}),
        )
        for trial in draws.trials
    )
    mean = np.broadcast_to(draws.coordinate_values.mean(axis=0), draws.coordinate_values.shape)
    still = replace(draws, coordinate_values=mean, trials=trials).without_places()
    return still if body else replace(still, bsp=np.broadcast_to(draws.bsp.mean(axis=0), draws.bsp.shape))


def usual_sources(fit: Fit) -> dict[str, PosteriorDraws]:
    """Return the draws of everything, of the body, and of plates and synchronisation.

    Raises:
        KinertiaError: the fit has no draws.
    """
    draws = kept_draws(fit)
    return {"all": draws, "body": only(draws, body=True), "instruments": only(draws, body=False)}


def event_weights(stride: Stride) -> np.ndarray:
    """Return the weights (5, 101) that average a curve over each of EVENTS; zero where an event is not known."""
    inside = np.array([(first <= PERCENT) & (last >= PERCENT) for first, last in event_spans(stride)])
    if stride.phase != "stride":
        inside[-1] = False  # it ends with stance
    weights: np.ndarray = inside / np.maximum(inside.sum(axis=1, keepdims=True), 1)
    return weights


def event_spans(stride: Stride) -> tuple[tuple[float, float], ...]:
    """Return first and last percent of each of EVENTS; NaN where a contact is not known, or the event does not occur.

    Before and after a flight, as of runs, this foot is on the ground alone all the time: there is neither loading nor
    push-off with both feet.
    """
    lifts, strikes, off = (
        stride.percent(time_s) for time_s in (stride.opposite_toe_off_s, stride.opposite_strike_s, stride.toe_off_s)
    )
    if strikes > off:
        never = (np.nan, np.nan)
        return never, (0.0, 0.5 * off), (0.5 * off, off), never, (off, 100.0)
    return tuple(pairwise((0.0, lifts, 0.5 * (lifts + strikes), strikes, off, 100.0)))
