"""Tests whether one side is heavier than the other, as with a prosthesis, an orthosis or an ankle weight.

People's left and right are alike (the prior's correlation is 0.9), so that a wrong mass of one leg pulls the sound leg
along: the moves of the two sides look alike, the difference between them does not. So differences are what is judged,
in deviations of people's. In walks with a prosthesis, a cast or an ankle weight that nobody declared, the mass of a
foot or a shank differs by 4 to 8 of them, and centres of mass across the limb by 1; a load that is on no plate for a
while, a handrail or one plate that is late makes centres of mass differ by 6 and more, too; plates, clock and joints
that are off make nothing differ by more than 2, but for a plate's vertical zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.estimation.asymmetry import asymmetries
from kinertia.estimation.prior import BspPrior
from kinertia.model.bsp import BodySegmentParameters

_BEYOND_SD = 4.0
"""Deviations from which on a difference of masses is none of a body's: one plate's vertical zero, 50 N off, makes up to
3.5."""
_ACROSS = 0.5
"""Share of the masses' deviations that centres of mass across the limbs may have."""
_WITH_IT = 0.5
"""Share of the largest deviation from which on another pair is named, too."""


@dataclass(frozen=True)
class OneSided:
    """One side's masses against the other's.

    Attributes:
        heavier, lighter: segments, from the trunk outwards, and their other sides.
        more_kg: by how much each of them is heavier.
        times: the largest difference, in deviations of people's.
        added: whether the heavier side is the one that is unlike the prior; else the lighter one is.
    """

    heavier: tuple[str, ...]
    lighter: tuple[str, ...]
    more_kg: tuple[float, ...]
    times: float
    added: bool


def one_sided(prior: BspPrior, estimate: BodySegmentParameters, covariance: np.ndarray) -> OneSided | None:
    """The side that is heavier, where that is what departs most of all differences between the sides; else None.

    Args:
        prior, estimate: of the same segments.
        covariance: posterior, of the estimate's table.
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
