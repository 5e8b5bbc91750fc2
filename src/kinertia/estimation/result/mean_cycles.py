"""Averages curves over complete strides, and computes norms and Gait Profile Scores from them.

Angles come from inverse kinematics, which covers the whole cycle; moments, powers and ground reactions from the
estimate. Coordinates of pelvis and trunk that are opposite on the two sides (obliquity, rotation, lateral bending) are
mirrored on the left, so that one norm applies to both.

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
from kinertia.estimation.result.curve_source import Stage
from kinertia.estimation.result.cycles import cycle_curves, spatiotemporal_columns
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.gait_scores import GaitProfile, rms_deg, variable_score
from kinertia.io.norms_file import Norm
from kinertia.model.skeleton import opposite_on_left
from kinertia.motion.gait_cycle import PERCENT
from kinertia.motion.joint_moments import component_names
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.motion.spatiotemporal import MEASURES
from kinertia.trial.data import FEET

_BUILT_IN = "gait27"
_KINDS: Mapping[Stage, tuple[str, ...]] = {
    "literature": ("angle",),
    "estimate": ("clinical", "moment", "joint_moment", "power", "force"),
}
_LUMBAR = tuple(f"{name}_joint_moment" for name in component_names("lumbar"))
"""Left out: the sides share them, some with opposite signs."""
MeanCurves = Mapping[tuple[str, str], np.ndarray]
"""Mean curves (101,) by quantity and side, in the units of `cycles.csv`; NaN where nothing was measured."""
_AS_LONG = 0.9
"""Least length of the common part, relative to the longest curve: so much of the cycle may be given up for more
strides."""
_PELVIS = tuple(CLINICAL_ANGLES)[:3]
_PELVIS_SIDE = "l"
FEWEST_PEOPLE = 2
ADULT_YEARS = 18.0
"""Age from which a person counts as an adult."""


def convention_of(fit: Fit) -> str:
    """Describe the model that a fit's curves belong to; even clinical angles differ by degrees between models."""
    if fit.file is None:
        return f"Kinertia {_BUILT_IN}"
    return "OpenSim model with " + " ".join(sorted(fit.skeleton.sides))


def mean_curves(fit: Fit) -> MeanCurves:
    """Average the curves of a fit over the strides of its main task (`main_task`); empty without strides."""
    found: dict[tuple[str, str], list[np.ndarray]] = {}
    flipped = {f"{name}_{kind}" for name in opposite_on_left(fit.skeleton) for kind in ("angle", "moment")}
    for stage, kinds in _KINDS.items():
        for cycle in (curve for trial in main_task(fit).trials for curve in cycle_curves(trial, fit.mass_kg, stage)):
            if cycle.kind in kinds and cycle.quantity not in _LUMBAR:
                sign = -1.0 if cycle.quantity in flipped and cycle.stride.side == "l" else 1.0
                found.setdefault((cycle.quantity, cycle.stride.side), []).append(sign * cycle.value)
    return {name: mean_of_common(np.array(curves)) for name, curves in found.items()}


def common_strides(values: np.ndarray) -> np.ndarray:
    """Select the curves (n, 101), NaN where not measured, that are to be averaged: returns (n,) bool.

    Complete curves are used if there are any. Otherwise those are chosen that together have the most measured frames,
    provided that their common part covers at least nine tenths of the longest curve.

    >>> common_strides(np.array([[1.0, 2.0, 3.0], [4.0, np.nan, np.nan], [3.0, 2.0, 1.0]])).tolist()
    [True, False, True]
    """
    known = np.isfinite(values)
    length = known.sum(axis=1)
    chosen: np.ndarray = known.all(axis=1)
    if chosen.any() or not length.any():
        return chosen
    order = np.argsort(-length, kind="stable")
    together = np.logical_and.accumulate(known[order], axis=0).sum(axis=1)
    worth = np.where(together >= _AS_LONG * length.max(), together * np.arange(1, len(values) + 1), 0)
    chosen[order[: int(np.argmax(worth)) + 1]] = True
    return chosen


def mean_of(values: np.ndarray) -> np.ndarray:
    """Return the mean (101,) of curves (n, 101): NaN where one was not measured, and throughout without curves."""
    return values.mean(axis=0) if len(values) else np.full(values.shape[1], np.nan)


def mean_of_common(values: np.ndarray) -> np.ndarray:
    """Return the mean (101,) of the curves (n, 101) that `common_strides` selects.

    >>> mean_of_common(np.array([[1.0, 2.0, 3.0], [4.0, np.nan, np.nan], [3.0, 2.0, 1.0]])).tolist()
    [2.0, 2.0, 2.0]
    """
    return mean_of(values[common_strides(values)])


def fits_by_task(fit: Fit) -> dict[str, Fit]:
    """Return the fit with the trials of each task that has strides: walks first, then the task with most strides."""
    trials: dict[str, list[int]] = {}
    for k, trial in enumerate(fit.trials):
        if trial.strides:
            trials.setdefault(trial.kinematics.trial.task, []).append(k)
    strides = {task: sum(len(fit.trials[k].strides) for k in members) for task, members in trials.items()}
    order = sorted(trials, key=lambda task: (task != "walk", -strides[task]))
    return {task: fit.with_trials(trials[task]) for task in order}


