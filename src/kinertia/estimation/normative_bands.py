"""Computes normative bands from the fits of controls: mean and SD between people."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from kinertia.errors import KinertiaError
from kinertia.estimation.cycles import spatiotemporal_columns
from kinertia.estimation.mean_cycles import convention_of, mean_curves, mean_of_common
from kinertia.estimation.result import Fit
from kinertia.motion.gait_cycle import PERCENT
from kinertia.trial.data import FEET

FEWEST_PEOPLE = 2
ADULT_YEARS = 18.0
"""Age from which a person counts as an adult."""


@dataclass(frozen=True, eq=False)
class Control:
    """Data of one control for norms.

    Attributes:
        name: of the person.
        curves: by quantity (101,), mean of both sides.
        age_years: as stated, or None.
        speed_m_s: mean over all strides; NaN where unknown.
        convention: of all quantities, as in `convention_of`.
    """

    name: str
    curves: dict[str, np.ndarray]
    age_years: float | None
    speed_m_s: float
    convention: str

    @classmethod
    def of(cls, fit: Fit) -> Self:
        """Extract the data from a fit.

        Raises:
            KinertiaError: it has no strides.
        """
        by_side = mean_curves(fit)
        if not by_side:
            raise KinertiaError(f"{fit.subject.name}: no strides, hence no curves over the gait cycle")
        curves = {}
        for quantity in dict.fromkeys(name for name, _ in by_side):
            sides = np.array([by_side[quantity, side] for side in FEET if (quantity, side) in by_side])
            curves[quantity] = mean_of_common(sides)
        return cls(fit.subject.name, curves, fit.subject.age_years, mean_speed_m_s(fit), convention_of(fit))


def mean_speed_m_s(fit: Fit) -> float:
    """Return the mean speed (m/s) over all strides; NaN where it is not known."""
    speeds = np.array(spatiotemporal_columns(fit.trials)["speed_m_s"], dtype=float)
    return float(np.nanmean(speeds)) if np.isfinite(speeds).any() else float("nan")


def mixture(people: Sequence[Control]) -> str:
    """Report in words whether these controls mix children and adults, or may; empty if not."""
    ages = [one.age_years for one in people]
    stated = [age for age in ages if age is not None]
    children = sum(age < ADULT_YEARS for age in stated)
    if 0 < children < len(stated):
        return f"{children} children and {len(stated) - children} adults in one band: make norms of each"
    if unknown := len(ages) - len(stated):
        return f"age of {unknown} of {len(ages)} people not stated: children and adults may be mixed"
    return ""


def band_columns(people: Sequence[Control]) -> dict[str, list[Any]]:
    """Compute the columns of a norms file, by name: a row per quantity and percent that at least two people have.

    Every person counts once, however many strides were measured.

    Raises:
        KinertiaError: there are fewer than two people, or their coordinates follow different conventions.
    """
    if len(people) < FEWEST_PEOPLE:
        raise KinertiaError(f"norms need at least {FEWEST_PEOPLE} different people; found {len(people)}")
    conventions = sorted({one.convention for one in people})
    if len(conventions) > 1:
        raise KinertiaError(f"people were fitted with different models, whose angles differ: {'; '.join(conventions)}")
    ages = [one.age_years for one in people if one.age_years is not None]
    speeds = [one.speed_m_s for one in people if np.isfinite(one.speed_m_s)]
    spans = {
        f"{name}_{end}": round(float(of(values)), 3) if values else None
        for name, values in (("age_years", ages), ("speed_m_s", speeds))
        for end, of in (("min", min), ("max", max))
    }
    names = ("quantity", "percent", "mean", "sd", "n")
    rows: list[tuple[Any, ...]] = []
    for quantity in sorted({name for one in people for name in one.curves}):
        curves = np.array([one.curves[quantity] for one in people if quantity in one.curves])
        for percent, values in zip(PERCENT.tolist(), curves.T, strict=True):
            known = values[np.isfinite(values)]
            if len(known) >= FEWEST_PEOPLE:
                rows.append((quantity, int(percent), float(known.mean()), float(known.std(ddof=1)), len(known)))
    columns = {name: [row[k] for row in rows] for k, name in enumerate(names)}
    shared = {**spans, "convention": conventions[0]}
    return columns | {name: [value] * len(rows) for name, value in shared.items()}
