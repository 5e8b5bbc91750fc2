"""Compares left and right limbs, and tests whether a person, or one of the sides, is far from the prior.

The data determine combinations of parameters. Along each, the estimate's distance from the prior's mean is normal with
the variance that the data removed from the prior's, if prior and model hold; over the combinations that the data
determine better than the prior, the squares sum to chi-square. A parameter may look ordinary while a combination is
not. The total mass is excluded as far as scale and plates may disagree, which has a warning of its own.

People's left and right are similar (the prior's correlation is 0.9), so a wrong mass of one leg also changes the other
leg: both sides change in a similar way, but their difference is not usual. So differences are judged, in standard
deviations of people's differences. In walks with an undeclared prosthesis, cast or ankle weight, the mass of a foot or
a shank differs by 4 to 8 of them, and centres of mass across the limb by 1. A load that is on no plate for a while, a
handrail or one delayed plate also makes centres of mass differ by 6 and more. Errors of plates, synchronisation and
joints make nothing differ by more than 2, except the zero offset of a plate's vertical force.

In the prior left and right are similar but not equal (correlation 0.9). A difference that the data do not show follows
from the measured lengths of the two sides, and its uncertainty shows how much larger it may be.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh
from scipy.special import chdtrc

from kinertia.estimation.prior import BspPrior
from kinertia.model.bsp import MIRROR_SIGNS, PARAMETERS, BodySegmentParameters, partners

UNLIKE_CHANCE = 1e-3
"""Share of the prior's people at the same or a larger distance, below which a person counts as implausible."""
_KNOWN_SHARE = 0.5
"""Share of a combination's prior variance that the data must have removed for it to count."""
_MIRRORED = (3, 8, 9)
"""Parameters whose sign differs between right and left: com_z, ixz, iyz."""
_ALIKE = 0.5
"""Share of a segment's change that its other side must show, too."""
_SCALE_AGAINST_PLATES = 0.03
"""Relative standard deviation of the total mass in this test."""
_BEYOND_SD = 4.0
"""Standard deviations above which a difference of masses is not anatomical: a vertical zero offset of 50 N of one plate
makes up to 3.5."""
_ACROSS = 0.5
"""Largest difference of centres of mass across the limbs, relative to the difference of masses, both in standard
deviations."""
_WITH_IT = 0.5
"""Share of the largest difference above which another pair is reported, too."""
BEYOND_SD = 2.81
"""Standard deviations beyond which one of a pair's ten parameters differs: by chance in at most 5 % of equal pairs
(Bonferroni)."""


@dataclass(frozen=True)
class OneSided:
    """Mass asymmetry between one side and the other.

    Attributes:
        heavier, lighter: segments, from the trunk outwards, and their other sides.
        more_kg: by how much each of them is heavier.
        times: the largest difference, in standard deviations of people's.
        added: whether the heavier side is farther from the prior; else the lighter one is.
    """

    heavier: tuple[str, ...]
    lighter: tuple[str, ...]
    more_kg: tuple[float, ...]
    times: float
    added: bool


def one_sided(prior: BspPrior, estimate: BodySegmentParameters, covariance: np.ndarray) -> OneSided | None:
    """Return the side that is heavier, if that is the largest of all differences between the sides; else None.

    Args:
        prior, estimate: of the same segments.
        covariance: posterior covariance of the estimate's table.
    """
    after = {pair.segment: pair for pair in asymmetries(estimate, covariance)}
    before = {pair.segment: pair for pair in asymmetries(prior.mean, prior.covariance)}
    names = [name for name in after if name in before]
    if not names:
        return None
    moved = np.array([after[name].difference - before[name].difference for name in names])
    away = moved / np.array([before[name].sd for name in names])
    masses, across = away[:, 0], np.abs(away[:, [1, 3]]).max()
    most = float(masses[np.argmax(np.abs(masses))])
    if abs(most) < max(_BEYOND_SD, across / _ACROSS):
        return None
    named = np.flatnonzero(masses * np.sign(most) >= _WITH_IT * abs(most))
    heavier, lighter = ("_r", "_l") if most > 0 else ("_l", "_r")
    rows = [estimate.segments.index(f"{names[k]}{side}") for k in named for side in ("_r", "_l")]
    mass_departures = ((estimate.mass_kg - prior.mean.mass_kg) / prior.sd[:, 0])[rows]
    return OneSided(
        tuple(names[k] + heavier for k in named),
        tuple(names[k] + lighter for k in named),
        tuple(abs(float(after[names[k]].difference[0])) for k in named),
        abs(most),
        bool(mass_departures.sum() > 0),
    )


