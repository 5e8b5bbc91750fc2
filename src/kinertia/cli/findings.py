"""Prints findings, and the outcome of a fit, on a terminal; defines `kinertia explain`: what a code means."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kinertia.cli.common import Outcome, out, plain_table
from kinertia.errors import KinertiaError, SettingsError, findings_of
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.leg_moments import coverage_sentence
from kinertia.findings.display import outlined
from kinertia.findings.finding import Finding, Severity
from kinertia.findings.overview import Group, Overview, consequences, grouped, in_order, reported
from kinertia.findings.rule import STAGES, Rule, all_rules, family_title, matching, nearest, page, rule
from kinertia.io.file_names import command_line
from kinertia.io.subject.tables import Model
from kinertia.report.wording import start_of

if TYPE_CHECKING:
    from rich.table import Table


_SHOWN = 3
_STYLES = {
    Severity.ERROR: "bold red",
    Severity.WARNING: "bold yellow",
    Severity.CORRECTED: "cyan",
    Severity.INFO: "dim",
}
_WHY_NOT = {True: "an ERROR that cannot be waived", False: "no ERROR here"}
_MARKS = {"measured": "**", "informed": "*", "assumed": "", "held": ""}
_STAGES = ("literature", "corrected", "estimate")
_NO_MARKER_SET = {"L101", "L105"}
_DRAFT = "markers.toml"
_INDENT = 13
_NARROWEST = 40


def show_overview(overview: Overview, verbose: bool) -> None:
    """Show the verdict in one line, then at most three findings of one line each, or everything."""
    out.print(overview.line, soft_wrap=True)
    if verbose:
        show_all(overview.findings)
        return
    shown = [*reported(overview.findings), *in_order(overview.waived)]
    groups = grouped(sorted(shown, key=lambda finding: -finding.severity))
    for group in groups[:_SHOWN]:
        _show_line(group)
    hidden = len(groups) - len(groups[:_SHOWN])
    infos = overview.count(Severity.INFO)
    more = [f"{hidden} more" if hidden else "", f"{infos} assumption{'s' * (infos > 1)}" if infos else ""]
    if any(more):
        out.print(f"{' and '.join(filter(None, more))}: --verbose lists all; kinertia explain CODE", soft_wrap=True)


def show_all(findings: Sequence[Finding]) -> None:
    """Show every finding with effect, causes and remedy, and those that it explains below it."""
    for group in grouped(in_order(finding for finding in findings if finding.muted_by is None)):
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
        found = [finding for finding in findings if finding.code.startswith(code)]
        later = any(rule(matched).stage not in stages for matched in matching(code))
        had_effect = any(finding.status == "waived" for finding in found)
        if not had_effect and (found or not later):
            why = dict.fromkeys(
                f"{finding.code} is {_WHY_NOT[finding.severity is Severity.ERROR]}" for finding in found
            )
            out.print(f"note: --waive {code} has no effect: {', '.join(why) or 'it was not found'}", soft_wrap=True)


@contextmanager
def failure_explained(codes: Sequence[str], given: Path, model: Model, command: str) -> Iterator[None]:
    """Add the next commands to an error that ends the command, and show which codes of `--waive` had no effect."""
    with waivers_reported(codes):
        try:
            yield
        except KinertiaError as error:
            for line in next_commands(error, given, model, command):
                error.add_note(line)
            raise


@contextmanager
def waivers_reported(codes: Sequence[str]) -> Iterator[None]:
    """Show which codes of `--waive` had no effect where an error ends the command."""
    try:
        yield
    except KinertiaError as error:
        found = findings_of(error)
        show_idle_waivers([code for code in codes if any(finding.code.startswith(code) for finding in found)], found)
        raise


def _causes(finding: Finding) -> str:
    return f"Likely causes: {'; '.join(finding.likely_causes)}." if finding.likely_causes else ""


def _show_line(group: Group) -> None:
    from rich.text import Text

    first = group.first
    overruled = "" if first.status == "open" else f" [{first.status}]"
    label = Text(f"{first.severity.name}{overruled}  ", style=_STYLES[first.severity])
    out.print(label.append(group.line, style="not bold default"), soft_wrap=True)


def show_coverage(fit: Fit) -> None:
    """Show in which part of each leg's stride joint moments are known, in one line."""
    if covered := coverage_sentence(fit.trials):
        out.print(f"joint moments {covered}", soft_wrap=True)


