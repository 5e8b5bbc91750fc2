"""Shows what changed between two conditions: words, tables, and curves with their bands."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from kinertia.estimation.changes.change import MOST_WALKS, NOTABLE, PRIMARY, SOURCES, Change, GroupChange, Names
from kinertia.estimation.changes.curve_changes import CurveChange
from kinertia.report.figures.coordinate_titles import OutcomeSigns
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
from kinertia.trial.data import FEET
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
_MOST_NAMED = 4
"""Other outcomes that are named in a sentence."""
_PHASES = {"stride": "% of the gait cycle", "stance": "% of stance"}


@dataclass(frozen=True)
class _ShownChange(Change):
    """A change with the sign, and the positive direction in words, that sentences and pages have."""

    words: str = ""


@dataclass(frozen=True, eq=False)
class _ShownCurve(CurveChange):
    """A change of a curve with the sign, and the positive direction in words, that pages have."""

    words: str = ""


def shown_changes(found: Sequence[Change], signs: OutcomeSigns) -> list[Change]:
    """Return changes with the signs of sentences and pages."""
    return [_ShownChange(**_signed(change, signs)) for change in found]


def shown_curves(found: Sequence[CurveChange], signs: OutcomeSigns) -> list[CurveChange]:
    """Return curves with the signs of pages."""
    return [_ShownCurve(**_signed(curve, signs)) for curve in found]


def _signed(outcome: Change | CurveChange, signs: OutcomeSigns) -> dict[str, Any]:
    words, sign = signs.get((outcome.quantity, outcome.joint, outcome.component, outcome.side), ("", 1.0))
    return {**vars(outcome), "before": sign * outcome.before, "after": sign * outcome.after, "words": words}


def change_sentences(found: Sequence[Change]) -> Iterator[str]:
    """Yield a sentence for each outcome that was named beforehand, as a report may state it."""
    for wanted in PRIMARY:
        for change in found:
            if (change.quantity, change.joint, change.component, change.event) == wanted:
                external = outcome_words(change).startswith("external ")
                internal = "internal, " if change.quantity == "moment" and not external else ""
                yield f"{_with_side(change)} ({internal}{change.event}) {_judgement(change)}."


def lacking_sentence(found: Sequence[Change]) -> str:
    """State which outcomes that were named beforehand are not compared on one side; empty if all are, or none."""
    known = {(change.side, change.quantity, change.joint, change.component, change.event) for change in found}
    legs = []
    for side in FEET:
        events: dict[str, list[str]] = {}
        for wanted in PRIMARY:
            if (side, *wanted) not in known:
                events.setdefault(f"{wanted[1]} {wanted[2]}", []).append(wanted[3])
        named = [f"{name} ({', '.join(some)})" for name, some in events.items()]
        legs += [f"{SIDES[side][0]} {' and '.join(named)}"] if named else []
    if not legs:
        return ""
    return f"Not compared, since one condition lacks the event or the moment: {'; '.join(legs)}."


def speed_sentence(speed: Change | None) -> str:
    """State whether walking speed changed, and that moments change with it where it did, or may have."""
    if speed is None:
        return "Walking speed is not known; if it changed, moments did, too."
    sentence = f"Walking speed {_judgement(speed)}."
    if speed.verdict == "changed" or abs(speed.difference) > NOTABLE * speed.before:
        sentence += " Moments change with speed: the speed may explain what changed below."
    return sentence


def _judgement(change: Change) -> str:
    """State what became of an outcome, as the predicate of a sentence that a clinician may copy."""
    digits = _DIGITS[change.unit]
    pair = f"from {change.before:.{digits}f} to {change.after:.{digits}f} {change.unit}"
    if change.doubt and np.isnan(change.sd) and not change.doubt.endswith("."):
        return f"went {pair}; whether that is a change cannot be judged, since {change.doubt}"
    if change.doubt:
        codes = ", ".join(re.findall(r"\b[A-Z]\d{3}(?=:)", change.doubt))
        reason = f"due to {codes}, stated below" if codes else "since it is not certain that both are one person"
        return f"went {pair}; whether that is a change cannot be judged, {reason}"
    if change.verdict == "cannot be judged":
        return f"went {pair}; {change.strides[0]} and {change.strides[1]} repeats cannot show whether that is a change"
    if change.verdict == "changed":
        return f"changed {pair} ({change.difference:+.{digits}f}, SD {change.sd:.{digits}f})"
    return f"went {pair}; no change is shown, and one below {change.mdc95:.{digits}f} {change.unit} would be missed"


def changed_sentence(found: Sequence[Change]) -> str:
    """State how many of the other outcomes changed; by chance some do."""
    others = [change for change in found if not change.primary and change.verdict != "cannot be judged"]
    if not others:
        return "Nothing else can be judged."
    count = sum(change.verdict == "changed" for change in others)
    kept = discoveries(found)
    remaining = sorted((change for change in others if kept.get(change.names)), key=lambda change: change.p)
    named = [f"{_with_side(change).lower()} ({change.event})" for change in remaining[:_MOST_NAMED]]
    names = f": {', '.join(named)}{', ...' if remaining[_MOST_NAMED:] else ''}" if named else ""
    return (
        f"Of {len(others)} other moments and angles {count} changed; without any change about {0.05 * len(others):.0f} "
        f"would seem to. At a false discovery rate of 5 %, {len(remaining)} remain{names}."
    )


def discoveries(found: Sequence[Change]) -> dict[Names, bool]:
    """Decide of each outcome that can be judged, and was not named beforehand, whether it remains (`discovered`)."""
    others = [change for change in found if not change.primary and np.isfinite(change.p) and not change.doubt]
    remain = discovered([change.p for change in others])
    return {change.names: remains for change, remains in zip(others, remain, strict=True)}


def _with_side(change: Change) -> str:
    side = f"{SIDES[change.side][0]} " if change.side else ""
    text = f"{side}{outcome_words(change)}"
    return text[0].upper() + text[1:]


def limit_sentences(found: Sequence[Change], doubt: str) -> Iterator[str]:
    """State what was assumed, and what cannot be judged."""
    if doubt:
        yield f"Changes of moments of the legs concerned cannot be judged: {doubt}"
    few = sorted({min(change.strides) for change in found if change.assumed})
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
    remaining = discoveries([change for change in found if change.quantity != "gait"])
    return {
        **{name: [getattr(change, name) for change in found] for name in names},
        **{f"sd_{source}": [change.sd_by_source[source] for change in found] for source in SOURCES},
        "sd_between_strides_before": [change.stride_sd[0] for change in found],
        "sd_between_strides_after": [change.stride_sd[1] for change in found],
        "spread_assumed": [change.assumed for change in found],
        "walks_needed": [change.walks_needed(RELEVANT[change.unit]) for change in found],
        "mdc95": [change.mdc95 for change in found],
        "p": [change.p for change in found],
        "discovered": [remaining.get(change.names) for change in found],
        "strides_before": [change.strides[0] for change in found],
        "strides_after": [change.strides[1] for change in found],
        "verdict": [change.verdict for change in found],
    }


def person_columns(person: str, found: Sequence[Change]) -> dict[str, list[Any]]:
    """Return the columns of a cohort's `changes.csv`: the rows of one person, with what keeps one from being judged."""
    return {
        "person": [person] * len(found),
        **change_columns(found),
        "remarks": [change.doubt for change in found],
    }


