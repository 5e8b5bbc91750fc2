"""Compares whole curves of joint moments and angles between two conditions, with a simultaneous band of the difference.

The deviation SD of the difference at each percent has the parts of `condition_changes`. A band d +- c SD holds the true
difference everywhere with 95 %, if c is exceeded by the maximum over the phase of |d_i| / SD in 5 % of simulated
differences d_i. These are posterior draws of the difference, and deviations of strides of the conditions, mixed at
random, over a spread that is known with few degrees of freedom.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.changes.change import UNITS, named_outcome
from kinertia.estimation.changes.condition_changes import FEW, SHRINK, USUAL, shrunk, spread_beyond
from kinertia.estimation.changes.stride_features import Rows
from kinertia.estimation.result.mean_cycles import common_strides
from kinertia.motion.gait_cycle import PERCENT

_SIMULATED = 2000
_SEED = 68
_SHARE = 0.95


@dataclass(frozen=True, eq=False)
class CurveChange:
    """One curve of two conditions.

    Attributes:
        quantity, joint, component, side, unit: as of `Change`.
        phase: "stride" (heel strike to heel strike) or "stance" (foot contact to foot off): what 100 % are.
        strides: number of strides of each condition.
        before, after: (101,) means; NaN where not known.
        before_sd, after_sd: (101,) standard deviations of these means.
        sd: (101,) of the difference.
        factor: of `sd` in the simultaneous band; NaN with fewer than two strides of a condition.

    Examples:
        >>> found = kinertia.compare("out", conditions=("normal", "toes out"))  # doctest: +SKIP
        >>> [curve.title for curve in found.curves if curve.changed.any()]  # doctest: +SKIP
    """

    quantity: str
    joint: str
    component: str
    side: str
    unit: str
    phase: str
    strides: tuple[int, int]
    before: np.ndarray
    after: np.ndarray
    before_sd: np.ndarray
    after_sd: np.ndarray
    sd: np.ndarray
    factor: float

    @property
    def difference(self) -> np.ndarray:
        """After minus before (101,)."""
        change: np.ndarray = self.after - self.before
        return change

    @property
    def band(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper end (101,) of the simultaneous 95 % band of the difference."""
        return self.difference - self.factor * self.sd, self.difference + self.factor * self.sd

    @property
    def changed(self) -> np.ndarray:
        """Mask (101,) of where the band leaves out zero."""
        low, high = self.band
        outside: np.ndarray = (low > 0.0) | (high < 0.0)
        return outside


@dataclass(frozen=True, eq=False)
class CurveCondition:
    """Curves of one condition.

    Attributes:
        mean: (101,) over the strides.
        count: of strides.
        departures: by source (n, 101) of the mean in each draw, and by contacts.
        residuals: (count, 101) of the strides from their mean.
        spread: (101,) variance from stride to stride beyond what is measured.
    """

    mean: np.ndarray
    count: int
    departures: Mapping[str, np.ndarray]
    residuals: np.ndarray
    spread: np.ndarray


Measured = Callable[[CurveCondition, CurveCondition], tuple[np.ndarray, Sequence[np.ndarray]]]
"""Variance (101,) of a difference without strides, and departures (n, 101) whose sum is its error."""


def paired(before: CurveCondition, after: CurveCondition) -> tuple[np.ndarray, Sequence[np.ndarray]]:
    """Return the error of a difference in one estimate, in which errors of both conditions belong together."""
    together = after.departures["all"] - before.departures["all"]
    contacts = np.square(after.departures["contacts"] - before.departures["contacts"]).sum(axis=0)
    return together.var(axis=0, ddof=1) + contacts, (together,)


def apart(before: CurveCondition, after: CurveCondition) -> tuple[np.ndarray, Sequence[np.ndarray]]:
    """Return the error of a difference of two sessions of one body."""
    rest = sum(condition.departures["rest"].var(axis=0, ddof=1) for condition in (before, after))
    shared = (after.departures["shared"] - before.departures["shared"]).var(axis=0, ddof=1)
    contacts = sum(np.square(condition.departures["contacts"]).sum(axis=0) for condition in (before, after))
    return rest + shared + contacts, (before.departures["rest"], after.departures["rest"])


def curve_changes(before: Rows, after: Rows, measured: Measured) -> Iterator[CurveChange]:
    """Compare all curves that both conditions show; of strides and stances those of which both have more.

    Args:
        before, after: rows of curves of each condition.
        measured: `paired` or `apart`.
    """
    first, second = (_conditions(rows) for rows in (before, after))
    best: dict[tuple[str, str], str] = {}
    for name, side, phase in first:
        if (name, side, phase) in second:
            count = min(condition[name, side, phase].count for condition in (first, second))
            known = best.get((name, side))
            if known is None or count > min(condition[name, side, known].count for condition in (first, second)):
                best[name, side] = phase
    random = np.random.default_rng(_SEED)
    for (name, side), phase in best.items():
        compared = first[name, side, phase], second[name, side, phase]
        opposite = {"r": "l", "l": "r"}.get(side, side)
        mirrored = [
            conditions.get((name, opposite, best.get((name, opposite), phase))) for conditions in (first, second)
        ]
        yield _compared(name, side, phase, compared, mirrored, measured, random)


