"""T21, are the forces of one plate late against those of the others? By the body's vertical velocity.

Plates of two makers reach a recorder on ways of their own. A late plate takes the body's weight over too late and keeps
it too long, so that the sum of all forces lacks weight at one step and has too much at the next. On 22 fault-free walks
and runs plates differ by up to 5 ms, and by 10 and 13 ms where this explains next to nothing; one plate that is 20 or
30 ms late shows 15 to 40 ms in all but two of 27. A foot over the edge of a plate looks late or early, too, but at one
end of its step only: what is late begins and ends late.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.horizontal_velocity import CausedVelocity, without_trend
from kinertia.findings.finding import Finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import FloatArray, PlateLoads
from kinertia.trial.sampled_time import span_s

_LEAST_WINDOW_S = 0.6
_DIFFERENCE_S, _USUAL_S = 0.012, 0.005
_EXPLAINS, _CLEARLY_BEST = 0.65, 0.85
"""Shares of the residual with one delay for all plates, and of that with a gain error of each plate, that may be left.
On fault-free recordings 0.70 of the former and more are."""
_BOTH_ENDS, _UNEQUAL_S = 0.4, 0.02
"""A late plate begins and ends by at least this share of the difference late, and the other one alike within this: all
late plates that pass the rest, on nine walks, and none of those with feet 10 to 30 mm over an edge, made up."""


def plate_delay(context: RecordingContext) -> Iterator[Finding]:
    """T216: each plate with a delay of its own explains the vertical velocity, and neither one for all nor gains do."""
    plates, parts = context.plates, [one for one in context.velocities if span_s(one.time) >= _LEAST_WINDOW_S]
    if plates is None or not parts or not context.has_strides:
        return
    used = [p for p in range(len(plates.names)) if plates.force[:, p, 1].max() > FIRM_LOAD_N]
    if len(used) < 2:
        return
    off = _joined(parts, [(one.pelvis + one.centre)[:, 1] / 2 - one.caused[:, 1] for one in parts])
    pushed, caused = (np.stack([_of_plate(parts, plates, p, each) for p in used], axis=1) for each in (False, True))
    delays_s, own = _fitted(pushed, off)
    _, together = _fitted(pushed.sum(axis=1, keepdims=True), off)
    _, gains = _fitted(caused, off)
    late, early = int(np.argmax(delays_s)), int(np.argmin(delays_s))
    difference_s = float(delays_s[late] - delays_s[early])
    if difference_s <= _DIFFERENCE_S or own > _EXPLAINS * together or own > _CLEARLY_BEST * gains:
        return
    names = {plates.names[used[p]] for p in (late, early)}
    if names & set(context.plates_reached_beyond) or not _at_both_ends(parts, plates, used, off, (late, early)):
        return
    yield with_evidence(
        "T216",
        context.at(),
        {
            "plate": Quantity(plates.names[used[late]]),
            "difference_s": Quantity(difference_s, "s", limit=_DIFFERENCE_S, usual=(-_USUAL_S, _USUAL_S)),
            "other": Quantity(plates.names[used[early]]),
            "velocity_residual_m_s": Quantity((together, own), "m/s", limit=_EXPLAINS * together),
        },
    )


def _at_both_ends(
    parts: Sequence[CausedVelocity],
    plates: PlateLoads,
    used: Sequence[int],
    off: FloatArray,
    late_and_early: tuple[int, int],
) -> bool:
    """Return whether growing and falling forces of the late plate are both late, and those of the early one alike."""
    terms = []
    for p in used:
        change = np.diff(plates.force[:, p, 1], prepend=plates.force[0, p, 1])
        for part in (np.maximum(change, 0.0), np.minimum(change, 0.0)):
            force = np.cumsum(part)
            terms.append(_joined(parts, [np.interp(one.time, plates.time, force) / one.mass_kg for one in parts]))
    ends_s = _fitted(np.stack(terms, axis=1), off)[0].reshape(-1, 2)
    late_s, early_s = ends_s[list(late_and_early)]
    after_s = late_s - early_s.mean()
    both = bool(after_s.min() >= _BOTH_ENDS * after_s.mean() > 0.0)
    return both and bool(np.ptp(early_s) <= _UNEQUAL_S)


def _of_plate(parts: Sequence[CausedVelocity], plates: PlateLoads, plate: int, integrated: bool) -> FloatArray:
    """Return the acceleration (n,) m/s2 of the body by a plate's vertical force in all windows, or the velocity."""
    force = plates.force[:, plate, 1]
    return _joined(
        parts,
        [
            part.by(plates.time, force) if integrated else np.interp(part.time, plates.time, force) / part.mass_kg
            for part in parts
        ],
    )


def _joined(parts: Sequence[CausedVelocity], values: Sequence[FloatArray]) -> FloatArray:
    """Join values (n,) of all windows, each without its linear trend."""
    return np.concatenate([without_trend(part.time, each) for part, each in zip(parts, values, strict=True)])


def _fitted(terms: FloatArray, wanted: FloatArray) -> tuple[FloatArray, float]:
    """Return the factors (k,) of terms (n, k) that explain values (n,) best, and the SD that they leave."""
    factors = np.asarray(np.linalg.lstsq(terms, wanted, rcond=None)[0], dtype=float)
    return factors, float(np.std(wanted - terms @ factors))
