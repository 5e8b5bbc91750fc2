"""People with girths and lengths: drawn around the usual build, their two sides a little different."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from kinertia.model.stadium_body import log_size, measures, usual_build

SIZES = {"Ann": (61.0, 1.66), "Ben": (58.0, 1.72), "Carl": (92.0, 1.79), "Dan": (80.0, 1.81), "Ed": (78.7, 1.76)}
"""Mass (kg) and stature (m) that their measures are drawn for."""
_OTHER_SIDE = 0.01
_ALIKE = 0.5
"""Share of the spread between people: it holds of few of them that a level is far from its neighbours."""


@dataclass(frozen=True, eq=False)
class StadiumPerson:
    """Measurements of one person, in m.

    Attributes:
        both: all 95 of them, by the key of the package `yeadon`.
        measures_m: (58,) in the order of `measures`, the mean of both sides.
    """

    both: dict[str, float]
    measures_m: np.ndarray


@cache
def stadium_people() -> dict[str, StadiumPerson]:
    """By name; always the same."""
    rng, usual = np.random.default_rng(95), usual_build()
    people = {}
    for name, size in SIZES.items():
        build = usual.common @ rng.normal(size=usual.common.shape[1])
        values = np.exp(usual.log_shape + log_size(*size) + _ALIKE * usual.log_sd * build)
        other = np.exp(_OTHER_SIDE * rng.normal(size=len(values)))
        both = {
            key: value * factor
            for measure, value, apart in zip(measures(), values, other, strict=True)
            for key, factor in zip(measure.keys, (apart, 1.0 / apart), strict=False)
        }
        people[name] = StadiumPerson(
            both, np.array([np.mean([both[key] for key in measure.keys]) for measure in measures()])
        )
    return people
