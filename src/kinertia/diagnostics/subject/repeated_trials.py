"""Is one recording, or its forces, given for several trials? Counted twice, errors look half as large as they are."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from kinertia.diagnostics.person_context import PersonContext
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.data import Recording

Span = tuple[float, float] | None


def repeated_trials(context: PersonContext) -> Iterator[Finding]:
    """Report S302 and S303: two trials whose markers (S302) or forces (S303) are identical over times that overlap."""
    for first, other in combinations(context.trials, 2):
        if not _overlap(first.window_s, other.window_s):
            continue
        one, two = first.recording, other.recording
        if _same(one.markers.positions, two.markers.positions):
            code = "S302"
        elif _same_forces(one, two) and _overlap(_span(one), _span(two)):
            code = "S303"
        else:
            continue
        yield finding(code, Where(trial=other.name), other_trial=Quantity(first.name))


def _same(one: np.ndarray, two: np.ndarray) -> bool:
    return one.shape == two.shape and bool(np.array_equal(one, two, equal_nan=True))


def _same_forces(first: Recording, other: Recording) -> bool:
    """Return whether both recordings have the same loads; false where they have none."""
    if first.plates is None or other.plates is None or not np.nan_to_num(first.plates.force).any():
        return False
    return _same(first.plates.force, other.plates.force)


def _span(recording: Recording) -> tuple[float, float]:
    """Return first and last time (s) of the markers: pieces of one recording may come with the forces of the whole."""
    return float(recording.markers.time[0]), float(recording.markers.time[-1])


def _overlap(one: Span, two: Span) -> bool:
    return one is None or two is None or (one[0] < two[1] and two[0] < one[1])
