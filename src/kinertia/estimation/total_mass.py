"""Computes the mass of the body alone, and the total mass that the forces support."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from kinertia.errors import PriorError
from kinertia.findings.finding import with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.settings import Attached

UNKNOWN_SHARE, UNKNOWN_SHARE_SD = 0.10, 0.15
"""Expected share of body mass of an object of unknown mass, and its standard deviation: anything up to 40 %."""
_LIGHTEST_KG = 10.0
"""Least plausible mass of a person (`check_subject`)."""


@dataclass(frozen=True)
class TotalMass:
    """Mass of the body alone and total mass with all attached objects, in kg.

    Attributes:
        body_kg: of the person alone, for the tables.
        total_kg, sd_kg: of the person with all attached objects, and its standard deviation apart from the scale's
            error.

    Examples:
        >>> pack = kinertia.Attached(
        ...     name="rucksack", segment="torso", mass_kg="10 +- 0.5", com_mm=[-200, 300, 0], on_scale=False
        ... )
        >>> from kinertia.estimation.total_mass import TotalMass
        >>> TotalMass.of(70.0, [pack])
        TotalMass(body_kg=70.0, total_kg=80.0, sd_kg=0.5)
    """

    body_kg: float
    total_kg: float
    sd_kg: float

    def __str__(self) -> str:
        beside = self.total_kg - self.body_kg
        return f"{self.total_kg:.1f} kg" + (f", {beside:.1f} kg of it attached" if beside else "")

    @classmethod
    def of(cls, stated_mass_kg: float, attached: Sequence[Attached]) -> Self:
        """Compute the masses from the stated mass.

        Raises:
            PriorError: the objects weighed with the person leave no mass for the person.
        """
        masses = [(mass_of(one, stated_mass_kg), one.on_scale) for one in attached]
        body = stated_mass_kg - sum(mass for (mass, _), weighed in masses if weighed)
        if body < min(_LIGHTEST_KG, stated_mass_kg):
            names = ", ".join(one.name for one in attached if one.on_scale)
            problem = f"weighed with the person (on_scale = true), it leaves {body:.4g} kg of {stated_mass_kg:.4g} kg"
            left = {"left_kg": Quantity(body, "kg"), "name": Quantity(names), "problem": Quantity(problem)}
            found = with_evidence("S406", Where(part=names), left)
            raise PriorError.of(found)
        beside = [mass for mass, weighed in masses if not weighed]
        return cls(body, stated_mass_kg + sum(mass for mass, _ in beside), sum(sd * sd for _, sd in beside) ** 0.5)


def body_sd_kg(stated_mass_kg: float, attached: Sequence[Attached]) -> float:
    """Return the standard deviation of the body's mass due to objects weighed with it, without the scale's error."""
    variances = [mass_of(one, stated_mass_kg)[1] ** 2 for one in attached if one.on_scale]
    return float(sum(variances) ** 0.5)


def mass_of(attached: Attached, stated_mass_kg: float) -> tuple[float, float]:
    """Return the mass of one object and its standard deviation, kg, before any estimate."""
    if attached.mass_kg is None:
        return UNKNOWN_SHARE * stated_mass_kg, UNKNOWN_SHARE_SD * stated_mass_kg
    return attached.mass_kg