def curve_columns(found: Sequence[CurveChange]) -> dict[str, list[Any]]:
    """Return the columns of `change_curves.csv`: a row per curve and percent, with the simultaneous band."""
    rows = [(curve, k) for curve in found for k in range(len(curve.before))]
    bands = {id(curve): curve.band for curve in found}
    names = ("quantity", "joint", "component", "side", "phase", "unit")
    curves = ("before", "after", "before_sd", "after_sd", "difference", "sd")
    return {
        **{name: [getattr(curve, name) for curve, _ in rows] for name in names},
        "percent": [k for _, k in rows],
        **{
            name: np.concatenate([getattr(curve, name) for curve in found]).tolist() if found else [] for name in curves
        },
        **{end: [float(bands[id(curve)][j][k]) for curve, k in rows] for j, end in enumerate(("lower", "upper"))},
    }


def change_rows(found: Sequence[Change]) -> list[dict[str, Any]]:
    """Return the rows of the page's table: numbers with their text, primary outcomes first."""
    order = sorted(found, key=lambda change: (not change.primary, change.quantity != "moment"))
    return [
        {
            "outcome": outcome_words(change),
            "side": SIDES[change.side][0] if change.side else "",
            "event": change.event,
            "unit": change.unit,
            "verdict": change.verdict,
            "primary": change.primary,
            "needed": _needed(change),
            "cells": [_cell(change, value) for value in (change.before, change.after)]
            + [_cell(change, change.difference, "+")]
            + [
                _cell(change, value)
                for value in (change.mdc95, change.sd, *(change.sd_by_source[source] for source in SOURCES))
            ],
        }
        for change in order
    ]


