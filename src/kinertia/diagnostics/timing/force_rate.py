"""Do forces keep time with the markers? A delay that grows is a wrong rate, where a late clock delays all alike.

The body goes up and down by its markers as the forces cause, but for a factor near one: vertical velocities tell a
delay, and its growth, from the first and the last of a second. Two steps are enough, where single contacts are too few
(`trial.load_times`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.diagnostics.evidence.caused_velocity import CausedVelocity
from kinertia.diagnostics.evidence.ups_and_downs import ups_and_downs_of
from kinertia.trial.data import Trial
from kinertia.trial.sampled_time import span_s

_LEAST_WINDOW_S, _LEAST_GROWTH, _MOST_LEFT = 1.0, 0.0105, 0.22
"""By pelvis or by markers' centre the delay of 21 sound trials grows by -0.017 to 0.013 in windows of 1.03 to 1.3 s
and by up to 0.002 in longer ones, and by both in one direction by at most 0.004."""


def rate_doubts(trial: Trial, parts: Sequence[CausedVelocity]) -> list[str]:
    """Forces that come ever later, or ever earlier, in a measured window.

    Args:
        trial: in ground axes.
        parts: its `caused_velocities`.
    """
    for part in parts:
        if span_s(part.time) < _LEAST_WINDOW_S:
            continue
        found = ups_and_downs_of(part, growing=True)
        if not found or max(one.left for one in found) > _MOST_LEFT:
            continue
        # with another gain under one foot the body seems to be pushed ever earlier, or later, within two steps
        gains = ups_and_downs_of(part, own=part.by(trial.loads.time, trial.loads.force[:, 0, 1]))
        if any(one.left > other.left for one, other in zip(found, gains, strict=False)):
            continue
        delay, growth = np.array([one.delay_s for one in found]), np.array([one.growth for one in found])
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
