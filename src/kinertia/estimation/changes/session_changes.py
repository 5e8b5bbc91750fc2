"""Tests what changed between two sessions of one person: joint moments and angles, event by event.

Markers are put on anew, so each session has its own markers, joint centres, axes and instruments; they share the body.
With the draws b of one body, at each session's mass,

    V = V_A + V_B - (V_body,A + V_body,B) + var[f_B(b) - f_A(b)]

takes the place of V in `condition_changes`, and both means are those of one body, the mean of both estimates.

Deviations of a fit whose axes of knees and ankles were fixed are too short for what these axes decide: they are
lengthened (`_FIXED_AXES`).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from kinertia.errors import KinertiaError
from kinertia.estimation.changes.change import SOURCES, UNITS, Change, named_outcome
from kinertia.estimation.changes.condition_changes import (
    DRAWS,
    Condition,
    conditions_by_outcome,
    conditions_of,
    judged,
    parts_of,
)
from kinertia.estimation.changes.stride_features import (
    Rows,
    StrideFeatures,
    only,
    stride_features,
    stride_means,
    usual_sources,
)
from kinertia.estimation.result.drawn_fit import kept_draws
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import PosteriorDraws
from kinertia.model.gait27 import AXIS_TILTS

_FIXED_AXES = 1.6
"""Factor on deviations due to markers: with fixed axes they covered 78 to 83 % of synthetic sessions, where 4 degrees
were their axes' error."""
_BY_AXES = ("moment ankle", "moment subtalar", "angle hip_rotation", "angle knee", "angle ankle", "angle subtalar")
NARROW_M = 0.006
"""Largest SD of a marker's position in a fit of one session alone, with a prior of 5 mm; as one of two it has 10 mm."""
_LIGHTER = 0.1
"""Relative difference of mass beyond which results are hardly of one person."""


@dataclass(frozen=True, eq=False)
class Session:
    """Trials of one session that are compared.

    Attributes:
        fit: from all trials of the session.
        condition: of the trials; all must state the same.
        trials: the trials.
    """

    fit: Fit
    condition: str
    trials: tuple[TrialFit, ...]

    @property
    def fixed_axes(self) -> bool:
        """Whether axes of knees and ankles were no unknowns of the estimate."""
        return not set(AXIS_TILTS) & set(kept_draws(self.fit).coordinates)

    @property
    def narrow_markers(self) -> bool:
        """Whether markers were taken to be where the session's static trial has them, within NARROW_M."""
        return bool(kept_draws(self.fit).places.std(axis=0).max(initial=0.0) < NARROW_M)


def session(fit: Fit, condition: str | None = None) -> Session:
    """Choose the trials of a session.

    Args:
        fit: from all its trials.
        condition: of the trials; None if all state the same.

    Raises:
        KinertiaError: no trial has the condition, or they state several and none is chosen.
    """
    known = conditions_of(fit)
    stated = ", ".join(repr(name) for name in sorted(known))
    if condition is None and len(known) > 1:
        raise KinertiaError(f"trials of {fit.subject.name} state several conditions ({stated}): choose by --conditions")
    chosen = next(iter(known)) if condition is None else condition
    if chosen not in known:
        raise KinertiaError(f"no trial of {fit.subject.name} has the condition {chosen!r}; stated are: {stated}")
    return Session(fit, chosen, tuple(trial for trial in fit.trials if trial.kinematics.trial.condition == chosen))


def why_incomparable(before: Fit, after: Fit) -> str:
    """State why joint moments of two results cannot be compared as of two sessions; empty if they can."""
    for fit in (before, after):
        try:
            kept_draws(fit)
        except KinertiaError as error:
            return str(error)
    if _recordings(before) & _recordings(after):
        return "both results are from the same recording, so nothing can have changed between them"
    if abs(before.mass_kg / after.mass_kg - 1.0) > _LIGHTER:
        return f"masses of {before.mass_kg:.1f} and {after.mass_kg:.1f} kg are hardly of one person"
    return ""


def why_unjudged(before: Fit, after: Fit) -> str:
    """State why changes between two sessions can be shown, but not judged; empty if they can."""
    if kept_draws(before).segments != kept_draws(after).segments:
        return "the results are of different models, which define joints differently"
    return ""


