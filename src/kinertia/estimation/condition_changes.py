"""Tests what changed between two conditions of one session: joint moments and angles, event by event.

Feature f is the mean of a curve over a phase between contacts (`EVENTS`). Of conditions A and B,

    d = mean f_B - mean f_A,        Var d = V + s_A^2 / n_A + s_B^2 / n_B,

the means over the n strides of each. V is the variance of mean f_B - mean f_A over posterior draws of one estimate from
all trials: what they share (body, plates, markers left in place) cancels. s is the spread from stride to stride beyond
what V leaves between strides of one condition, each condition's own. It is shrunk to the mean square of the joint's
features, which count for at most _SHRINK degrees of freedom. A change is shown where |d| exceeds t(0.975) standard
deviations, with degrees of freedom by Satterthwaite (1946, Biometrics Bulletin 2:110).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import stats

from kinertia.errors import KinertiaError
from kinertia.estimation.cycles import CycleCurve, curves_by_stage
from kinertia.estimation.drawn_fit import drawn_fit, kept_draws
from kinertia.estimation.result import Fit
from kinertia.estimation.simultaneous.posterior_draws import PosteriorDraws
from kinertia.motion.gait_cycle import PERCENT, Stride

Verdict = Literal["changed", "not shown", "cannot be judged"]
EVENTS = ("loading", "mid-stance", "late stance", "push-off", "swing")
"""Phases of a stride: both feet, the other foot in the air (first half, second half), both feet again, this foot in the
air."""
SOURCES = ("instruments", "body", "markers", "stride")
PRIMARY = (
    ("moment", "knee", "adduction", "mid-stance"),
    ("moment", "knee", "adduction", "late stance"),
    ("moment", "ankle", "flexion", "push-off"),
)
"""Outcomes that are named beforehand: quantity, joint, component and event. The first half of single support has the
first peak of the knee adduction moment, the second half the second."""
DRAWS = 80
_SHRINK = 6.0
_FEW = 3
_USUAL = {
    "moment hip flexion": 0.037,
    "moment hip adduction": 0.019,
    "moment knee flexion": 0.042,
    "moment knee adduction": 0.021,
    "moment ankle flexion": 0.063,
    "angle hip flexion": 0.8,
    "angle hip rotation": 1.4,
    "angle knee flexion": 1.6,
    "angle subtalar flexion": 2.4,
}
"""Spread from stride to stride (N m/kg, degrees) of two people of one laboratory (adduction and angles: of one). It is
the least that is assumed with fewer strides of a condition than _FEW."""
_COMPONENTS = {"angle": "flexion"}
_UNITS = {"moment": "N m/kg", "angle": "degrees"}
_KINDS = {"joint_moment": "moment", "angle": "angle"}


@dataclass(frozen=True)
class Change:
    """The change of one outcome between two conditions.

    Attributes:
        quantity: "moment" or "angle".
        joint, component, side: as in `joint_moments.sto`: "knee", "adduction", "r".
        event: one of EVENTS.
        unit: of the numbers below; moments are internal, over body mass.
        before, after: means over the strides of each condition.
        strides: number of strides of each.
        sd: standard deviation of the difference.
        sd_by_source: its parts by SOURCES; their squares add up.
        mdc95: smallest change that these recordings can show.
        verdict: "changed", "not shown", or "cannot be judged" with fewer than two strides of a condition.

    Examples:
        >>> change = Change("moment", "knee", "adduction", "r", "loading", "N m/kg", 0.4, 0.3, (3, 3), 0.02, {}, 0.05)
        >>> round(change.difference, 6), change.verdict
        (-0.1, 'changed')
    """

    quantity: str
    joint: str
    component: str
    side: str
    event: str
    unit: str
    before: float
    after: float
    strides: tuple[int, int]
    sd: float
    sd_by_source: Mapping[str, float]
    mdc95: float

    @property
    def difference(self) -> float:
        """After minus before."""
        return self.after - self.before

    @property
    def verdict(self) -> Verdict:
        """Whether the change is beyond what instruments, body, markers and strides make of none."""
        if not np.isfinite(self.mdc95):
            return "cannot be judged"
        return "changed" if abs(self.difference) > self.mdc95 else "not shown"

    @property
    def primary(self) -> bool:
        """Whether the outcome was named beforehand."""
        return (self.quantity, self.joint, self.component, self.event) in PRIMARY


def conditions_of(fit: Fit) -> dict[str, list[str]]:
    """Return the names of the trials of each condition."""
    result: dict[str, list[str]] = {}
    for trial in fit.trials:
        result.setdefault(trial.kinematics.trial.condition, []).append(trial.name)
    return result


def changes(
    fit: Fit, before: str, after: str, progress: Callable[[float], None] = lambda share: None
) -> tuple[Change, ...]:
    """Compare the strides of two conditions in one estimate from all trials.

    Args:
        fit: by the simultaneous estimate; its trials state their `condition`.
        before, after: the conditions.
        progress: is told the share done.

    Raises:
        KinertiaError: no trial states one of the conditions, or the fit has no posterior draws.
    """
    known = conditions_of(fit)
    for wanted in (before, after):
        if wanted not in known:
            stated = ", ".join(sorted(filter(None, known))) or "none"
            raise KinertiaError(f"no trial has the condition {wanted!r}; stated are: {stated}")
    chosen = tuple(trial for trial in fit.trials if trial.kinematics.trial.condition in (before, after))
    at = [fit.trials.index(trial) for trial in chosen]
    condition = {trial.name: trial.kinematics.trial.condition for trial in chosen}
    draws = kept_draws(fit)
    count = min(DRAWS, draws.count)
    parts = {"all": draws, "body": _only(draws, body=True), "instruments": _only(draws, body=False)}
    estimate, keys = _features(replace(fit, trials=chosen), None)
    drawn: dict[str, np.ndarray] = {}
    for step, (source, own) in enumerate(parts.items()):
        varied = _with_draws(fit, own)
        rows = []
        for number in range(count):
            one = drawn_fit(varied, number)
            rows.append(_features(replace(one, trials=tuple(one.trials[k] for k in at)), keys)[0])
            progress((step * count + number + 1) / (len(parts) * count))
        drawn[source] = np.array(rows)
    of_condition = [np.array([condition[trial] == name for trial, *_ in keys]) for name in (before, after)]
    return tuple(_judged(keys, estimate, drawn, of_condition))


def _with_draws(fit: Fit, draws: PosteriorDraws) -> Fit:
    assert fit.posterior is not None  # it has draws
    return replace(fit, posterior=replace(fit.posterior, draws=draws))


def _only(draws: PosteriorDraws, body: bool) -> PosteriorDraws:
    """Return draws in which only the body, or only plates and clock, differ from draw to draw."""
    trials = tuple(
        replace(
            one,
            coefficients=np.zeros_like(one.coefficients),
            **({"plates": np.zeros_like(one.plates), "delay_s": np.zeros_like(one.delay_s)} if body else {}),
            **({"impact": np.zeros_like(one.impact)} if body else {}),
        )
        for one in draws.trials
    )
    mean = np.broadcast_to(draws.coordinate_values.mean(axis=0), draws.coordinate_values.shape)
    still = replace(draws, coordinate_values=mean, trials=trials).without_places()
    return still if body else replace(still, bsp=np.broadcast_to(draws.bsp.mean(axis=0), draws.bsp.shape))


Key = tuple[str, str, str, str]
"""Trial, outcome, side, phase and number of the stride."""


def _features(fit: Fit, keys: Sequence[Key] | None) -> tuple[np.ndarray, list[Key]]:
    """Return the features of all strides (k,), and what they are of, in the order of `keys` if given."""
    found: dict[Key, float] = {}
    curves = curves_by_stage(fit.trials, fit.mass_kg, stages=("estimate",))["estimate"]
    for curve in curves:
        if curve.kind in _KINDS and curve.stride.phase != "landing":
            for event, mean in _means(curve):
                name = f"{_KINDS[curve.kind]} {curve.quantity.removesuffix(f'_{curve.kind}')} {event}"
                found[curve.trial, name, curve.stride.side, f"{curve.stride.phase} {curve.stride.number}"] = mean
    order = sorted(found) if keys is None else list(keys)
    return np.array([found.get(key, np.nan) for key in order]), order


def _means(curve: CycleCurve) -> Iterator[tuple[str, float]]:
    """Yield the mean of each event of which all is known."""
    bounds = event_bounds(curve.stride)
    events = EVENTS if curve.stride.phase == "stride" else EVENTS[:-1]
    for event, first, last in zip(events, bounds, bounds[1:], strict=False):
        inside = (first <= PERCENT) & (last >= PERCENT)
        if inside.any() and np.isfinite(curve.value[inside]).all():
            yield event, float(curve.value[inside].mean())


def event_bounds(stride: Stride) -> tuple[float, ...]:
    """Return where in the stride (%) each of EVENTS begins, and the last ends; NaN where a contact is not known."""
    lifts, strikes, off = (
        stride.percent(time_s) for time_s in (stride.opposite_toe_off_s, stride.opposite_strike_s, stride.toe_off_s)
    )
    return 0.0, lifts, 0.5 * (lifts + strikes), strikes, off, 100.0


@dataclass(frozen=True)
class _Condition:
    """Strides of one outcome in one condition.

    Attributes:
        mean, count: over the strides.
        drawn: by source (n,) the mean in each draw.
        spread: variance from stride to stride beyond what is measured; zero with fewer than two.
    """

    mean: float
    count: int
    drawn: Mapping[str, np.ndarray]
    spread: float


def _judged(
    keys: Sequence[Key], estimate: np.ndarray, drawn: Mapping[str, np.ndarray], of_condition: Sequence[np.ndarray]
) -> Iterator[Change]:
    """Yield the changes of all outcomes that both conditions show."""
    named = np.array([f"{name} {side}" for _, name, side, _ in keys])
    cells: dict[str, list[_Condition]] = {}
    for outcome in dict.fromkeys(named.tolist()):
        own = [_condition(estimate, drawn, (named == outcome) & mask) for mask in of_condition]
        if min(one.count for one in own) > 0:
            cells[outcome] = own
    for outcome, own in cells.items():
        quantity, rest, event_side = outcome.split(" ", 2)
        group = f"{quantity} {rest.partition('_')[0]}"
        alike = [other for name, other in cells.items() if name.startswith(f"{group}_") or name.startswith(f"{group} ")]
        event, _, side = event_side.rpartition(" ")
        joint, _, component = rest.partition("_")
        yield _change((quantity, joint, _COMPONENTS.get(component, component), side, event), own, alike)


def _condition(estimate: np.ndarray, drawn: Mapping[str, np.ndarray], mask: np.ndarray) -> _Condition:
    seen = mask & np.isfinite(estimate)
    seen[seen] = np.isfinite(drawn["all"][:, seen]).all(axis=0)
    count = int(seen.sum())
    if count == 0:
        return _Condition(np.nan, 0, {}, 0.0)
    means = {source: rows[:, seen].mean(axis=1) for source, rows in drawn.items()}
    spread = 0.0
    if count > 1:
        measured = np.var(drawn["all"][:, seen] - estimate[seen], axis=1, ddof=1).mean()
        spread = max(0.0, float(np.var(estimate[seen], ddof=1) - measured))
    return _Condition(float(estimate[seen].mean()), count, means, spread)


def _change(
    named: tuple[str, str, str, str, str], own: Sequence[_Condition], alike: Sequence[Sequence[_Condition]]
) -> Change:
    before, after = own
    quantity, joint, component, side, event = named
    variance = {s: float(np.var(after.drawn[s] - before.drawn[s], ddof=1)) for s in ("all", "body", "instruments")}
    between, freedom = [], []
    usual = _USUAL.get(f"{quantity} {joint} {component}", 0.0)
    for k, one in enumerate(own):
        others = [each[k] for each in alike if each[k].count > 1]
        pooled = float(np.mean([each.spread for each in others])) if others else 0.0
        weight = min(_SHRINK, 0.5 * sum(each.count - 1 for each in others if each is not one))
        if one.count < _FEW and usual:
            pooled, weight = max(pooled, usual**2), _SHRINK
        freedom.append(max(one.count - 1 + weight, 1.0))
        between.append(((one.count - 1) * one.spread + weight * pooled) / freedom[-1] / one.count)
    stride, total = sum(between), variance["all"] + sum(between)
    rest = max(0.0, variance["all"] - variance["body"] - variance["instruments"])
    of_strides = sum(each**2 / own_freedom for each, own_freedom in zip(between, freedom, strict=True))
    limit = float(stats.t.ppf(0.975, total**2 / of_strides)) if of_strides > 0.0 else 1.96
    enough = min(one.count for one in own) > 1
    parts = (variance["instruments"], variance["body"], rest, stride)
    return Change(
        quantity=quantity,
        joint=joint,
        component=component,
        side=side,
        event=event,
        unit=_UNITS[quantity],
        before=before.mean,
        after=after.mean,
        strides=(before.count, after.count),
        sd=float(np.sqrt(total)),
        sd_by_source={source: float(np.sqrt(part)) for source, part in zip(SOURCES, parts, strict=True)},
        mdc95=limit * float(np.sqrt(total)) if enough else np.nan,
    )