def report_tables(fit: Fit, fit_summary: Mapping[str, Any]) -> None:
    """Show person and method, residuals of every trial, the table of segments, and masses, given `fit.json`."""
    subject, mass = fit_summary["subject"], fit_summary["total_mass_kg"]
    height = None if subject["height_m"] is None else f"{subject['height_m']:g} m"
    person = ", ".join(filter(None, [f"{subject['mass_kg']:g} kg", height, subject["sex"]]))
    out.print(f"\n{subject['name']}: {person}; method {fit_summary['method']}; {fit.notes[0]}")
    for trial in fit_summary["trials"]:
        _report_trial(trial, start_of(fit).word)
    out.print(_bsp_table(fit))
    if fit.posterior is not None:
        out.print(
            "** well informed by the data, * partly informed, no mark: not informed (about as uncertain as the prior, "
            "even where the value changed); sd: standard deviation\n"
        )
    named = {"measured": "stated", "literature": start_of(fit).word}
    masses = ", ".join(f"{named.get(source, source)} {value:.1f}" for source, value in mass.items())
    beside = f", {fit.attached_kg:.1f} of it not body" if fit.attached_kg else ""
    out.print(f"total mass (kg): {masses}{beside}\n")
    if fit_summary["asymmetry"]:
        out.print(f"left and right: {'; '.join(fit_summary['asymmetry'])}\n")
    for note in fit.notes:
        out.print(f"assumed: {note}", soft_wrap=True)
    for trial in fit.trials:
        spent = ", ".join(f"{stage} {seconds:.1f}" for stage, seconds in trial.seconds.items())
        out.print(f"{trial.name}: seconds: {spent}")


def _report_trial(trial: dict[str, Any], before: str) -> None:
    (first, last), parts = trial["window_s"], len(trial["windows_s"])
    intervals = f" in {parts} measured intervals" if parts > 1 else ""
    markers = {stage: f"{value * 1e3:.1f} mm" for stage, value in trial["marker_rms_m"].items()}
    out.print(
        f"\n{trial['name']}: {first:.3f} to {last:.3f} s used{intervals}, {trial['n_dynamic_frames']} of "
        f"{trial['n_frames']} frames; RMS distance of the markers {markers['ik']} (inverse kinematics), "
        f"{markers['final']} (estimate)"
    )
    if trial["residual_force_rms_N"]["estimate"] is None:
        out.print(" no residual at the pelvis: all ground contact is never measured together")
        return
    hz = {**dict.fromkeys(_STAGES, trial["cutoff_hz"]), "estimate": trial["motion_hz"]}
    title = "residual at the pelvis, RMS (max),\nforces at the motion's bandwidth"
    names = {stage: before if stage == "literature" else stage for stage in _STAGES}
    table = plain_table(title, *(f"{name}\n{hz[stage]:.3g} Hz" for stage, name in names.items()))
    for kind, unit in (("force", "N"), ("moment", "Nm")):
        rms, top = trial[f"residual_{kind}_rms_{unit}"], trial[f"residual_{kind}_max_{unit}"]
        table.add_row(f"{kind} ({unit.replace('Nm', 'N m')})", *(f"{rms[s]:.1f} ({top[s]:.1f})" for s in _STAGES))
    out.print(table)
    sizes = ("force_rms_N", "force_max_N", "moment_rms_Nm", "moment_max_Nm")
    full = [f"{trial[f'full_residual_{size}']['estimate']:.1f}" for size in sizes]
    out.print(
        " estimate with forces at full bandwidth (what OpenSim finds on these files):\n"
        f" force {full[0]} ({full[1]}) N, moment {full[2]} ({full[3]}) N m"
    )


def _bsp_table(fit: Fit) -> Table:
    """Tabulate two rows per segment, three with error bars; if left mirrors right, the right side stands for both."""
    table = plain_table("segment", "", "mass\n(kg)", "CoM x\n(mm)", "y", "z", "Ixx\n(kg m2)", "Iyy", "Izz")
    for i, segment in enumerate(fit.literature.segments):
        if fit.posterior is None and fit.settings.symmetry and segment.endswith("_l"):
            continue
        for source, bsp in ((start_of(fit).word, fit.literature), ("estimate", fit.estimate)):
            com = (f"{round(value * 1e3)}" for value in bsp.com_m[i])
            inertia = (f"{value:.4f}" for value in bsp.inertia_kgm2[i].diagonal())
            cells = [f"{bsp.mass_kg[i]:.2f}", *com, *inertia]
            if source == "estimate" and fit.posterior is not None:
                cells = [cell + _MARKS[word] for cell, word in zip(cells, fit.evidence[i], strict=False)]
            table.add_row(segment, source, *cells)
            segment = ""
        if fit.posterior is not None and not fit.posterior.prior_sd[i].any():
            table.add_row("", "sd", "fixed")
        elif fit.posterior is not None:
            sd = fit.posterior.sd[i]
            table.add_row(
                "", "sd", f"{sd[0]:.2f}", *(f"{v * 1e3:.0f}" for v in sd[1:4]), *(f"{v:.4f}" for v in sd[4:7])
            )
    return table


