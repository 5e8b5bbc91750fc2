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
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import stats

from kinertia.errors import KinertiaError
from kinertia.estimation.drawn_fit import kept_draws
from kinertia.estimation.result import Fit
from kinertia.estimation.stride_features import Key, stride_features, usual_sources

Verdict = Literal["changed", "not shown", "cannot be judged"]
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
        p: probability of at least this difference without any change.
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
    p: float = np.nan

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
    condition = {trial.name: trial.kinematics.trial.condition for trial in chosen}
    found = stride_features(fit, chosen, usual_sources(fit), min(DRAWS, kept_draws(fit).count), progress)
    of_condition = [np.array([condition[trial] == name for trial, *_ in found.keys]) for name in (before, after)]
    return tuple(_judged(found.keys, found.estimate, found.drawn, of_condition))


@dataclass(frozen=True)
class Condition:
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


Parts = Callable[[str, Condition, Condition], dict[str, float]]
"""Variances of an outcome's difference between two conditions by SOURCES, without strides."""


def _judged(
    keys: Sequence[Key], estimate: np.ndarray, drawn: Mapping[str, np.ndarray], of_condition: Sequence[np.ndarray]
) -> Iterator[Change]:
    """Yield the changes of all outcomes that both conditions of one estimate show."""
    before, after = (conditions_by_outcome(keys, estimate, drawn, mask) for mask in of_condition)
    return judged(before, after, _paired)


def conditions_by_outcome(
    keys: Sequence[Key], estimate: np.ndarray, drawn: Mapping[str, np.ndarray], mask: np.ndarray | None = None
) -> dict[str, Condition]:
    """Return the strides (in `mask`, if given) of each outcome: "moment knee_adduction loading r"."""
    named = np.array([f"{name} {side}" for _, name, side, _ in keys])
    chosen = np.ones(len(named), dtype=bool) if mask is None else mask
    found = {name: _condition(estimate, drawn, (named == name) & chosen) for name in dict.fromkeys(named.tolist())}
    return {name: one for name, one in found.items() if one.count > 0}


def judged(before: Mapping[str, Condition], after: Mapping[str, Condition], parts: Parts) -> Iterator[Change]:
    """Yield the changes of all outcomes that both conditions show."""
    cells = {name: (before[name], after[name]) for name in before if name in after}
    for outcome, own in cells.items():
        quantity, rest, event_side = outcome.split(" ", 2)
        group = f"{quantity} {rest.partition('_')[0]}"
        alike = [other for name, other in cells.items() if name.startswith(f"{group}_") or name.startswith(f"{group} ")]
        event, _, side = event_side.rpartition(" ")
        joint, _, component = rest.partition("_")
        named = quantity, joint, _COMPONENTS.get(component, component), side, event
        yield _change(named, own, alike, parts(outcome, *own))


def _paired(_: str, before: Condition, after: Condition) -> dict[str, float]:
    """Return variances over draws of one estimate, in which errors of both conditions belong together."""
    total, body, instruments = (
        float(np.var(after.drawn[source] - before.drawn[source], ddof=1)) for source in ("all", "body", "instruments")
    )
    return parts_of(total, instruments, body)


def parts_of(total: float, instruments: float, body: float) -> dict[str, float]:
    """Return the parts of a variance by SOURCES, without strides; what is left is due to markers and motion."""
    share = min(1.0, total / max(instruments + body, 1e-300))
    return {
        "instruments": share * instruments,
        "body": share * body,
        "markers": max(0.0, total - instruments - body),
    }


def _condition(estimate: np.ndarray, drawn: Mapping[str, np.ndarray], mask: np.ndarray) -> Condition:
    seen = mask & np.isfinite(estimate)
    seen[seen] = np.isfinite(drawn["all"][:, seen]).all(axis=0)
    count = int(seen.sum())
    if count == 0:
        return Condition(np.nan, 0, {}, 0.0)
    means = {source: rows[:, seen].mean(axis=1) for source, rows in drawn.items()}
    spread = 0.0
    if count > 1:
        departures = drawn["all"][:, seen] - drawn["all"][:, seen].mean(axis=0)
        measured = np.var(departures, axis=1, ddof=1).mean()
        spread = max(0.0, float(np.var(estimate[seen], ddof=1) - measured))
    return Condition(float(estimate[seen].mean()), count, means, spread)


def _change(
    named: tuple[str, str, str, str, str],
    own: Sequence[Condition],
    alike: Sequence[Sequence[Condition]],
    measured: Mapping[str, float],
) -> Change:
    before, after = own
    quantity, joint, component, side, event = named
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
    variances = {**measured, "stride": sum(between)}
    total = sum(variances.values())
    of_strides = sum(each**2 / own_freedom for each, own_freedom in zip(between, freedom, strict=True))
    of_sd = stats.t(total**2 / of_strides) if of_strides > 0.0 else stats.norm()
    sd = float(np.sqrt(total))
    enough = min(one.count for one in own) > 1
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
        sd=sd,
        sd_by_source={source: float(np.sqrt(variances[source])) for source in SOURCES},
        mdc95=float(of_sd.ppf(0.975)) * sd if enough else np.nan,
        p=float(2.0 * of_sd.sf(abs(after.mean - before.mean) / max(sd, 1e-300))) if enough else np.nan,
    )
