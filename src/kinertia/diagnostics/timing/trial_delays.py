"""Are the forces of all trials of a person equally late? The simultaneous estimate finds each trial's delay; nothing
else does, and whoever is late may have lost more than time.

The body goes up and down by its markers as the forces cause, but for a delay: that of the forces' clock, and some ms
that skin, trunk and arms add, alike whenever somebody moves. Of one person's trials (two walks, squats, parts of walks
and runs) either way to tell it differs by up to 8 ms, but both in one direction by at most 4 ms; even those of eight
people with skin motion of their own differ by at most 10 ms so. Parts of less than a second differ by up to 15 ms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.evidence.caused_velocity import caused_velocities
from kinertia.diagnostics.evidence.ups_and_downs import ups_and_downs_of
from kinertia.trial.data import Trial
from kinertia.trial.sampled_time import span_s

_LEAST_WINDOW_S, _MOST_LEFT = 0.8, 0.22
"""Parts of half a second of one trial differ by up to 40 ms."""
_SHORT_S = 1.0
_APART_S, _SHORT_APART_S = 0.012, 0.018
"""In longer windows, and in shorter ones."""


class TrialDelay(NamedTuple):
    """By how much the forces of a trial are late (s): by the pelvis, and by the centre of all markers; and whether only
    short windows tell.
    """

    name: str
    by_pelvis_s: float
    by_centre_s: float
    short: bool = False

    def shown(self) -> str:
        """The name, and both delays in ms."""
        return f"{self.name} ({1e3 * self.by_pelvis_s:+.0f} and {1e3 * self.by_centre_s:+.0f} ms)"


def trial_delay(trial: Trial, segments: Mapping[str, Sequence[str]]) -> TrialDelay | None:
    """Over all windows that are long enough to tell; None where none is.

    Args:
        trial: in axes with Y up.
        segments: labels of the markers on each segment.
    """
    owners = {label: name for name, labels in segments.items() for label in labels}
    found, spans = [], []
    for part in caused_velocities(trial, owners):
        if span_s(part.time) < _LEAST_WINDOW_S:
            continue
        both = ups_and_downs_of(part)
        if both and max(one.left for one in both) <= _MOST_LEFT:
            found.append([one.delay_s for one in both])
            spans.append(span_s(part.time))
    if not found:
        return None
    pelvis, centre = np.average(found, axis=0, weights=spans)
    return TrialDelay(trial.name, float(pelvis), float(centre), max(spans) < _SHORT_S)


def uneven_delays(trials: Sequence[Trial], segments: Mapping[str, Sequence[str]]) -> list[str]:
    """One sentence for each trial of a person whose forces are late by another time than those of the others."""
    if len(trials) < 2:
        return []
    return [sentence for _, sentence in trial_delays_doubts([trial_delay(trial, segments) for trial in trials])]


def trial_delays_doubts(delays: Sequence[TrialDelay | None]) -> list[tuple[str, str]]:
    """Trials whose forces are late by another time than those of the others: the later of two, or each that is apart
    from the middle of three and more; with a sentence.
    """
    known = sorted((one for one in delays if one is not None), key=lambda one: one.by_pelvis_s + one.by_centre_s)
    if len(known) < 2:
        return []
    values = np.array([[one.by_pelvis_s, one.by_centre_s] for one in known])
    limit_s = _SHORT_APART_S if any(one.short for one in known) else _APART_S
    if len(known) == 2:
        usual, apart, against = values[0], [1], f"than those of {known[0].shown()}"
    else:
        usual, apart = np.median(values, axis=0), list(range(len(known)))
        against = f"than those of the other trials (medians {1e3 * usual[0]:+.0f} and {1e3 * usual[1]:+.0f} ms)"
    late_s = values - usual
    return [
        (known[k].name, _sentence(known[k], float(late_s[k].mean()), against))
        for k in apart
        if np.abs(late_s[k]).min() > limit_s and late_s[k].prod() > 0
    ]


def _sentence(one: TrialDelay, late_s: float, against: str) -> str:
    word = "later" if late_s > 0 else "earlier"
    return (
        f"the forces of {one.shown()} come {1e3 * abs(late_s):.0f} ms {word} {against}, by when "
        "the pelvis and the middle of all markers go up and down (4 ms are usual): in one of the trials "
        "cameras and plates did not start together, or one was filtered with a delay; the simultaneous estimate finds "
        "the delay of each trial and puts it right, nothing else does: correct the start of the forces that are late "
        "or early"
    )
