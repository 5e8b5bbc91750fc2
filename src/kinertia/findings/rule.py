"""Reads the catalogue of rules: `catalogue/*.toml`, a file per family, when one of its codes is asked for."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from typing import Any

FAMILIES = ("F", "M", "L", "P", "T", "S", "O", "R")
STAGES = ("file", "recording", "person", "kinematics", "estimate", "result")
OUTPUTS = ("motion", "moments", "masses", "centres_of_mass", "inertias")


@dataclass(frozen=True)
class Rule:
    """What one code means.

    Attributes:
        code, name: "P213", "plate-zero-offset".
        severity: "ERROR", "WARNING", "CORRECTED" or "INFO".
        stage: at which it is asked.
        message, effect, remedy: sentences with `{names}` of evidence and places.
        detects: what it looks at and from which limit on, for the documentation.
        escalation: when it is more or less severe, in words.
        hard: cannot be waived, since nothing can be computed.
        affects: outputs that an open WARNING lowers to "use with care".
        supersedes: codes, or questions like "T20", whose findings are a consequence of this one.
        resolves: codes of warnings about the same quantity that this correction lowers to CORRECTED.
        causes: likeliest first.

    Examples:
        >>> kinertia.rule("P213").name, kinertia.rule("P213").question
        ('plate-zero-offset', 'P21')
    """

    code: str
    name: str
    severity: str
    stage: str
    message: str
    effect: str
    remedy: str
    detects: str = ""
    escalation: str = ""
    hard: bool = False
    affects: tuple[str, ...] = ()
    supersedes: tuple[str, ...] = ()
    resolves: tuple[str, ...] = ()
    causes: tuple[str, ...] = ()

    @property
    def question(self) -> str:
        """The first three characters: all codes of a question are answers to it."""
        return self.code[:3]

    @property
    def asks(self) -> str:
        """The question in words."""
        return questions(self.code[0])[self.question]


def rule(code: str) -> Rule:
    """The rule of a code.

    Raises:
        KeyError: there is none.
    """
    return rules(code[:1])[code]


@cache
def rules(family: str) -> dict[str, Rule]:
    """All rules of a family by their codes; empty where there is no such family."""
    entries = {code: entry for code, entry in _read(family).items() if len(code) == 4}
    return {code: _rule(code, entry) for code, entry in entries.items()}


@cache
def questions(family: str) -> dict[str, str]:
    """What each question of a family asks, by its first three characters."""
    return dict(_read(family).get("questions", {}))


def all_rules() -> dict[str, Rule]:
    """The whole catalogue."""
    return {code: one for family in FAMILIES for code, one in rules(family).items()}


def matching(code: str) -> tuple[str, ...]:
    """Codes that a code, a question ("P21") or a family ("P") stands for; empty where it is unknown."""
    return tuple(one for one in rules(code[:1]) if one.startswith(code))


def nearest(code: str) -> tuple[str, ...]:
    """Up to three codes that look most like one that is unknown, or whose rule's name does."""
    names = {one.name: one.code for one in all_rules().values()}
    close = [*get_close_matches(code.lower(), list(names), n=1), *get_close_matches(code, [*names.values()], n=3)]
    return tuple(names.get(one, one) for one in close[:3])


@cache
def family_title(family: str) -> str:
    """What a family is about."""
    return str(_read(family).get("title", ""))


def page(code: str) -> str:
    """Page and place of the documentation about a code or question: "findings/force-plates.md#p213"."""
    return f"findings/{family_title(code[:1]).lower().replace(' ', '-')}.md#{code.lower()}"


def _rule(code: str, entry: dict[str, Any]) -> Rule:
    named: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in entry.items()}
    return Rule(code, **named)


@cache
def _read(family: str) -> dict[str, Any]:
    if family not in FAMILIES:
        return {}
    path = files("kinertia.findings").joinpath(f"catalogue/{family}.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))
