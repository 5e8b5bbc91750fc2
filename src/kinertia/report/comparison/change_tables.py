"""Shows what changed between two conditions: words, tables, and curves with their bands."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from kinertia.estimation.changes.change import MOST_WALKS, NOTABLE, PRIMARY, SOURCES, Change
from kinertia.estimation.changes.curve_changes import CurveChange
from kinertia.estimation.changes.group_changes import GroupChange
from kinertia.report.figures.cycle_figures import band, mean_line
from kinertia.report.figures.figure import (
    COMPARED,
    GREEN,
    GREY,
    SIDES,
    Figure,
    Panel,
    faded,
    plain,
    shaded,
    small_multiples,
    written,
)
from kinertia.report.wording import INTERVAL_SD
from kinertia.trial.sampled_data import runs

_DIGITS = {"N m/kg": 3, "degrees": 1, "m/s": 2, "steps/min": 1, "m": 3, "%": 1}
RELEVANT = {"N m/kg": 0.1, "degrees": 5.0, "m/s": 0.1, "steps/min": 5.0, "m": 0.05, "%": 2.0}
"""Changes for which the repeats needed are stated. Errors above 5 degrees mislead (McGinley et al. 2009, Gait Posture
29:360), and 0.1 m/s matter to patients (Bohannon and Glenney 2014, J Eval Clin Pract 20:295); the others are chosen
here."""
_JOINTS = {
    "moment": ("knee", "hip", "ankle", "lumbar"),
    "angle": ("knee", "hip", "ankle", "subtalar", "pelvis", "lumbar"),
}
_OPACITY, _SHADE = 0.2, 0.12
_PHASES = {"stride": "% of the gait cycle", "stance": "% of stance"}


def change_sentences(found: Sequence[Change]) -> Iterator[str]:
    """Yield a sentence for each outcome that was named beforehand, as a report may state it."""
    for wanted in PRIMARY:
        for one in found:
            if (one.quantity, one.joint, one.component, one.event) == wanted:
                side = f"{SIDES[one.side][0].capitalize()} " if one.side else ""
                yield f"{side}{one.joint} {one.component} {one.quantity} ({one.event}) {_judgement(one)}."


def speed_sentence(speed: Change | None) -> str:
    """State whether walking speed changed, and that moments change with it where it did, or may have."""
    if speed is None:
        return "Walking speed is not known; if it changed, moments did, too."
    sentence = f"Walking speed {_judgement(speed)}."
    if speed.verdict == "changed" or abs(speed.difference) > NOTABLE * speed.before:
        sentence += " Moments change with speed: the speed may explain what changed below."
    return sentence


def _judgement(one: Change) -> str:
    """State what became of an outcome, as the predicate of a sentence that a clinician may copy."""
    digits = _DIGITS[one.unit]
    pair = f"from {one.before:.{digits}f} to {one.after:.{digits}f} {one.unit}"
    if one.doubt:
        return f"went {pair}; a finding about the instruments keeps this from being judged"
    if one.verdict == "cannot be judged":
        return f"went {pair}; {one.strides[0]} and {one.strides[1]} repeats cannot show whether that is a change"
    if one.verdict == "changed":
        return f"changed {pair} ({one.difference:+.{digits}f}, SD {one.sd:.{digits}f})"
    return f"went {pair}; no change is shown, and one below {one.mdc95:.{digits}f} {one.unit} would be missed"


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


def limit_sentences(found: Sequence[Change], doubt: str) -> Iterator[str]:
    """State what was assumed, and what cannot be judged."""
    if doubt:
        yield f"Changes of moments of the legs concerned cannot be judged: {doubt}"
    few = sorted({min(one.strides) for one in found if one.assumed})
    if few:
        least = f"{few[0]}" if len(few) == 1 else f"{few[0]} to {few[-1]}"
        strides = "one stride" if least == "1" else f"{least} strides"
        yield (
            f"With {strides} of a condition their spread is hardly known: at least that of four other people was "
            "assumed. Three or more repeats of each condition show it."
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
        "sd_between_strides_before": [one.stride_sd[0] for one in found],
        "sd_between_strides_after": [one.stride_sd[1] for one in found],
        "spread_assumed": [one.assumed for one in found],
        "walks_needed": [one.walks_needed(RELEVANT[one.unit]) for one in found],
        "mdc95": [one.mdc95 for one in found],
        "p": [one.p for one in found],
        "strides_before": [one.strides[0] for one in found],
        "strides_after": [one.strides[1] for one in found],
        "verdict": [one.verdict for one in found],
    }


def person_columns(person: str, found: Sequence[Change]) -> dict[str, list[Any]]:
    """Return the columns of a cohort's `changes.csv`: the rows of one person, with what keeps one from being judged."""
    return {
        "person": [person] * len(found),
        **change_columns(found),
        "remarks": [one.doubt for one in found],
    }


