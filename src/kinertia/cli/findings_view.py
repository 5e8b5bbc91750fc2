"""Prints findings on a terminal: the verdict, at most three findings, or all of them with `--verbose`."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from kinertia.cli.terminal import out
from kinertia.errors import KinertiaError, findings_of
from kinertia.findings.finding import Finding, Severity
from kinertia.findings.overview import Group, Overview, consequences, grouped, in_order, reported
from kinertia.findings.rule import STAGES, matching, rule

_SHOWN = 3
_STYLES = {
    Severity.ERROR: "bold red",
    Severity.WARNING: "bold yellow",
    Severity.CORRECTED: "cyan",
    Severity.INFO: "dim",
}
_WHY_NOT = {True: "an ERROR that cannot be waived", False: "no ERROR here"}


def show_overview(overview: Overview, verbose: bool) -> None:
    """Show the verdict in one line, then at most three findings of one line each, or everything."""
    out.print(overview.line, soft_wrap=True)
    if verbose:
        show_all(overview.findings)
        return
    shown = [*reported(overview.findings), *in_order(overview.waived)]
    groups = grouped(sorted(shown, key=lambda one: -one.severity))
    for group in groups[:_SHOWN]:
        _show_line(group)
    hidden = len(groups) - len(groups[:_SHOWN])
    infos = overview.count(Severity.INFO)
    more = [f"{hidden} more" if hidden else "", f"{infos} assumption{'s' * (infos > 1)}" if infos else ""]
    if any(more):
        out.print(f"{' and '.join(filter(None, more))}: --verbose lists all; kinertia explain CODE", soft_wrap=True)


def show_all(findings: Sequence[Finding]) -> None:
    """Show every finding with effect, causes and remedy, and those that it explains below it."""
    for group in grouped(in_order(one for one in findings if one.muted_by is None)):
        _show_line(group)
        first = group.first
        if first.severity is Severity.INFO:
            continue
        lines = [first.effect, _causes(first), first.remedy]
        out.print("\n".join(f"    {line}" for line in lines if line), soft_wrap=True)
        for muted in grouped(consequences(findings, group.findings)):
            out.print(f"    explains {muted.line}", soft_wrap=True)


def show_idle_waivers(codes: Sequence[str], findings: Sequence[Finding], stages: Sequence[str] = STAGES) -> None:
    """Show which codes of `--waive` had no effect, and why. Nothing is known of rules in other stages than these."""
    for code in codes:
        found = [one for one in findings if one.code.startswith(code)]
        later = any(rule(one).stage not in stages for one in matching(code))
        had_effect = any(one.status == "waived" for one in found)
        if not had_effect and (found or not later):
            why = dict.fromkeys(f"{one.code} is {_WHY_NOT[one.severity is Severity.ERROR]}" for one in found)
            out.print(f"note: --waive {code} has no effect: {', '.join(why) or 'it was not found'}", soft_wrap=True)


@contextmanager
def waivers_reported(codes: Sequence[str]) -> Iterator[None]:
    """Show which codes of `--waive` had no effect where an error ends the command."""
    try:
        yield
    except KinertiaError as error:
        found = findings_of(error)
        show_idle_waivers([code for code in codes if any(one.code.startswith(code) for one in found)], found)
        raise


def _causes(one: Finding) -> str:
    return f"Likely causes: {'; '.join(one.likely_causes)}." if one.likely_causes else ""


def _show_line(group: Group) -> None:
    from rich.text import Text

    first = group.first
    overruled = "" if first.status == "open" else f" [{first.status}]"
    label = Text(f"{first.severity.name}{overruled}  ", style=_STYLES[first.severity])
    out.print(label.append(group.line, style="not bold default"), soft_wrap=True)
