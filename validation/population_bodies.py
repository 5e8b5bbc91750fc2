"""Bodies that the tables do not describe, for studies of what a wrong prior costs.

Directions are those of the literature (`kinertia.estimation.prior`); sizes are set here, of the order that is told
there, and are nobody's measurements. People of a population spread about its mean as adults do about theirs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from kinertia.estimation.prior import BspPrior
from kinertia.model.bsp import BodySegmentParameters

_TRUNK = ("pelvis", "torso")


@dataclass(frozen=True)
class Population:
    """Difference of a population's mean body from adults of the same mass and lengths.

    Attributes:
        title: title in tables.
        mass: factor on the mass, by segment or, for both sides, by its name without side; the trunk has the rest.
        forward_m: forward displacement of the trunk's centre of mass.
        proximal: by segment, share of the way to its joint by which the centre of mass moves.
        radius: by segment, factor on the radii of gyration.
    """

    title: str
    mass: Mapping[str, float]
    forward_m: float = 0.0
    proximal: Mapping[str, float] = field(default_factory=dict)
    radius: Mapping[str, float] = field(default_factory=dict)

    def of(self, adults: BspPrior) -> BspPrior:
        """Return the distribution of this population's bodies."""
        mean = adults.mean
        names = [_whole(name, self.mass) for name in mean.segments]
        trunk = np.array([name in _TRUNK for name in mean.segments])
        mass = mean.mass_kg * [self.mass.get(name, 1.0) for name in names]
        mass[trunk] *= (mean.total_mass_kg - mass[~trunk].sum()) / mass[trunk].sum()
        up = 1.0 - np.array([self.proximal.get(_whole(name, self.proximal), 0.0) for name in mean.segments])
        com = mean.com_m * up[:, None] + np.outer(trunk, [self.forward_m, 0.0, 0.0])
        radius = np.array([self.radius.get(_whole(name, self.radius), 1.0) for name in mean.segments])
        inertia = mean.inertia_kgm2 * (mass / mean.mass_kg * radius**2)[:, None, None]
        return replace(adults, mean=BodySegmentParameters(mean.segments, mass, com, inertia))


def _whole(segment: str, names: Mapping[str, float]) -> str:
    """Return the segment's own name where sides are distinguished, else the name of both sides."""
    return segment if segment in names else segment.removesuffix("_r").removesuffix("_l")


POPULATIONS = {
    "child": Population(
        "children: heavy head, light legs",
        {"thigh": 0.75, "shank": 0.90, "foot": 1.1, "upper_arm": 0.9},
        radius={"torso": 1.05},
    ),
    "obese": Population(
        "obese people: heavy trunk, forward",
        {"thigh": 0.85, "shank": 0.80, "foot": 0.80, "upper_arm": 0.95, "forearm": 0.80},
        forward_m=0.03,
        radius={"pelvis": 1.15, "torso": 1.10},
    ),
    "elderly": Population(
        "old people: light thighs",
        {"thigh": 0.92, "shank": 0.92, "foot": 1.0, "upper_arm": 1.2, "forearm": 1.03},
        forward_m=0.01,
    ),
    "prosthesis": Population(
        "below-knee prosthesis, left",
        {"shank_l": 0.6, "foot_l": 0.7},
        proximal={"shank_l": 0.2},
        radius={"shank_l": 0.9},
    ),
}
