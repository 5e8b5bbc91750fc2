"""Weighs a body by forces, before inverse kinematics: on the move, standing, and on each plate.

Over a window the mean vertical force is m (g + dv / T), where dv is the change of the body centre's upward velocity
from its beginning to its end. The body's centre is marker-based: each segment has its usual share of body mass. No
model is fitted; the centre's velocity is wrong by about 0.1 m/s, and by less where the body moves at the end as at the
beginning: over whole strides and steps, and in standing.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.evidence.ambiguous_loads import OVERHANG_M, beyond_edges
from kinertia.diagnostics.evidence.body_motion import NEAR_END_S
from kinertia.diagnostics.evidence.foot_trajectories import periods
from kinertia.diagnostics.evidence.landmarks import body_centre
from kinertia.findings.quantity import Limit
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.smoothing import MIN_SAMPLES, SmoothingError, smooth
from kinertia.trial.data import FEET, FloatArray, FootLoads, Markers, PlateLoads, Trial
from kinertia.trial.foot_motion import AROUND_LOAD_S
from kinertia.trial.ground_contact import FIRM_LOAD_N, FootMarkers
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, nearest_samples, runs, span_s, within

CHANGE_SD_M_S = {"standing": 0.01, "whole strides": 0.05, "steps": 0.05, "the whole window": 0.14}
"""Standard deviation of the change of vertical velocity by markers, between both ends: half of it is due to motion of
arms and trunk that their markers do not show, half to skin. On seven measured trials of a second and more it is 0.001
to 0.003 m/s where the person stands, over strides and steps 0.01 to 0.02 m/s in walking and 0.02 to 0.07 in running."""
_SHARE_OF_VELOCITY = 0.6
"""The same over any window, as a share of the SD of the vertical velocity, if that is more. Over 60 windows of 0.25 to
2 s of each of 25 measured trials it is 0.02 to 0.07 m/s in walks and squats, 0.18 to 0.26 m/s in runs and jumps: 0.18
to 0.6 of the velocity's."""
_SHORTEST_WEIGHED_S, _FEWEST_COMPLETE = 0.25, 0.15
"""Nobody is weighed in less. About the mean mass is supported in 0.25 and more of the frames of runs, landings, walks
and parts of them, in 0.03 where only the end of a step is on a plate."""
_FAST_HZ, _SLOW_HZ = 8.0, 4.0
_AROUND_S = 0.25
"""Frames this near the window help to know velocities at its ends."""
_FEWEST_FRAMES = 2 * MIN_SAMPLES
_COMPLETE, MISSING = 0.15, Limit(0.25)
"""Share of body weight within which all of it is supported, and from which on some of it is not."""
UNMEASURED_S = Limit(0.2, "s", usual=(0.0, 0.06))
"""Part of the weight that is missing for this long is on something else, whatever the mean: in fault-free walks, runs
and jumps it is missing for 0.06 s at most, in flight."""
MOSTLY = Limit(0.25)
"""Share of the window in which all must be supported for the rest to be called an unmeasured contact."""
FOREIGN_SHARE, FOREIGN_S = Limit(0.3), Limit(0.15, "s", usual=(0.0, 0.09))
"""Share of body weight that plates bear in addition, and its duration, from which on it is another person's: in 29
walks it is beyond 0.3 for no sample, in landings, of which markers smooth the impact, for up to 0.09 s."""
_WINDOW_S, _STILL_M = 0.2, 0.005
"""A standing person moves by less within this time: in quiet standing 1 to 3 mm."""
_BETWEEN, _ASIDE_M = (0.15, 0.85), 0.15
"""Range between the feet of the load of both: beyond it, one of them also stands on something else."""
_CENTRE_HZ = 8.0
_ALONE_N, _UNLOADED_N, _SHORTEST_S = 50.0, 10.0, 0.2
ADULT_KG = Limit(70.0, "kg")
_ADULT_N = ADULT_KG * GRAVITY_M_S2
_HEAVIEST_PERCENT = 95.0
STEP_N, _FEWEST = Limit(350.0, "N"), 10
"""Half the weight of an adult, which no bump has; so many samples under load, at least."""


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

    @property
    def is_borne(self) -> bool:
        """Whether this mass is on the plates for a while, not only the end of a step."""
        near = np.abs(self.supported_kg / self.mass_kg - 1.0) < _COMPLETE
        return bool(near.mean() > _FEWEST_COMPLETE and np.ptp(self.time) >= _SHORTEST_WEIGHED_S)

    def unmeasured(self, total_kg: float) -> UnmeasuredSupport | None:
        """Find the longest interval in which part of the weight is on no plate, while at other times all is."""
        share = self.supported_kg / total_kg - 1.0
        complete = float((np.abs(share) < _COMPLETE).mean())
        spans = [(a, b) for a, b in runs(share < -MISSING) if span_s(self.time, a, b) >= UNMEASURED_S]
        if complete < MOSTLY or not spans:
            return None
        first, last = max(spans, key=lambda span: span[1] - span[0])
        span = float(self.time[first]), float(self.time[last])
        return UnmeasuredSupport(-float(share[first : last + 1].mean()), span, complete)

    def foreign(self, total_kg: float) -> ForeignLoad | None:
        """Find the longest time in which plates bear much more than the person, though at other times they do not."""
        share = self.supported_kg / total_kg - 1.0
        spans = [(a, b) for a, b in runs(share > FOREIGN_SHARE) if span_s(self.time, a, b) >= FOREIGN_S]
        if float((np.abs(share) < _COMPLETE).mean()) < MOSTLY or not spans:
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
    of_velocity = _SHARE_OF_VELOCITY * float(np.std(fast(time, 1)))
    change_sd = CHANGE_SD_M_S | {"the whole window": max(CHANGE_SD_M_S["the whole window"], of_velocity)}
    found: list[tuple[float, float, str]] = []
    for over, first, last in _spans(loads, float(time[0]), float(time[-1]), standing):
        here, lasts_s = within(loads.time, first, last), last - first
        velocity = fast(np.array([first, last]), 1)
        specific = GRAVITY_M_S2 + float(velocity[1] - velocity[0]) / lasts_s
        if here.sum() >= MIN_SAMPLES and specific > 0.2 * GRAVITY_M_S2:
            mass_kg = float(force[here].mean()) / specific
            found.append((mass_kg, mass_kg * change_sd[over] / (lasts_s * specific), over))
    if not found:
        return None
    # weight that is on no plate at the ends of the window affects only the mean over the whole window
    whole_kg, whole_sd_kg, _ = found[0]
    fitting = [
        estimate for estimate in found if abs(estimate[0] - whole_kg) <= 2.0 * float(np.hypot(estimate[1], whole_sd_kg))
    ]
    slow = smooth(loads.time[inside], force[inside], _SLOW_HZ)(time)
    needed = GRAVITY_M_S2 + smooth(around.time, height, _SLOW_HZ)(time, 2)
    least = 0.3 * GRAVITY_M_S2
    supported = np.where(needed > least, slow / np.maximum(needed, least), np.nan)
    return ForceMass(*min(fitting, key=lambda estimate: estimate[1]), time, supported)


