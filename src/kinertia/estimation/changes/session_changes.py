"""Tests what changed between two sessions of one person: joint moments and angles, event by event.

Markers are re-applied, so each session has its own markers, joint centres, axes and instruments; they share the body.
Both means are computed with the same body, the mean of the two estimates, and

    V = V_A + V_B + var[f_B(b) - f_A(b)]

takes the place of V in `condition_changes`: V_A and V_B are over draws of everything but the body, b draws of the body,
at each session's mass. (Subtracting the body's variance from the total does not give V_A and V_B: for lumbar moments
the two are nearly equal, so that their difference is uncertain, and within an estimate body and posture compensate for
each other.)

Re-applied markers move the ankle's centre equally in shank and foot. In the estimate, errors of the markers of shank
and foot are independent, which allows the centre about 4 mm. The middle of two malleoli whose markers are off
by 5 mm each, and by 5 mm together, is off by 6 mm. Draws therefore displace it to the side by another 5 mm
(`with_drawn_ankles`), as they do the knee's.

Deviations of a fit whose axes of knees and ankles were fixed are too short for what these axes decide: they are
lengthened (`_FIXED_AXES`).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from kinertia.errors import KinertiaError
from kinertia.estimation.changes.change import SOURCES, UNITS, Change, named_outcome
from kinertia.estimation.changes.condition_changes import (
    DRAWS,
    Condition,
    condition_among,
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
from kinertia.findings.finding import Finding, Severity
from kinertia.io.subject.provenance import sha256
from kinertia.io.subject.tables import SubjectFile
from kinertia.model.anatomy import segment_of
from kinertia.model.gait27 import AXIS_TILTS, VIRTUAL_TRUNK
from kinertia.settings import Subject
from kinertia.trial.data import FEET

_FIXED_AXES = 1.6
"""Factor on deviations due to markers: with fixed axes they covered 78 to 83 % of synthetic sessions, where 4 degrees
were their axes' error."""
_BY_AXES = ("moment ankle", "moment subtalar", "angle hip_rotation", "angle knee", "angle ankle", "angle subtalar")
NARROW_M = 0.006
"""Largest SD of a marker's position in a fit of one session alone, with a prior of 5 mm; as one of two it has 10 mm."""
_VIRTUAL = frozenset(marker.label for marker in VIRTUAL_TRUNK)
_LIGHTER, _LONGER = 0.1, 0.05
"""Relative differences of mass, and of leg length, beyond which it is asked whether results are of one person.
Re-applied markers change the length of legs by 2 %."""
_GROWN_YEARS = 20.0
_OTHER_PERSON = 1.5
"""Ratio of masses beyond which results are hardly of one person: a child takes years to gain as much."""

_INSTRUMENTS = ("P", "T")
_LEFT_OUT = frozenset({"P271", "P272", "P276", "P278", "P279", "P280", "P281", "P283", "P290"})
"""Codes of loads that are not known: moments have gaps there."""
_MILD = frozenset({"P105", "P106", "P107", "P108"})
"""Codes of noise and resolution, which joint moments of whole phases hardly show."""
Trials = Sequence[TrialFit]


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
        seen = [label not in _VIRTUAL for label in self.fit.skeleton.labels]
        return bool(kept_draws(self.fit).places[:, seen].std(axis=0).max(initial=0.0) < NARROW_M)


def session(fit: Fit, condition: str | None = None) -> Session:
    """Choose the trials of a session.

    Args:
        fit: from all its trials.
        condition: of the trials; None if all state the same.

    Raises:
        KinertiaError: no trial has the condition, they state several and none is chosen, or none shows a step.
    """
    chosen = condition_among(conditions_of(fit), fit.subject.name, condition)
    trials = tuple(trial for trial in fit.trials if trial.kinematics.trial.condition == chosen)
    if not any(_steps(trial) for trial in trials):
        names = ", ".join(trial.name for trial in trials)
        raise KinertiaError(
            f"{names} of {fit.subject.name}: no stride or stance is seen, and changes are compared between contacts of "
            "the feet; give walks or runs"
        )
    return Session(fit, chosen, trials)


def _steps(trial: TrialFit) -> bool:
    return any(stride.phase != "landing" for stride in (*trial.strides, *trial.phases))


def why_incomparable(before: Fit, after: Fit) -> str:
    """State why joint moments of two results cannot be compared as of two sessions; empty if they can."""
    for fit in (before, after):
        try:
            kept_draws(fit)
        except KinertiaError as error:
            return str(error)
    both = _recordings(before), _recordings(after)
    if same := sorted(both[0][content] for content in both[0].keys() & both[1].keys()):
        return f"{', '.join(same)}: both are from the same recording, so nothing can have changed between them"
    if reason := other_sex(before.subject, after.subject):
        return reason
    ratio = after.mass_kg / before.mass_kg
    if not 1.0 / _OTHER_PERSON < ratio < _OTHER_PERSON:
        return f"masses of {before.mass_kg:.1f} and {after.mass_kg:.1f} kg are hardly of one person"
    return ""


def other_sex(before: Subject, after: Subject) -> str:
    """State that two subjects are of different sex; empty if not, or if it is not known."""
    sexes = before.sex, after.sex
    if None in sexes or len(set(sexes)) == 1:
        return ""
    return f"{sexes[0]} and {sexes[1]} are not the sex of one person: correct it in one of both"


def grows(fit: Fit) -> bool:
    """Return whether a person may have grown, by age or stated population."""
    age = fit.subject.age_years
    return fit.subject.population == "child" or (age is not None and age < _GROWN_YEARS)