@dataclass(frozen=True)
class MahalanobisDistance:
    """Distance of an estimate from its prior.

    Attributes:
        distance2: squared distance in standard deviations, over the combinations that the data determine.
        combinations: number of these.
        chance: share of the prior's people at the same or a larger distance.
        segments: those that have changed most, the largest change first.
        both_sides: whether the first of them and its other side have changed equally: misplaced joint centres have this
            effect, a prosthesis does not.
        one_sided: the heavier side, if mass asymmetry is the largest difference; through the prior the other side
            changes too, so that both may seem to have changed equally.
    """

    distance2: float
    combinations: int
    chance: float
    segments: tuple[str, ...]
    both_sides: bool
    one_sided: OneSided | None = None

    @property
    def implausible(self) -> bool:
        """Whether the person is implausible under the prior."""
        return self.chance < UNLIKE_CHANCE


def mahalanobis_distance(
    prior: BspPrior, estimate: BodySegmentParameters, covariance: np.ndarray
) -> MahalanobisDistance:
    """Compute the distance of the estimate (with its table's posterior covariance) from the prior given the scale."""
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
    return MahalanobisDistance(distance2, count, chance, segments, alike, side)


def _alike(segments: Sequence[str], moved: np.ndarray, k: int) -> bool:
    """Decide whether segment k and its other side changed (s, 10) equally in the parameter that changed most."""
    name = segments[k]
    opposite = name[:-1] + {"r": "l", "l": "r"}.get(name[-1], "")
    if name[-2:] not in ("_r", "_l") or opposite not in segments:
        return False
    most = int(np.argmax(np.abs(moved[k])))
    sign = -1.0 if most in _MIRRORED else 1.0
    return bool(sign * moved[segments.index(opposite), most] / moved[k, most] > _ALIKE)


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """Difference between the two segments of a pair.

    Attributes:
        segment: without its side.
        difference: (10,) right minus mirrored left, in the order and units of the table.
        sd: (10,) posterior standard deviations of the difference.
    """

    segment: str
    difference: np.ndarray
    sd: np.ndarray

    @property
    def differing(self) -> tuple[int, ...]:
        """Indices into `PARAMETERS` of those that differ beyond their uncertainty, the most significant first."""
        away = np.abs(self.difference) / self.sd
        return tuple(int(k) for k in np.argsort(-away) if away[k] > BEYOND_SD)


def asymmetries(bsp: BodySegmentParameters, covariance: np.ndarray) -> list[Asymmetry]:
    """Compute the difference of every pair of segments whose right and left were estimated.

    Args:
        bsp: the estimate.
        covariance: (10 s, 10 s) posterior covariance of its table.
    """
    table, pairs = bsp.table(), []
    for right, left in enumerate(partners(bsp.segments)):
        if left == right or not bsp.segments[right].endswith("_r"):
            continue
        of_pair = np.hstack([np.eye(10), -np.diag(MIRROR_SIGNS)])
        rows = np.r_[10 * right : 10 * right + 10, 10 * left : 10 * left + 10]
        variance = np.diag(of_pair @ covariance[np.ix_(rows, rows)] @ of_pair.T)
        if np.all(variance > 0):
            difference = table[right] - MIRROR_SIGNS * table[left]
            pairs.append(Asymmetry(bsp.segments[right][:-2], difference, np.sqrt(variance)))
    return pairs


def asymmetry_columns(pairs: Sequence[Asymmetry]) -> dict[str, list[object]]:
    """Return the columns of a table of pairs and parameters: segment, parameter, right_minus_left, sd, differs."""
    rows = [
        (pair.segment, name, float(pair.difference[k]), float(pair.sd[k]), k in pair.differing)
        for pair in pairs
        for k, name in enumerate(PARAMETERS)
    ]
    names = ("segment", "parameter", "right_minus_left", "sd", "differs")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}