def unjudged_changes(
    before: Session, after: Session, doubt: str, same_sign: Callable[[str, str], int]
) -> Iterator[Change]:
    """Yield the outcomes that both sessions have, without deviations: nothing is known of how they depend on models.

    Args:
        before, after: sessions.
        doubt: why they are not judged.
        same_sign: 1 or -1 for the angle (its coordinate without a side, and "r" or "l") that has the same or the
            opposite sign in both models; 0, and it is left out, where it is another angle.
    """
    first, other = (stride_means(visit.trials, visit.fit.mass_kg) for visit in (before, after))
    for (outcome, side), values in first.items():
        if (later := other.get((outcome, side))) is not None:
            quantity, name, event = outcome.split(" ", 2)
            sign = 1 if quantity == "moment" else same_sign(name, side)
            if not sign:
                continue
            yield Change(
                *named_outcome(f"{quantity} {name}"),
                side,
                event,
                UNITS[quantity],
                float(np.mean(values)),
                sign * float(np.mean(later)),
                (len(values), len(later)),
                np.nan,
                dict.fromkeys(SOURCES, np.nan),
                np.nan,
                doubt=doubt,
            )


def session_features(
    before: Session, after: Session, progress: Callable[[float], None] = lambda share: None, draws: int | None = None
) -> tuple[StrideFeatures, StrideFeatures]:
    """Compute the features of the strides of two sessions, with one body, and in so many draws of each."""
    count = min(draws or DRAWS, *(kept_draws(visit.fit).count for visit in (before, after)))
    bodies = _one_body(before.fit, after.fit, count)
    first = _features(before, bodies[0], count, lambda share: progress(0.5 * share))
    return first, _features(after, bodies[1], count, lambda share: progress(0.5 + 0.5 * share))


def changes_between(before: Rows, after: Rows, fixed_axes: bool) -> tuple[Change, ...]:
    """Judge the changes between two sessions by the events of both (`session_features`)."""
    first, second = (conditions_by_outcome(visit) for visit in (before, after))
    return tuple(judged(first, second, partial(_apart, fixed_axes)))


def _features(visit: Session, bodies: np.ndarray, count: int, progress: Callable[[float], None]) -> StrideFeatures:
    """Return the strides of a session with the first of these bodies, and draws with the others."""
    sources = usual_sources(visit.fit)
    sources["shared"] = replace(sources["body"], bsp=bodies[1:])
    with_mean = replace(_unmoved(visit.fit), bsp=bodies[:1])
    return stride_features(visit.fit, visit.trials, sources, count, progress, with_mean)


def _one_body(before: Fit, after: Fit, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (count + 1, s, 10) the mean of both bodies, then draws of the first one, at the mass of each fit."""
    tables = [_at_mass(_drawn_segments(fit), before.mass_kg / fit.mass_kg) for fit in (before, after)]
    bodies = np.concatenate([np.mean(tables, axis=0, keepdims=True), kept_draws(before).bsp[:count]])
    return bodies, _at_mass(bodies, after.mass_kg / before.mass_kg)


def _drawn_segments(fit: Fit) -> np.ndarray:
    result: np.ndarray = fit.estimate.table()[[fit.estimate.segments.index(name) for name in kept_draws(fit).segments]]
    return result


def _at_mass(tables: np.ndarray, ratio: float) -> np.ndarray:
    """Return tables (..., 10) with masses and moments of inertia in this ratio."""
    scale = np.full(10, ratio)
    scale[1:4] = 1.0
    result: np.ndarray = tables * scale
    return result


def _unmoved(fit: Fit) -> PosteriorDraws:
    """Return one draw that departs from the estimate nowhere."""
    draws = only(kept_draws(fit), body=True)
    return replace(draws, coordinate_values=np.array([[fit.skeleton.locked[name] for name in draws.coordinates]]))


def _apart(fixed_axes: bool, outcome: str, before: Condition, after: Condition) -> dict[str, float]:
    """Return variances of a difference between sessions."""
    variance = {
        source: _variance(before, source) + _variance(after, source) for source in ("all", "body", "instruments")
    }
    shared = float(np.var(after.drawn["shared"] - before.drawn["shared"], ddof=1))
    contacts = sum(float(np.square(condition.drawn["contacts"]).sum()) for condition in (before, after))
    parts = parts_of(max(variance["all"] - variance["body"], 0.0) + shared, variance["instruments"], shared)
    if fixed_axes and outcome.startswith(_BY_AXES):
        parts["markers"] *= _FIXED_AXES**2
    parts["markers"] += contacts
    return parts


def _variance(condition: Condition, source: str) -> float:
    return float(np.var(condition.drawn[source], ddof=1))


def _recordings(fit: Fit) -> set[bytes]:
    return {trial.kinematics.trial.markers.positions.tobytes() for trial in fit.trials}
