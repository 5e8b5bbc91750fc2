"""Data that no reader of files lets through, and that come from arrays of one's own: times that are no clock's, numbers
that are none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_UNEVEN = 0.5
"""Of a usual step between frames, by which others may differ: clocks of cameras jitter."""


def marker_trouble(time: np.ndarray, labels: Sequence[str], positions: np.ndarray) -> str:
    """What is impossible in the times (n,) and places (n, m, 3) of markers, as part of a sentence; empty if nothing."""
    if trouble := _clock_trouble("markers", time):
        return trouble
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if len(steps) and (away := np.abs(steps - usual)).max() > _UNEVEN * usual:
        k = int(np.argmax(away))
        return (
            f"the step to the next frame is {steps[k]:.4g} s at {time[k]:.4f} s, of most others {usual:.4g} s; frames "
            "must follow one another evenly: where one is missing, have it, with NaN for its markers"
        )
    infinite = np.argwhere(np.isinf(positions))
    if len(infinite):
        frame, marker, _ = infinite[0]
        where = f"{labels[marker]} at {time[frame]:.3f} s"
        return f"the place of {where} is infinite; a marker that was not seen has NaN"
    return ""


def plate_trouble(time: np.ndarray, names: Sequence[str], feet: Sequence[str | None], wrench: np.ndarray) -> str:
    """The same of the times (k,), the declared feet (p,) and the forces and moments (k, p, 6) of plates."""
    if trouble := _clock_trouble("plates", time):
        return trouble
    if len(set(names)) != len(names):
        return f"two plates have one name ({', '.join(names)}) and would be taken for one; give each a name of its own"
    if odd := [foot for foot in feet if foot not in ("r", "l", None)]:
        return f"declared_feet has {odd[0]!r}; give 'r', 'l' or None for each plate"
    lost = np.argwhere(~np.isfinite(wrench))
    if len(lost):
        sample, plate, _ = lost[0]
        where = f"{names[plate]} at {time[sample]:.4f} s"
        return f"force or moment of {where} is not a number; have zeros where nobody stands, and cut what is lost"
    return ""


def _clock_trouble(whose: str, time: np.ndarray) -> str:
    if np.isfinite(time).all() and (np.diff(time) > 0.0).all():
        return ""
    return f"the times of the {whose} must be numbers, each later than the one before"
