"""Rejects impossible data, such as times that do not increase or values that are not numbers.

No file reader lets them through; they come from arrays that a user passes.
"""

from collections.abc import Sequence

import numpy as np

from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where

_UNEVEN = 0.5
"""Share of a usual step between frames by which other steps may differ: camera clocks jitter."""


def impossible_markers(time: np.ndarray, labels: Sequence[str], positions: np.ndarray) -> Finding | None:
    """Return the finding for impossible times (n,) or positions (n, m, 3) m of markers; None if there is none."""
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
    """Return the finding for impossible times (k,), declared feet (p,) or wrenches (k, p, 6) of plates, or None."""
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
    """Make the finding that a marker is outside any laboratory (F171)."""
    where = Where(markers=(label,), span_s=(time_s, time_s))
    position = Quantity(position_m, "m", limit=limit_m)
    return with_evidence("F171", where, {"position_m": position, **_at(time_s)})


def impossible_load(plate: str, what: str, time_s: float, **size: Quantity) -> Finding:
    """Make the finding that a force or moment of a plate is not a number, or larger than any plate measures (F172)."""
    found = Quantity("no number" if not size else "more than any plate measures")
    where = Where(plate=plate, span_s=(time_s, time_s))
    return with_evidence("F172", where, {**size, **_at(time_s), "what": Quantity(what), "found": found})


def _at(time_s: float) -> dict[str, Quantity]:
    """Return a time as evidence: as a number, and as text precise enough to find its row."""
    return {"time_s": Quantity(time_s, "s"), "time": Quantity(f"{time_s:.6g} s")}


def step_evidence(before: float, after: float, usual: float) -> dict[str, Quantity]:
    """Return evidence of T101: a step between two times and the usual one (s), and the times to find their rows by."""
    steps = {"step_s": after - before, "usual_s": usual, "time_s": before}
    known = {name: Quantity(float(value), "s") for name, value in steps.items() if np.isfinite(value)}
    times = {"before": before, "after": after, "usual": usual}
    return known | {
        name: Quantity(f"{value:.6g} s" if np.isfinite(value) else "no number") for name, value in times.items()
    }


def _not_growing(time: np.ndarray) -> Finding | None:
    """Return the finding for the first time that is not a number or not later than the one before, or None."""
    steps = np.diff(time)
    odd = np.flatnonzero(~(steps > 0.0))
    if odd.size:
        known = steps[np.isfinite(steps)]
        usual = float(np.median(known)) if known.size else float("nan")
        return with_evidence("T101", Where(), step_evidence(time[odd[0]], time[odd[0] + 1], usual))
    if not np.isfinite(time).all():
        return with_evidence("T101", Where(), step_evidence(time[0], time[-1], float("nan")))
    return None