def curve_columns(found: Sequence[CurveChange]) -> dict[str, list[Any]]:
    """Return the columns of `change_curves.csv`: a row per curve and percent, with the simultaneous band."""
    rows = [(one, k) for one in found for k in range(len(one.before))]
    bands = {id(one): one.band for one in found}
    names = ("quantity", "joint", "component", "side", "phase", "unit")
    curves = ("before", "after", "before_sd", "after_sd", "difference", "sd")
    return {
        **{name: [getattr(one, name) for one, _ in rows] for name in names},
        "percent": [k for _, k in rows],
        **{name: np.concatenate([getattr(one, name) for one in found]).tolist() if found else [] for name in curves},
        **{end: [float(bands[id(one)][j][k]) for one, k in rows] for j, end in enumerate(("lower", "upper"))},
    }


def change_rows(found: Sequence[Change]) -> list[dict[str, Any]]:
    """Return the rows of the page's table: numbers with their text, primary outcomes first."""
    order = sorted(found, key=lambda one: (not one.primary, one.quantity != "moment"))
    return [
        {
            "outcome": outcome_words(one),
            "side": SIDES[one.side][0] if one.side else "",
            "event": one.event,
            "unit": one.unit,
            "verdict": one.verdict,
            "primary": one.primary,
            "needed": one.walks_needed(RELEVANT[one.unit]) or f"over {MOST_WALKS}",
            "cells": [_cell(one, value) for value in (one.before, one.after)]
            + [_cell(one, one.difference, "+")]
            + [_cell(one, value) for value in (one.mdc95, one.sd, *(one.sd_by_source[source] for source in SOURCES))],
        }
        for one in order
    ]


def group_columns(found: Sequence[GroupChange]) -> dict[str, list[Any]]:
    """Return the columns of `change_means.csv`: a row per outcome."""
    return {each.name: [getattr(one, each.name) for one in found] for each in fields(GroupChange)}


def group_rows(found: Sequence[GroupChange]) -> list[tuple[str, ...]]:
    """Return rows of text: speed, steps and the primary outcomes."""
    chosen = [one for one in found if one.quantity == "gait" or one.primary]
    return [_group_row(one) for one in chosen]


def _group_row(one: GroupChange) -> tuple[str, ...]:
    side = f"{SIDES[one.side][0]} " if one.side else ""
    event = f", {one.event}" if one.event else ""
    digits = _DIGITS[one.unit]
    known = one.people > 1
    return (
        f"{side}{outcome_words(one)}{event}",
        one.unit,
        str(one.people),
        f"{one.before:.{digits}f}",
        f"{one.after:.{digits}f}",
        f"{one.difference:+.{digits}f}",
        f"{one.lower:+.{digits}f} to {one.upper:+.{digits}f}" if known else "",
        f"{one.sd:.{digits}f}" if known else "",
        str(one.changed),
    )


def outcome_words(one: Change | CurveChange | GroupChange) -> str:
    """Return what a change is of: "knee adduction moment", "walking speed"."""
    quantity = "" if one.quantity == "gait" else f" {one.quantity}"
    return f"{one.joint} {one.component}{quantity}".replace("_", " ")


