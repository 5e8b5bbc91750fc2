"""All messages as they read, in `messages.txt`: whoever changes one sees it there, and means it.

    PYTHONPATH=src python tests/findings/test_messages.py

writes the file.
"""

import re
from pathlib import Path

from kinertia.findings.display import filled
from kinertia.findings.quantity import Quantity, Where
from kinertia.findings.rule import Rule, all_rules

MESSAGES = Path(__file__).with_name("messages.txt")
PLACE = Where("walk.c3d", 7, "walk", "plate 1", "fore-aft", "X", ("RKNE", "LKNE"), "shank_r", (0.5, 1.25))
SIZES = {
    "_m_s": (1.23, "m/s"),
    "_nm_n": (0.0123, "N m/N"),
    "_kg_m3": (1050.0, "kg/m3"),
    "_kg": (72.6, "kg"),
    "_nm": (12.3, "N m"),
    "_rad": (0.12, "rad"),
    "_hz": (100.0, "Hz"),
    "_n": (23.4, "N"),
    "_m": (0.0123, "m"),
    "_s": (0.0123, "s"),
}
"""Values of evidence by the unit that its name ends in."""


def example(name: str, style: str) -> Quantity:
    """A value that evidence of this name may have: a text where it is neither a number nor a share."""
    for ending, (value, unit) in SIZES.items():
        if name.endswith(ending):
            return Quantity(value, unit)
    return Quantity(0.123 if "%" in style else 3.0, "1") if style or name.endswith("_sd") else Quantity(f"<{name}>")


def said(rule: Rule) -> str:
    """Its message with example values."""
    styles = dict(re.findall(r"\{(\w+):?([^}]*)\}", rule.message))
    known = {name for name in styles if "{" not in filled("{" + name + "}", PLACE, {})}
    return filled(rule.message, PLACE, {name: example(name, styles[name]) for name in styles.keys() - known})


def written() -> str:
    """The file: code and message with example values, and below it the template."""
    return "".join(
        f"{code} {entry.severity} {said(entry)}\n     {entry.message}\n" for code, entry in all_rules().items()
    )


def test_messages_are_those_that_were_meant():
    assert MESSAGES.read_text(encoding="utf-8") == written(), f"to mean it: python {Path(__file__).name}"


def test_nothing_is_left_in_braces():
    assert [code for code, entry in all_rules().items() if "{" in said(entry)] == []


if __name__ == "__main__":
    MESSAGES.write_text(written(), encoding="utf-8")