def identity_note(before: Fit, after: Fit) -> str:
    """Ask whether both results are of one person, if mass or legs differ as of two, or of one who grew; else empty."""
    masses, legs = (before.mass_kg, after.mass_kg), (_leg_m(before), _leg_m(after))
    found = []
    if abs(masses[1] / masses[0] - 1.0) > _LIGHTER:
        found.append(f"masses of {masses[0]:.1f} and {masses[1]:.1f} kg")
    if abs(legs[1] / legs[0] - 1.0) > _LONGER:
        found.append(f"legs of {100.0 * legs[0]:.0f} and {100.0 * legs[1]:.0f} cm")
    if not found:
        return ""
    text = " and ".join(found)
    remedy = "If not, ignore what follows." if grows(before) else "If a child has grown, state age_years in both files."
    return f"{text[0].upper()}{text[1:]}: is it one person? {remedy}"


def _leg_m(fit: Fit) -> float:
    """Return the mean length of both legs from hip to ankle, m; NaN where the model lacks a part of both."""
    origins = fit.skeleton.neutral.translation[0]
    segments = [segment_of(name) for name in fit.skeleton.segments]
    lengths = []
    for side in FEET:
        parts = [f"{part}_{side}" for part in ("thigh", "shank", "foot")]
        if set(parts) <= set(segments):
            joints = origins[[segments.index(part) for part in parts]]
            lengths.append(float(np.linalg.norm(np.diff(joints, axis=0), axis=1).sum()))
    return float(np.mean(lengths)) if lengths else np.nan


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


def tasks_note(walks: tuple[Trials, Trials]) -> str:
    """State the tasks of both where they differ, and which are averaged together."""
    before, after = (sorted({trial.kinematics.trial.task for trial in trials} - {""}) for trials in walks)
    if before != after:
        return f"Tasks differ: {' and '.join(before)} before, {' and '.join(after)} after."
    return f"Averages are over {' and '.join(before)} together." if len(before) > 1 else ""


def one_session_note(sources: Sequence[Fit | SubjectFile]) -> str:
    """State how two subject files with the same static trial or model are compared better; else empty."""
    files = [
        source.model.static or source.model.osim if isinstance(source, SubjectFile) else None for source in sources
    ]
    if None in files or len({sha256(path) for path in files if path is not None}) > 1:
        return ""
    return (
        "Both name the same static trial or model. If markers stayed in place, compare all trials in one subject file "
        "by --conditions: errors of marker placement then cancel."
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
    sources["shared"] = replace(sources.pop("body"), bsp=bodies[1:])
    sources["rest"] = replace(sources["all"], bsp=np.repeat(bodies[:1], kept_draws(visit.fit).count, axis=0))
    with_mean = replace(_unmoved(visit.fit), bsp=bodies[:1])
    return stride_features(visit.fit, visit.trials, sources, count, progress, with_mean, anew=True)


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
    rest, instruments = (_variance(before, source) + _variance(after, source) for source in ("rest", "instruments"))
    shared = float(np.var(after.drawn["shared"] - before.drawn["shared"], ddof=1))
    contacts = sum(float(np.square(condition.drawn["contacts"]).sum()) for condition in (before, after))
    parts = parts_of(rest + shared, instruments, shared)
    if fixed_axes and outcome.startswith(_BY_AXES):
        parts["markers"] *= _FIXED_AXES**2
    parts["markers"] += contacts
    return parts


def _variance(condition: Condition, source: str) -> float:
    return float(np.var(condition.drawn[source], ddof=1))


def _recordings(fit: Fit) -> dict[bytes, str]:
    return {trial.kinematics.trial.markers.positions.tobytes(): trial.name for trial in fit.trials}


def instrument_doubts(before: tuple[Fit, Trials], after: tuple[Fit, Trials]) -> dict[str, str]:
    """State the findings that keep changes of moments from being judged, by side of the leg: codes and messages.

    Args:
        before, after: fit and trials of each condition; of one session, the same fit.
    """
    by_side = [_findings(*compared) for compared in (before, after)]
    if before[0] is after[0]:
        everywhere = {_kind(finding) for finding in by_side[0]} & {_kind(finding) for finding in by_side[1]}
        by_side = [
            [finding for finding in some if finding.severity is Severity.ERROR or _kind(finding) not in everywhere]
            for some in by_side
        ]
    doubts: dict[str, dict[str, str]] = {}
    for finding in (*by_side[0], *by_side[1]):
        for side in _sides(finding):
            doubts.setdefault(side, {})[finding.code] = f"{finding.code}: {finding.message}"
    return {side: " ".join(said.values()) for side, said in doubts.items()}


def _sides(finding: Finding) -> tuple[str, ...]:
    """Return the sides whose loads a finding concerns: that of the foot in its evidence; all sides if it has none."""
    foot = finding.evidence.get("foot")
    return {"right": ("r",), "left": ("l",)}.get("" if foot is None else str(foot.value), ("r", "l", ""))


def _findings(fit: Fit, trials: Trials) -> list[Finding]:
    names = {trial.name for trial in trials}
    return [
        finding
        for finding in fit.findings
        if finding.code.startswith(_INSTRUMENTS)
        and finding.severity >= Severity.WARNING
        and finding.code not in _LEFT_OUT | _MILD
        and finding.muted_by is None
        and finding.status != "ignored"
        and finding.where.trial in (None, *names)
    ]


def _kind(finding: Finding) -> tuple[str, str | None, str | None]:
    return finding.code, finding.where.plate, finding.where.axis
