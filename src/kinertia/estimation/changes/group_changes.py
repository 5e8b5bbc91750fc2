"""Averages the changes of a group, each person before and after: a paired comparison.

The deviation of the changes between people contains each person's own error of measurement. What remains without it,

    s_true^2 = max(0, s^2 - mean sd_i^2),

is how differently people changed. The mean change has the standard error s / sqrt(n), errors of measurement included,
as long as they are independent from person to person: an error of plates that everyone shares is not in it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.changes.change import Change, NamedOutcome, Names


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
