"""Data that no reader of files lets through, and that come from arrays of one's own: times that are no clock's, numbers
that are none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where

_UNEVEN = 0.5
"""Of a usual step between frames, by which others may differ: clocks of cameras jitter."""


def impossible_markers(time: np.ndarray, labels: Sequence[str], positions: np.ndarray) -> Finding | None:
    """What is impossible in the times (n,) and positions (n, m, 3) of markers; None if nothing is."""
    if wrong := _not_growing(time):
        return wrong
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if len(steps) and (away := np.abs(steps - usual)).max() > _UNEVEN * usual:
        k = int(np.argmax(away))
        return with_evidence("T101", Where(), step_evidence(time[k], time[k + 1], usual))
    infinite = np.argwhere(np.isinf(positions))
    if len(infinite):
        frame, marker, axis = infinite[0]
        return impossible_position(labels[marker], float(positions[frame, marker, axis]), float(time[frame]))
    return None


def impossible_plates(
    time: np.ndarray, names: Sequence[str], feet: Sequence[str | None], wrench: np.ndarray
) -> Finding | None:
    """The same of the times (k,), the declared feet (p,) and the forces and moments (k, p, 6) of plates."""
    if wrong := _not_growing(time):
        return wrong
    if len(set(names)) != len(names):
        problem = Quantity("each needs a name of its own")
        return finding("F173", names=Quantity(", ".join(names)), problem=problem)
    if odd := [(name, foot) for name, foot in zip(names, feet, strict=True) if foot not in ("r", "l", None)]:
        name, foot = odd[0]
        return finding(
            "F173",
            Where(plate=name),
            names=Quantity(name),
            problem=Quantity(f"declared_feet has {foot!r} in place of 'r', 'l' or None"),
        )
    lost = np.argwhere(~np.isfinite(wrench))
    if len(lost):
        sample, plate, _ = lost[0]
        return impossible_load(names[plate], "force or moment", float(time[sample]))
    return None


def impossible_position(label: str, position_m: float, time_s: float, limit_m: float | None = None) -> Finding:
    """That a marker is somewhere where no laboratory is."""
    where = Where(markers=(label,), span_s=(time_s, time_s))
    position = Quantity(position_m, "m", limit=limit_m)
    return with_evidence("F171", where, {"position_m": position, **_at(time_s)})


def impossible_load(plate: str, what: str, time_s: float, **size: Quantity) -> Finding:
    """That a force or moment of a plate is no number, or of a size that no plate measures."""
    found = Quantity("no number" if not size else "more than any plate measures")
    where = Where(plate=plate, span_s=(time_s, time_s))
    return with_evidence("F172", where, {**size, **_at(time_s), "what": Quantity(what), "found": found})


def _at(time_s: float) -> dict[str, Quantity]:
    """A time as a number, and so exactly that its row is found."""
    return {"time_s": Quantity(time_s, "s"), "time": Quantity(f"{time_s:.6g} s")}


def step_evidence(before: float, after: float, usual: float) -> dict[str, Quantity]:
    """Evidence of T101: the step between two times and the usual one, s, and the times so that their rows are found."""
    steps = {"step_s": after - before, "usual_s": usual, "time_s": before}
    known = {name: Quantity(float(value), "s") for name, value in steps.items() if np.isfinite(value)}
    times = {"before": before, "after": after, "usual": usual}
    return known | {
        name: Quantity(f"{value:.6g} s" if np.isfinite(value) else "no number") for name, value in times.items()
    }


def _not_growing(time: np.ndarray) -> Finding | None:
    """The first time that is no number, or not later than the one before."""
    steps = np.diff(time)
    odd = np.flatnonzero(~(steps > 0.0))
    if odd.size:
        known = steps[np.isfinite(steps)]
        usual = float(np.median(known)) if known.size else float("nan")
        return with_evidence("T101", Where(), step_evidence(time[odd[0]], time[odd[0] + 1], usual))
    if not np.isfinite(time).all():
        return with_evidence("T101", Where(), step_evidence(time[0], time[-1], float("nan")))
    return None
