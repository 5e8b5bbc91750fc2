"""Is the person unlike the prior? One number for all that the data say, where single parameters say little.

What the data show are combinations of parameters. Along each, the estimate's distance from the prior's mean is normal
with the variance that the data took away from the prior's, if prior and model hold; over the combinations that the data
know better than the prior, the squares add up to chi-square. A parameter may look ordinary while a combination is not.
The total mass is left out as far as scale and plates may disagree, which has a warning of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh
from scipy.special import chdtrc

from kinertia.estimation.prior import BspPrior
from kinertia.model.bsp import BodySegmentParameters

UNLIKE_CHANCE = 1e-3
"""People of the prior of whom more than this share are as far away are not called unlike it."""
_KNOWN_SHARE = 0.5
"""Share of a combination's prior variance that the data must have taken away for it to count."""


_SCALE_AGAINST_PLATES = 0.03
"""Relative deviation of the total mass here."""


@dataclass(frozen=True)
class Unlikeness:
    """How far an estimate is from its prior.

    Attributes:
        distance2: squared distance in deviations, over the combinations that the data show.
        combinations: how many these are.
        chance: share of the prior's people who are as far away or further.
        segments: those that have moved most, the furthest first.
    """

    distance2: float
    combinations: int
    chance: float
    segments: tuple[str, ...]

    @property
    def unlike(self) -> bool:
        """Whether this is hardly a person of the prior."""
        return self.chance < UNLIKE_CHANCE

    def sentence(self) -> str:
        """What that means, the likeliest causes first."""
        rounded = 10.0 ** round(np.log10(max(self.chance, 1e-9)))
        return (
            f"the person is unlike the prior: {self.combinations} combinations of parameters that the data show are "
            f"together as far from it as in 1 of {1.0 / rounded:,.0f} people, most of all "
            f"{', '.join(self.segments)}; a prosthesis ([segment.shank_l] prosthesis = true), something that was worn "
            f"or carried ([[attached]]), a body that the tables do not describe (age_years, population under "
            f"[subject]), or a wrong joint, plate or marker"
        )


def unlikeness(prior: BspPrior, estimate: BodySegmentParameters, covariance: np.ndarray) -> Unlikeness:
    """How far the estimate (with the posterior covariance of its table) is from the prior once the scale has spoken."""
    mean, before = replace(prior, mass_sd_kg=_SCALE_AGAINST_PLATES * prior.mass_kg).given_scale()
    sd = np.sqrt(np.diag(before))
    left, directions = eigh(covariance / np.outer(sd, sd), before / np.outer(sd, sd))
    shown = left < 1.0 - _KNOWN_SHARE
    moved = (estimate.table().ravel() - mean) / sd
    along = directions[:, shown].T @ moved / np.sqrt(1.0 - left[shown])
    distance2, count = float(along @ along), int(shown.sum())
    chance = float(chdtrc(count, distance2)) if count else 1.0
    far = np.abs(moved.reshape(-1, 10)).max(axis=1)
    order = np.argsort(-far)[:3]
    return Unlikeness(distance2, count, chance, tuple(estimate.segments[k] for k in order))