def _spans(loads: FootLoads, start_s: float, end_s: float, standing: bool) -> list[tuple[str, float, float]]:
    """List spans over which the mean force gives a mass: the whole window, and strides and steps in its middle."""
    if standing:
        return [("standing", start_s, end_s)]
    lasts_s, spans = end_s - start_s, [("the whole window", start_s, end_s)]
    strides, steps = periods(loads)
    step = float(np.median(steps)) if steps else np.inf
    for over, times in (("whole strides", strides), ("steps", (step, 2.0 * step))):
        if fitting := [length_s for length_s in times if length_s <= lasts_s]:
            off = (lasts_s - max(fitting)) / 2.0
            spans.append((over, start_s + off, end_s - off))
    return spans


@dataclass(frozen=True)
class StandingMass:
    """Mass that the plates support while a person stands still.

    Attributes:
        mass_kg, sd_kg: the mass, and its SD from the person's sway.
        span_s: first and last time of standing still.
        plates: names of the plates that support the mass.
    """

    mass_kg: float
    sd_kg: float
    span_s: tuple[float, float]
    plates: tuple[str, ...]


def standing_mass(plates: PlateLoads, markers: Markers, feet: FootMarkers) -> StandingMass | None:
    """Weigh the person in the longest interval of standing still with both feet on plates; None without one."""
    total = plates.wrench.sum(axis=1)
    best: StandingMass | None = None
    for start_s, end_s in _still_spans(markers):
        here = within(plates.time, start_s, end_s)
        if here.sum() < 2 or total[here, 1].min() < FIRM_LOAD_N:
            continue
        right, left = (_places(markers, feet[side], start_s) for side in FEET)
        if not _under_both(total[here], right, left) or _beyond_plates(plates, np.concatenate([right, left])):
            continue
        lasts_s = end_s - start_s
        if best is None or lasts_s > best.span_s[1] - best.span_s[0]:
            mass_kg = float(total[here, 1].mean()) / GRAVITY_M_S2
            sd_kg = mass_kg * CHANGE_SD_M_S["standing"] / (lasts_s * GRAVITY_M_S2)
            on = plates.force[here, :, 1].mean(axis=0) > 0.0
            names = tuple(name for name, loaded in zip(plates.names, on, strict=True) if loaded)
            best = StandingMass(mass_kg, sd_kg, (start_s, end_s), names)
    return best