def group_columns(found: Sequence[GroupChange]) -> dict[str, list[Any]]:
    """Return the columns of `change_means.csv`: a row per outcome."""
    return {column.name: [getattr(change, column.name) for change in found] for column in fields(GroupChange)}


def group_rows(found: Sequence[GroupChange]) -> list[tuple[str, ...]]:
    """Return rows of text: speed, steps and the primary outcomes."""
    chosen = [change for change in found if change.quantity == "gait" or change.primary]
    return [_group_row(change) for change in chosen]


def _group_row(change: GroupChange) -> tuple[str, ...]:
    side = f"{SIDES[change.side][0]} " if change.side else ""
    event = f", {change.event}" if change.event else ""
    digits = _DIGITS[change.unit]
    known = change.people > 1
    return (
        f"{side}{outcome_words(change)}{event}",
        change.unit,
        str(change.people),
        f"{change.before:.{digits}f}",
        f"{change.after:.{digits}f}",
        f"{change.difference:+.{digits}f}",
        f"{change.lower:+.{digits}f} to {change.upper:+.{digits}f}" if known else "",
        f"{change.sd:.{digits}f}" if known else "",
        str(change.changed),
    )


def outcome_words(outcome: Change | CurveChange | GroupChange) -> str:
    """Return what a change is of: "knee adduction moment", "walking speed"."""
    quantity = "" if outcome.quantity == "gait" else f" {outcome.quantity}"
    if words := getattr(outcome, "words", ""):
        name, comma, direction = words.partition(", ")
        return f"{name}{quantity}{comma}{direction}"
    return f"{outcome.joint} {outcome.component}{quantity}".replace("_", " ")


def _needed(change: Change) -> int | str:
    if not np.isfinite(change.stride_sd).all():
        return "–"
    return change.walks_needed(RELEVANT[change.unit]) or f"over {MOST_WALKS}"


def _cell(change: Change, value: float, sign: str = "") -> dict[str, Any]:
    known = bool(np.isfinite(value))
    return {"value": value if known else 0.0, "text": f"{value:{sign}.{_DIGITS[change.unit]}f}" if known else "–"}


def changes_summary(
    before: str, after: str, found: Sequence[Change], speed: Change | None, gait: Sequence[Change]
) -> dict[str, Any]:
    """Return what `kinertia compare --json` prints of changes."""
    remaining = discoveries(found)
    rows = [{**_summary(change), "discovered": remaining.get(change.names)} for change in found]
    return {
        "before": before,
        "after": after,
        "walking_speed": None if speed is None else _summary(speed),
        "spatiotemporal": [_summary(change) for change in gait],
        "outcomes": rows,
    }


