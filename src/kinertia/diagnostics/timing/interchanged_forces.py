"""Do the forces of two trials of a person go with each other's markers?

Walks of one person are alike, so that exchanged force files pass for plates that are off. But the body goes up and
down as its own forces cause: of nine pairs of walks of one person, measured and made, what their own forces leave of
the vertical velocities is 0.6 to 0.8 times what those of the other walk leave.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from kinertia.diagnostics.evidence.caused_velocity import caused_velocities, without_trend
from kinertia.trial.data import Trial

_BETTER, _EACH_BETTER = 0.8, 0.92
"""Of both trials together, and of either (0.51 to 0.88 where they are exchanged). Where one is late and the other
early, either may seem to go with the other's forces, but not both."""


def exchanged_forces(trials: Sequence[Trial], segments: Mapping[str, Sequence[str]]) -> list[str]:
    """One sentence for each two trials of a person whose forces seem to be exchanged.

    Args:
        trials: in axes with Y up.
        segments: labels of the markers on each segment.
    """
    owners = {label: name for name, labels in segments.items() for label in labels}
    sentences = []
    for one, other in combinations(trials, 2):
        own = [_left(one, owners), _left(other, owners)]
        crossed = [_left(replace(a, loads=b.loads), owners) for a, b in ((one, other), (other, one))]
        if np.less(crossed, np.multiply(_EACH_BETTER, own)).all() and sum(crossed) < _BETTER * sum(own):
            shown, rather = (" and ".join(f"{100 * left:.0f} %" for left in each) for each in (own, crossed))
            sentences.append(
                f"the forces of {one.name} and {other.name} seem to be exchanged: pelvis and markers go up and down "
                f"rather as the forces of the other trial make them ({rather} of the velocities are left; by their own "
                f"forces {shown}): give each trial its own force file"
            )
    return sentences


def _left(trial: Trial, owners: Mapping[str, str]) -> float:
    """Share of the vertical velocities of pelvis and markers' centre that the forces leave; NaN where nothing tells."""
    shown, left = [], []
    for part in caused_velocities(trial, owners):
        caused = without_trend(part.time, part.caused)[:, 1]
        for velocity in (part.pelvis, part.centre):
            up = without_trend(part.time, velocity)[:, 1]
            shown.append(np.square(up).sum())
            left.append(np.square(up - caused).sum())
    return float(np.sqrt(sum(left) / sum(shown))) if shown else float("nan")
