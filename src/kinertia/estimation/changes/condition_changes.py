"""Tests what changed between two conditions of one session: joint moments and angles, event by event.

Feature f is the mean of a curve over a phase between contacts (`EVENTS`). Of conditions A and B,

    d = mean f_B - mean f_A,        Var d = V + s_A^2 / n_A + s_B^2 / n_B,

the means over the n strides of each. V is the variance of mean f_B - mean f_A over posterior draws of one estimate from
all trials: what they share (body, plates, markers left in place) cancels. s is the spread from stride to stride beyond
what V leaves between strides of one condition, each condition's own. It is shrunk to the mean square of the joint's
features, which count for at most SHRINK degrees of freedom. A change is shown where |d| exceeds t(0.975) standard
deviations, with degrees of freedom by Satterthwaite (1946, Biometrics Bulletin 2:110).
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TypeVar

import numpy as np

from kinertia.errors import KinertiaError
from kinertia.estimation.changes.change import SOURCES, UNITS, Change, named_outcome, shown_from
from kinertia.estimation.changes.stride_features import Rows, StrideFeatures, stride_features, usual_sources
from kinertia.estimation.result.drawn_fit import kept_draws
from kinertia.estimation.result.fit import Fit

Spread = TypeVar("Spread", float, np.ndarray)
DRAWS = 80
SHRINK = 6.0
FEW = 3
USUAL = {
    "moment hip flexion": 0.037,
    "moment hip adduction": 0.028,
    "moment hip rotation": 0.009,
    "moment knee flexion": 0.042,
    "moment knee adduction": 0.023,
    "moment knee rotation": 0.008,
    "moment ankle flexion": 0.063,
    "moment ankle adduction": 0.029,
    "moment ankle rotation": 0.010,
    "moment lumbar flexion": 0.010,
    "moment lumbar bending": 0.010,
    "moment lumbar rotation": 0.004,
    "angle pelvis tilt": 0.6,
    "angle pelvis list": 0.6,
    "angle pelvis rotation": 1.3,
    "angle hip flexion": 1.1,
    "angle hip adduction": 0.8,
    "angle hip rotation": 2.0,
    "angle knee flexion": 1.6,
    "angle ankle flexion": 1.0,
    "angle subtalar flexion": 2.4,
    "angle lumbar extension": 1.4,
    "angle lumbar bending": 0.7,
    "angle lumbar rotation": 0.7,
}
"""Spread from stride to stride (N m/kg, degrees) of normal walks of four people of three laboratories, the larger
of two means where they differ. It is the least that is assumed with fewer strides of a condition than FEW."""


def conditions_of(fit: Fit) -> dict[str, list[str]]:
    """Return the names of the trials of each condition."""
    result: dict[str, list[str]] = {}
    for trial in fit.trials:
        result.setdefault(trial.kinematics.trial.condition, []).append(trial.name)
    return result


def condition_among(stated: Collection[str], person: str, wanted: str | None) -> str:
    """Return the condition that is compared: the wanted one, or the only one that a person's trials state.

    Args:
        stated: conditions of all trials, "" where none is stated.
        person: whose trials they are.
        wanted: by the user; None if all trials should state the same.

    Raises:
        KinertiaError: no trial states it, or trials state several and none is wanted.

    Examples:
        >>> condition_among(["normal", "toe out"], "Anna", "toe-out")
        Traceback (most recent call last):
        ...
        kinertia.errors.KinertiaError: no trial of Anna has the condition 'toe-out'; stated are: normal, toe out \