def rows_of(rows: Rows, mask: np.ndarray) -> Rows:
    """Return some rows."""
    keys = tuple(key for key, is_own in zip(rows.keys, mask, strict=True) if is_own)
    return Rows(keys, rows.estimate[mask], {source: drawn[:, mask] for source, drawn in rows.drawn.items()})


def _conditions(rows: Rows) -> dict[tuple[str, str, str], CurveCondition]:
    named: dict[tuple[str, str, str], list[int]] = {}
    for row, (_, name, side, stride) in enumerate(rows.keys):
        named.setdefault((name, side, stride.split()[0]), []).append(row)
    result = {}
    for curve, some in named.items():
        members = np.array(some)
        chosen = members[common_strides(rows.estimate[members])]
        if len(chosen):
            result[curve] = _condition(rows.estimate[chosen], {s: drawn[:, chosen] for s, drawn in rows.drawn.items()})
    return result


def _condition(curves: np.ndarray, drawn: Mapping[str, np.ndarray]) -> CurveCondition:
    means = {source: rows.mean(axis=1) for source, rows in drawn.items()}
    residuals = curves - curves.mean(axis=0)
    spread = np.zeros(len(PERCENT))
    if len(curves) > 1:
        spread = spread_beyond(curves, drawn["all"])
    departed = {
        source: of_source - (0.0 if source == "contacts" else of_source.mean(axis=0))
        for source, of_source in means.items()
    }
    return CurveCondition(curves.mean(axis=0), len(curves), departed, residuals, spread)


def _compared(
    name: str,
    side: str,
    phase: str,
    compared: tuple[CurveCondition, CurveCondition],
    mirrored: Sequence[CurveCondition | None],
    measured: Measured,
    random: np.random.Generator,
) -> CurveChange:
    before, after = compared
    quantity, joint, component = named_outcome(name)
    usual = USUAL.get(f"{quantity} {joint} {component}", 0.0)
    variance, departures = measured(before, after)
    of_strides, freedom = zip(*(_of_strides(condition, usual) for condition in compared), strict=True)
    total = variance + of_strides[0] + of_strides[1]
    of_each = [condition.departures["all"].var(axis=0, ddof=1) for condition in compared]
    judged = min(condition.count for condition in compared) > 1
    factor = np.nan
    if judged:
        errors = _departed(departures, variance, random)
        for condition, of_one, freely, mirror in zip(compared, of_strides, freedom, mirrored, strict=True):
            errors = errors + _strayed(condition, mirror, of_one, freely, random)
        with np.errstate(invalid="ignore", divide="ignore"):
            most = np.nanmax(np.where(total > 0.0, np.abs(errors) / np.sqrt(total), 0.0), axis=1)
        factor = float(np.quantile(most, _SHARE))
    return CurveChange(
        quantity,
        joint,
        component,
        side,
        UNITS[quantity],
        phase,
        (before.count, after.count),
        before.mean,
        after.mean,
        np.sqrt(of_each[0] + of_strides[0]),
        np.sqrt(of_each[1] + of_strides[1]),
        np.sqrt(total),
        factor,
    )


def _of_strides(condition: CurveCondition, usual: float) -> tuple[np.ndarray, float]:
    """Return the variance (101,) that strides leave in a mean, and its degrees of freedom."""
    pooled = float(np.nanmean(condition.spread)) if np.isfinite(condition.spread).any() else 0.0
    if condition.count < FEW:
        pooled = max(pooled, usual**2)
    variance, freedom = shrunk(condition.spread, condition.count, pooled, SHRINK)
    return variance / condition.count, freedom


def _departed(departures: Sequence[np.ndarray], variance: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Simulate errors (_SIMULATED, 101) of this variance that vary over the phase as the departures do."""
    mixed = np.zeros((_SIMULATED, len(PERCENT)))
    for departure in departures:
        mixed += random.standard_normal((_SIMULATED, len(departure))) @ (departure / np.sqrt(len(departure) - 1))
    found = sum(departure.var(axis=0, ddof=1) for departure in departures)
    return np.asarray(mixed * np.sqrt(variance / np.maximum(found, 1e-300)))


def _strayed(
    condition: CurveCondition,
    mirrored: CurveCondition | None,
    variance: np.ndarray,
    freedom: float,
    random: np.random.Generator,
) -> np.ndarray:
    """Simulate deviations (_SIMULATED, 101) of this variance, mixed from those of strides of both sides."""
    shapes = [
        side_condition.residuals
        for side_condition in (condition, mirrored)
        if side_condition is not None and side_condition.count > 1
    ]
    mixed = np.concatenate(shapes)
    mixed = np.where(np.isfinite(mixed), mixed, 0.0)
    mixed = mixed / np.maximum(np.sqrt(np.square(mixed).sum(axis=0)), 1e-300)
    wider = np.sqrt(freedom / random.chisquare(freedom, (_SIMULATED, 1)))
    return np.asarray(random.standard_normal((_SIMULATED, len(mixed))) @ mixed * np.sqrt(variance) * wider)
