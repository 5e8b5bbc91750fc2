"""Defines a finding: what was found, where, with its size, what follows and what to do.

All quantities are SI; `kinertia.findings.display` makes them readable. A quantity about an instrument is its *error*,
recorded minus true: positive means that it reads too much, lies too far along the positive axis, is rotated
counter-clockwise seen from above, or is delayed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, Literal, Self

from kinertia.findings.display import filled
from kinertia.findings.quantity import Quantity, Where
from kinertia.findings.rule import Rule, rule

Status = Literal["open", "waived", "ignored"]


class Severity(IntEnum):
    """Importance of a finding: an ERROR blocks, a WARNING lowers the verdict, CORRECTED and INFO do not.

    Examples:
        >>> kinertia.Severity.ERROR > kinertia.Severity.WARNING > kinertia.Severity.CORRECTED > kinertia.Severity.INFO
        True
    """

    INFO = 0
    CORRECTED = 1
    WARNING = 2
    ERROR = 3


@dataclass(frozen=True)
class Finding:
    """One result of a rule of the catalogue: what was found, where, and with which evidence.

    Attributes:
        code: code of the rule, such as "P213".
        where: place that it concerns.
        evidence: measured quantities by name; the first is the headline.
        severity: severity of the rule, or as escalated.
        causes: likely causes, likeliest first; the rule's if empty.
        muted_by: code of the finding that explains this one.
        status: "open", "waived" or "ignored".
        reason: why the user overruled it.

    Examples:
        >>> zero = kinertia.finding("P213", kinertia.Where("walk.c3d", plate="plate 1", axis="vertical", file_axis="Z"),
        ...     level_n=kinertia.Quantity(-23.1, "N", limit=15.0))
        >>> zero.severity.name, zero.name
        ('WARNING', 'plate-zero-offset')
        >>> zero.message
        'The zero of plate 1 is off: it reads -23 N along the vertical (Z) axis while unloaded.'
    """

    code: str
    where: Where
    evidence: Mapping[str, Quantity]
    severity: Severity
    causes: tuple[str, ...] = ()
    muted_by: str | None = None
    status: Status = "open"
    reason: str = ""

    def __post_init__(self) -> None:
        # saved results hold it as a number
        object.__setattr__(self, "severity", Severity(self.severity))

    @property
    def rule(self) -> Rule:
        """Rule of the catalogue that this finding belongs to."""
        return rule(self.code)

    @property
    def name(self) -> str:
        """The rule's name in words."""
        return self.rule.name

    @property
    def message(self) -> str:
        """What is wrong, with its size, in at most 25 words."""
        return self._said(self.rule.message)

    @property
    def effect(self) -> str:
        """Consequence if it is not corrected, with its typical size."""
        return self._said(self.rule.effect)

    @property
    def remedy(self) -> str:
        """One thing to do."""
        return self._said(self.rule.remedy)

    @property
    def likely_causes(self) -> tuple[str, ...]:
        """Likely causes, its own or the rule's; likeliest first."""
        return self.causes or self.rule.causes

    @property
    def headline(self) -> Quantity | None:
        """First quantity of the evidence that is a number."""
        return next((quantity for quantity in self.evidence.values() if isinstance(quantity.value, float | int)), None)

    @property
    def is_open(self) -> bool:
        """Whether the finding is neither explained by another nor overruled."""
        return self.status == "open" and self.muted_by is None

    def muted(self, by: str) -> Self:
        """Return the finding as explained by the finding of that code."""
        return replace(self, muted_by=by)

    def at(self, severity: Severity) -> Self:
        """Return the finding with another severity."""
        return replace(self, severity=severity)

    def in_trial(self, trial: str | None) -> Self:
        """Return the finding as found in that trial; in no trial if None."""
        return replace(self, where=replace(self.where, trial=trial))

    def in_file(self, file: str) -> Self:
        """Return the finding as found in that file."""
        return replace(self, where=replace(self.where, file=file))

    @property
    def place(self) -> str:
        """File and line where they are known, else the trial, else the file that the message does not state."""
        where = self.where
        if where.file is not None and where.line is not None:
            return f"{where.file}, line {where.line}"
        file = "" if where.file is None or where.file in self.message else where.file
        return where.trial or file

    def line(self) -> str:
        """Return place and message on one line: `walk  P213 The zero of plate 1 is off ...`."""
        return f"{self.place}  {self.code} {self.message}" if self.place else f"{self.code} {self.message}"

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON content, with numbers in SI units."""
        return {
            "code": self.code,
            "name": self.name,
            "severity": self.severity.name,
            "status": self.status,
            "muted_by": self.muted_by,
            "where": self.where.to_dict(),
            "evidence": {name: quantity.to_dict() for name, quantity in self.evidence.items()},
            "message": self.message,
            "effect": self.effect,
            "causes": list(self.likely_causes),
            "remedy": self.remedy,
            **({"reason": self.reason} if self.reason else {}),
        }

    def _said(self, template: str) -> str:
        return filled(template, self.where, self.evidence)


def finding(
    code: str,
    where: Where | None = None,
    severity: Severity | None = None,
    causes: tuple[str, ...] = (),
    **evidence: Quantity,
) -> Finding:
    """Create a finding of this rule, with the rule's severity unless another is given.

    Args:
        code: code of the rule.
        where: place that it concerns.
        severity: severity, where the rule's is raised or lowered.
        causes: likely causes, likeliest first, where they depend on what was measured.
        evidence: measured quantities, the headline first.
    """
    return with_evidence(code, where or Where(), evidence, severity, causes)


def with_evidence(
    code: str,
    where: Where,
    evidence: Mapping[str, Quantity],
    severity: Severity | None = None,
    causes: tuple[str, ...] = (),
) -> Finding:
    """Create a finding of this rule from evidence in a mapping, as `finding` does."""
    return Finding(code, where, evidence, Severity[rule(code).severity] if severity is None else severity, causes)
