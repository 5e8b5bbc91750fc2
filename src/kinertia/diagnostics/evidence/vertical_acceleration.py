"""Compares the vertical acceleration of the markers with the vertical force: delay, rate and gains.

Vertical velocities tell these apart within two steps: a delay shifts them, a wrong rate shifts the last more than the
first, and a wrong gain of one plate adds to them whenever that plate is stood on.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.evidence.horizontal_velocity import ForceVelocity
from kinertia.trial.data import FloatArray

LARGEST_RESIDUAL = 0.22
"""Largest residual of a delay; a larger one has another fault as its reason."""
_STEPS = 5


@dataclass(frozen=True)
class VerticalVelocityFit:
    """Fit of shown(t) = factor * (forces(t + delay + rate_error * t) + gain * own(t)), up to a zero offset and a level.

    Attributes:
        delay_s, rate_error: delay of the forces in the middle, and its growth in seconds per second.
        gain: gain by which one plate reads more than the others.
        residual: unexplained share (residual SD over the SD of what is shown).
    """

    delay_s: float
    rate_error: float
    gain: float
    residual: float


def vertical_match(
    part: ForceVelocity, shown: FloatArray, own: FloatArray | None = None, growing: bool = False
) -> VerticalVelocityFit | None:
    """Fit the vertical velocity by Gauss-Newton; None where the velocities do not follow the forces.

    Args:
        part: the force-derived velocity, over (n,) s.
        shown: (n, 3) m/s, of the pelvis or of the marker-based centre.
        own: (n,) m/s due to one plate, if its gain may be wrong.
        growing: whether the delay may change over time.
    """
    after = part.time - part.time.mean()
    by_forces, accelerated = part.by_forces[:, 1], np.gradient(part.by_forces[:, 1], part.time)
    delay = rate_error = 0.0
    for _ in range(_STEPS):
        at = part.time + delay + rate_error * after
        inside = (at >= part.time[0]) & (at <= part.time[-1])
        if inside.sum() < len(at) / 2:
            return None
        pushed = np.interp(at[inside], part.time, accelerated)
        moved, since = np.interp(at[inside], part.time, by_forces), after[inside]
        columns = [moved, pushed, np.ones_like(since), since]
        columns += [since * pushed] if growing else []
        columns += [] if own is None else [np.interp(at[inside], part.time, own)]
        terms, wanted = np.stack(columns, axis=1), shown[inside, 1]
        solution = np.linalg.lstsq(terms, wanted, rcond=None)[0]
        if solution[0] <= 0.0:
            return None
        delay += float(solution[1] / solution[0])
        rate_error += float(solution[4] / solution[0]) if growing else 0.0
    gain = 0.0 if own is None else float(solution[-1] / solution[0])
    left = float(np.std(wanted - terms @ solution) / max(float(np.std(wanted)), 1e-12))
    return VerticalVelocityFit(delay, rate_error, gain, left)


def vertical_match_of(
    part: ForceVelocity, own: FloatArray | None = None, growing: bool = False
) -> Sequence[VerticalVelocityFit]:
    """Fit pelvis and marker-based centre of mass; empty where either does not follow the forces."""
    found = [vertical_match(part, shown, own, growing) for shown in (part.pelvis, part.centre)]
    return [one for one in found if one is not None] if all(found) else []
