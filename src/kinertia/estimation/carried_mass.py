"""Works out who was weighed with what, and which mass the forces must carry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from kinertia.errors import PriorError, problem_of
from kinertia.findings.finding import with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.settings import Attached

UNKNOWN_SHARE, UNKNOWN_SHARE_SD = 0.10, 0.15
"""Share of body mass that something of unknown mass is expected to have: anything up to 40 %."""
_LIGHTEST_KG = 10.0
"""What a person weighs at least (`check_subject`)."""


@dataclass(frozen=True)
class CarriedMass:
    """Masses in kg.

    Attributes:
        body_kg: of the person alone, for the tables.
        total_kg, sd_kg: of the person and all that is attached, and how far that may be off besides the scale.

    Examples:
        >>> pack = kinertia.Attached(
        ...     name="rucksack", segment="torso", mass_kg="10 +- 0.5", com_mm=[-200, 300, 0], on_scale=False
        ... )
        >>> from kinertia.estimation.carried_mass import CarriedMass
        >>> CarriedMass.of(70.0, [pack])
        CarriedMass(body_kg=70.0, total_kg=80.0, sd_kg=0.5)
    """

    body_kg: float
    total_kg: float
    sd_kg: float

    def __str__(self) -> str:
        beside = self.total_kg - self.body_kg
        return f"{self.total_kg:.1f} kg" + (f", {beside:.1f} kg of it attached" if beside else "")

    @classmethod
    def of(cls, scale_kg: float, attached: Sequence[Attached]) -> CarriedMass:
        """What follows from the mass on the scale.

        Raises:
            PriorError: what was on the scale leaves nothing for the person.
        """
        masses = [(mass_of(one, scale_kg), one.on_scale) for one in attached]
        body = scale_kg - sum(mass for (mass, _), weighed in masses if weighed)
        if body < min(_LIGHTEST_KG, scale_kg):
            names = ", ".join(one.name for one in attached if one.on_scale)
            problem = f"weighed with the person (on_scale = true), it leaves {body:.4g} kg of {scale_kg:.4g} kg"
            left = {"left_kg": Quantity(body, "kg"), "name": Quantity(names), "problem": Quantity(problem)}
            found = with_evidence("S406", Where(part=names), left)
            raise PriorError(problem_of(found)).with_finding(found)
        beside = [mass for mass, weighed in masses if not weighed]
        return cls(body, scale_kg + sum(mass for mass, _ in beside), sum(sd * sd for _, sd in beside) ** 0.5)


def body_sd_kg(scale_kg: float, attached: Sequence[Attached]) -> float:
    """How far the body's own mass may be off besides the scale, by what was weighed with it."""
    variances = [mass_of(one, scale_kg)[1] ** 2 for one in attached if one.on_scale]
    return float(sum(variances) ** 0.5)


def mass_of(attached: Attached, scale_kg: float) -> tuple[float, float]:
    """Mass of one thing and its deviation, before any estimate."""
    if attached.mass_kg is None:
        return UNKNOWN_SHARE * scale_kg, UNKNOWN_SHARE_SD * scale_kg
    return attached.mass_kg
