"""Summarises findings: the verdict, what is open in order of importance, equal findings as one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

from kinertia.findings.display import first_few
from kinertia.findings.finding import Finding, Severity
from kinertia.findings.rule import STAGES

if TYPE_CHECKING:
    import pandas as pd

Use = Literal["use", "use with care", "do not use"]
USE: Final = "use"
WITH_CARE: Final = "use with care"
DO_NOT_USE: Final = "do not use"
USES: Final = (USE, WITH_CARE, DO_NOT_USE)
"""The best first."""
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


@dataclass(frozen=True)
class Overview:
    """Summary of findings.

    Attributes:
        findings: all of them, muted and overruled ones included.
        rules: how many rules were asked.
        trials: number of trials, without those used only for their markers on request.
        left_out: names of the trials that were not used, or only for their markers.

    Examples:
        >>> from kinertia.findings.overview import Overview
        >>> Overview((), 61, 2).line
        'Use. No problems were found; both trials were used.'
    """

    findings: Sequence[Finding]
    rules: int
    trials: int
    left_out: tuple[str, ...] = ()

    @property
    def open(self) -> list[Finding]:
        """Findings that are neither explained nor overruled, the most important first."""
        return reported(self.findings, Severity.INFO)

    def count(self, severity: Severity) -> int:
        """Count the open findings of this severity."""
        return sum(finding.severity is severity for finding in self.open)

    @property
    def failed(self) -> bool:
        """Whether an ERROR is open, or a trial was not used."""
        return bool(self.left_out) or self.count(Severity.ERROR) > 0

    @property
    def waived(self) -> list[Finding]:
        """ERRORs that the user has overruled."""
        return [finding for finding in self.findings if finding.status == "waived" and finding.muted_by is None]

    @property
    def severity(self) -> Severity:
        """Worst severity of the open findings; a waived ERROR, and one of a trial left out, count as a WARNING."""
        used = [
            finding
            for finding in self.open
            if finding.where.trial not in self.left_out or len(self.left_out) >= self.trials
        ]
        worst = max((finding.severity for finding in used), default=Severity.INFO)
        return max(worst, Severity.WARNING) if self.waived or self.left_out else worst

    @property
    def verdict(self) -> Use:
        """Verdict: "use", "use with care" or "do not use"."""
        if self.severity is Severity.ERROR:
            return DO_NOT_USE
        return WITH_CARE if self.severity is Severity.WARNING else USE

    @property
    def table(self) -> pd.DataFrame:
        """All findings, one row each, the worst first: the columns of `findings.parquet`, and message."""
        import pandas as pd

        found = in_order(self.findings)
        return pd.DataFrame({**finding_columns(found), "message": [finding.message for finding in found]})

    @property
    def line(self) -> str:
        """Verdict with its basis, in plain sentences."""
        open_ones = (_counted(self.count(Severity.ERROR), "error"), _counted(self.count(Severity.WARNING), "warning"))
        ignored = sum(finding.status == "ignored" and finding.muted_by is None for finding in self.findings)
        parts = [
            " and ".join(filter(None, open_ones)),
            _counted(self.count(Severity.CORRECTED), "error", "corrected"),
            _counted(len(self.waived), "error", "waived"),
            _counted(ignored, "finding", "ignored"),
        ]
        found = [*filter(None, parts)] or ["no problems were found"]
        sentence = "; ".join([*found, *filter(None, [self._trials_used])])
        return f"{self.verdict.capitalize()}. {sentence[0].upper()}{sentence[1:]}."

    @property
    def _trials_used(self) -> str:
        """Part of the line that says which trials were used; empty where there are none."""
        used, by_markers = self.trials - len(self.left_out), len(self.markers_only)
        if not self.trials:
            return ""
        if used < self.trials:
            text = f"{used} of {self.trials} trials {'was' if used == 1 else 'were'} used"
        else:
            whole = {1: "the trial was", 2: "both trials were"}
            text = f"{whole.get(used, f'all {_number(used)} trials were')} used"
        return text + (f", and the markers of {_number(by_markers)} more" if by_markers else "")

    @property
    def markers_only(self) -> set[str | None]:
        """Names of the trials of which only the markers are used: on request (P280), or because forces are unusable
        (P283)."""
        asked, refused = (
            {finding.where.trial for finding in self.findings if finding.code == code} for code in ("P280", "P283")
        )
        return asked - set(self.left_out) | refused


def _number(count: int) -> str:
    """Return a small number in words; larger ones as digits."""
    return _NUMBERS[count] if count < len(_NUMBERS) else str(count)


def _counted(count: int, noun: str, done: str = "") -> str:
    """Return a count in words, "two errors were corrected"; empty for none."""
    nouns = f"{_number(count)} {noun}{'' if count == 1 else 's'}"
    clause = f" {'was' if count == 1 else 'were'} {done}" if done else ""
    return nouns + clause if count else ""


def in_order(findings: Iterable[Finding]) -> list[Finding]:
    """Sort findings, the worst first; equals by concerning all trials first, then by stage."""

    def importance(finding: Finding) -> tuple[int, bool, int, str]:
        return -finding.severity, finding.where.trial is not None, STAGES.index(finding.rule.stage), finding.code

    return sorted(findings, key=importance)


def reported(findings: Iterable[Finding], least: Severity = Severity.CORRECTED) -> list[Finding]:
    """Return open findings from this severity on, in order; assumptions and advice are left out by default."""
    return in_order(finding for finding in findings if finding.is_open and finding.severity >= least)


def consequences(findings: Sequence[Finding], causes: Iterable[Finding]) -> list[Finding]:
    """Return the findings that these causes explain, directly or through others."""
    found: list[Finding] = []
    waiting = list(causes)
    while waiting:
        cause = waiting.pop()
        for finding in findings:
            if finding.muted_by == cause.code and cause.where.overlaps(finding.where) and finding not in found:
                found.append(finding)
                waiting.append(finding)
    return in_order(found)


def finding_columns(found: Sequence[Finding]) -> dict[str, Any]:
    """Return the columns of a table of findings, with the headline's value."""
    heads = [finding.headline for finding in found]
    return {
        "trial": [finding.where.trial for finding in found],
        "plate": [finding.where.plate for finding in found],
        "code": [finding.code for finding in found],
        "severity": [finding.severity.name for finding in found],
        "status": [finding.status for finding in found],
        "muted_by": [finding.muted_by for finding in found],
        "value": [None if head is None else float(head.value) for head in heads],  # type: ignore[arg-type]
        "unit": [None if head is None else head.unit for head in heads],
    }


