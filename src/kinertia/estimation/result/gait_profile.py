"""Computes normative bands from the fits of controls, and Gait Profile Scores against them.

Baker, McGinley, Schwartz et al. 2009, The Gait Profile Score and Movement Analysis Profile, Gait & Posture 30:265-269.
The Gait Variable Score (GVS) of each of nine kinematic variables is the root mean square difference, over the gait
cycle, between a person's curve and the mean of people without pathology; together, the GVS form the Movement Analysis
Profile. The Gait Profile Score of a side is the root mean square of its nine GVS; the overall score uses fifteen: hip,
knee, ankle and foot of both sides, and the pelvis once, over the left side's cycle.

Angles are clinical angles, as in the paper, from inverse kinematics.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from kinertia.errors import KinertiaError
from kinertia.estimation.result.cycles import spatiotemporal_columns
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.gait_scores import GaitProfile, rms_deg, variable_score
from kinertia.estimation.result.mean_cycles import MeanCurves, convention_of, mean_curves, mean_of_common
from kinertia.io.norms_file import Norm
from kinertia.motion.gait_cycle import PERCENT
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.trial.data import FEET

_PELVIS = tuple(CLINICAL_ANGLES)[:3]
_PELVIS_SIDE = "l"
FEWEST_PEOPLE = 2
ADULT_YEARS = 18.0
"""Age from which a person counts as an adult."""


def gait_profile(fit: Fit, norms: Mapping[str, Norm]) -> GaitProfile:
    """Compute the scores of a fit against norms.

    Args:
        fit: with strides.
        norms: by quantity, as `kinertia norms` writes them.

    Raises:
        KinertiaError: norms lack a variable or have another convention, or there are no strides.
    """
    check_convention(fit, {name: norm for name, norm in norms.items() if name in CLINICAL_ANGLES})
    expect_all_nine(norms)
    curves = mean_curves(fit)
    if not curves:
        raise KinertiaError("no trial has a stride, and without strides there is no Gait Profile Score")
    if not set(CLINICAL_ANGLES) & {quantity for quantity, _ in curves}:
        legs = "legs are not hip, knee and ankle with axes forward, up and right"
        raise KinertiaError(f"there are no clinical angles for the model {fit.skeleton.name}: its {legs}")
    return scores(curves, norms, remarks(fit, norms[_PELVIS[0]]))


def expect_all_nine(norms: Mapping[str, Norm]) -> None:
    """Raise a KinertiaError if norms lack a variable of the score."""
    if lacking := [one.title for quantity, one in CLINICAL_ANGLES.items() if quantity not in norms]:
        raise KinertiaError(
            f"the norms lack {', '.join(lacking)}, which the Gait Profile Score needs: make them with kinertia norms"
        )


def scores(curves: MeanCurves, norms: Mapping[str, Norm], said: Sequence[str] = ()) -> GaitProfile:
    """Compute the scores of a person's mean curves against norms of all nine variables."""
    unknown = np.full(len(PERCENT), np.nan)
    gvs = {
        (quantity, side): variable_score(curves.get((quantity, side), unknown), norms[quantity])
        for quantity in CLINICAL_ANGLES
        for side in FEET
    }
    of_sides = {side: rms_deg([gvs[quantity, side] for quantity in CLINICAL_ANGLES]) for side in FEET}
    fifteen = [gvs[quantity, _PELVIS_SIDE] for quantity in _PELVIS]
    fifteen += [gvs[quantity, side] for quantity in CLINICAL_ANGLES if quantity not in _PELVIS for side in FEET]
    return GaitProfile(gvs, of_sides, rms_deg(fifteen), norms[_PELVIS[0]].people, tuple(said))


def remarks(fit: Fit, norm: Norm) -> tuple[str, ...]:
    """List the respects in which norms are not from people like this one, in sentences."""
    found, age, speed = [], fit.subject.age_years, mean_speed_m_s(fit)
    if norm.age_years is not None:
        low, high = norm.age_years
        if low < ADULT_YEARS <= high:
            found.append(f"The norms mix children and adults ({low:g} to {high:g} years).")
        if age is not None and not low <= age <= high:
            found.append(f"This person is {age:g} years old, people in the norms {low:g} to {high:g}.")
    if not norm.convention:
        found.append("The norms state no convention: constant offsets between models count in full.")
    elif norm.age_years is None or age is None:
        found.append(f"Age {'of the norms' if norm.age_years is None else 'of this person'} is not stated.")
    if norm.speed_m_s is not None and np.isfinite(speed):
        low, high = norm.speed_m_s
        if not low <= round(speed, 3) <= high:
            found.append(f"This person walks at {speed:.2f} m/s, people in the norms at {low:.2f} to {high:.2f}.")
    return tuple(found)


def check_convention(fit: Fit, norms: Mapping[str, Norm]) -> None:
    """Raise a KinertiaError if norms state a different convention from a fit's."""
    own = convention_of(fit)
    for norm in norms.values():
        if norm.convention and norm.convention != own:
            raise KinertiaError(
                f"the norms are of {norm.convention}, this fit is of {own}: angles and signs differ; make norms from "
                "fits with the same model"
            )


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
