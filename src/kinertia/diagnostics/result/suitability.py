"""Rates the fitness of each output for its use; R11 and R40 report what a result is based on.

Findings judge the estimate as a whole; here their consequences for each output are derived: an ERROR that affects it
means "do not use", a WARNING "use with care".
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.runner import check
from kinertia.estimation.identifiability import INFORMED, MEASURED
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.leg_moments import coverage_sentence, forces_used
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.trial.sampled_data import rms, rms_length

Use = Literal["use", "use with care", "do not use"]
_ORDER: tuple[Use, ...] = ("use", "use with care", "do not use")
SHOWN_SHARE = 0.5
"""Share of parameters that the data inform from which a table of them is this person's, if they inform any well."""
_BAND_SD = 1.96
_LEAST_SHARE = Limit(0.01)
"""Frames with less weight, from which share on they are mentioned."""


class Group(NamedTuple):
    """Parameters of one kind, such as masses or centres of mass.

    Attributes:
        nouns: what they are called.
        columns: their columns in the table of body segment parameters.
        start: prefix of the parameters' names.
    """

    nouns: str
    columns: slice
    start: str


GROUPS: Mapping[str, Group] = {
    "masses": Group("masses", slice(0, 1), "mass"),
    "centres_of_mass": Group("coordinates of centres of mass", slice(1, 4), "com"),
    "inertias": Group("moments of inertia", slice(4, 7), "i"),
}
"""Groups of parameters by their name among the outputs that rules affect."""
_TITLES = {
    "moments": "joint moments",
    "masses": "segment masses",
    "centres_of_mass": "centres of mass",
    "inertias": "moments of inertia",
    "motion": "motion",
}


@dataclass(frozen=True)
class Suitability:
    """Suitability of an output for use, with the reason.

    Attributes:
        output: "joint moments", "segment masses", "centres of mass", "moments of inertia" or "motion".
        use: "use", "use with care" or "do not use".
        reason: reason, with a number.
        codes: codes of the findings that lower the suitability.

    Examples:
        >>> for one in kinertia.suitability(fit, fit.findings):
        ...     print(one.output)
        joint moments
        segment masses
        centres of mass
        moments of inertia
        motion
    """

    output: str
    use: Use
    reason: str
    codes: tuple[str, ...] = ()


class Informed(NamedTuple):
    """How many of a group of estimated parameters the data inform, and how many of them well."""

    total: int
    informed: int
    measured: int


def suitability(fit: Fit, findings: Iterable[Finding], left_out: Sequence[str] = ()) -> tuple[Suitability, ...]:
    """Rate the suitability of each output.

    Args:
        fit: the fit as estimated.
        findings: findings of all stages, explained and overruled.
        left_out: trials that were blocked and are not in the fit: then nothing is used without care.
    """
    known = [reported for reported in findings if reported.where.trial not in left_out]
    return tuple(_output(fit, name, known, left_out) for name in _TITLES)


def informed(fit: Fit, output: str) -> Informed | None:
    """Count informed parameters of an output; None if unknown, after two-level, or where none was estimated."""
    if fit.posterior is None:
        return None
    columns = GROUPS[output].columns
    estimated = fit.posterior.prior_sd[:, columns] > 0
    information = fit.posterior.information[:, columns][estimated]
    if not information.size:
        return None
    return Informed(information.size, int((information > INFORMED).sum()), int((information > MEASURED).sum()))


def _output(fit: Fit, name: str, findings: Sequence[Finding], left_out: Sequence[str]) -> Suitability:
    level, reason = _of_parameters(fit, name) if name in GROUPS else (0, _REASONS[name](fit))
    levels, reasons = [level], [reason if fit.converged else "the estimate did not converge"]
    affecting = [reported for reported in findings if _affects(reported, name)]
    lowering = [_lowering(reported, findings) for reported in affecting]
    levels += [level for _, level in lowering]
    if not fit.converged:
        levels.append(2)
    if left_out:
        levels.append(1)
        reasons.append(f"{len(left_out)} of {len(fit.trials) + len(left_out)} trials left out")
    codes = tuple(dict.fromkeys(code for code, level in sorted(lowering, key=lambda cause: -cause[1]) if level))
    if codes:
        reasons.append(f"see {', '.join(codes)}")
    return Suitability(_TITLES[name], _ORDER[max(levels)], "; ".join(reasons), codes)


def _affects(reported: Finding, output: str) -> bool:
    """Return whether a finding concerns an output, so that it, or what explains it, lowers it."""
    return reported.severity >= Severity.WARNING and output in reported.rule.affects and _concerns(reported, output)


def _cause(reported: Finding, findings: Sequence[Finding]) -> Finding:
    """Return the finding that explains this one, directly or through others; itself if none does.

    A finding knows its cause by code alone: of several at its place, an unexplained one is the cause, and none twice.
    """
    followed = [reported]
    while followed[-1].muted_by is not None:
        last = followed[-1]
        causes = [
            candidate
            for candidate in findings
            if candidate.code == last.muted_by
            and candidate.where.overlaps(last.where)
            and not any(candidate is other for other in followed)
        ]
        if not causes:
            break
        followed.append(min(causes, key=lambda candidate: candidate.muted_by is not None))
    return followed[-1]


