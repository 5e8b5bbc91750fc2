"""Tests whether one side is heavier than the other, as with a prosthesis, an orthosis or an ankle weight.

People's left and right are similar (the prior's correlation is 0.9), so a wrong mass of one leg also changes the other
leg: both sides change in a similar way, but their difference is not usual. So differences are judged, in standard
deviations of people's differences. In walks with an undeclared prosthesis, cast or ankle weight, the mass of a foot or
a shank differs by 4 to 8 of them, and centres of mass across the limb by 1. A load that is on no plate for a while, a
handrail or one delayed plate also makes centres of mass differ by 6 and more. Errors of plates, synchronisation and
joints make nothing differ by more than 2, except the zero offset of a plate's vertical force.
"""

from dataclasses import dataclass

import numpy as np

from kinertia.estimation.asymmetry import asymmetries
from kinertia.estimation.prior import BspPrior
from kinertia.model.bsp import BodySegmentParameters

_BEYOND_SD = 4.0
"""Standard deviations above which a difference of masses is not anatomical: a vertical zero offset of 50 N of one plate
makes up to 3.5."""
_ACROSS = 0.5
"""Largest difference of centres of mass across the limbs, relative to the difference of masses, both in standard
deviations."""
_WITH_IT = 0.5
"""Share of the largest difference above which another pair is reported, too."""


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
    own = ((estimate.mass_kg - prior.mean.mass_kg) / prior.sd[:, 0])[rows]
    return OneSided(
        tuple(names[k] + heavier for k in named),
        tuple(names[k] + lighter for k in named),
        tuple(abs(float(after[names[k]].difference[0])) for k in named),
        abs(most),
        bool(own.sum() > 0),
    )
