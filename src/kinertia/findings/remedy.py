"""Derives the settings of the subject file that mend or overrule a finding, from its rule, place and evidence.

A rule names the settings that its remedy proposes, such as `trial.window_s`; their values follow from the finding.
"""

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from kinertia.findings.finding import Finding, Severity

Span = tuple[float, float]
DIAGNOSTICS = "diagnostics"
"""Table that overrules findings."""
SHORTEST_S = 0.2
"""Shortest rest of a trial that is proposed as its window."""
_OVERRULES = {Severity.ERROR: "waive", Severity.WARNING: "ignore"}


@dataclass(frozen=True)
class Remedy:
    """One setting of the subject file that mends or overrules a finding.

    Attributes:
        table: table of the subject file: "subject", "model", "trial", "instruments" or "diagnostics".
        key: entry of the table; empty for the table as a whole, a trial that is left out.
        value: value of the entry, as TOML has it; None if the entry is removed; of "diagnostics" the code.
        trial: name of the trial that it concerns; empty for all.

    Examples:
        >>> from kinertia.findings.remedy import Remedy
        >>> Remedy("trial", "window_s", [0.4, 1.2], "walk").text
        'window_s = [0.4, 1.2] under [[trial]] walk'
    """

    table: str
    key: str
    value: Any = None
    trial: str = ""

    @property
    def overrules(self) -> bool:
        """Whether it overrules the finding, for which a reason is to be given."""
        return self.table == DIAGNOSTICS

    @property
    def text(self) -> str:
        """The setting as a user would write it, and where."""
        if not self.key:
            return f"no [[{self.table}]] {self.trial}"
        where = f"[{self.table}]"
        if self.trial:
            where = f"[trial.{self.table}] of {self.trial}" if self.overrules else f"[[trial]] {self.trial}"
        value = json.dumps([self.value] if self.overrules else self.value, ensure_ascii=False)
        return f"{f'no {self.key}' if self.value is None else f'{self.key} = {value}'} under {where}"

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON content."""
        return asdict(self)


def remedies(alike: Sequence[Finding], windows: Mapping[str, Sequence[Span]]) -> tuple[Remedy, ...]:
    """Return the settings that mend equal findings of one trial, then the one that overrules them.

    Args:
        alike: open findings of one code and trial.
        windows: used parts (s) of each trial, the longest first, by the trial's name in the subject file.
    """
    first = alike[0]
    trial = first.where.trial if first.where.trial in windows else None
    names = dict.fromkeys([*first.rule.settings, *(["trial"] if first.severity is Severity.ERROR else [])])
    found = [remedy for name in names for remedy in _proposed(name, alike, windows)]
    level = _OVERRULES.get(first.severity)
    if level is not None and not first.rule.hard and (first.rule.stage != "file"):
        found.append(Remedy(DIAGNOSTICS, level, first.code, trial or ""))
    return tuple(found)


def _proposed(name: str, alike: Sequence[Finding], windows: Mapping[str, Sequence[Span]]) -> Iterator[Remedy]:
    """Return the setting of a name, `table.key` or `table.key = evidence`, where its value is known."""
    name, _, source = name.partition(" = ")
    table, _, key = name.partition(".")
    where, trial = alike[0].where, ""
    if table == "trial":
        trial = where.trial or ""
        if trial not in windows:
            return
    value: Any = None
    match name:
        case "trial":
            known = len(windows) > 1
        case "model.static":
            known = True
        case "trial.window_s":
            value = _rest(
                windows[trial], [finding.where.span_s for finding in alike if finding.where.span_s is not None]
            )
            known = value is not None
        case "model.window_s":
            value = None if where.span_s is None else _rounded(where.span_s)
            known = value is not None
        case "trial.leave_out":
            value = list(dict.fromkeys(label for finding in alike for label in finding.where.markers))
            known = bool(value)
        case "model.calibrate":
            value, known = True, "--calibrate" in alike[0].remedy
        case _:
            value = _of_evidence(alike[0], source or key)
            known = value is not None
    if known:
        yield Remedy(table, key, value, trial)


def _rest(windows: Sequence[Span], spans: Sequence[Span]) -> list[float] | None:
    """Return the longest part of the windows outside these spans; None if there is hardly any, or no span."""
    parts = list(windows)
    for start, end in spans:
        before_after = [piece for low, high in parts for piece in ((low, min(high, start)), (max(low, end), high))]
        parts = [(low, high) for low, high in before_after if low < high]
    longest = max(parts, key=lambda part: part[1] - part[0], default=(0.0, 0.0))
    usable = spans and [longest] != [*windows] and longest[1] - longest[0] >= SHORTEST_S
    return _rounded(longest) if usable else None


def _rounded(span: Span) -> list[float]:
    return [round(end, 3) for end in span]


def _of_evidence(finding: Finding, name: str) -> Any:
    """Return the value of a piece of evidence: a number to four digits, `true`, a word, or a list written as TOML."""
    if name == "true":
        return True
    quantity = finding.evidence.get(name)
    if quantity is None:
        return None
    if isinstance(quantity.value, str) and quantity.value.isalpha():
        return quantity.value
    if isinstance(quantity.value, str):
        return tomllib.loads(f"value = [{quantity.value}]")["value"]
    return None if isinstance(quantity.value, tuple) else float(f"{quantity.value:.4g}")
