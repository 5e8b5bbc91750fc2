"""The report's first part: a fit in words, for somebody who reads nothing else.

Whether numbers can be used is judged in `kinertia.verdict`; here that is put beside how far the motion was changed to
get there, what the data told about the body, and where the estimate leaves the literature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.fit import Fit, TrialFit
from kinertia.identifiability import INFORMED, MEASURED, evidence
from kinertia.ik import rms
from kinertia.report.bsp_figures import DEPARTURE_SD, NAMES, departures, read_in, segment_name
from kinertia.report.coordinate_titles import title_of
from kinertia.report.time_figures import motion_change
from kinertia.verdict import Level, Verdict, verdicts

_LISTED_FAR = 12
_EVIDENCE = {"measured": "", "informed": " by the data", "assumed": ", not to be read as this person's"}


@dataclass(frozen=True)
class Words:
    """A fit in sentences.

    Attributes:
        level: the worst of the judgements.
        headline: what it means for using the numbers.
        judgements: `kinertia.verdict.verdicts`.
        motion: how far the motion was changed.
        knowledge: what the data could and could not tell about the body segment parameters.
        departures: estimates beyond two deviations of the literature.
    """

    level: Level
    headline: str
    judgements: tuple[Verdict, ...]
    motion: tuple[str, ...]
    knowledge: tuple[str, ...]
    departures: tuple[str, ...]


def words(fit: Fit) -> Words:
    """The verdict on a fit."""
    judgements = tuple(verdicts(fit))
    levels = [judgement.level for judgement in judgements]
    level: Level = next(one for one in ("against", "okay", "good") if one in levels)
    against = levels.count("against")
    headline = {
        "good": "The checks are passed: forces, motion and model agree. What that shows of the body stands below.",
        "okay": "Usable with care: every check is passed, but not all of them well.",
        "against": f"Do not use these numbers as they are: {against} of {len(levels)} checks speak against them.",
    }[level]
    if fit.warnings:
        headline += f" Read the warning{'s' if len(fit.warnings) > 1 else ''}."
    motion = tuple(sentence for trial in fit.trials for sentence in _motion(fit, trial))
    return Words(level, headline, judgements, motion, _knowledge(fit), _departures(fit))


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
            "not. Small residuals alone prove nothing about single parameters; the simultaneous method tells",
        )
    told = [[evidence(value) for value in row] for row in fit.posterior.information]
    counts = {word: sum(row.count(word) for row in told) for word in _EVIDENCE}
    found = [
        f"of {sum(counts.values())} parameters the data measured {counts['measured']} (information above "
        f"{100 * MEASURED:g} %) and informed {counts['informed']}; {counts['assumed']} are assumed from the literature "
        f"(below {100 * INFORMED:g} %)"
    ]
    for word, meaning in _EVIDENCE.items():
        names = [name for name, row in zip(fit.estimate.segments, told, strict=True) if row[0] == word]
        if names:
            found.append(f"masses {word}{meaning}: {_segments(names)}")
    if never := fit.posterior.base.never:
        found.append(f"{len(never)} combinations no motion ever shows, such as {never[0]}: they stand with the table")
    return tuple(found)


def _segments(names: list[str]) -> str:
    """ "thigh (both), foot, left"."""
    pairs = {name[:-2] for name in names if name.endswith("_r") and f"{name[:-2]}_l" in names}
    short = [name[:-2].replace("_", " ") if name[:-2] in pairs else segment_name(name) for name in names]
    return "; ".join(dict.fromkeys(short))


def _departures(fit: Fit) -> tuple[str, ...]:
    away = departures(fit)
    if away is None:
        return ()
    before, after = fit.literature.table(), fit.estimate.table()
    far = [(int(i), int(k)) for i, k in np.argwhere(np.abs(away) > DEPARTURE_SD)]
    far.sort(key=lambda place: -abs(away[place]))
    told = []
    for i, k in far[:_LISTED_FAR]:
        unit, factor = read_in(k)
        told.append(
            f"{NAMES[k]} of {segment_name(fit.estimate.segments[i])}: {factor * after[i, k]:.3g} {unit}; literature "
            f"{factor * before[i, k]:.3g}; {away[i, k]:+.1f} deviations apart"
        )
    if len(far) > _LISTED_FAR:
        told.append(f"and {len(far) - _LISTED_FAR} more: sort the table by deviations to see them")
    return tuple(told)