def main_task(fit: Fit) -> Fit:
    """Return the fit with the trials of the first of `fits_by_task` alone; as it is without strides."""
    return next(iter(fits_by_task(fit).values()), fit)


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


def profiles_by_task(fit: Fit, norms: Mapping[str, Norm]) -> dict[str, GaitProfile]:
    """Compute the scores by task, in the order of `fits_by_task`; none where norms lack a variable.

    The main task, which comes first, has the scores that `gait_profile` gives the whole fit.

    Raises:
        KinertiaError: as `gait_profile`.
    """
    if not set(CLINICAL_ANGLES) <= set(norms):
        return {}
    fits = enumerate(fits_by_task(fit).items())
    return {task: gait_profile(part if k else fit, norms) for k, (task, part) in fits}


def expect_all_nine(norms: Mapping[str, Norm]) -> None:
    """Raise a KinertiaError if norms lack a variable of the score."""
    if lacking := [title.title for quantity, title in CLINICAL_ANGLES.items() if quantity not in norms]:
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
    fit_convention = convention_of(fit)
    for norm in norms.values():
        if norm.convention and norm.convention != fit_convention:
            raise KinertiaError(
                f"the norms are of {norm.convention}, this fit is of {fit_convention}: angles and signs differ; make "
                "norms from fits with the same model"
            )


@dataclass(frozen=True, eq=False)
class Control:
    """Data of one control for norms.

    Attributes:
        name: of the person.
        curves: by quantity, mean of both sides: (101,), or (1,) of a measure of strides such as speed_m_s.
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
        curves |= _mean_measures(main_task(fit))
        return cls(fit.subject.name, curves, fit.subject.age_years, mean_speed_m_s(fit), convention_of(fit))


def _mean_measures(fit: Fit) -> dict[str, np.ndarray]:
    """Return the mean (1,) over the sides of each measure's mean over their strides, where it is known."""
    columns = spatiotemporal_columns(fit.trials)
    sides, result = np.array(columns["side"]), {}
    for name in MEASURES:
        values = np.array(columns[name], dtype=float)
        known = [of_side for side in FEET if len(of_side := values[(sides == side) & np.isfinite(values)])]
        if known:
            result[name] = np.array([np.mean([of_side.mean() for of_side in known])])
    return result


def mean_speed_m_s(fit: Fit) -> float:
    """Return the mean speed (m/s) over all strides; NaN where it is not known."""
    speeds = np.array(spatiotemporal_columns(fit.trials)["speed_m_s"], dtype=float)
    return float(np.nanmean(speeds)) if np.isfinite(speeds).any() else float("nan")


def mixture(people: Sequence[Control]) -> str:
    """Report in words whether these controls mix children and adults, or may; empty if not."""
    ages = [person.age_years for person in people]
    stated = [age for age in ages if age is not None]
    children = sum(age < ADULT_YEARS for age in stated)
    if 0 < children < len(stated):
        return f"{children} children and {len(stated) - children} adults in one band: make norms of each"
    if unknown := len(ages) - len(stated):
        return f"age of {unknown} of {len(ages)} people not stated: children and adults may be mixed"
    return ""


def band_columns(people: Sequence[Control]) -> dict[str, list[Any]]:
    """Compute the columns of a norms file, by name: a row per quantity and percent that at least two people have.

    A measure of strides, such as speed_m_s, has one row, at 0 %.

    Every person counts once, however many strides were measured.

    Raises:
        KinertiaError: there are fewer than two people, or their coordinates follow different conventions.
    """
    if len(people) < FEWEST_PEOPLE:
        raise KinertiaError(f"norms need at least {FEWEST_PEOPLE} different people; found {len(people)}")
    conventions = sorted({person.convention for person in people})
    if len(conventions) > 1:
        raise KinertiaError(f"people were fitted with different models, whose angles differ: {'; '.join(conventions)}")
    ages = [person.age_years for person in people if person.age_years is not None]
    speeds = [person.speed_m_s for person in people if np.isfinite(person.speed_m_s)]
    spans = {
        f"{name}_{end}": round(float(extreme(values)), 3) if values else None
        for name, values in (("age_years", ages), ("speed_m_s", speeds))
        for end, extreme in (("min", min), ("max", max))
    }
    names = ("quantity", "percent", "mean", "sd", "n")
    rows: list[tuple[Any, ...]] = []
    for quantity in sorted({name for person in people for name in person.curves}):
        curves = np.array([person.curves[quantity] for person in people if quantity in person.curves])
        for percent, values in zip(PERCENT[: curves.shape[1]].tolist(), curves.T, strict=True):
            known = values[np.isfinite(values)]
            if len(known) >= FEWEST_PEOPLE:
                rows.append((quantity, int(percent), float(known.mean()), float(known.std(ddof=1)), len(known)))
    columns = {name: [row[k] for row in rows] for k, name in enumerate(names)}
    shared = {**spans, "convention": conventions[0]}
    return columns | {name: [value] * len(rows) for name, value in shared.items()}
