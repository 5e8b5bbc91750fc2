"""Decides which findings about plates and synchronisation keep changes of joint moments from being judged.

What all trials of one estimate share cancels in a difference, and what the estimate corrects is in its deviations. What
remains are errors of one condition only, and errors that a user waived.
"""

from collections.abc import Sequence

from kinertia.estimation.result import Fit
from kinertia.estimation.trial_fit import TrialFit
from kinertia.findings.finding import Finding, Severity

_INSTRUMENTS = ("P", "T")
_LEFT_OUT = frozenset({"P271", "P272", "P276", "P278", "P279", "P280", "P281", "P283", "P290"})
"""Codes of loads that are not known: moments have gaps there."""
_MILD = frozenset({"P105", "P106", "P107", "P108"})
"""Codes of noise and resolution, which joint moments of whole phases hardly show."""
Trials = Sequence[TrialFit]


def instrument_doubts(before: tuple[Fit, Trials], after: tuple[Fit, Trials]) -> dict[str, str]:
    """State the findings that keep changes of moments from being judged, by side of the leg: codes and messages.

    Args:
        before, after: fit and trials of each condition; of one session, the same fit.
    """
    own = [_findings(*each) for each in (before, after)]
    if before[0] is after[0]:
        everywhere = {_kind(one) for one in own[0]} & {_kind(one) for one in own[1]}
        own = [[one for one in some if one.severity is Severity.ERROR or _kind(one) not in everywhere] for some in own]
    doubts: dict[str, dict[str, str]] = {}
    for one in (*own[0], *own[1]):
        for side in _sides(one):
            doubts.setdefault(side, {})[one.code] = f"{one.code}: {one.message}"
    return {side: " ".join(said.values()) for side, said in doubts.items()}


def _sides(one: Finding) -> tuple[str, ...]:
    """Return the sides whose loads a finding is about: that of a foot which it names, or all."""
    foot = one.evidence.get("foot")
    return {"right": ("r",), "left": ("l",)}.get("" if foot is None else str(foot.value), ("r", "l", ""))


def _findings(fit: Fit, trials: Trials) -> list[Finding]:
    names = {trial.name for trial in trials}
    return [
        one
        for one in fit.findings
        if one.code.startswith(_INSTRUMENTS)
        and one.severity >= Severity.WARNING
        and one.code not in _LEFT_OUT | _MILD
        and one.muted_by is None
        and one.status != "ignored"
        and one.where.trial in (None, *names)
    ]


def _kind(one: Finding) -> tuple[str, str | None, str | None]:
    return one.code, one.where.plate, one.where.axis
