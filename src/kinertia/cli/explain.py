"""Defines `kinertia explain`: what a finding's code means, and what to do about it."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from textwrap import fill
from typing import Annotated, Any

import typer

from kinertia.cli.options import Outcome
from kinertia.cli.terminal import out
from kinertia.diagnostics.limits import with_limits
from kinertia.errors import SettingsError
from kinertia.findings.display import outlined
from kinertia.findings.rule import Rule, all_rules, family_title, matching, nearest, page, rule

_INDENT = 13
_NARROWEST = 40


def explain(
    code: Annotated[str, typer.Argument(help="A code (P213), a question (P21) or a family (P).")],
) -> Outcome:
    """Explain a finding: what it means, what it does to results, likely causes, and what to do.

    Codes are those of check, fit and reports. A family (F files, M markers,
    L labels, P force plates, T timing, S subject, O OpenSim model, R results)
    lists its questions, a question the answers that may be found.

    [bold]Examples[/]

    kinertia explain P213

    kinertia explain P21
    """
    wanted = code.strip().upper()
    found = [with_limits(rule(one)) for one in matching(wanted)]
    if not found:
        raise SettingsError(_unknown(code))
    if len(wanted) == 4:
        _show_rule(found[0])
    else:
        _show_questions(found)
    return Outcome([_content(one) for one in found])


def _unknown(code: str) -> str:
    near = ", ".join(f"{one} ({rule(one).name})" for one in nearest(code.strip().upper()))
    families = ", ".join(dict.fromkeys(one[0] for one in all_rules()))
    return f"there is no finding {code!r}; " + (f"nearest: {near}" if near else f"families: {families}")


def _show_questions(rules: Sequence[Rule]) -> None:
    """Show each question with its codes, one line each, and the message of each below it."""
    family = rules[0].code[0]
    out.print(f"{family}  {family_title(family)}")
    asked = None
    for one in rules:
        if one.question != asked:
            asked = one.question
            out.print(f"\n{asked}  {one.asks}", style="bold", soft_wrap=True)
        out.print(f"  {one.code}  {one.severity.lower():<9}  {one.name}", soft_wrap=True)
    out.print(f"\nfor details of one: kinertia explain {rules[0].code}")


def _show_rule(one: Rule) -> None:
    out.print(f"{one.code}  {one.name}", style="bold", soft_wrap=True)
    for heading, text in _lines(one):
        _show_line(heading, text)


def _lines(one: Rule) -> Iterator[tuple[str, str]]:
    """Yield headings and sentences about a rule."""
    yield "severity", severity_text(one)
    yield "question", f"{one.question}  {one.asks}"
    yield "message", outlined(one.message)
    yield "detects", one.detects
    yield "effect", outlined(one.effect)
    for k, cause in enumerate(one.causes):
        yield "causes" if k == 0 else "", f"{k + 1}. {cause}"
    yield "remedy", outlined(one.remedy)
    if one.affects:
        yield "affects", ", ".join(one.affects).replace("_", " ")
    if one.supersedes:
        yield "explains", ", ".join(one.supersedes)
    if one.resolves:
        yield "resolves", ", ".join(one.resolves)
    yield "overrule", overruling(one)
    yield "more", f"docs/{page(one.code)}"


def _show_line(heading: str, text: str) -> None:
    width = max(out.console.width, _NARROWEST)
    first = f"  {heading:<{_INDENT - 2}}"
    lines = fill(text, width, initial_indent=first, subsequent_indent=" " * _INDENT, break_on_hyphens=False)
    out.print(lines, soft_wrap=True)


def severity_text(one: Rule) -> str:
    """Describe severity, escalation and stage in words."""
    return one.severity + (f"; {one.escalation}" if one.escalation else "") + f" ({one.stage} stage)"


def overruling(one: Rule) -> str:
    """Describe whether and how a user may overrule a rule."""
    ignored = f'ignore = ["{one.code}"] under [diagnostics] in the subject file leaves it out of the verdict'
    if one.hard:
        waived = "cannot be waived, since nothing can be computed"
    else:
        waived = (
            f'--waive {one.code}, or waive = ["{one.code}"] under [diagnostics] in the subject file, lets the fit go '
            "on; the outputs concerned are then at best to be used with care"
        ) + ("; it cannot be waived where a file could not be read further" if one.by_readers else "")
    if one.severity == "ERROR":
        return waived
    return f"{ignored}; as an ERROR: {waived}" if "ERROR" in one.escalation else ignored


def _content(one: Rule) -> dict[str, Any]:
    return asdict(one) | {"question": one.question, "asks": one.asks, "page": page(one.code)}
