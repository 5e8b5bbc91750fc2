"""Who of a cohort passed, whose results are to be used with care, who did not pass, and why: reasons counted.

A fit of which no check failed may have cautions and warnings; its report then says "usable with care", and so does the
page.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from markupsafe import Markup, escape

from kinertia.report.result_page import Part
from kinertia.report.row_figures import bar_figure
from kinertia.studies.cohort_record import AGAINST, PASSED, Place

if TYPE_CHECKING:
    import pandas as pd

_MOST_REASONS, _MOST_NAMES = 12, 5
_FIT = "fit.json"
_WORDS = ("passed", "with care", "not fitted", "a check failed")
_QUOTED_OR_PATH = re.compile(
    r"(?<!\w)'[^']*'"  # and no apostrophes
    r'|"[^"]*"'
    r"|(?<!\S)([A-Za-z]:)?[/\\][^\s;,]+"  # and no units, such as N m/kN
    r"|[^\s;,]+[/\\][^\s;,]*\.\w{2,4}\b"
)


@dataclass(frozen=True)
class Outcome:
    """How a person's fit ended.

    Attributes:
        person: name.
        fitted: whether there are results.
        failed: why there are none, or which checks failed.
        doubts: cautions and warnings.
    """

    person: str
    fitted: bool
    failed: tuple[str, ...]
    doubts: tuple[str, ...]

    @property
    def word(self) -> str:
        """One of `_WORDS`."""
        if not self.fitted:
            return "not fitted"
        if self.failed:
            return "a check failed"
        return "with care" if self.doubts else "passed"


def outcomes_of(folder: Path, people: pd.DataFrame) -> list[Outcome]:
    """Everybody's, from the list of people and each one's `fit.json`."""
    found = []
    for person, status, sentence in zip(people["person"], people["status"], people["sentence"], strict=True):
        fitted = status in (PASSED, AGAINST)
        result = _result(Place(folder, person).results / _FIT) if fitted else {}
        failed, doubts = _judged(result)
        if status != PASSED and not failed:
            failed = (sentence,)
        found.append(Outcome(person, fitted, failed, doubts))
    return found


def _result(path: Path) -> Mapping[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _judged(result: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Checks that failed; cautions and warnings. Without the names of trials, which are not the others'."""
    trials = [trial["name"] for trial in result.get("trials", ())]

    def nameless(sentence: str) -> str:
        return next(
            (sentence.removeprefix(f"{name}: ") for name in trials if sentence.startswith(f"{name}: ")), sentence
        )

    by_level: dict[str, list[str]] = {"pass": [], "caution": [], "fail": []}
    for verdict in result.get("verdicts", ()):
        by_level[verdict["level"]].append(nameless(verdict["sentence"]))
    warnings = [nameless(sentence) for sentence in result.get("warnings", ())]
    return tuple(by_level["fail"]), (*by_level["caution"], *warnings)


def lead(outcomes: Iterable[Outcome]) -> str:
    """The page's first sentence."""
    counts = _counts(outcomes)
    careful = counts["with care"]
    care = f", {careful} {'is' if careful == 1 else 'are'} usable with care" if careful else ""
    total = sum(counts.values())
    return (
        f"{total} people; {counts['passed']} passed every check{care}. Each one's report is in people/NAME/report.html."
    )


def _counts(outcomes: Iterable[Outcome]) -> dict[str, int]:
    counted = Counter(one.word for one in outcomes)
    return {word: counted[word] for word in _WORDS}


def outcome_parts(outcomes: Iterable[Outcome]) -> list[Part]:
    """How many passed, and the reasons of the others: numbers in a sentence do not make another reason."""
    everybody = list(outcomes)
    counts = _counts(everybody)
    bars = bar_figure(
        ["people"],
        {f"{word} ({count})": [count] for word, count in counts.items()},
        ", ".join(f"{count} {word}" for word, count in counts.items()),
        "people",
    )
    failed = _reasons({one.person: one.failed for one in everybody}, everybody)
    doubts = _reasons({one.person: one.doubts for one in everybody}, everybody)
    parts = [Part("Who passed", figure=bars, headings=("why not", "people", "who"), rows=failed)]
    if doubts:
        text = "Cautions and warnings of results, which count as passed for the exit status."
        parts.append(Part("What to look at", (text,), headings=("what", "people", "who"), rows=doubts))
    return parts


def _reasons(sentences: Mapping[str, Iterable[str]], everybody: Iterable[Outcome]) -> list[tuple[str, str, str]]:
    """The most frequent ones first, each person once, linked to the report if there is one."""
    shown = {one.person: _linked(one) for one in everybody}
    names: dict[str, list[str]] = {}
    for person, said in sentences.items():
        for reason in dict.fromkeys(map(reason_of, said)):
            names.setdefault(reason, []).append(person)
    counted = Counter({reason: len(who) for reason, who in names.items()})
    return [
        (
            reason,
            str(count),
            Markup(", ").join(shown[person] for person in names[reason][:_MOST_NAMES])
            + (", ..." if count > _MOST_NAMES else ""),
        )
        for reason, count in counted.most_common(_MOST_REASONS)
    ]


def _linked(one: Outcome) -> Markup:
    return linked(one.person) if one.fitted else escape(one.person)


def linked(person: str) -> Markup:
    """The name, which leads to the person's report."""
    return Markup('<a href="people/{}/report.html">{}</a>').format(quote(person), person)


def reason_of(sentence: str) -> str:
    """The first clause without paths and numbers."""
    text = re.sub(r"^[^ ]*[/\\][^:]*?(, line \d+)?: ", "", sentence)
    text = _QUOTED_OR_PATH.sub("...", text)
    text = re.sub(r"[-+]?\d+([.,]\d+)*", "#", text)
    return re.split(r"; |(?<!\.)\. ", text, maxsplit=1)[0] or "no reason given"
