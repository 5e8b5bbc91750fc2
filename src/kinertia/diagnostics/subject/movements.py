"""Do the trials include trunk sway and squats, the two movements that complement walking best?

In the synthetic laboratory, adding a trial of trunk sway lowers the errors of moments of inertia by a third, more than
any other movement (`kinertia plan` predicts both for a person's own trials).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.person_context import PersonContext
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import Markers

SWAY_RAD, SQUAT_M = float(np.radians(12.0)), 0.15
"""A walking trunk leans by up to 5 degrees from its mean; a walking pelvis moves up and down by up to 0.08 m."""


@dataclass(frozen=True)
class InformativeMovements:
    """Range of movement of trunk and pelvis.

    Attributes:
        trunk_lean_rad: largest angle of the line from pelvis to torso from its mean.
        drop_m: distance from the highest to the lowest position of the pelvis.

    >>> InformativeMovements(0.073, 0.05).sentence()
    'the trunk leans by up to 4 degrees from its mean, the pelvis moves up and down by 5 cm'
    >>> InformativeMovements(0.07, 0.05).sways, InformativeMovements(0.35, 0.3).squats
    (False, True)
    """

    trunk_lean_rad: float
    drop_m: float

    @classmethod
    def of(cls, markers: Markers, pelvis: Sequence[str], torso: Sequence[str]) -> Self | None:
        """Compute the movement from markers with these labels; None where no frame shows all that are ever visible."""
        middles = []
        for labels in (pelvis, torso):
            own = markers.positions[:, [markers.labels.index(label) for label in labels if label in markers.labels]]
            used = np.isfinite(own).any(axis=(0, 2))
            if not used.any():
                return None
            # of the same markers in every frame, or a gap would move their middle
            middles.append(own[:, used].mean(axis=1))
        shown = np.isfinite(middles).all(axis=(0, 2))
        if not shown.any():
            return None
        low, high = (middle[shown] for middle in middles)
        line = high - low
        line /= np.linalg.norm(line, axis=1, keepdims=True)
        mean = line.mean(axis=0)
        lean = np.arccos(np.clip(line @ mean / np.linalg.norm(mean), -1.0, 1.0))
        return cls(float(lean.max()), float(np.ptp(low[:, 1])))

    @property
    def sways(self) -> bool:
        """Whether the trunk sways more than in walking."""
        return self.trunk_lean_rad > SWAY_RAD

    @property
    def squats(self) -> bool:
        """Whether the person squats, or sits down, climbs, or jumps."""
        return self.drop_m > SQUAT_M

    def sentence(self) -> str:
        """Describe the movement in words."""
        return (
            f"the trunk leans by up to {np.degrees(self.trunk_lean_rad):.0f} degrees from its mean, "
            f"the pelvis moves up and down by {100 * self.drop_m:.0f} cm"
        )


def informative_movements(context: PersonContext) -> Iterator[Finding]:
    """Report S312: no trial with forces shows trunk sway, or none shows squats."""
    measured = [movements_of(one) for one in context.trials if one.plates is not None]
    known = [one for one in measured if one is not None]
    lacking = [
        name
        for name, there in (
            ("trunk sway", any(one.sways for one in known)),
            ("squats", any(one.squats for one in known)),
        )
        if not there
    ]
    if known and lacking:
        yield finding(
            "S312",
            movements=Quantity(" or ".join(lacking)),
            lean_rad=Quantity(max(one.trunk_lean_rad for one in known), "rad", limit=SWAY_RAD),
            drop_m=Quantity(max(one.drop_m for one in known), "m", limit=SQUAT_M),
        )


def movements_of(context: RecordingContext) -> InformativeMovements | None:
    """Compute how far trunk and pelvis move in a recording; None where its markers do not show both."""
    segments = {} if context.marker_set is None else context.marker_set.segments
    return InformativeMovements.of(context.all_markers, *(segments.get(name, ()) for name in ("pelvis", "torso")))
