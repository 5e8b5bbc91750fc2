"""Which recordings hold the two movements that tell most of what walking leaves open: a swaying trunk, and squats.

In the package's own laboratory trunk sway as one more trial lowers the errors of moments of inertia by a third, more
than any other movement (`kinertia plan` predicts both for a person's own trials).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.trial.data import Markers

SWAY_DEG, SQUAT_M = 12.0, 0.15
"""From its mean a walking trunk leans by up to 5 degrees; a walking pelvis goes up and down by up to 0.08 m."""


@dataclass(frozen=True)
class TellingMovements:
    """How far trunk and pelvis move.

    Attributes:
        lean_deg: largest angle of the line from pelvis to torso from its mean.
        drop_m: from the highest to the lowest place of the pelvis.

    >>> TellingMovements(4.2, 0.05).sentence()
    'the trunk leans by up to 4 degrees from its mean, the pelvis moves up and down by 5 cm'
    >>> TellingMovements(4.2, 0.05).sways, TellingMovements(20.0, 0.3).squats
    (False, True)
    """

    lean_deg: float
    drop_m: float

    @classmethod
    def of(cls, markers: Markers, pelvis: Sequence[str], torso: Sequence[str]) -> TellingMovements | None:
        """From the markers with these labels; None where no frame shows all that are ever seen of both."""
        places = []
        for labels in (pelvis, torso):
            own = markers.positions[:, [markers.labels.index(label) for label in labels if label in markers.labels]]
            worn = np.isfinite(own).any(axis=(0, 2))
            if not worn.any():
                return None
            # of the same markers in every frame, or a gap would move their middle
            places.append(own[:, worn].mean(axis=1))
        shown = np.isfinite(places).all(axis=(0, 2))
        if not shown.any():
            return None
        low, high = (place[shown] for place in places)
        line = high - low
        line /= np.linalg.norm(line, axis=1, keepdims=True)
        middle = line.mean(axis=0)
        leaning = np.arccos(np.clip(line @ middle / np.linalg.norm(middle), -1.0, 1.0))
        return cls(float(np.degrees(leaning.max())), float(np.ptp(low[:, 1])))

    @property
    def sways(self) -> bool:
        """The trunk, more than in walking."""
        return self.lean_deg > SWAY_DEG

    @property
    def squats(self) -> bool:
        """Or sits down, climbs, or jumps."""
        return self.drop_m > SQUAT_M

    def sentence(self) -> str:
        """In words."""
        return (
            f"the trunk leans by up to {self.lean_deg:.0f} degrees from its mean, the pelvis moves up and down by "
            f"{100 * self.drop_m:.0f} cm"
        )


def missing_movements(movements: Iterable[TellingMovements | None]) -> str | None:
    """What recordings of a person lack, in words; None where they lack nothing, or show nothing of it."""
    known = [each for each in movements if each is not None]
    lacking = [
        name
        for name, there in (
            ("a swaying trunk", any(each.sways for each in known)),
            ("squats", any(each.squats for each in known)),
        )
        if not there
    ]
    if not known or not lacking:
        return None
    return (
        f"no trial with {' or '.join(lacking)}: of what walking leaves open, most of all inertias, a trial of it tells "
        "most (kinertia plan)"
    )
