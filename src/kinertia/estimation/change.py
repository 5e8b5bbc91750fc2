"""Defines the change of one outcome between two conditions, with what makes it uncertain."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import stats

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
        stride_sd: spread from stride to stride of each condition, as judged by.
        assumed: whether that spread is at least the usual one, since a condition has fewer than three strides.
        doubt: what keeps it from being judged, besides fewer than two strides of a condition.

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
        spread = float(np.square(self.stride_sd).sum())
        shared = self.sd**2 - self.sd_by_source["stride"] ** 2
        counts = np.arange(2, MOST_WALKS + 1)
        limits = stats.t.ppf(0.975, 2 * (counts - 1)) + stats.norm.ppf(_POWER)
        enough = np.flatnonzero(limits * np.sqrt(max(shared, 0.0) + spread / counts) <= abs(change))
        return int(counts[enough[0]]) if len(enough) else None

    @property
    def primary(self) -> bool:
        """Whether the outcome was named beforehand."""
        return (self.quantity, self.joint, self.component, self.event) in PRIMARY


def named_outcome(name: str) -> tuple[str, str, str]:
    """Return quantity, joint and component of "moment knee_adduction" or "angle knee_angle".

    >>> named_outcome("angle knee_angle"), named_outcome("moment hip_rotation")
    (('angle', 'knee', 'flexion'), ('moment', 'hip', 'rotation'))
    """
    quantity, _, rest = name.partition(" ")
    joint, _, component = rest.partition("_")
    return quantity, joint, {"angle": "flexion"}.get(component, component)
