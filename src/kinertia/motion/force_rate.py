"""Do forces keep time with the markers? A delay that grows is a wrong rate, where a late clock delays all alike.

The body goes up and down by its markers as the forces cause, but for a factor near one: vertical velocities tell a
delay, and its growth, from the first and the last of a second. Two steps are enough, where single contacts are too few
(`trial.load_times`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinertia.motion.caused_velocity import CausedVelocity, caused_velocities
from kinertia.trial.data import FloatArray, Trial

_LEAST_WINDOW_S, _LEAST_GROWTH, _CLEAR, _STEPS = 1.0, 0.0105, 0.95, 5
"""By pelvis or by markers' centre the delay of 21 sound trials grows by -0.017 to 0.013 in windows of 1.03 to 1.3 s
and by up to 0.002 in longer ones, and by both in one direction by at most 0.004."""


def rate_doubts(trial: Trial, owners: Mapping[str, str]) -> list[str]:
    """Forces that come ever later, or ever earlier, in a measured window.

    Args:
        trial: in ground axes.
        owners: the segment that each marker is on.
    """
    for part in caused_velocities(trial, owners):
        if np.ptp(part.time) < _LEAST_WINDOW_S:
            continue
        found = [_delay(part, shown) for shown in (part.pelvis, part.centre)]
        if any(one is None for one in found):
            continue
        delay, growth = (np.array([one[k] for one in found if one is not None]) for k in range(2))
        if np.abs(growth).min() < _LEAST_GROWTH or abs(np.sign(growth).sum()) < len(growth):
            continue
        mean = float(growth.mean())
        begin, end = (float(delay.mean()) + mean * half * np.ptp(part.time) / 2 for half in (-1, 1))
        return [
            f"markers and forces do not run at the same speed, by a factor of about {1 / (1 - mean):.2f}: the body "
            f"goes up and down {1e3 * begin:+.0f} ms later by the forces than by the markers at {part.time[0]:.2f} s, "
            f"and {1e3 * end:+.0f} ms later at {part.time[-1]:.2f} s, where a late clock would delay both alike; "
            "correct the frame rate of one of the files"
        ]
    return []


def _delay(part: CausedVelocity, shown: FloatArray) -> tuple[float, float] | None:
    """Delay (s) of the forces in the middle, and its growth (s/s), by these velocities (n, 3); None where they do not
    follow the forces.

    Of shown(t) = factor * caused(t + delay + growth * t), up to a wrong zero and a level, by Gauss-Newton.
    """
    after = part.time - part.time.mean()
    caused, accelerated = part.caused[:, 1], np.gradient(part.caused[:, 1], part.time)
    delay = growth = 0.0
    for _ in range(_STEPS):
        at = part.time + delay + growth * after
        inside = (at >= part.time[0]) & (at <= part.time[-1])
        if inside.sum() < len(at) / 2:
            return None
        pushed = np.interp(at[inside], part.time, accelerated)
        moved, since = np.interp(at[inside], part.time, caused), after[inside]
        terms = np.stack([moved, pushed, since * pushed, np.ones_like(since), since], axis=1)
        wanted = shown[inside, 1]
        solution = np.linalg.lstsq(terms, wanted, rcond=None)[0]
        if solution[0] <= 0.0:
            return None
        delay, growth = delay + float(solution[1] / solution[0]), growth + float(solution[2] / solution[0])
    left = wanted - terms @ solution
    return (delay, growth) if left.var() <= (1 - _CLEAR) * wanted.var() else None
