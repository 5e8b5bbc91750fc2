"""The report's first part: a fit in words, for somebody who reads nothing else.

Whether numbers can be used is judged in `diagnostics.result.verdict`; here that is put beside how far the motion was
changed to get there, what the data say about the body, and where the estimate leaves what it started from.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.result.uses import Use, uses
from kinertia.diagnostics.result.verdict import Level, Verdict, verdicts, worst_level
from kinertia.estimation.identifiability import INFORMED, MEASURED, evidence
from kinertia.estimation.result import Fit, TrialFit
from kinertia.report.bsp_figures import DEPARTURE_SD, NAMES, departures, estimated_rows, segment_name
from kinertia.report.coordinate_titles import title_of
from kinertia.report.time_figures import motion_change
from kinertia.report.wording import decimals, expected_of, fixed, read_in, start_of
from kinertia.trial.rms import rms

_LISTED_FAR = 12
_EVIDENCE = {
    "measured": "measured",
    "informed": "informed by the data",
    "assumed": "hardly informed by the data, not to be read as this person's",
}


@dataclass(frozen=True)
class Words:
    """A fit in sentences.

    Attributes:
        level: `level_of`.
        headline: what it means for using the numbers.
        uses: `kinertia.diagnostics.result.uses.uses`.
        judgements: `kinertia.diagnostics.result.verdict.verdicts`.
        motion: how far the motion was changed.
        knowledge: what the data could and could not tell about the body segment parameters.
        departures: estimates more than two prior SDs from the prior's mean.
    """

    level: Level
    headline: str
    uses: tuple[Use, ...]
    judgements: tuple[Verdict, ...]
    motion: tuple[str, ...]
    knowledge: tuple[str, ...]
    departures: tuple[str, ...]


def level_of(fit: Fit, judgements: Iterable[Verdict]) -> Level:
    """A fit in one word: the worst of its judgements; a warning is worth a caution."""
    level = worst_level(judgements)
    return "caution" if level == "pass" and fit.warnings else level


def words(fit: Fit) -> Words:
    """The verdict on a fit."""
    judgements = tuple(verdicts(fit))
    level = level_of(fit, judgements)
    counts = [sum(one.level == wanted for one in judgements) for wanted in ("fail", "caution")]
    warned = f"{len(fit.warnings)} warning{'s' if len(fit.warnings) > 1 else ''}" if fit.warnings else ""
    calls = (
        ""
        if not counts[1]
        else f"{counts[1]} of {len(judgements)} checks call{'s' if counts[1] == 1 else ''} for caution"
    )
    headline = {
        "pass": "All checks passed: forces, motion and model agree.",
        "caution": f"Usable with care: {'; '.join(filter(None, (calls, warned)))}.",
        "fail": f"Do not use these numbers as they are: {counts[0]} of {len(judgements)} checks failed.",
    }[level]
    if level == "fail" and warned:
        headline += f" Read the {warned}."
    motion = tuple(sentence for trial in fit.trials for sentence in _motion(fit, trial))
    return Words(level, headline, tuple(uses(fit)), judgements, motion, _knowledge(fit), _departures(fit))


def _motion(fit: Fit, trial: TrialFit) -> list[str]:
    before, after = (1e3 * rms(trial.marker_errors_m[stage]) for stage in ("ik", "final"))
    change = motion_change(trial)
    angles = np.flatnonzero(fit.skeleton.rotational)
    each = np.degrees([rms(change[:, k]) for k in angles])
    worst = int(np.nanargmax(each))
    name = title_of(fit.skeleton, int(angles[worst]))
    moved = 1e3 * np.linalg.norm(change[:, :3], axis=1)
    overall = float(np.degrees(rms(change[:, angles])))
    return [
        f"{trial.name}: the model's markers are {before:.1f} mm (RMS) from the measured ones after inverse kinematics "
        f"and {after:.1f} mm after the estimate",
        f"{trial.name}: joint angles were changed by {overall:.1f} degrees (RMS), most of all {name} by "
        f"{each[worst]:.1f}; the pelvis was moved by {rms(moved):.0f} mm (RMS), {np.nanmax(moved):.0f} mm at most",
    ]


def _knowledge(fit: Fit) -> tuple[str, ...]:
    if fit.posterior is None:
        return (
            "the two-level method has no error bars: it cannot tell which parameters the data show and which they do "
            "not. Small residuals alone prove nothing about single parameters; the simultaneous method does tell",
        )
    posterior = fit.posterior
    grades = [evidence(value) for value in posterior.information[posterior.prior_sd > 0]]
    counts = {word: grades.count(word) for word in _EVIDENCE}
    sentences = [
        f"of {len(grades)} parameters {counts['measured']} are measured (information above {100 * MEASURED:g} %) "
        f"and {counts['informed']} informed by the data; {counts['assumed']} are hardly informed (below "
        f'{100 * INFORMED:g} %; "assumed" in the table): their values are about as uncertain as '
        f"{start_of(fit).whose}, even where they moved"
    ]
    masses = {fit.estimate.segments[i]: evidence(posterior.information[i, 0]) for i in estimated_rows(fit)}
    for word, meaning in _EVIDENCE.items():
        if names := [name for name, one in masses.items() if one == word]:
            sentences.append(f"masses {meaning}: {_segments(names)}")
    if kept := held_sentence(fit):
        sentences.append(kept)
    if never := posterior.base.never:
        sentences.append(
            f"{hidden_combinations(fit)} combinations cannot be seen in any motion, such as {never[0]}: all are "
            "listed above the table"
        )
    return tuple(sentences)


def held_sentence(fit: Fit) -> str:
    """Names the segments that were not estimated; empty where all were."""
    estimated = set(estimated_rows(fit))
    names = [name for i, name in enumerate(fit.estimate.segments) if i not in estimated]
    return f"kept as the model has them, not estimated: {_segments(names)}" if names else ""


def hidden_combinations(fit: Fit) -> int:
    """How many independent combinations of the estimated parameters no motion shows: parameters minus rank."""
    if fit.posterior is None:
        return 0
    base = fit.posterior.base
    return len(base.best[0].weights) - base.count


def _segments(names: list[str]) -> str:
    """ "thigh (both), foot, left"."""
    pairs = {name[:-2] for name in names if name.endswith("_r") and f"{name[:-2]}_l" in names}
    short = [name[:-2].replace("_", " ") if name[:-2] in pairs else segment_name(name) for name in names]
    return "; ".join(dict.fromkeys(short))


def _departures(fit: Fit) -> tuple[str, ...]:
    away = departures(fit)
    if away is None or fit.posterior is None:
        return ()
    scale = fit.posterior.prior_sd
    before, after, start = fit.expected.table(), fit.estimate.table(), expected_of(fit)
    far = [(int(i), int(k)) for i, k in np.argwhere(np.abs(away) > DEPARTURE_SD)]
    far.sort(key=lambda place: -abs(away[place]))
    sentences = []
    for i, k in far[:_LISTED_FAR]:
        (unit, factor), digits = read_in(k), decimals(k, scale[i, k])
        sentences.append(
            f"{NAMES[k]} of {segment_name(fit.estimate.segments[i])}: {fixed(factor * after[i, k], digits)} {unit}; "
            f"{start.word} {fixed(factor * before[i, k], digits)}; {away[i, k]:+.1f} prior SDs apart"
        )
    if len(far) > _LISTED_FAR:
        sentences.append(f"and {len(far) - _LISTED_FAR} more: sort the table by prior SDs to see them")
    return tuple(sentences)
