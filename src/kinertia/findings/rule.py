"""Reads the catalogue of rules: `catalogue/*.toml`, a file per family, when one of its codes is asked for."""

import tomllib
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from kinertia.findings.extensions import RULES, loaded, names

FAMILIES = ("F", "M", "L", "P", "T", "S", "O", "R")
STAGES = ("file", "recording", "person", "kinematics", "estimate", "result")


@dataclass(frozen=True)
class Rule:
    """One rule of the catalogue: the meaning of a code.

    Attributes:
        code, name: "P213", "plate-zero-offset".
        severity: "ERROR", "WARNING", "CORRECTED" or "INFO".
        stage: stage at which it is checked.
        message, effect, remedy: sentences with `{names}` of evidence and places.
        detects: what it examines and its limit, for the documentation.
        escalation: when it is more or less severe, in words.
        hard: whether it cannot be waived, since nothing can be computed.
        by_readers: whether a reader reports it, too: where a file cannot be read further it cannot be waived.
        affects: outputs that an open WARNING lowers to "use with care".
        supersedes: codes, or questions like "T20", whose findings are a consequence of this one.
        resolves: codes of warnings about the same quantity that this correction lowers to CORRECTED.
        settings: settings of the subject file that the remedy proposes (`findings.remedy`).
        causes: likely causes, likeliest first.

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
    by_readers: bool = False
    affects: tuple[str, ...] = ()
    supersedes: tuple[str, ...] = ()
    resolves: tuple[str, ...] = ()
    settings: tuple[str, ...] = ()
    causes: tuple[str, ...] = ()

    @property
    def question(self) -> str:
        """Code of the question, the first three characters: all its codes are answers to it."""
        return self.code[:3]

    @property
    def asks(self) -> str:
        """Question in words."""
        return questions(self.code[0])[self.question]


def rule(code: str) -> Rule:
    """Return the rule of a code.

    Raises:
        KeyError: there is no such rule.
    """
    return rules(code[:1])[code]


@cache
def rules(family: str) -> dict[str, Rule]:
    """Read all rules of a family by code; empty where there is no such family."""
    entries = {code: entry for code, entry in _read(family).items() if len(code) == 4}
    plain: dict[str, dict[str, Any]] = {
        code: {name: tuple(value) if isinstance(value, list) else value for name, value in entry.items()}
        for code, entry in entries.items()
    }
    return {code: Rule(code, **entry) for code, entry in plain.items()}


@cache
def questions(family: str) -> dict[str, str]:
    """Return the text of each question of a family, by its first three characters."""
    return dict(_read(family).get("questions", {}))


def all_rules() -> dict[str, Rule]:
    """Return all rules of the catalogue, and those of installed packages."""
    return {code: known for family in (*FAMILIES, *names(RULES)) for code, known in rules(family).items()}


def matching(code: str) -> tuple[str, ...]:
    """Return the codes covered by a code, a question ("P21") or a family ("P"); empty where it is unknown."""
    return tuple(known for known in rules(code[:1]) if known.startswith(code))


def nearest(code: str) -> tuple[str, ...]:
    """Return up to three known codes most similar to an unknown one, by code or by the rule's name."""
    names = {known.name: known.code for known in all_rules().values()}
    close = [*get_close_matches(code.lower(), list(names), n=1), *get_close_matches(code, [*names.values()], n=3)]
    return tuple(names.get(similar, similar) for similar in close[:3])


@cache
def family_title(family: str) -> str:
    """Return the title of a family."""
    return str(_read(family).get("title", ""))


def page(code: str) -> str:
    """Return the documentation page and anchor of a code or question: "findings/force-plates.md#p213"."""
    return f"findings/{family_title(code[:1]).lower().replace(' ', '-')}.md#{code.lower()}"


@cache
def _read(family: str) -> dict[str, Any]:
    if family in FAMILIES:
        path = files("kinertia.findings").joinpath(f"catalogue/{family}.toml")
    elif family in names(RULES):
        path = Path(loaded(RULES, family).catalogue)
    else:
        return {}
    return tomllib.loads(path.read_text(encoding="utf-8"))
