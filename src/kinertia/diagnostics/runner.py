"""Runs checks, lets causes explain their consequences, and applies what the user overrules.

A check declares itself beside its function: `@check("P245", unless=..., off_plate=OFF_PLATE)`. It returns all findings
that apply, or fits every hypothesis and returns the best. It is left out where a check that runs before it found that
it is meaningless (`unless`): the order of checks follows from that, not from their place in a list. Only the relation
`supersedes` of the catalogue hides findings, whatever their order.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, Generic, TypeVar

from kinertia.findings.extensions import RULES, loaded, names
from kinertia.findings.finding import Finding, Severity
from kinertia.findings.quantity import Limit, Where
from kinertia.findings.rule import FAMILIES, matching, rule
from kinertia.settings import Overrule

Context = TypeVar("Context")

# what checks need, by the codes whose ERROR says that it is not there: without it a check means nothing
NEEDS_LENGTH_UNIT = ("M141",)
"""In another unit of length no limit in metres means anything."""
NEEDS_AXES = ("M141", "M142")
"""Without a vertical and a unit of length, nothing is above or beside anything."""
NEEDS_MEASURED_FRAMES = ("M123",)
"""Where frames were interpolated, steps from frame to frame mean nothing."""
NEEDS_VERTICAL_FORCE = ("P201",)
"""In other axes there is no vertical force to judge by."""
NEEDS_LOADS_UNDER_FEET = ("P201", "P202", "P203", "P204", "P24", "T20", "T21")
"""Else it is not known where on a foot a load acts."""
NEEDS_VELOCITY = ("L20", "M12", "M14", "P10", "P11", "P20", "P24", "T201", "T211", "T212")
"""Else markers, forces or their times do not belong to one moving body."""


@dataclass(frozen=True, eq=False)
class Check(Generic[Context]):
    """One check of a recording, person or result, called like the function that it was declared with.

    Attributes:
        codes: codes of its findings; of other packages the first three characters.
        ask: function that returns the findings.
        unless: codes, or beginnings of codes, of other checks, whose ERROR makes it meaningless: then it does not run.
        limits: its limits, by the names that texts of the catalogue have for them.
    """

    codes: tuple[str, ...]
    ask: Callable[[Context], Iterable[Finding]]
    unless: tuple[str, ...] = ()
    limits: Mapping[str, Limit] = field(default_factory=dict)

    def __call__(self, context: Context) -> Iterable[Finding]:
        """Return the findings about this context."""
        return self.ask(context)

    def needs(self, other: "Check[Any]") -> bool:
        """Return whether it has to run after another, whose ERROR may make it meaningless."""
        return other is not self and any(code.startswith(self.unless) for code in other.codes)


def check(
    *codes: str, unless: tuple[str, ...] = (), **limits: Limit
) -> Callable[[Callable[[Context], Iterable[Finding]]], Check[Context]]:
    """Declare a function as a check that reports these codes; arguments as in `Check`."""
    return lambda ask: Check(codes, ask, unless, limits)


def asked(
    checks: Sequence[Check[Context]], context: Context, found: Sequence[Finding] = (), trial: str | None = None
) -> list[Finding]:
    """Run these checks, except those that earlier findings make meaningless, and return the findings.

    Args:
        checks: in any order.
        context: what they are asked of.
        found: earlier findings.
        trial: name of the trial for findings that state none.
    """
    result: list[Finding] = []
    for next_check in in_order(tuple(checks)):
        errors = {known.code for known in (*found, *result) if known.severity is Severity.ERROR}
        if any(code.startswith(next_check.unless) for code in errors):
            continue
        for reported in next_check(context):
            result.append(reported if trial is None or reported.where.trial is not None else reported.in_trial(trial))
    return result


@cache
def in_order(checks: tuple[Check[Any], ...]) -> tuple[Check[Any], ...]:
    """Return the checks so that each comes after those that may make it meaningless, else in the order given.

    Raises:
        ValueError: checks need one another in a circle.
    """
    left, result = list(checks), []
    while left:
        first = next((candidate for candidate in left if not any(candidate.needs(other) for other in left)), None)
        if first is None:
            raise ValueError(f"checks need one another: {', '.join('/'.join(unordered.codes) for unordered in left)}")
        left.remove(first)
        result.append(first)
    return tuple(result)


def added_checks() -> tuple[Check[Any], ...]:
    """Return the checks of recordings that installed packages add."""
    families = [name for name in names(RULES) if name not in FAMILIES]
    return tuple(
        Check((code,), ask) for family in families for code, ask in loaded(RULES, family).recording_questions.items()
    )


def rules_of(*checks: Check[Any]) -> int:
    """Count the rules that these checks cover."""
    return len({matched for ran in checks for code in ran.codes for matched in matching(code)})


def explained(findings: Iterable[Finding], left_out: Collection[str] = ()) -> list[Finding]:
    """Mute findings that another one explains; a cause, and others like it, take over the severity of consequences.

    A correction of the estimate that resolves an earlier warning mutes it, and leaves it a correction.

    Args:
        findings: findings, each as it was made.
        left_out: names of trials that are not in the result: what is found in them explains nothing elsewhere.
    """
    unique: dict[tuple[str, Where], Finding] = {}
    for finding in findings:
        unique.setdefault((finding.code, finding.where), finding)
    result = list(unique.values())
    causes = _causes(result, left_out)
    severities = [finding.severity for finding in result]
    for j in causes:
        last, first = j, causes[j][0]
        while first in causes:
            last, first = first, causes[first][0]
        for k in causes[last]:
            if result[k].code == result[first].code:
                severities[k] = max(severities[k], result[j].severity)
    result = [finding.at(severity) for finding, severity in zip(result, severities, strict=True)]
    resolved = _resolve(result, causes)
    return [
        replace(
            finding,
            severity=Severity.CORRECTED if j in resolved else finding.severity,
            muted_by=result[causes[j][0]].code if j in causes else None,
        )
        for j, finding in enumerate(result)
    ]


def _causes(findings: Sequence[Finding], left_out: Collection[str]) -> dict[int, list[int]]:
    """Return which findings explain each, by their places in the list; without circles, as `supersedes` has none."""
    causes: dict[int, list[int]] = {}
    for k, cause in enumerate(findings):
        consequences = {code for superseded in cause.rule.supersedes for code in matching(superseded)}
        for j, other in enumerate(findings):
            is_here = cause.where.trial not in left_out or cause.where.trial == other.where.trial
            if j != k and other.code in consequences and is_here and cause.where.overlaps(other.where):
                causes.setdefault(j, []).append(k)
    return causes


def _resolve(findings: Sequence[Finding], causes: dict[int, list[int]]) -> set[int]:
    """Make corrections of the estimate the causes of unexplained warnings about the same quantity; return these.

    A correction that such a warning explains, directly or through others, is explained no more: no circle is possible.
    """
    resolved = set()
    for j, consequence in enumerate(findings):
        if consequence.severity is not Severity.WARNING or j in causes:
            continue
        for k, correction in enumerate(findings):
            codes = {code for resolvable in correction.rule.resolves for code in matching(resolvable)}
            is_correction = correction.severity is Severity.CORRECTED and correction.where.overlaps(consequence.where)
            if consequence.code in codes and is_correction:
                if _first_cause(k, causes) == j:
                    del causes[k]
                causes[j] = [k]
                resolved.add(j)
                break
    return resolved


def _first_cause(k: int, causes: Mapping[int, Sequence[int]]) -> int:
    while k in causes:
        k = causes[k][0]
    return k


def overruled(
    findings: Iterable[Finding], overrule: Overrule, of_trials: Mapping[str, Overrule] | None = None
) -> list[Finding]:
    """Apply the status that the user gives findings: ERRORs are waived unless nothing can be computed, others ignored.

    A waived ERROR explains no ERROR with which nothing can be computed: that one is open.

    Args:
        findings: findings with their explanations.
        overrule: what the user overrules in all trials.
        of_trials: what the user overrules in single trials, by name.
    """
    result = []
    for finding in findings:
        given = overrule + (of_trials or {}).get(finding.where.trial or "", Overrule())
        is_error = finding.severity is Severity.ERROR
        codes = given.waive if is_error else given.ignore
        if not any(finding.code.startswith(code) for code in codes) or (is_error and finding.rule.hard):
            result.append(replace(finding, status="open"))
        else:
            result.append(
                replace(finding, status="waived" if is_error else "ignored", reason=given.reason(finding.code))
            )
    return _released(result)


def _released(findings: list[Finding]) -> list[Finding]:
    """Return the findings, those ERRORs open that cannot be waived and that only waived ones explain."""
    if all(finding.status != "waived" for finding in findings):
        return findings
    hard = [finding for finding in findings if finding.severity is Severity.ERROR and finding.rule.hard]
    open_ = explained(replace(finding, muted_by=None) for finding in findings if finding.is_open or finding in hard)
    muted_by = {(finding.code, finding.where): finding.muted_by for finding in open_}
    return [
        replace(finding, muted_by=muted_by[finding.code, finding.where]) if finding in hard else finding
        for finding in findings
    ]


def blocking(findings: Iterable[Finding]) -> list[Finding]:
    """Return open ERRORs that no other finding explains; they stop the next stage."""
    return [finding for finding in findings if finding.severity is Severity.ERROR and finding.is_open]


def unknown_codes(overrule: Overrule) -> list[str]:
    """Return entries that are no code, question or family of the catalogue, or cannot be waived."""
    unknown = [code for code in (*overrule.waive, *overrule.ignore) if not matching(code)]
    hard = [code for code in overrule.waive if len(code) == 4 and matching(code) and rule(code).hard]
    return [*unknown, *hard]