@dataclass(frozen=True)
class Group:
    """Findings of one code in one trial or file, represented by the first."""

    findings: tuple[Finding, ...]

    @property
    def first(self) -> Finding:
        """Finding whose message is shown."""
        return self.findings[0]

    @property
    def message(self) -> str:
        """Message of the first finding, with the number of further places."""
        if len(self.findings) == 1:
            return self.first.message
        places = [_place(finding) for finding in self.findings]
        named = [place for place in places[1:] if place and place != places[0]]
        also = f"also {first_few(named, 3)}" if named else f"{len(places) - 1} more"
        return f"{self.first.message.rstrip('.')} ({also})."

    @property
    def line(self) -> str:
        """Place, code and message on one line."""
        place = f"{self.first.place}  " if self.first.place else ""
        return f"{place}{self.first.code} {self.message}"


def grouped(findings: Iterable[Finding]) -> list[Group]:
    """Group findings of the same code, file, trial and severity, in order."""
    groups: dict[tuple[object, ...], list[Finding]] = {}
    for finding in findings:
        alike = (
            finding.code,
            finding.where.file,
            finding.where.trial,
            finding.severity,
            finding.status,
            finding.muted_by,
        )
        groups.setdefault(alike, []).append(finding)
    return [Group(tuple(alike_findings)) for alike_findings in groups.values()]


def _place(finding: Finding) -> str:
    where = finding.where
    if where.plate or where.axis:
        return " on ".join(filter(None, (where.axis, where.plate)))
    return (where.markers[0] if where.markers else None) or where.part or ""
