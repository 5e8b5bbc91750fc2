"""Shows findings on pages: what to do next, by severity, corrections, explanations.

The report, check.html and the page in the browser share one view, so that they describe a finding in the same way.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from markupsafe import Markup, escape

from kinertia.findings.display import axis_text, first_few, outlined, shown
from kinertia.findings.finding import Finding, Severity
from kinertia.findings.overview import (
    DO_NOT_USE,
    USE,
    WITH_CARE,
    Group,
    Overview,
    consequences,
    grouped,
    in_order,
    reported,
)
from kinertia.findings.quantity import Quantity, Where
from kinertia.findings.remedy import Span, remedies
from kinertia.findings.rule import Rule, matching, rule

LOOKS = {USE: "info", WITH_CARE: "warning", DO_NOT_USE: "error"}
"""Class of the style sheet for each word of a verdict; that of a finding is its severity."""
MOST_STEPS = 3
_TITLES = {Severity.ERROR: "Errors", Severity.WARNING: "Warnings"}
_CODE = re.compile(r"\b([A-Z]\d{3})\b")
_OPTION = re.compile(r"(?<!\S)(--?[a-z][a-z-]*)")


@dataclass(frozen=True)
class Measured:
    """Evidence of one finding: its place, and each quantity in words."""

    place: str
    quantities: tuple[str, ...]


@dataclass(frozen=True)
class Correction:
    """Row of the table of corrections: place, name, size with its SD, and effect."""

    finding: Finding
    where: str
    what: str
    size: str
    muted: tuple[Group, ...]


@dataclass(frozen=True)
class Card:
    """Findings of one code in one trial or file, with those that they explain."""

    group: Group
    muted: tuple[Group, ...]

    @property
    def first(self) -> Finding:
        """Finding whose words are shown."""
        return self.group.first

    @property
    def measured(self) -> list[Measured]:
        """Evidence, one entry for each finding that has any."""
        measured = [
            Measured(place_text(finding.where), tuple(evidence_texts(finding))) for finding in self.group.findings
        ]
        return [place for place in measured if place.quantities]


@dataclass(frozen=True)
class FindingView:
    """Findings of one or several overviews, as a page shows them."""

    overviews: Sequence[Overview]

    @cached_property
    def findings(self) -> list[Finding]:
        """All findings, the worst first."""
        return in_order(finding for overview in self.overviews for finding in overview.findings)

    def _cards(self, severity: Severity) -> list[Card]:
        top = [finding for finding in self.findings if finding.muted_by is None and finding.status != "ignored"]
        groups = grouped(finding for finding in top if finding.severity is severity)
        return [Card(group, self._explained(group.findings)) for group in groups]

    def _explained(self, causes: Sequence[Finding]) -> tuple[Group, ...]:
        """Return the findings that equal causes explain; each of several models explains its own."""
        findings = next(overview.findings for overview in self.overviews if causes[0] in overview.findings)
        return tuple(grouped(consequences(findings, causes)))

    @cached_property
    def sections(self) -> list[tuple[str, list[Card]]]:
        """Errors and warnings, including waived ones, under their headings; without empty sections."""
        cards = [(title, self._cards(severity)) for severity, title in _TITLES.items()]
        return [(title, some) for title, some in cards if some]

    @cached_property
    def corrections(self) -> list[Correction]:
        """Apparent errors that a reader or the estimate has corrected."""
        return [_correction(finding, self._explained([finding])) for finding in self._top(Severity.CORRECTED)]

    @cached_property
    def notes(self) -> list[tuple[Group, str]]:
        """Assumptions and advice, once for each code and message, with their trials or files."""
        alike: dict[tuple[str, str], list[Group]] = {}
        for group in grouped(self._top(Severity.INFO)):
            alike.setdefault((group.first.code, group.message), []).append(group)
        places = (list(filter(None, (similar.first.place for similar in groups))) for groups in alike.values())
        return [(groups[0], first_few(names)) for groups, names in zip(alike.values(), places, strict=True)]

    def _top(self, severity: Severity) -> list[Finding]:
        return [finding for finding in self.findings if finding.severity is severity and finding.is_open]

    @cached_property
    def ignored(self) -> str:
        """Codes that the user ignores, how often they were found, and the reason; empty without any."""
        found = [finding for finding in self.findings if finding.status == "ignored" and finding.muted_by is None]
        codes, reasons = [finding.code for finding in found], {finding.code: finding.reason for finding in found}
        return ", ".join(f"{code} ({codes.count(code)}{f': {why}' if why else ''})" for code, why in reasons.items())

    @cached_property
    def steps(self) -> list[Card]:
        """Findings whose remedies come first: at most three, each remedy once."""
        cards = {card.first.remedy: card for _, some in reversed(self.sections) for card in reversed(some)}
        return [card for _, some in self.sections for card in some if cards[card.first.remedy] is card][:MOST_STEPS]

    @cached_property
    def rules(self) -> list[Rule]:
        """Rules of all codes on the page, to be explained there."""
        from kinertia.diagnostics.limits import with_limits  # loads all checks

        shown_ = [finding for finding in self.findings if finding.status != "ignored"]
        return [with_limits(rule(code)) for code in sorted({finding.code for finding in shown_})]


def _correction(finding: Finding, explained: tuple[Group, ...]) -> Correction:
    what = finding.name.removesuffix("-corrected").replace("-", " ")
    size = next((evidence_text(finding, name, signed=True) for name in finding.evidence), "")
    return Correction(finding, place_text(finding.where, with_trial=True) or "all trials", what, size, explained)


def place_text(where: Where, with_trial: bool = False) -> str:
    """Describe a place in words: "walk: plate 1, fore-aft (X)"."""
    span = "" if where.span_s is None else f"{where.span_s[0]:.2f} to {where.span_s[1]:.2f} s"
    axis = axis_text(where) if where.axis or where.file_axis else ""
    place = ", ".join(filter(None, [where.plate, where.part, axis, first_few(where.markers), span]))
    trial = (where.trial or where.file or "") if with_trial else ""
    return f"{trial}: {place}" if trial and place else trial or place


def evidence_texts(finding: Finding) -> list[str]:
    """List every quantity of a finding, "level -23 N (limit 15 N)"; words only if message and remedy lack them."""
    named = [name for name, quantity in finding.evidence.items() if not _is_said(finding, quantity)]
    return [f"{outlined('{' + name + '}', '{}')} {evidence_text(finding, name)}" for name in named]


def _is_said(finding: Finding, quantity: Quantity) -> bool:
    return isinstance(quantity.value, str) and quantity.value in f"{finding.message} {finding.remedy}"


def evidence_text(finding: Finding, name: str, signed: bool = False) -> str:
    """Format a quantity as in the message, with its SD, limit and usual range."""
    quantity, style = finding.evidence[name], _style(finding.rule.message, name)
    plain = style.replace("+", "")

    def read(value: float) -> str:
        return shown(Quantity(value, quantity.unit), plain)

    text = shown(quantity, f"{plain}+" if signed and isinstance(quantity.value, float) else style)
    more = [] if quantity.limit is None else [f"limit {read(quantity.limit)}"]
    if quantity.usual is not None:
        low, high = quantity.usual
        more.append(f"usual within {read(high)}" if low == -high else f"usual {read(low)} to {read(high)}")
    deviation = "" if quantity.sd is None else f" ± {read(quantity.sd)} (SD)"
    return text + deviation + (f" ({'; '.join(more)})" if more else "")


def _style(template: str, name: str) -> str:
    field = re.search(rf"\{{{name}:([+%#]*)\}}", template)
    return "" if field is None else field.group(1)


def linked(sentence: str) -> Markup:
    """Link the codes in a sentence to their explanation on the same page."""
    link = Markup('<a class="code" href="#explain-{0}">{0}</a>')
    parts = _CODE.split(sentence)
    return Markup("").join(
        link.format(part) if k % 2 and matching(part) else escape(part) for k, part in enumerate(parts)
    )


def unbroken(sentence: str) -> Markup:
    """Keep each option of a command (`--markers`) on one line."""
    whole = Markup('<span class="option">{0}</span>')
    parts = _OPTION.split(sentence)
    return Markup("").join(whole.format(part) if k % 2 else escape(part) for k, part in enumerate(parts))


def lines(findings: Iterable[Finding], least: Severity = Severity.CORRECTED) -> list[str]:
    """List open findings from this severity on, one line each, equal ones together."""
    return [group.line for group in grouped(reported(findings, least))]


def digest(overview: Overview, windows: Mapping[str, Sequence[Span]]) -> dict[str, Any]:
    """Return verdict, remedies that come first and findings for the page in the browser, without assumptions.

    Equal findings have one entry.

    Args:
        overview: summary of the findings.
        windows: used parts (s) of each trial by its name, the longest first.
    """
    shown_ = [finding for finding in overview.findings if finding.severity > Severity.INFO and finding.muted_by is None]
    groups = grouped(in_order(finding for finding in shown_ if finding.status != "ignored"))
    return {
        "verdict": overview.verdict,
        "line": overview.line,
        "steps": [_in_short(card.group, windows) for card in FindingView([overview]).steps],
        "findings": [_in_short(group, windows) for group in groups],
    }


def _in_short(group: Group, windows: Mapping[str, Sequence[Span]]) -> dict[str, Any]:
    first = group.first
    return {
        "code": first.code,
        "severity": first.severity.name,
        "status": first.status,
        "place": first.place,
        "message": group.message,
        "remedy": first.remedy,
        "reason": first.reason,
        "settings": [remedy.to_dict() for remedy in remedies(group.findings, windows) if first.is_open],
    }