def _lowering(reported: Finding, findings: Sequence[Finding]) -> tuple[str, int]:
    """Return the code of the finding that explains this one, and by how many steps of _ORDER it lowers an output."""
    cause = _cause(reported, findings)
    if cause.status == "ignored" or cause.severity < Severity.WARNING:
        return cause.code, 0
    return cause.code, 2 if reported.severity is Severity.ERROR and cause.status == "open" else 1


def _concerns(reported: Finding, output: str) -> bool:
    """Return whether an implausible parameter belongs to the output."""
    parameter = reported.evidence.get("parameter")
    return parameter is None or output not in GROUPS or str(parameter.value).startswith(GROUPS[output].start)


def _of_parameters(fit: Fit, name: str) -> tuple[int, str]:
    """Return level and reason from how well the data inform these parameters."""
    shown, nouns = informed(fit, name), GROUPS[name].nouns
    if fit.posterior is None:
        return 1, "no error bars (two-level): it is unknown which of them this recording informs"
    if shown is None:
        return 1, f"no {nouns} were estimated"
    values = prior_values(fit)
    well = f" ({shown.measured} of them well)" if shown.measured else ""
    if not shown.informed:
        return 2, f"none of {shown.total} {nouns} is informed by this recording: they remain {values}"
    needs_care = int(shown.informed < SHOWN_SHARE * shown.total or not shown.measured)
    if shown.informed == shown.total:
        return needs_care, f"all {shown.total} {nouns} are {'' if well else 'partly '}informed by this recording{well}"
    verb = "is" if shown.informed == 1 else "are"
    reason = (
        f"{shown.informed} of {shown.total} {nouns} {verb} partly informed by this recording{well}; the other "
        f"{shown.total - shown.informed} remain {values}"
    )
    return needs_care, reason


def prior_values(fit: Fit) -> str:
    """Name the source of parameters that the data do not inform: literature, prior or the model's own values."""
    source = fit.expected_source
    return source if source.endswith("values") else f"{source.removeprefix('the ')} values"


def _moments(fit: Fit) -> str:
    complete = [trial for trial in fit.trials if trial.kinematics.complete]
    force, moment = (
        max((rms_length(trial.residuals["estimate"][:, part]) for trial in complete), default=float("nan"))
        for part in (slice(0, 3), slice(3, 6))
    )
    reason = f"residual at most {force:.1f} N and {moment:.1f} N m (RMS)" if complete else "residual unknown"
    if covered := coverage_sentence(fit.trials):
        reason = f"{covered}; {reason}"
    half = _half_interval(fit, "moments")
    if half is None:
        return reason
    return f"{reason}; typical 95 % interval of a joint moment: ± {half / fit.mass_kg:.2f} N m/kg"


def _motion(fit: Fit) -> str:
    apart = 1e3 * max(rms(trial.marker_errors_m["final"]) for trial in fit.trials)
    reason = f"model and measured markers are at most {apart:.1f} mm apart (RMS)"
    half = _half_interval(fit, "coordinates")
    if half is None:
        return reason
    return f"{reason}; typical 95 % interval of a joint angle: ± {np.degrees(half):.1f} degrees"


def _half_interval(fit: Fit, kind: Literal["moments", "coordinates"]) -> float | None:
    """Return half a typical 95 % interval of the rotations after the pelvis; None without their SDs."""
    sds = [getattr(trial.deviations, kind)[:, 6:] for trial in fit.trials if trial.deviations is not None]
    turns = fit.skeleton.rotational[6:]
    every = np.concatenate(sds)[:, turns] if sds else np.zeros(0)
    return _BAND_SD * rms(every) if np.isfinite(every).any() else None


_REASONS: Mapping[str, Callable[[Fit], str]] = {"moments": _moments, "motion": _motion}


@check("R111", "R112", share=_LEAST_SHARE)
def filters(context: ResultContext) -> Iterator[Finding]:
    """Report R111 and R112: a cutoff that was chosen (R111), and impacts that were given less weight (R112)."""
    for trial in context.fit.trials if context.fit.settings.cutoff_hz == "gcv" else ():
        yield finding("R111", Where(trial=trial.name), cutoff_hz=Quantity(trial.kinematics.cutoff_hz, "Hz"))
    posterior = context.fit.posterior
    shares = () if posterior is None else posterior.down_weighted
    for trial, share in zip(context.fit.trials, shares, strict=False):
        if share > _LEAST_SHARE:
            yield finding("R112", Where(trial=trial.name), share=Quantity(share, "1", limit=_LEAST_SHARE))


@check("R402", "R403", "R404")
def basis(context: ResultContext) -> Iterator[Finding]:
    """Report which part of the result rests on assumptions, or on the prior."""
    fit = context.fit
    for trial in fit.trials:
        used = forces_used(trial.reactions, fit.settings, trial.motion_hz)
        impact = Quantity(trial.reactions.impact_n, "N")
        yield finding("R402", Where(trial=trial.name), which=Quantity(used.which), impact_n=impact)
    if fit.posterior is None:
        yield finding("R403")
    for output, group in GROUPS.items():
        shown = informed(fit, output)
        if shown is not None and shown.informed < SHOWN_SHARE * shown.total:
            counts = {"shown": Quantity(shown.informed, "1"), "count": Quantity(shown.total, "1")}
            words = {"group": Quantity(group.nouns), "values": Quantity(prior_values(fit))}
            yield with_evidence("R404", Where(part=group.nouns), counts | words)
