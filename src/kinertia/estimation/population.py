"""Adapts the literature's prior to people whom its tables do not describe: children, elderly and obese people.

The tables describe young adults of ordinary build (de Leva's men were 24 years old, body-mass index 24). Published
numbers for other populations are used, with their source; where there are none, none are invented: standard deviations
are multiplied by 1.5. The one group with known numbers supports this factor: including the spread of people, the masses
that Pavol found in the elderly are 1.58 times the tables' standard deviations from Dumas' values, and 1.33 times from
de Leva's.

- elderly: segment masses by Pavol, Owings and Grabiner (2002, J Biomech 35:707), whose table was available in one
  transcription only; trunk and head together keep the tables' split between pelvis and torso, since the trunk is cut
  elsewhere in that study. Standard deviations of masses stay, those of centres of mass and inertias grow.
- child: head and trunk are heavier, thighs, shanks and feet lighter than an adult's (Jensen 1986, J Biomech 19:359);
  his coefficients could not be checked. Standard deviations grow.
- other: anyone else whom the tables do not describe, for example pregnant or very muscular people. Standard deviations
  grow.
- obese: trunks are heavier, thighs and shanks lighter for the same mass (Chambers et al. 2010, Clin Biomech 25:131,
  people over 65); de Leva's masses were wrong by up to 60 % on average in a sample of working adults (Merrill et al.
  2019). Standard deviations grow.
"""

from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.prior import BspPrior
from kinertia.findings.finding import Finding, Severity, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.bsp import BodySegmentParameters
from kinertia.settings import Subject

UNKNOWN_SPREAD = 1.5
"""Factor on standard deviations where no published numbers exist."""
GROWN_UP_YEARS, OLD_YEARS = 18.0, 65.0
OBESE_KG_M2 = 30.0
"""Body-mass index from which a person counts as obese (WHO)."""
_SHORT_M = 1.4
"""Stature below which a person without a stated age is likely a child, and in any case not described by the tables."""
_PAVOL = {
    "male": {"thigh": 0.1127, "shank": 0.0441, "foot": 0.0127, "upper_arm": 0.0299, "forearm": 0.0175 + 0.0065},
    "female": {"thigh": 0.1162, "shank": 0.0456, "foot": 0.0123, "upper_arm": 0.0301, "forearm": 0.0141 + 0.0054},
}
"""Shares of body mass; forearm and hand together."""


@dataclass(frozen=True)
class Population:
    """Population that the person belongs to, the reason, and whether the user stated it."""

    name: str
    reason: str
    stated: bool

    def finding(self, subject: Subject) -> Finding | None:
        """Make S401 if the tables do not describe this population, else return None."""
        if self.name == "adult":
            return None
        evidence = {"population": Quantity(self.name), "reason": Quantity(self.reason)}
        if subject.mass_kg is not None and subject.height_m is not None:
            evidence["bmi"] = Quantity(subject.mass_kg / subject.height_m**2, "kg/m2", limit=OBESE_KG_M2)
        if subject.age_years is not None:
            evidence["age"] = Quantity(subject.age_years, "a")
        return with_evidence("S401", Where(), evidence, Severity.INFO if self.stated else Severity.WARNING)


@dataclass(frozen=True, eq=False)
class PopulationPrior:
    """A prior, with findings about what was assumed for it."""

    prior: BspPrior
    findings: tuple[Finding, ...]


def population_prior(prior: BspPrior, subject: Subject, body_kg: float | None = None) -> PopulationPrior:
    """Return the prior for this person's population, as stated or inferred from age and body-mass index.

    Args:
        prior: from the literature or a scaled model.
        subject: mass and height may be unknown.
        body_kg: mass of the body alone, where objects were weighed with it; None: the mass of the subject.
    """
    population = population_of(subject, body_kg)
    if population.name == "elderly" and subject.sex is not None:
        prior = _spread(_with_masses(prior, _PAVOL[subject.sex]), keep_masses=True)
    elif population.name != "adult":
        prior = _spread(prior)
    assumed = population.finding(subject)
    return PopulationPrior(prior, () if assumed is None else (assumed,))


def population_of(subject: Subject, body_kg: float | None = None) -> Population:
    """Return the stated population, or infer it from age, body-mass index and stature.

    Arguments are as in `population_prior`.
    """
    if subject.population is not None:
        return Population(subject.population, "the stated population", True)
    return Population(*_by_age_and_build(subject, body_kg or subject.mass_kg), False)


def _by_age_and_build(subject: Subject, mass_kg: float | None) -> tuple[str, str]:
    age, height_m = subject.age_years, subject.height_m
    if age is not None and age < GROWN_UP_YEARS:
        return "child", f"an age of {age:g} years"
    if mass_kg and height_m and mass_kg / height_m**2 >= OBESE_KG_M2:
        return "obese", f"a body-mass index of {mass_kg / height_m**2:.1f} kg/m2"
    if age is None and height_m is not None and height_m < _SHORT_M:
        return "child", f"a height of {height_m:g} m and no stated age"
    if age is not None and age >= OLD_YEARS:
        return "elderly", f"an age of {age:g} years"
    return "adult", "no evidence of another"


def _with_masses(prior: BspPrior, shares: dict[str, float]) -> BspPrior:
    """Return the prior with these shares of body mass for the limbs, and the rest for trunk and head; shapes stay."""
    mean = prior.mean
    kinds = [name.removesuffix("_r").removesuffix("_l") for name in mean.segments]
    total = mean.total_mass_kg
    mass = np.array([shares.get(kind, 0.0) * total for kind in kinds])
    rest = np.array([kind not in shares for kind in kinds])
    mass[rest] = (total - mass.sum()) * mean.mass_kg[rest] / mean.mass_kg[rest].sum()
    factor = mass / mean.mass_kg
    moved = BodySegmentParameters(mean.segments, mass, mean.com_m, mean.inertia_kgm2 * factor[:, None, None])
    scale = np.ones((len(kinds), 10))
    scale[:, [0, *range(4, 10)]] = factor[:, None]
    return replace(prior, mean=moved, covariance=prior.covariance * np.outer(scale, scale))


def _spread(prior: BspPrior, keep_masses: bool = False) -> BspPrior:
    scale = np.full((len(prior.mean.segments), 10), UNKNOWN_SPREAD)
    scale[:, 0] = 1.0 if keep_masses else UNKNOWN_SPREAD
    return replace(prior, covariance=prior.covariance * np.outer(scale, scale))
