"""Writes the report's first part: fitness for use, and what the estimate changed.

Findings state what is wrong and `suitability` the consequence for each output; this module applies it to the purposes
that people have.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.result.suitability import Suitability
from kinertia.estimation.identifiability import INFORMED, MEASURED
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.findings.finding import Severity
from kinertia.findings.overview import DO_NOT_USE, USES, WITH_CARE
from kinertia.model.bsp import PARAMETERS
from kinertia.report.figures.bsp_figures import DEPARTURE_SD, NAMES, segment_name
from kinertia.report.figures.coordinate_titles import title_of
from kinertia.report.wording import asymmetry_sentences, decimals, expected_of, fixed, read_in
from kinertia.trial.sampled_data import rms

_LISTED_FAR = 12
_EVIDENCE = {
    "measured": "well informed by the data",
    "informed": "partly informed by the data",
    "assumed": "not informed by the data, not to be read as this person's",
}
IMPOSSIBLE = "R202"
"""The code of bodies that cannot exist."""


class Purpose(NamedTuple):
    """Purpose of a result, whether this one is suitable ("use", "use with care", "do not use"), and why."""

    name: str
    use: str
    reason: str


@dataclass(frozen=True)
class Words:
    """Description of a fit in sentences.

    Attributes:
        motion: how far the motion was changed.
        knowledge: which body segment parameters the data determine.
        departures: estimates more than two prior SDs from the prior's mean.
        held: segments that were not estimated; empty where all were.
        asymmetry: whether left and right differ, by pair of limbs.
        hidden: number of independent combinations of the estimated parameters that no motion shows.
    """

    motion: tuple[str, ...]
    knowledge: tuple[str, ...]
    departures: tuple[str, ...]
    held: str
    asymmetry: list[str]
    hidden: int


def words(fit: Fit) -> Words:
    """Describe a fit in sentences."""
    held, hidden = _held(fit), _hidden(fit)
    knowledge, departures, asymmetry = _knowledge(fit, held, hidden), _departures(fit), asymmetry_sentences(fit)
    motion = tuple(sentence for trial in fit.trials for sentence in _motion(fit, trial))
    return Words(motion, knowledge, departures, held, asymmetry, hidden)


def impossible(fit: Fit) -> bool:
    """Return whether an impossible body was estimated, which no simulation accepts."""
    return any(finding.code == IMPOSSIBLE and finding.severity is Severity.ERROR for finding in fit.findings)


def purposes(outputs: Sequence[Suitability], no_body: bool) -> tuple[Purpose, ...]:
    """Rate three purposes by the five outputs: joint moments, parameters in print, next steps in OpenSim."""
    by_name = {rating.output: rating for rating in outputs}
    moments, motion = by_name["joint moments"], by_name["motion"]
    segments = [by_name[name] for name in ("segment masses", "centres of mass", "moments of inertia")]
    uses = {rating.use for rating in segments}
    by_use = [
        f"{word}: {', '.join(rating.output for rating in segments if rating.use == use)}"
        for use, word in zip(USES, ("use", "with care", DO_NOT_USE), strict=True)
        if use in uses
    ]
    codes = dict.fromkeys(code for rating in segments for code in rating.codes)
    by_use += [f"see {', '.join(codes)}"] if codes else []
    parameters = segments[0] if len(uses) == 1 else Suitability("", WITH_CARE, "; ".join(by_use))
    worse = max((moments, motion), key=lambda rating: USES.index(rating.use))
    opensim = Purpose("Next OpenSim step (RRA, CMC)", worse.use, worse.reason)
    if no_body:
        opensim = opensim._replace(use=DO_NOT_USE, reason=f"a segment is physically impossible; see {IMPOSSIBLE}")
    return (
        Purpose("Joint moments and powers", moments.use, moments.reason),
        Purpose("Segment parameters in a paper", parameters.use, parameters.reason),
        opensim,
    )


def without_repetition(rated: Sequence[Purpose], said: str) -> list[Purpose]:
    """Leave out of the reasons what the report states elsewhere, and what another purpose has stated."""
    result: list[Purpose] = []
    for purpose in rated:
        like = next((other for other in rated[: len(result)] if other.reason == purpose.reason), None)
        reason = purpose.reason.removeprefix(f"{said}; ") if like is None else f"same as for {like.name.lower()}"
        result.append(purpose._replace(reason=reason))
    return result


def _motion(fit: Fit, trial: TrialFit) -> list[str]:
    before, after = (1e3 * rms(trial.marker_errors_m[stage]) for stage in ("ik", "final"))
    change = trial.motion_change
    angles = np.flatnonzero(fit.skeleton.rotational)
    by_angle = np.degrees([rms(change[:, k]) for k in angles])
    worst = int(np.nanargmax(by_angle))
    name = title_of(fit.skeleton, int(angles[worst]))
    moved = 1e3 * np.linalg.norm(change[:, :3], axis=1)
    overall = float(np.degrees(rms(change[:, angles])))
    return [
        f"{trial.name}: model and measured markers are {before:.1f} mm (RMS) apart by inverse kinematics and "
        f"{after:.1f} mm by the estimate",
        f"{trial.name}: joint angles were changed by {overall:.1f} degrees (RMS), most of all {name} by "
        f"{by_angle[worst]:.1f}; the pelvis was moved by {rms(moved):.0f} mm (RMS), {np.nanmax(moved):.0f} mm at most",
    ]


def _knowledge(fit: Fit, held: str, hidden: int) -> tuple[str, ...]:
    if fit.posterior is None:
        return (
            "the two-level method has no error bars, so it is unknown which parameters the data inform. Small "
            "residuals alone prove nothing about single parameters; use the simultaneous method",
        )
    posterior = fit.posterior
    grades = fit.evidence[posterior.prior_sd > 0].tolist()
    counts = {word: grades.count(word) for word in _EVIDENCE}
    sentences = [
        f"of {len(grades)} parameters {counts['measured']} are well informed by the data (information above "
        f"{100 * MEASURED:g} %), {counts['informed']} partly and {counts['assumed']} not (below {100 * INFORMED:g} %; "
        f'"assumed" in the table): treat the latter as {expected_of(fit).values}'
    ]
    masses = {fit.estimate.segments[i]: fit.evidence[i, 0] for i in fit.estimated_rows}
    for word, meaning in _EVIDENCE.items():
        if names := [name for name, knowledge in masses.items() if knowledge == word]:
            sentences.append(f"masses {meaning}: {_segments(names)}")
    if held:
        sentences.append(held)
    if never := posterior.base.never:
        sentences.append(
            f"{hidden} combinations cannot be seen in any motion, such as {never[0]}: all are listed above the table"
        )
    return tuple(sentences)


def _held(fit: Fit) -> str:
    """List the segments that were not estimated, in a sentence; empty where all were."""
    estimated = set(fit.estimated_rows)
    names = [name for i, name in enumerate(fit.estimate.segments) if i not in estimated]
    return f"fixed at the model's values, not estimated: {_segments(names)}" if names else ""


def _hidden(fit: Fit) -> int:
    """Count independent combinations of the estimated parameters that no motion shows: parameters minus rank."""
    if fit.posterior is None:
        return 0
    base = fit.posterior.base
    return len(PARAMETERS) * len(fit.estimated_rows) - base.count


def _segments(names: list[str]) -> str:
    """List segments: "thigh (both), foot, left"."""
    pairs = {name[:-2] for name in names if name.endswith("_r") and f"{name[:-2]}_l" in names}
    short = [name[:-2].replace("_", " ") if name[:-2] in pairs else segment_name(name) for name in names]
    return "; ".join(dict.fromkeys(short))


def _departures(fit: Fit) -> tuple[str, ...]:
    away = fit.departures
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
