"""Computes body mass from vertical force and markers, before inverse kinematics.

Over a window the mean vertical force is m (g + dv / T), where dv is the change of the body centre's upward velocity
from its beginning to its end. The body's centre is marker-based: each segment has its usual share of body mass. No
model is fitted; the centre's velocity is wrong by about 0.1 m/s, and by less where the body moves at the end as at the
beginning: over whole strides and steps, and in standing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.evidence.body_centre import body_centre
from kinertia.diagnostics.evidence.strides import periods
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.smoothing import MIN_SAMPLES, smooth
from kinertia.trial.data import FloatArray, FootLoads, Trial
from kinertia.trial.sampled_time import runs, span_s, within

CHANGE_SD_M_S = {"standing": 0.01, "whole strides": 0.05, "steps": 0.05, "the whole window": 0.14}
"""Standard deviation of the change of vertical velocity by markers, between both ends: half of it is due to motion of
arms and trunk that their markers do not show, half to skin. On seven measured trials of a second and more it is 0.001
to 0.003 m/s where the person stands, over strides and steps 0.01 to 0.02 m/s in walking and 0.02 to 0.07 in running,
over other windows 0.03 m/s in walking and squatting and up to 0.25 in running."""
_FAST_HZ, _SLOW_HZ = 8.0, 4.0
_AROUND_S = 0.25
"""Frames this near the window help to know velocities at its ends."""
_FEWEST_FRAMES = 2 * MIN_SAMPLES
_COMPLETE, MISSING = 0.15, 0.25
"""Share of body weight within which all of it is supported, and from which on some of it is not."""
UNMEASURED_S = 0.2
"""Part of the weight that is missing for this long is on something else, whatever the mean: in fault-free walks, runs
and jumps it is missing for 0.06 s at most, in flight."""
_MOSTLY = 0.25
"""Share of the window in which all must be supported for the rest to be called an unmeasured contact."""


FOREIGN_SHARE, _FOREIGN_S = 0.3, 0.15
"""Share of body weight that plates bear in addition, and its duration, from which on it is another person's: in 29
walks it is beyond 0.3 for no sample, in landings, of which markers smooth the impact, for up to 0.09 s."""


class ForeignLoad(NamedTuple):
    """A temporary load on the plates besides the person: its share of body weight, and its start and end."""

    surplus: float
    span_s: tuple[float, float]


class UnmeasuredSupport(NamedTuple):
    """Part of the weight that is on no plate for a while: its share, its start and end, and the share of the window
    with full support.
    """

    missing: float
    span_s: tuple[float, float]
    complete: float


@dataclass(frozen=True, eq=False)
class ForceMass:
    """Body mass from the vertical force of one trial.

    Attributes:
        mass_kg, sd_kg: the mass that the forces move like the marker-based centre, and its standard deviation.
        over: a key of `CHANGE_SD_M_S`.
        time: (n,) s, the frames of the longest window in which the sum of the forces is known.
        supported_kg: (n,) force over what a body of one kilogram would need for the same movement.
    """

    mass_kg: float
    sd_kg: float
    over: str
    time: FloatArray
    supported_kg: FloatArray

    def unmeasured(self, total_kg: float) -> UnmeasuredSupport | None:
        """Find the longest interval in which part of the weight is on no plate, while at other times all is."""
        share = self.supported_kg / total_kg - 1.0
        complete = float((np.abs(share) < _COMPLETE).mean())
        spans = [(a, b) for a, b in runs(share < -MISSING) if span_s(self.time, a, b) >= UNMEASURED_S]
        if complete < _MOSTLY or not spans:
            return None
        first, last = max(spans, key=lambda span: span[1] - span[0])
        span = float(self.time[first]), float(self.time[last])
        return UnmeasuredSupport(-float(share[first : last + 1].mean()), span, complete)

    def foreign(self, total_kg: float) -> ForeignLoad | None:
        """Find the longest time in which plates bear much more than the person, though at other times they do not."""
        share = self.supported_kg / total_kg - 1.0
        spans = [(a, b) for a, b in runs(share > FOREIGN_SHARE) if span_s(self.time, a, b) >= _FOREIGN_S]
        if float((np.abs(share) < _COMPLETE).mean()) < _MOSTLY or not spans:
            return None
        first, last = max(spans, key=lambda span: span[1] - span[0])
        span = float(self.time[first]), float(self.time[last])
        return ForeignLoad(float(share[first : last + 1].mean()), span)


def force_mass(segment_of_label: Mapping[str, str], trial: Trial, standing: bool = False) -> ForceMass | None:
    """Compute body mass from the forces in the longest window of known total force, or in whole strides or steps of it.

    Args:
        segment_of_label: which marker is on which segment.
        trial: with measured frames.
        standing: the person stands still.

    Returns:
        None where too few frames, or no markers, show how the body moves.
    """
    if not trial.measured.any():
        return None
    start, end = trial.total_force_windows()[0]
    around, time = trial.markers.cut(start - _AROUND_S, end + _AROUND_S), trial.markers.cut(start, end).time
    place = body_centre(segment_of_label, around) if len(time) >= _FEWEST_FRAMES else None
    loads = trial.loads
    inside = within(loads.time, start, end)
    if place is None or inside.sum() < MIN_SAMPLES:
        return None
    height, force = place[:, 1], loads.force[:, :, 1].sum(axis=1)
    fast = smooth(around.time, height, _FAST_HZ)
    found: list[tuple[float, float, str]] = []
    for over, first, last in _spans(loads, float(time[0]), float(time[-1]), standing):
        here, lasts_s = within(loads.time, first, last), last - first
        velocity = fast(np.array([first, last]), 1)
        specific = GRAVITY_M_S2 + float(velocity[1] - velocity[0]) / lasts_s
        if here.sum() >= MIN_SAMPLES and specific > 0.2 * GRAVITY_M_S2:
            mass_kg = float(force[here].mean()) / specific
            found.append((mass_kg, mass_kg * CHANGE_SD_M_S[over] / (lasts_s * specific), over))
    if not found:
        return None
    # weight that is on no plate at the ends of the window affects only the mean over the whole window
    whole_kg, whole_sd_kg, _ = found[0]
    fitting = [one for one in found if abs(one[0] - whole_kg) <= 2.0 * float(np.hypot(one[1], whole_sd_kg))]
    slow = smooth(loads.time[inside], force[inside], _SLOW_HZ)(time)
    needed = GRAVITY_M_S2 + smooth(around.time, height, _SLOW_HZ)(time, 2)
    least = 0.3 * GRAVITY_M_S2
    supported = np.where(needed > least, slow / np.maximum(needed, least), np.nan)
    return ForceMass(*min(fitting, key=lambda one: one[1]), time, supported)


def _spans(loads: FootLoads, start_s: float, end_s: float, standing: bool) -> list[tuple[str, float, float]]:
    """List spans over which the mean force gives a mass: the whole window, and strides and steps in its middle."""
    if standing:
        return [("standing", start_s, end_s)]
    lasts_s, spans = end_s - start_s, [("the whole window", start_s, end_s)]
    strides, steps = periods(loads)
    step = float(np.median(steps)) if steps else np.inf
    for over, times in (("whole strides", strides), ("steps", (step, 2.0 * step))):
        if fitting := [one for one in times if one <= lasts_s]:
            off = (lasts_s - max(fitting)) / 2.0
            spans.append((over, start_s + off, end_s - off))
    return spans