def _still_spans(markers: Markers) -> list[tuple[float, float]]:
    """Find intervals (s) in which the median marker stays in place, joined where they follow each other."""
    if len(markers.time) < 2:
        return []
    every = max(2, round(_WINDOW_S * markers.rate_hz))
    spans: list[tuple[float, float]] = []
    for first in range(0, len(markers.time) - every + 1, every):
        place = markers.positions[first : first + every][:, markers.seen[first : first + every].all(axis=0)]
        if not place.shape[1] or np.median(np.linalg.norm(np.ptp(place, axis=0), axis=1)) > _STILL_M:
            continue
        start_s, end_s = float(markers.time[first]), float(markers.time[first + every - 1])
        if spans and start_s - spans[-1][1] < 1.5 / markers.rate_hz:
            start_s = spans.pop()[0]
        spans.append((start_s, end_s))
    return spans


def _places(markers: Markers, labels: Sequence[str], at_s: float) -> FloatArray:
    """Return horizontal positions (m, 2) m of the markers of one foot that are visible at this time."""
    first = int(np.searchsorted(markers.time, at_s - TIME_TOLERANCE_S))
    place = markers.select(labels).positions[first][:, [0, 2]]
    result: FloatArray = place[np.isfinite(place).all(axis=1)]
    return result


def _under_both(total: FloatArray, right: FloatArray, left: FloatArray) -> bool:
    """Return whether the whole load (k, 6) is between both feet (m, 2)."""
    if not len(right) or not len(left):
        return False
    mean, start, along = total.mean(axis=0), right.mean(axis=0), left.mean(axis=0) - right.mean(axis=0)
    point = np.array([mean[5], -mean[3]]) / mean[1]
    share = float((point - start) @ along / max(float(along @ along), 1e-12))
    aside = float(np.linalg.norm(point - start - share * along))
    return _BETWEEN[0] < share < _BETWEEN[1] and aside < _ASIDE_M


def _beyond_plates(plates: PlateLoads, feet: FloatArray) -> bool:
    """Return whether a marker on the feet (m, 2) is beyond the edges of all plates, whose corners are known."""
    if plates.corners is None:
        return False
    beyond_plates = np.stack([beyond_edges(corners, feet) for corners in plates.corners])
    return bool((beyond_plates.min(axis=0) > OVERHANG_M).any())


