"""Write the pages about findings from the catalogue: an index, and a page per family with every code.

    python docs/tools/findings.py

A test compares the pages with the catalogue.
"""

from collections.abc import Iterator
from pathlib import Path

from kinertia.diagnostics.limits import with_limits
from kinertia.findings.display import outlined
from kinertia.findings.rule import FAMILIES, Rule, all_rules, family_title, matching, page, questions, rules

DOCS = Path(__file__).resolve().parents[1]

_INDEX = """# Findings

Kinertia checks files, recordings, people, models and results with {count} rules. What one finds is a *finding*: it
states what is wrong with its size, what that does to the results, the likely causes, and one thing to do.
`kinertia explain P213` shows the same as these pages.

A code is a family's letter, two digits for the question and one for the answer: P213 is one answer to P21, "Are the
plates' zeros right?".

| severity | what it means |
|---|---|
| ERROR | the result would be wrong, or cannot be computed: the trial, or the person, is not used |
| WARNING | may change a result beyond its error bar, and is not corrected: what it affects is to be used with care |
| CORRECTED | found and corrected; its size and SD are shown, and nothing else needs to be done for this result |
| INFO | an assumption, or advice |

A finding that *explains* another one hides it: of a recording with two labels swapped, only the swap is shown, not the
forces that seem to act beside the feet. The hidden ones are in `fit.json`, and folded below their cause in the report.

A quantity about an instrument is its error, recorded minus true. Positive means: it reads too much, lies too far
along the positive axis, is rotated counter-clockwise seen from above, or is delayed.

## Overruling { #overruling }

In the subject file, for all its trials, or for one as `[trial.diagnostics]` below its `[[trial]]`:

```toml
[diagnostics]
ignore = ["M102", "R40"]   # codes or questions that are left out of the verdict
waive = ["P244"]           # errors that do not block; outputs are then to be used with care at best
```

For a whole study the same table is in a file
[`kinertia.toml`](subject-file.md#diagnostics-which-findings-are-overruled).

## All codes
"""


def pages() -> dict[Path, str]:
    """The text of every page about findings."""
    return {DOCS / "findings.md": _index()} | {_path(family): _family(family) for family in FAMILIES}


def _path(family: str) -> Path:
    return DOCS / page(family).partition("#")[0]


def _index() -> str:
    parts = [_INDEX.replace("{count}", str(len(all_rules())))]
    for family in FAMILIES:
        parts += [f"### [{family_title(family)}]({_path(family).relative_to(DOCS)})", _listed(family)]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _listed(family: str) -> str:
    rows = ["| question | codes |", "|---|---|"]
    for question, asked in questions(family).items():
        codes = ", ".join(f"[{code}]({page(code)}) {rules(family)[code].name}" for code in matching(question))
        rows.append(f"| [{question}]({page(question)}) {asked} | {codes} |")
    return "\n".join(rows)


def _family(family: str) -> str:
    parts = [f"# {family_title(family)} {{ #{family.lower()} }}"]
    for question, asked in questions(family).items():
        parts.append(f"## {question} {asked} {{ #{question.lower()} }}")
        for code in matching(question):
            parts += _rule(with_limits(rules(family)[code]))
    return "\n\n".join(parts) + "\n"


def _rule(rule: Rule) -> Iterator[str]:
    yield f"### {rule.code} {rule.name} {{ #{rule.code.lower()} }}"
    severity = f"**{rule.severity}**" + (f"; {rule.escalation}" if rule.escalation else "")
    yield f"{severity} · {rule.stage} stage · {_overruling(rule)}"
    yield f"> {outlined(rule.message, '*{}*')}"
    yield f"**Detects.** {rule.detects}"
    yield f"**Effect.** {outlined(rule.effect, '*{}*')}"
    if rule.causes:
        yield "**Likely causes.**\n\n" + "\n".join(f"{k}. {cause}" for k, cause in enumerate(rule.causes, 1))
    yield f"**Remedy.** {outlined(rule.remedy, '*{}*')}"
    if rule.affects:
        yield f"**Affects** {', '.join(rule.affects).replace('_', ' ')}."
    if rule.supersedes:
        yield f"**Explains** {_links(rule.supersedes)}."
    if rule.resolves:
        yield f"**Resolves** {_links(rule.resolves)}."


def _overruling(rule: Rule) -> str:
    """Whether it may be overruled; how is on the index."""
    words = [] if rule.severity == "ERROR" else ["can be ignored"]
    if rule.severity == "ERROR" or "ERROR" in rule.escalation:
        words.append(
            "cannot be waived"
            if rule.hard
            else "can be waived where the file could be read"
            if rule.by_readers
            else "can be waived"
        )
    return f"[{', '.join(words)}](../findings.md#overruling)"


def _links(codes: tuple[str, ...]) -> str:
    """Codes with links from any page of a family."""
    return ", ".join(f"[{code}]({page(code).removeprefix('findings/')})" for code in codes)


if __name__ == "__main__":
    for path, text in pages().items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