def _cell(one: Change, value: float, sign: str = "") -> dict[str, Any]:
    known = bool(np.isfinite(value))
    return {"value": value if known else 0.0, "text": f"{value:{sign}.{_DIGITS[one.unit]}f}" if known else "–"}


def changes_summary(
    before: str, after: str, found: Sequence[Change], speed: Change | None, gait: Sequence[Change]
) -> dict[str, Any]:
    """Return what `kinertia compare --json` prints of changes."""
    rows = [_summary(one) for one in found]
    return {
        "before": before,
        "after": after,
        "walking_speed": None if speed is None else _summary(speed),
        "spatiotemporal": [_summary(one) for one in gait],
        "outcomes": rows,
    }


def _summary(one: Change) -> dict[str, Any]:
    return {
        **asdict(one),
        "difference": one.difference,
        "verdict": one.verdict,
        "walks_needed": one.walks_needed(RELEVANT[one.unit]),
    }


def curve_figures(curves: Sequence[CurveChange], before: str, after: str) -> list[dict[str, Any]]:
    """Return the figures of each joint for the page: id, title and figure, moments first."""
    result = []
    for quantity, joints in _JOINTS.items():
        for joint in joints:
            own = [one for one in curves if (one.quantity, one.joint) == (quantity, joint)]
            if own:
                title = f"{joint.capitalize()} {quantity}s"
                drawn = joint_figure(own, title, before, after)
                result.append({"id": f"change-{joint}-{quantity}", "title": title, "figure": written(drawn)})
    return result


def joint_figure(curves: Sequence[CurveChange], title: str, before: str, after: str) -> Figure:
    """Draw the curves of one joint, side by side, and their differences below."""
    panels: list[Panel] = []
    for side in ("r", "l", ""):
        own = [one for one in curves if one.side == side]
        panels += [_both(one, before, after) for one in own]
        panels += [_difference(one) for one in own]
    axis: dict[str, Any] = {"range": [0, 100], "tickvals": [0, 20, 40, 60, 80, 100]}
    axis["title"] = {
        "text": " or ".join(dict.fromkeys(_PHASES[one.phase] for one in curves)),
        "font": {"size": 11},
        "standoff": 2,
    }
    alt = f"{title} of {plain(before)} and {plain(after)}, and their difference with its simultaneous 95 % band."
    return small_multiples(panels, alt, axis)


def _both(one: CurveChange, before: str, after: str) -> Panel:
    traces: list[dict[str, Any]] = []
    for name, mean, sd, colour in (
        (before, one.before, one.before_sd, COMPARED[0]),
        (after, one.after, one.after_sd, COMPARED[1]),
    ):
        traces.append(band(mean - INTERVAL_SD * sd, mean + INTERVAL_SD * sd, faded(colour, _OPACITY)))
        traces.append({**mean_line(mean), "name": plain(name), "line": {"color": colour, "width": 2}})
    return Panel(f"{_words(one)} ({one.unit})", traces)


def _difference(one: CurveChange) -> Panel:
    low, high = one.band
    traces: list[dict[str, Any]] = []
    if np.isfinite(one.factor):
        traces.append(band(low, high, faded(GREY, _OPACITY)))
    traces.append({**mean_line(one.difference), "name": "difference", "line": {"color": GREY, "width": 2}})
    return Panel(f"Difference: {_words(one)}", traces, shapes=list(_shown(one)))


def _shown(one: CurveChange) -> Iterator[dict[str, Any]]:
    """Shade where the band leaves out zero."""
    for first, last in runs(one.changed):
        yield shaded(float(first), float(last), faded(GREEN, _SHADE))


def _words(one: CurveChange) -> str:
    side = f"{SIDES[one.side][0]} " if one.side else ""
    during = ", stance" if one.phase == "stance" else ""
    text = f"{side}{one.joint} {one.component}{during}".replace("_", " ")
    return text[0].upper() + text[1:]