(nearest: 'toe out')
    """
    known = sorted({condition for condition in stated if condition})
    if wanted is None and len(set(stated)) == 1:
        return next(iter(stated))
    if wanted is None:
        names = ", ".join(repr(name) for name in sorted(set(stated)))
        raise KinertiaError(f"trials of {person} state several conditions ({names}): choose by --conditions")
    if wanted in stated:
        return wanted
    if not known:
        problem = f"state it in the subject file, as condition = {wanted!r} under each [[trial]]; stated are: none"
        raise KinertiaError(f"no trial of {person} has the condition {wanted!r}: {problem}")
    near = get_close_matches(wanted, known, n=1, cutoff=0.5)
    hint = f" (nearest: {near[0]!r})" if near else ""
    raise KinertiaError(f"no trial of {person} has the condition {wanted!r}; stated are: {', '.join(known)}{hint}")


def expect_two(before: str, after: str) -> None:
    """Raise an error unless these are two conditions."""
    if before == after:
        raise KinertiaError(f"both conditions are {before!r}; choose two")


def condition_features(
    fit: Fit, before: str, after: str, progress: Callable[[float], None] = lambda share: None
) -> tuple[StrideFeatures, dict[str, str]]:
    """Compute the features of the strides of two conditions in one estimate, and the condition of each trial.

    Args:
        fit: by the simultaneous estimate; its trials state their `condition`.
        before, after: the conditions.
        progress: is told the share done.

    Raises:
        KinertiaError: no trial states one of the conditions, both are the same, or the fit has no posterior draws.
    """
    expect_two(before, after)
    for wanted in (before, after):
        condition_among(conditions_of(fit), fit.subject.name, wanted)
    chosen = tuple(trial for trial in fit.trials if trial.kinematics.trial.condition in (before, after))
    condition = {trial.name: trial.kinematics.trial.condition for trial in chosen}
    found = stride_features(fit, chosen, usual_sources(fit), min(DRAWS, kept_draws(fit).count), progress)
    return found, condition


def masks_of(rows: Rows, condition: Mapping[str, str], *names: str) -> list[np.ndarray]:
    """Return the masks of the rows of each condition."""
    return [np.array([condition[trial] == name for trial, *_ in rows.keys], dtype=bool) for name in names]


@dataclass(frozen=True)
class Condition:
    """Strides of one outcome in one condition.

    Attributes:
        mean, count: over the strides.
        drawn: by source (n,) the mean in each draw; of "contacts" its departures.
        spread: variance from stride to stride beyond what is measured; zero with fewer than two.
    """

    mean: float
    count: int
    drawn: Mapping[str, np.ndarray]
    spread: float


Parts = Callable[[str, Condition, Condition], dict[str, float]]
"""Variances of an outcome's difference between two conditions by SOURCES, without strides."""


def changes_of_strides(rows: Rows, of_condition: Sequence[np.ndarray]) -> Iterator[Change]:
    """Yield the changes of all outcomes that both conditions of one estimate show, by the rows (k,) of each."""
    before, after = (conditions_by_outcome(rows, mask) for mask in of_condition)
    return judged(before, after, _paired)


def conditions_by_outcome(rows: Rows, mask: np.ndarray | None = None) -> dict[str, Condition]:
    """Return the strides (in `mask`, if given) of each outcome: "moment knee_adduction loading r"."""
    named = np.array([f"{name} {side}" for _, name, side, _ in rows.keys])
    chosen = np.ones(len(named), dtype=bool) if mask is None else mask
    found = {
        name: _condition(rows.estimate, rows.drawn, (named == name) & chosen) for name in dict.fromkeys(named.tolist())
    }
    return {name: condition for name, condition in found.items() if condition.count > 0}


def judged(before: Mapping[str, Condition], after: Mapping[str, Condition], parts: Parts) -> Iterator[Change]:
    """Yield the changes of all outcomes that both conditions show."""
    cells = {name: (before[name], after[name]) for name in before if name in after}
    for outcome, compared in cells.items():
        quantity, rest, event_side = outcome.split(" ", 2)
        group = f"{quantity} {rest.partition('_')[0]}"
        alike = [other for name, other in cells.items() if name.startswith(f"{group}_") or name.startswith(f"{group} ")]
        event, _, side = event_side.rpartition(" ")
        named = (*named_outcome(f"{quantity} {rest}"), side, event)
        yield _change(named, compared, alike, parts(outcome, *compared))


