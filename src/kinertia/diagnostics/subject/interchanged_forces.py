"""Do the forces of two trials of a person belong to each other's markers?

Walks of one person are so similar that interchanged force files look like displaced plates. But the vertical velocity
follows its own forces: in nine pairs of walks of one person, measured and synthetic, the residual with their own forces
is 0.6 to 0.8 times the residual with the forces of the other walk.

Both are compared over the same time, since residuals of short windows are smaller. Where two trials are parts of one
recording, they are compared where they overlap, and there the forces are the same.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.horizontal_velocity import (
    LEAST_WINDOW_S,
    ForceVelocity,
    force_velocities,
    without_trend,
)
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.sampled_data import span_s

_BETTER, _EACH_BETTER = 0.8, 0.92
"""Of both trials together, and of either (0.51 to 0.88 where they are interchanged). Where one is late and the other
early, either may seem to go with the other's forces, but not both."""


@check("S304")
def interchanged_forces(person: PersonContext) -> Iterator[Finding]:
    """Report S304: two trials whose forces seem to be interchanged, one finding for each."""
    loaded = [one for one in person.trials if one.trial is not None]
    for pair in combinations(loaded, 2):
        with_others = [_with_forces_of(a, b) for a, b in (pair, pair[::-1])]
        kept = [_residual(_over(other, one.velocities)) for one, other in zip(pair, with_others, strict=True)]
        crossed = [_residual(_over(one.velocities, other)) for one, other in zip(pair, with_others, strict=True)]
        if np.less(crossed, np.multiply(_EACH_BETTER, kept)).all() and sum(crossed) < _BETTER * sum(kept):
            for k, one in enumerate(pair):
                yield finding(
                    "S304",
                    Where(trial=one.name),
                    left_own=Quantity(kept[k], "1"),
                    left_crossed=Quantity(crossed[k], "1", limit=_EACH_BETTER * kept[k]),
                    other_trial=Quantity(pair[1 - k].name),
                )


def _with_forces_of(one: RecordingContext, other: RecordingContext) -> list[ForceVelocity]:
    assert one.trial is not None
    assert other.trial is not None
    return force_velocities(replace(one.trial, loads=other.trial.loads), one.segment_of_label)


def _over(windows: Sequence[ForceVelocity], parts: Sequence[ForceVelocity]) -> Sequence[ForceVelocity]:
    """Return the parts where they overlap these windows; whole where none does for long enough."""
    cut = [part.cut(window.time[0], window.time[-1]) for part in parts for window in windows]
    return [part for part in cut if len(part.time) > 1 and span_s(part.time) >= LEAST_WINDOW_S] or parts


def _residual(parts: Sequence[ForceVelocity]) -> float:
    """Return the share of the vertical velocities of pelvis and markers that forces do not explain; NaN if unknown."""
    shown, left = [], []
    for part in parts:
        by_forces = without_trend(part.time, part.by_forces)[:, 1]
        for velocity in (part.pelvis, part.centre):
            up = without_trend(part.time, velocity)[:, 1]
            shown.append(np.square(up).sum())
            left.append(np.square(up - by_forces).sum())
    return float(np.sqrt(sum(left) / sum(shown))) if shown else float("nan")