def plate_masses(
    plates: PlateLoads, trial: Trial, markers: Markers, segment_of_label: Mapping[str, str]
) -> dict[str, float]:
    """Compute body mass (kg) by plate, of a body that moves like the marker-based centre; only plates that for a while
    support it alone.

    Args:
        plates: plates of the recording.
        trial: the recording with loads sorted by foot; it knows in which frames ground contact is measured.
        markers: all markers of the recording.
        segment_of_label: which marker is on which segment.
    """
    windows = trial.windows()
    if not windows:
        return {}
    markers = markers.cut(
        min(start for start, _ in windows) - AROUND_LOAD_S, max(end for _, end in windows) + AROUND_LOAD_S
    )
    place = body_centre(segment_of_label, markers)
    if place is None:
        return {}
    try:
        centre = smooth(markers.time, place[:, 1], _CENTRE_HZ)
    except SmoothingError:
        return {}
    measured = trial.measured[nearest_samples(trial.markers.time, plates.time)]
    measured &= within(plates.time, markers.time[0], markers.time[-1])
    by_plate = {}
    for p, name in enumerate(plates.names):
        vertical: FloatArray = plates.force[:, p, 1]
        others = np.delete(plates.force[..., 1], p, axis=1).max(axis=1, initial=0.0)
        masses_kg = []
        for first, last in runs((vertical > _ALONE_N) & (others < _UNLOADED_N) & measured):
            span = span_s(plates.time, first, last)
            beside_s = min(plates.time[first] - markers.time[0], markers.time[-1] - plates.time[last])
            # nearer to the ends a sound plate seemed to weigh 9 % more than the other
            if span < _SHORTEST_S or beside_s < NEAR_END_S:
                continue
            step = np.diff(plates.time[first : last + 1])
            impulse = float(((vertical[first + 1 : last + 1] + vertical[first:last]) / 2 * step).sum())
            velocity = centre(plates.time[[first, last]], 1)
            masses_kg.append(impulse / (GRAVITY_M_S2 * span + float(velocity[1] - velocity[0])))
        if masses_kg:
            by_plate[name] = float(np.mean(masses_kg))
    return by_plate


def adult_share(plates: PlateLoads | None, mass_kg: float | None = None) -> float:
    """Return body weight as a share of a 70 kg adult's, at most 1: limits in newtons are an adult's times this share.

    Where no mass is stated, the heaviest loads on all plates stand for body weight. They are 1.1 times body weight in a
    walk and more in a run: an overestimate, so that a limit is never too low for the person.
    """
    if mass_kg is not None:
        return min(1.0, mass_kg * GRAVITY_M_S2 / _ADULT_N)
    total = np.zeros(0) if plates is None else plates.force[..., 1].sum(axis=1)
    loaded = total[total > FIRM_LOAD_N]
    if len(loaded) < _FEWEST:
        return 1.0
    return min(1.0, float(np.percentile(loaded, _HEAVIEST_PERCENT)) / _ADULT_N)


def wrenches(plates: PlateLoads) -> Iterator[tuple[str, FloatArray]]:
    """Yield the name and wrench (k, 6) of every plate."""
    return zip(plates.names, np.moveaxis(plates.wrench, 1, 0), strict=True)


def loaded_wrenches(plates: PlateLoads, fewest: int = 1) -> Iterator[tuple[str, FloatArray]]:
    """Yield the name and wrench (j, 6) of the loaded samples of every plate that has at least `fewest` of them."""
    for name, wrench in wrenches(plates):
        loaded = wrench[wrench[:, 1] > FIRM_LOAD_N]
        if len(loaded) >= fewest:
            yield name, loaded


def carrying(plates: PlateLoads, share: float) -> Iterator[tuple[str, FloatArray]]:
    """Yield name and wrench (j, 6) of the loaded samples of every plate that carries a person of this `adult_share`."""
    return ((name, loaded) for name, loaded in loaded_wrenches(plates, _FEWEST) if loaded[:, 1].max() >= STEP_N * share)
