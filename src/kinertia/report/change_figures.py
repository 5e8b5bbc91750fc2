"""Draws curves of two conditions with their bands, and the difference with its simultaneous band below."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from kinertia.estimation.curve_changes import CurveChange
from kinertia.report import style
from kinertia.report.cycle_figures import band, mean_line
from kinertia.report.figure import Figure, written
from kinertia.report.panels import Panel, plain, shaded, small_multiples
from kinertia.report.wording import INTERVAL_SD
from kinertia.trial.sampled_time import runs

_JOINTS = {
    "moment": ("knee", "hip", "ankle", "lumbar"),
    "angle": ("knee", "hip", "ankle", "subtalar", "pelvis", "lumbar"),
}
_OPACITY, _SHADE = 0.2, 0.12
_PHASES = {"stride": "% of the gait cycle", "stance": "% of stance"}


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
        (before, one.before, one.before_sd, style.COMPARED[0]),
        (after, one.after, one.after_sd, style.COMPARED[1]),
    ):
        traces.append(band(mean - INTERVAL_SD * sd, mean + INTERVAL_SD * sd, style.faded(colour, _OPACITY)))
        traces.append({**mean_line(mean), "name": plain(name), "line": {"color": colour, "width": 2}})
    return Panel(f"{_words(one)} ({one.unit})", traces)


def _difference(one: CurveChange) -> Panel:
    low, high = one.band
    traces: list[dict[str, Any]] = []
    if np.isfinite(one.factor):
        traces.append(band(low, high, style.faded(style.GREY, _OPACITY)))
    traces.append({**mean_line(one.difference), "name": "difference", "line": {"color": style.GREY, "width": 2}})
    return Panel(f"Difference: {_words(one)}", traces, shapes=list(_shown(one)))


def _shown(one: CurveChange) -> Iterator[dict[str, Any]]:
    """Shade where the band leaves out zero."""
    for first, last in runs(one.changed):
        yield shaded(float(first), float(last), style.faded(style.GREEN, _SHADE))


def _words(one: CurveChange) -> str:
    side = f"{style.SIDES[one.side][0]} " if one.side else ""
    during = ", stance" if one.phase == "stance" else ""
    text = f"{side}{one.joint} {one.component}{during}".replace("_", " ")
    return text[0].upper() + text[1:]
