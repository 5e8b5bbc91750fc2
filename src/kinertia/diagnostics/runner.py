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
    for one in in_order(tuple(checks)):
        errors = {each.code for each in (*found, *result) if each.severity is Severity.ERROR}
        if any(code.startswith(one.unless) for code in errors):
            continue
        for each in one(context):
            result.append(each if trial is None or each.where.trial is not None else each.in_trial(trial))
    return result


@cache
def in_order(checks: tuple[Check[Any], ...]) -> tuple[Check[Any], ...]:
    """Return the checks so that each comes after those that may make it meaningless, else in the order given.

    Raises:
        ValueError: checks need one another in a circle.
    """
    left, result = list(checks), []
    while left:
        first = next((one for one in left if not any(one.needs(other) for other in left)), None)
        if first is None:
            raise ValueError(f"checks need one another: {', '.join('/'.join(one.codes) for one in left)}")
        left.remove(first)
        result.append(first)
    return tuple(result)


def added_checks() -> tuple[Check[Any], ...]:
    """Return the checks of recordings that installed packages add."""
    families = [one for one in names(RULES) if one not in FAMILIES]
    return tuple(
        Check((code,), ask) for one in families for code, ask in loaded(RULES, one).recording_questions.items()
    )


def rules_of(*checks: Check[Any]) -> int:
    """Count the rules that these checks cover."""
    return len({each for one in checks for code in one.codes for each in matching(code)})


def explained(findings: Iterable[Finding], left_out: Collection[str] = ()) -> list[Finding]:
    """Mute findings that another one explains; a cause, and others like it, take over the severity of consequences.

    A correction of the estimate that resolves an earlier warning mutes it, and leaves it a correction.

    Args:
        findings: findings, each as it was made.
        left_out: names of trials that are not in the result: what is found in them explains nothing elsewhere.
    """
    unique: dict[tuple[str, Where], Finding] = {}
    for one in findings:
        unique.setdefault((one.code, one.where), one)
    result = list(unique.values())
    causes = _causes(result, left_out)
    severities = [one.severity for one in result]
    for j in causes:
        last, first = j, causes[j][0]
        while first in causes:
            last, first = first, causes[first][0]
        for k in causes[last]:
            if result[k].code == result[first].code:
                severities[k] = max(severities[k], result[j].severity)
    result = [one.at(severity) for one, severity in zip(result, severities, strict=True)]
    resolved = _resolve(result, causes)
    return [
        replace(
            one,
            severity=Severity.CORRECTED if j in resolved else one.severity,
            muted_by=result[causes[j][0]].code if j in causes else None,
        )
        for j, one in enumerate(result)
    ]


def _causes(findings: Sequence[Finding], left_out: Collection[str]) -> dict[int, list[int]]:
    """Return which findings explain each, by their places in the list; without circles, as `supersedes` has none."""
    causes: dict[int, list[int]] = {}
    for k, cause in enumerate(findings):
        consequences = {code for each in cause.rule.supersedes for code in matching(each)}
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
    for j, one in enumerate(findings):
        if one.severity is not Severity.WARNING or j in causes:
            continue
        for k, correction in enumerate(findings):
            codes = {code for each in correction.rule.resolves for code in matching(each)}
            is_correction = correction.severity is Severity.CORRECTED and correction.where.overlaps(one.where)
            if one.code in codes and is_correction:
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
    for one in findings:
        given = overrule + (of_trials or {}).get(one.where.trial or "", Overrule())
        is_error = one.severity is Severity.ERROR
        codes = given.waive if is_error else given.ignore
        if not any(one.code.startswith(code) for code in codes) or (is_error and one.rule.hard):
            result.append(replace(one, status="open"))
        else:
            result.append(replace(one, status="waived" if is_error else "ignored", reason=given.reason(one.code)))
    return _released(result)


def _released(findings: list[Finding]) -> list[Finding]:
    """Return the findings, those ERRORs open that cannot be waived and that only waived ones explain."""
    if all(one.status != "waived" for one in findings):
        return findings
    hard = [one for one in findings if one.severity is Severity.ERROR and one.rule.hard]
    open_ = explained(replace(one, muted_by=None) for one in findings if one.is_open or one in hard)
    muted_by = {(one.code, one.where): one.muted_by for one in open_}
    return [replace(one, muted_by=muted_by[one.code, one.where]) if one in hard else one for one in findings]


def blocking(findings: Iterable[Finding]) -> list[Finding]:
    """Return open ERRORs that no other finding explains; they stop the next stage."""
    return [one for one in findings if one.severity is Severity.ERROR and one.is_open]


def unknown_codes(overrule: Overrule) -> list[str]:
    """Return entries that are no code, question or family of the catalogue, or cannot be waived."""
    unknown = [each for each in (*overrule.waive, *overrule.ignore) if not matching(each)]
    hard = [each for each in overrule.waive if len(each) == 4 and matching(each) and rule(each).hard]
    return [*unknown, *hard]
