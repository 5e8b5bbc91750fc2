"""Tests whether a person as a whole is unlike the prior, where single parameters say little.

What the data show are combinations of parameters. Along each, the estimate's distance from the prior's mean is normal
with the variance that the data took away from the prior's, if prior and model hold; over the combinations that the data
know better than the prior, the squares add up to chi-square. A parameter may look ordinary while a combination is not.
The total mass is left out as far as scale and plates may disagree, which has a warning of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh
from scipy.special import chdtrc

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.one_sided import OneSided, one_sided
from kinertia.model.bsp import BodySegmentParameters

UNLIKE_CHANCE = 1e-3
"""People of the prior of whom more than this share are as far away are not called unlike it."""
_KNOWN_SHARE = 0.5
"""Share of a combination's prior variance that the data must have taken away for it to count."""


_MIRRORED = (3, 8, 9)
"""Parameters that change their sign from right to left: com_z, ixz, iyz."""
_ALIKE = 0.5
"""Share of a segment's move that its other side must have made, too."""
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
        both_sides: whether the first of them and its other side have moved alike: joints that are found wrongly do so,
            a prosthesis does not.
        one_sided: the side that is heavier, where that is what departs most; the prior pulls the other side along, so
            that both may seem to have moved alike.
    """

    distance2: float
    combinations: int
    chance: float
    segments: tuple[str, ...]
    both_sides: bool
    one_sided: OneSided | None = None

    @property
    def unlike(self) -> bool:
        """Whether this is hardly a person of the prior."""
        return self.chance < UNLIKE_CHANCE


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
    by_segment = moved.reshape(-1, 10)
    order = np.argsort(-np.abs(by_segment).max(axis=1))[:3]
    segments = tuple(estimate.segments[k] for k in order)
    side = one_sided(prior, estimate, covariance)
    alike = side is None and _alike(estimate.segments, by_segment, int(order[0]))
    return Unlikeness(distance2, count, chance, segments, alike, side)


def _alike(segments: Sequence[str], moved: np.ndarray, k: int) -> bool:
    """Whether segment k and its other side have moved (s, 10) alike in what has moved most of it."""
    name = segments[k]
    other = name[:-1] + {"r": "l", "l": "r"}.get(name[-1], "")
    if name[-2:] not in ("_r", "_l") or other not in segments:
        return False
    most = int(np.argmax(np.abs(moved[k])))
    sign = -1.0 if most in _MIRRORED else 1.0
    return bool(sign * moved[segments.index(other), most] / moved[k, most] > _ALIKE)
