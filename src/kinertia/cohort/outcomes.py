"""Summarises a cohort: verdicts, findings by code, and overruled findings that never occurred."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np
from markupsafe import Markup, escape

from kinertia.findings.display import outlined, shown
from kinertia.findings.finding import Severity
from kinertia.findings.overview import USES
from kinertia.findings.quantity import Quantity
from kinertia.findings.rule import matching, rule
from kinertia.report.finding_view import linked
from kinertia.report.result_page import Part
from kinertia.report.row_figures import bar_figure

if TYPE_CHECKING:
    import pandas as pd

PEOPLE = ("person", "status", "sentence", "verdict", "overruled")
FINDINGS = ("person", "code", "severity", "status", "muted_by", "value", "unit")
"""Columns that are read of the two tables."""
NOT_FITTED = "not fitted"
_MOST_NAMES, _MOST_PEOPLE = 5, 20
_HEADINGS = ("code", "severity", "finding", "people", "open", "explained by another", "overruled", "median size", "who")


def lead(people: pd.DataFrame) -> str:
    """Write the page's first sentence."""
    counts = _counts(people)
    said = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    return f"{len(people)} people: {said}. Each one's report is in people/NAME/report.html."


def _counts(people: pd.DataFrame) -> dict[str, int]:
    counted = Counter(people["verdict"])
    return {word: counted[word] for word in USES} | {NOT_FITTED: counted[""]}


def outcome_parts(people: pd.DataFrame, findings: pd.DataFrame) -> Iterator[Part]:
    """Yield verdicts, people without results and why, findings by code, unused overrules, and the meaning of codes."""
    counts = _counts(people)
    bars = bar_figure(
        ["people"],
        {f"{word} ({count})": [count] for word, count in counts.items()},
        ", ".join(f"{count} {word}" for word, count in counts.items()),
        "people",
    )
    without = people[people["verdict"] == ""]
    why = [
        Markup("{}: {}").format(*row) for row in zip(without["person"], map(linked, without["sentence"]), strict=True)
    ]
    more = (f"{len(why)} people; the others are in people.csv.",) if len(why) > _MOST_PEOPLE else ()
    yield Part("Verdicts", figure=bars)
    if why:
        yield Part("Not fitted", more, listed=why[:_MOST_PEOPLE])
    if len(findings):
        fitted = set(people["person"][people["verdict"] != ""])
        text = "Every finding: findings.parquet. Open: neither explained by another finding nor overruled."
        yield Part("Findings by code", (text,), headings=_HEADINGS, rows=_by_code(findings, fitted))
    if vain := overruled_in_vain(people, findings):
        yield Part("Overruled, but never found", listed=vain)
    if len(findings):
        yield Part("What the codes mean", listed=[_meaning(code) for code in sorted(findings["code"].unique())])


def _by_code(findings: pd.DataFrame, fitted: set[str]) -> list[tuple[str, ...]]:
    """Return a row for each code, the worst and most frequent first."""
    rows = []
    for code, of in findings.groupby("code", observed=True):
        severity = max(Severity[name] for name in of["severity"].unique())
        muted = of["muted_by"].notna() & (of["status"] == "open")
        overruled, people = of["status"] != "open", of["person"].unique().tolist()
        counts = [
            len(people),
            len(of) - int(overruled.sum()) - int(muted.sum()),
            int(muted.sum()),
            int(overruled.sum()),
        ]
        names = Markup(", ").join(report_of(name) if name in fitted else escape(name) for name in people[:_MOST_NAMES])
        cells = (linked(str(code)), severity.name, rule(str(code)).name.replace("-", " "), *map(str, counts))
        more = names + (", ..." if len(people) > _MOST_NAMES else "")
        rows.append(((-severity, -len(people), str(code)), (*cells, _median(of), more)))
    return [cells for _, cells in sorted(rows, key=lambda row: row[0])]


def _median(of: pd.DataFrame) -> str:
    """Return the median size of the headlines; empty where there is none."""
    known = of.dropna(subset=["value"])
    if not len(known):
        return ""
    return shown(Quantity(float(np.median(known["value"].abs())), str(known["unit"].iloc[0])))


def overruled_in_vain(people: pd.DataFrame, findings: pd.DataFrame) -> list[str]:
    """List codes, questions or families that people waive or ignore, and that were never found."""
    said = Counter(code for text in people["overruled"] for code in text.split())
    found = set(findings["code"].unique())
    return [f"{code}: {count} people" for code, count in said.most_common() if not found & set(matching(code))]


def _meaning(code: str) -> Markup:
    one = rule(code)
    texts = (code, code, one.name.replace("-", " "), one.detects, outlined(one.effect), outlined(one.remedy))
    return Markup('<strong id="explain-{}">{} {}</strong>: {} {} {}').format(*texts)


def report_of(person: str) -> Markup:
    """Return the name as a link to the person's report."""
    return Markup('<a href="people/{}/report.html">{}</a>').format(quote(person), person)