def _paired(_: str, before: Condition, after: Condition) -> dict[str, float]:
    """Return variances over draws of one estimate, in which errors of both conditions belong together."""
    total, body, instruments = (
        float(np.var(after.drawn[source] - before.drawn[source], ddof=1)) for source in ("all", "body", "instruments")
    )
    contacts = float(np.square(after.drawn["contacts"] - before.drawn["contacts"]).sum())
    return parts_of(total + contacts, instruments, body)


def parts_of(total: float, instruments: float, body: float) -> dict[str, float]:
    """Return the parts of a variance by SOURCES, without strides; what is left is due to markers and motion."""
    share = min(1.0, total / max(instruments + body, 1e-300))
    return {
        "instruments": share * instruments,
        "body": share * body,
        "markers": max(0.0, total - instruments - body),
    }


def spread_beyond(estimate: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return the variance (...) between k >= 2 strides (k, ...) beyond what draws (n, k, ...) of them leave."""
    departures = drawn - drawn.mean(axis=0)
    measured = np.var(departures, axis=1, ddof=1).mean(axis=0)
    return np.asarray(np.maximum(np.var(estimate, axis=0, ddof=1) - measured, 0.0))


def shrunk(spread: Spread, count: int, pooled: float, weight: float) -> tuple[Spread, float]:
    """Return a variance of this many strides, shrunk to a pooled one of this weight, and its degrees of freedom."""
    freedom = max(count - 1 + weight, 1.0)
    return ((count - 1) * spread + weight * pooled) / freedom, freedom


def _condition(estimate: np.ndarray, drawn: Mapping[str, np.ndarray], mask: np.ndarray) -> Condition:
    seen = mask & np.isfinite(estimate)
    seen[seen] = np.isfinite(drawn["all"][:, seen]).all(axis=0)
    count = int(seen.sum())
    if count == 0:
        return Condition(np.nan, 0, {}, 0.0)
    means = {source: rows[:, seen].mean(axis=1) for source, rows in drawn.items()}
    spread = 0.0
    if count > 1:
        spread = float(spread_beyond(estimate[seen], drawn["all"][:, seen]))
    return Condition(float(estimate[seen].mean()), count, means, spread)


def _change(
    named: tuple[str, str, str, str, str],
    compared: Sequence[Condition],
    alike: Sequence[Sequence[Condition]],
    measured: Mapping[str, float],
) -> Change:
    before, after = compared
    quantity, joint, component, side, event = named
    strides, between, freedom = [], [], []
    usual = USUAL.get(f"{quantity} {joint} {component}", 0.0)
    for k, condition in enumerate(compared):
        others = [outcome_conditions[k] for outcome_conditions in alike if outcome_conditions[k].count > 1]
        pooled = float(np.mean([other.spread for other in others])) if others else 0.0
        weight = min(SHRINK, 0.5 * sum(other.count - 1 for other in others if other is not condition))
        if condition.count < FEW and usual:
            pooled, weight = max(pooled, usual**2), SHRINK
        variance, own_freedom = shrunk(condition.spread, condition.count, pooled, weight)
        strides.append(variance)
        freedom.append(own_freedom)
        between.append(variance / condition.count)
    variances = {**measured, "stride": sum(between)}
    total = sum(variances.values())
    of_strides = sum(
        stride_variance**2 / own_freedom for stride_variance, own_freedom in zip(between, freedom, strict=True)
    )
    enough = min(condition.count for condition in compared) > 1
    of_sd = (total**2 / of_strides if of_strides > 0.0 else np.inf) if enough else np.nan
    sd = float(np.sqrt(total))
    mdc95, p = shown_from(after.mean - before.mean, sd, of_sd)
    return Change(
        quantity=quantity,
        joint=joint,
        component=component,
        side=side,
        event=event,
        unit=UNITS[quantity],
        before=before.mean,
        after=after.mean,
        strides=(before.count, after.count),
        sd=sd,
        sd_by_source={source: float(np.sqrt(variances[source])) for source in SOURCES},
        mdc95=mdc95,
        p=p,
        stride_sd=(float(np.sqrt(strides[0])), float(np.sqrt(strides[1]))),
        assumed=bool(usual) and min(condition.count for condition in compared) < FEW,
    )