def next_commands(error: KinertiaError, given: Path, model: Model, command: str) -> list[str]:
    """List the next commands in order; empty where another marker set would not help, or one was stated.

    Args:
        error: the reason why there is no fit.
        given: the subject file, its folder, or the markers of a trial.
        model: the model as stated in the subject file, or in options.
        command: the command that failed.
    """
    if not _NO_MARKER_SET & {finding.code for finding in findings_of(error)}:
        return []
    if model.static is None or model.markers is not None or model.osim is not None:
        return []
    folder = given if given.is_dir() else given.parent
    by_file = given.is_dir() or given.suffix.lower() == ".toml"
    drafted = folder / _DRAFT if by_file else Path(_DRAFT)
    static = _as_typed(model.static)
    draft = command_line(["kinertia", "markers", static, "-o", str(drafted)])
    if by_file:
        return [draft, f'put markers = "{_DRAFT}" under [model] of the subject file', command]
    return [draft, f"{command} --markers {_DRAFT}"]


def _as_typed(path: Path) -> str:
    """Return the path relative to the shell's folder where it is in it."""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


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
    from kinertia.diagnostics.limits import with_limits  # loads all checks

    found = [with_limits(rule(matched)) for matched in matching(wanted)]
    if not found:
        raise SettingsError(_unknown(code))
    if len(wanted) == 4:
        _show_rule(found[0])
    else:
        _show_questions(found)
    return Outcome([_content(explained) for explained in found])


def _unknown(code: str) -> str:
    near = ", ".join(f"{similar} ({rule(similar).name})" for similar in nearest(code.strip().upper()))
    families = ", ".join(dict.fromkeys(rule_code[0] for rule_code in all_rules()))
    return f"there is no finding {code!r}; " + (f"nearest: {near}" if near else f"families: {families}")


def _show_questions(rules: Sequence[Rule]) -> None:
    """Show each question with its codes, one line each, and the message of each below it."""
    family = rules[0].code[0]
    out.print(f"{family}  {family_title(family)}")
    asked = None
    for shown in rules:
        if shown.question != asked:
            asked = shown.question
            out.print(f"\n{asked}  {shown.asks}", style="bold", soft_wrap=True)
        out.print(f"  {shown.code}  {shown.severity.lower():<9}  {shown.name}", soft_wrap=True)
    out.print(f"\nfor details of one: kinertia explain {rules[0].code}")


def _show_rule(shown: Rule) -> None:
    out.print(f"{shown.code}  {shown.name}", style="bold", soft_wrap=True)
    for heading, text in _lines(shown):
        _show_code(heading, text)


def _lines(shown: Rule) -> Iterator[tuple[str, str]]:
    """Yield headings and sentences about a rule."""
    yield "severity", severity_text(shown)
    yield "question", f"{shown.question}  {shown.asks}"
    yield "message", outlined(shown.message)
    yield "detects", shown.detects
    yield "effect", outlined(shown.effect)
    for k, cause in enumerate(shown.causes):
        yield "causes" if k == 0 else "", f"{k + 1}. {cause}"
    yield "remedy", outlined(shown.remedy)
    if shown.affects:
        yield "affects", ", ".join(shown.affects).replace("_", " ")
    if shown.supersedes:
        yield "explains", ", ".join(shown.supersedes)
    if shown.resolves:
        yield "resolves", ", ".join(shown.resolves)
    yield "overrule", overruling(shown)
    yield "more", f"docs/{page(shown.code)}"


def _show_code(heading: str, text: str) -> None:
    width = max(out.console.width, _NARROWEST)
    first = f"  {heading:<{_INDENT - 2}}"
    lines = fill(text, width, initial_indent=first, subsequent_indent=" " * _INDENT, break_on_hyphens=False)
    out.print(lines, soft_wrap=True)


def severity_text(explained: Rule) -> str:
    """Describe severity, escalation and stage in words."""
    return (
        explained.severity
        + (f"; {explained.escalation}" if explained.escalation else "")
        + f" ({explained.stage} stage)"
    )


def overruling(explained: Rule) -> str:
    """Describe whether and how a user may overrule a rule."""
    ignored = f'ignore = ["{explained.code}"] under [diagnostics] in the subject file leaves it out of the verdict'
    if explained.hard:
        waived = "cannot be waived, since nothing can be computed"
    else:
        waived = (
            f'--waive {explained.code}, or waive = ["{explained.code}"] under [diagnostics] in the subject file, lets '
            "the fit go on; the outputs concerned are then at best to be used with care"
        ) + ("; it cannot be waived where a file could not be read further" if explained.by_readers else "")
    if explained.severity == "ERROR":
        return waived
    return f"{ignored}; as an ERROR: {waived}" if "ERROR" in explained.escalation else ignored


def _content(explained: Rule) -> dict[str, Any]:
    return asdict(explained) | {"question": explained.question, "asks": explained.asks, "page": page(explained.code)}
