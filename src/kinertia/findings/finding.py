"""One finding: what was found, where, with its size, what follows and what to do.

All quantities are SI; `kinertia.findings.display` makes them readable. A quantity about an instrument is its *error*,
recorded minus true: positive means reads too much, lies too far along the positive axis, is turned counter-clockwise
seen from above, comes too late.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, Literal

from kinertia.findings.display import filled
from kinertia.findings.rule import Rule, rule

Status = Literal["open", "waived", "ignored"]


class Severity(IntEnum):
    """How much a finding matters: ERROR blocks, WARNING lowers a verdict, CORRECTED and INFO lower none.

    Examples:
        >>> kinertia.Severity.ERROR > kinertia.Severity.WARNING > kinertia.Severity.CORRECTED > kinertia.Severity.INFO
        True
    """

    INFO = 0
    CORRECTED = 1
    WARNING = 2
    ERROR = 3


@dataclass(frozen=True)
class Quantity:
    """A measured quantity in SI units, with the limit that it exceeds.

    Attributes:
        value: a number, several, or text.
        unit: "m", "s", "N", "N m", "N m/N", "kg", "kg m2", "rad", "Hz" ...; "1" of shares and counts, "" of text.
        limit: beyond which the rule fires.
        usual: range on fault-free recordings.
        sd: standard deviation.

    Examples:
        >>> kinertia.Quantity(-23.1, "N", limit=15.0).value
        -23.1
    """

    value: float | tuple[float, ...] | str
    unit: str = ""
    limit: float | None = None
    usual: tuple[float, float] | None = None
    sd: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """For JSON: value and unit, and the others where they are known."""
        others = {"limit": self.limit, "usual": self.usual, "sd": self.sd}
        value = list(self.value) if isinstance(self.value, tuple) else self.value
        return {"value": value, "unit": self.unit} | {
            name: list(each) if isinstance(each, tuple) else each for name, each in others.items() if each is not None
        }


@dataclass(frozen=True)
class Where:
    """Where something was found; what is None, or empty, means all of it.

    Attributes:
        file, line: of text files, the one-based line.
        trial: name of the trial, or of the static trial.
        plate: name of the force plate.
        axis: direction of the person's walk: "fore-aft", "vertical" or "mediolateral".
        file_axis: the same axis as the file calls it, "X", "Y" or "Z".
        markers: labels.
        part: segment, joint, coordinate or parameter.
        span_s: start and end, s.

    Examples:
        >>> kinertia.Where(trial="walk", plate="plate 1").overlaps(kinertia.Where(trial="walk"))
        True
    """

    file: str | None = None
    line: int | None = None
    trial: str | None = None
    plate: str | None = None
    axis: str | None = None
    file_axis: str | None = None
    markers: tuple[str, ...] = ()
    part: str | None = None
    span_s: tuple[float, float] | None = None

    def overlaps(self, other: Where) -> bool:
        """Whether both may be about the same: equal or unstated in each respect, with a common marker and time."""
        for name in ("trial", "plate", "axis", "part"):
            own, others = getattr(self, name), getattr(other, name)
            if own is not None and others is not None and own != others:
                return False
        if self.markers and other.markers and not set(self.markers) & set(other.markers):
            return False
        if self.span_s is None or other.span_s is None:
            return True
        return self.span_s[0] <= other.span_s[1] and other.span_s[0] <= self.span_s[1]

    def to_dict(self) -> dict[str, Any]:
        """For JSON: what is stated."""
        stated = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in stated.items()
            if value not in (None, ())
        }


@dataclass(frozen=True)
class Finding:
    """What a rule of the catalogue found.

    Attributes:
        code: of the rule, like "P213".
        where: what it is about.
        evidence: what was measured by name; the first is the headline.
        severity: the rule's, or as escalated.
        causes: likeliest first; the rule's if empty.
        muted_by: code of the finding that explains this one.
        status: "open", "waived" or "ignored".

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

    @property
    def rule(self) -> Rule:
        """The entry of the catalogue."""
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
        """What goes wrong if it stays, with its typical size."""
        return self._said(self.rule.effect)

    @property
    def remedy(self) -> str:
        """One thing to do."""
        return self._said(self.rule.remedy)

    @property
    def is_open(self) -> bool:
        """Whether it is neither explained by another nor overruled."""
        return self.status == "open" and self.muted_by is None

    def muted(self, by: str) -> Finding:
        """The same, explained by the finding of that code."""
        return replace(self, muted_by=by)

    def at(self, severity: Severity) -> Finding:
        """The same with another severity."""
        return replace(self, severity=severity)

    def in_trial(self, trial: str) -> Finding:
        """The same, found in that trial."""
        return replace(self, where=replace(self.where, trial=trial))

    def line(self) -> str:
        """Where and what on one line: `walk  P213 The zero of plate 1 is off ...`."""
        return f"{self.where.trial}  {self.code} {self.message}" if self.where.trial else f"{self.code} {self.message}"

    def to_dict(self) -> dict[str, Any]:
        """For JSON, numbers in SI units."""
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
            "causes": list(self.causes or self.rule.causes),
            "remedy": self.remedy,
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
    """A finding of the catalogue's rule, with its severity unless another is given.

    Args:
        code: of the rule.
        where: what it is about.
        severity: where the rule's is raised or lowered.
        causes: likeliest first, where they depend on what was measured.
        evidence: what was measured, the headline first.
    """
    return Finding(code, where or Where(), evidence, severity or Severity[rule(code).severity], causes)
