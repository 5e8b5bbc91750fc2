"""Words and tables of what changed between two conditions, for the terminal, scripts and Excel."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from kinertia.estimation.condition_changes import PRIMARY, SOURCES, Change
from kinertia.estimation.walking_speed import NOTABLE
from kinertia.report.style import SIDES

_DIGITS = {"N m/kg": 3, "degrees": 1, "m/s": 2}


def change_sentences(found: Sequence[Change]) -> Iterator[str]:
    """Yield a sentence for each outcome that was named beforehand, as a report may state it."""
    for wanted in PRIMARY:
        for one in found:
            if (one.quantity, one.joint, one.component, one.event) == wanted:
                side = f"{SIDES[one.side][0].capitalize()} " if one.side else ""
                yield f"{side}{one.joint} {one.component} {one.quantity}, {one.event}: {_judgement(one)}."


def speed_sentence(speed: Change | None) -> str:
    """State whether walking speed changed, and that moments change with it where it did, or may have."""
    if speed is None:
        return "Walking speed is not known; if it changed, moments did, too."
    sentence = f"Walking speed: {_judgement(speed)}."
    if speed.verdict == "changed" or abs(speed.difference) > NOTABLE * speed.before:
        sentence += " Moments change with speed: the speed may explain what changed below."
    return sentence


def _judgement(one: Change) -> str:
    digits = _DIGITS[one.unit]
    pair = f"{one.before:.{digits}f} before, {one.after:.{digits}f} after"
    if one.verdict != "changed":
        pair += f", {one.unit}"
    if one.verdict == "cannot be judged":
        return f"cannot be judged, with {one.strides[0]} and {one.strides[1]} repeats ({pair})"
    if one.verdict == "changed":
        return f"changed by {one.difference:+.{digits}f} {one.unit} (SD {one.sd:.{digits}f}; {pair})"
    return f"no change shown; one below {one.mdc95:.{digits}f} {one.unit} would be missed ({pair})"


def changed_sentence(found: Sequence[Change]) -> str:
    """State how many of the other outcomes changed; by chance some do."""
    others = [one for one in found if not one.primary and one.verdict != "cannot be judged"]
    if not others:
        return "Nothing else can be judged."
    count = sum(one.verdict == "changed" for one in others)
    remain = sum(discovered([one.p for one in others]))
    return (
        f"Of {len(others)} other moments and angles {count} changed; without any change about {0.05 * len(others):.0f} "
        f"would seem to. At a false discovery rate of 5 %, {remain} remain."
    )


def discovered(p: Sequence[float], rate: float = 0.05) -> list[bool]:
    """Select what is discovered at this false discovery rate (Benjamini and Hochberg 1995, J R Stat Soc B 57:289)."""
    order = np.argsort(p)
    below = np.flatnonzero(np.asarray(p)[order] <= rate * np.arange(1, len(order) + 1) / len(order))
    found = np.zeros(len(order), dtype=bool)
    found[order[: below[-1] + 1 if len(below) else 0]] = True
    chosen: list[bool] = found.tolist()
    return chosen


def change_columns(found: Sequence[Change]) -> dict[str, list[Any]]:
    """Return the columns of `changes.csv`: a row per outcome, one column for each part of the standard deviation."""
    names = ("quantity", "joint", "component", "side", "event", "unit", "before", "after", "difference", "sd")
    return {
        **{name: [getattr(one, name) for one in found] for name in names},
        **{f"sd_{source}": [one.sd_by_source[source] for one in found] for source in SOURCES},
        "mdc95": [one.mdc95 for one in found],
        "p": [one.p for one in found],
        "strides_before": [one.strides[0] for one in found],
        "strides_after": [one.strides[1] for one in found],
        "verdict": [one.verdict for one in found],
    }


def change_rows(found: Sequence[Change]) -> list[dict[str, Any]]:
    """Return the rows of the page's table: numbers with their text, outcomes that were named beforehand first."""
    order = sorted(found, key=lambda one: (not one.primary, one.quantity != "moment"))
    return [
        {
            "outcome": f"{one.joint.replace('_', ' ')} {one.component.replace('_', ' ')} {one.quantity}",
            "side": SIDES[one.side][0] if one.side else "",
            "event": one.event,
            "unit": one.unit,
            "verdict": one.verdict,
            "cells": [_cell(one, value) for value in (one.before, one.after)]
            + [_cell(one, one.difference, "+")]
            + [_cell(one, value) for value in (one.mdc95, one.sd, *(one.sd_by_source[source] for source in SOURCES))],
        }
        for one in order
    ]


def _cell(one: Change, value: float, sign: str = "") -> dict[str, Any]:
    known = bool(np.isfinite(value))
    return {"value": value if known else 0.0, "text": f"{value:{sign}.{_DIGITS[one.unit]}f}" if known else "–"}


def changes_summary(before: str, after: str, found: Sequence[Change], speed: Change | None) -> dict[str, Any]:
    """Return what `kinertia compare --json` prints of changes."""
    rows = [_summary(one) for one in found]
    return {
        "before": before,
        "after": after,
        "walking_speed": None if speed is None else _summary(speed),
        "outcomes": rows,
    }


def _summary(one: Change) -> dict[str, Any]:
    return {**asdict(one), "difference": one.difference, "verdict": one.verdict}