def _summary(change: Change) -> dict[str, Any]:
    return {
        **asdict(change),
        "difference": change.difference,
        "verdict": change.verdict,
        "walks_needed": change.walks_needed(RELEVANT[change.unit]),
    }


def curve_figures(curves: Sequence[CurveChange], before: str, after: str) -> list[dict[str, Any]]:
    """Return the figures of each joint for the page: id, title and figure, moments first."""
    result = []
    for quantity, joints in _JOINTS.items():
        for joint in joints:
            chosen = [curve for curve in curves if (curve.quantity, curve.joint) == (quantity, joint)]
            if chosen:
                title = f"{joint.capitalize()} {quantity}s"
                drawn = written(joint_figure(chosen, title, before, after))
                changed = any(curve.changed.any() for curve in chosen)
                id_ = f"change-{joint}-{quantity}"
                result.append({"id": id_, "title": title, "figure": drawn, "changed": changed})
    return result


def joint_figure(curves: Sequence[CurveChange], title: str, before: str, after: str) -> Figure:
    """Draw the curves of one joint, side by side, and their differences below."""
    panels: list[Panel] = []
    mixed = len({curve.phase for curve in curves}) > 1
    for side in ("r", "l", ""):
        of_side = [curve for curve in curves if curve.side == side]
        panels += [_both(curve, before, after, mixed) for curve in of_side]
        panels += [_difference(curve, mixed) for curve in of_side]
    axis: dict[str, Any] = {"range": [0, 100], "tickvals": [0, 20, 40, 60, 80, 100]}
    axis["title"] = {
        "text": " or ".join(dict.fromkeys(_PHASES[curve.phase] for curve in curves)),
        "font": {"size": 11},
        "standoff": 2,
    }
    alt = f"{title} of {plain(before)} and {plain(after)}, and their difference with its simultaneous 95 % band."
    return small_multiples(panels, alt, axis)


def _both(curve: CurveChange, before: str, after: str, mixed: bool) -> Panel:
    traces: list[dict[str, Any]] = []
    for name, mean, sd, colour in (
        (before, curve.before, curve.before_sd, COMPARED[0]),
        (after, curve.after, curve.after_sd, COMPARED[1]),
    ):
        traces.append(band(mean - INTERVAL_SD * sd, mean + INTERVAL_SD * sd, faded(colour, _OPACITY)))
        traces.append({**mean_line(mean), "name": plain(name), "line": {"color": colour, "width": 2}})
    return Panel(f"{_words(curve, mixed)} ({curve.unit})", traces)


def _difference(curve: CurveChange, mixed: bool) -> Panel:
    low, high = curve.band
    traces: list[dict[str, Any]] = []
    if np.isfinite(curve.factor):
        traces.append(band(low, high, faded(GREY, _OPACITY)))
    traces.append({**mean_line(curve.difference), "name": "difference", "line": {"color": GREY, "width": 2}})
    return Panel(f"Difference: {_words(curve, mixed)}", traces, shapes=list(_shown(curve)))


def _shown(curve: CurveChange) -> Iterator[dict[str, Any]]:
    """Shade where the band leaves out zero."""
    for first, last in runs(curve.changed):
        yield shaded(float(first), float(last), faded(GREEN, _SHADE))


def _words(curve: CurveChange, mixed: bool) -> str:
    side = f"{SIDES[curve.side][0]} " if curve.side else ""
    during = ", stance" if mixed and curve.phase == "stance" else ""
    words = getattr(curve, "words", "").replace("external rotation", "ext. rotation")
    words = words.replace("internal rotation", "int. rotation")
    text = f"{side}{f'{words} +' if words else f'{curve.joint} {curve.component}'}{during}".replace("_", " ")
    return text[0].upper() + text[1:]
