"""In which frames all ground contact is measured.

A foot without load is taken to be on the ground by the heights and speeds that the markers of this trial's
feet have when a plate begins or ceases to be loaded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.errors import MarkerSetError
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, BoolArray, FloatArray, FootLoads, Markers, nearest_samples, runs

BRIDGED_GAP_S = 0.02
"""A load that vanishes for less than this is one contact."""

CONTACT_SLACK_S = 0.04
"""Largest error of the time that markers give for landing or leaving, seen against plates (usual 0.015 s)."""

CONTACT_MARGIN_S = 0.02
"""Ground contact off the plates is widened by this on both sides: a missed first contact spoils dynamics."""

LONGEST_FLIGHT_S = 1.0
"""Nobody is in the air for longer: then something else than the feet carries the person."""

# Below these, markers of a foot that stands still differ by noise only.
_LEAST_CLEARANCE_M = 0.01
_LEAST_SPEED_M_S = 0.1
_SPEED_SPAN_S = 0.01
_FILLED_GAP_S = 0.2
_FEWEST_TO_JUDGE, _FAR_BEYOND = 3, 3.0
"""Of so many landings, one that is so many times as fast as usual is none."""

FootMarkers = Mapping[str, Sequence[str]]
"""Labels of the markers on each foot (heel, toes, ankle), by "r" and "l"."""


def measured_frames(markers: Markers, loads: FootLoads, feet: FootMarkers) -> BoolArray:
    """(n,) True where every foot on the ground stands on a loaded plate, so that all ground contact is known.

    A loaded foot is on the ground by its load. A foot without load is on the ground while one of its markers
    is as low and as slow against the ground as the markers of loaded feet are in this trial: it lands when
    that speed falls to the speed seen where a plate starts to be loaded, and leaves when it rises to the
    speed seen where a plate ceases to be. Up to `CONTACT_SLACK_S` of such ground contact right before or
    after a load is the markers' inaccuracy; what remains is widened by `CONTACT_MARGIN_S`.

    Frames outside the forces' time are not measured. Frames in the air (no foot on the ground, no load) are
    measured only between measured frames, for up to `LONGEST_FLIGHT_S`: then plates have seen both the
    take-off and the landing. A foot whose markers are missing counts as on the ground.

    Speeds are against the ground under the loaded feet, so that a treadmill's belt is no trouble.
    """
    return ground_contact(markers, loads, feet).measured(markers.time)


@dataclass(frozen=True, eq=False)
class GroundContact:
    """Ground contact by marker frame.

    Attributes:
        loaded: (n, 2) True where the right, left foot stands on a loaded plate.
        ground: (n, 2) True where the foot is on the ground, loaded or not.
        inside: (n,) True within the forces' time.
        together: (n,) True where one plate carries both feet, so that only the sum of their loads is known.
    """

    loaded: BoolArray
    ground: BoolArray
    inside: BoolArray
    together: BoolArray

    def measured(self, time: FloatArray) -> BoolArray:
        """(n,) True where all ground contact is known, by the rules of `measured_frames`."""
        measured = self.inside & ~self.together & np.asarray(self.loaded | ~self.ground).all(axis=1)
        flight = measured & ~self.ground.any(axis=1)
        for first, last in runs(flight):
            between = first > 0 and last < len(time) - 1 and measured[first - 1] and measured[last + 1]
            if not between or time[last] - time[first] > LONGEST_FLIGHT_S:
                measured[first : last + 1] = False
        return measured


def ground_contact(markers: Markers, loads: FootLoads, feet: FootMarkers) -> GroundContact:
    """Which foot is on the ground and which on a loaded plate, by the rules of `measured_frames`."""
    nearest = nearest_samples(loads.time, markers.time)
    inside = (markers.time >= loads.time[0] - 1e-6) & (markers.time <= loads.time[-1] + 1e-6)
    loaded = np.stack(
        [bridged(loads.time, loads.force[:, foot, 1] >= LOAD_THRESHOLD_N)[nearest] & inside for foot in range(2)],
        axis=1,
    )
    ground = loaded.copy()
    moves = [_foot_motion(markers.select(feet[foot])) for foot in FEET]
    if loaded.any():
        moves = _against_ground(moves, loaded)
        clearance, landing, leaving = _learned(moves, loaded)
        for foot, move in enumerate(moves):
            planted = _planted(move, clearance, landing, leaving)
            ground[:, foot] |= _off_plates(planted, loaded[:, foot], markers.time)
    together = np.zeros(len(inside), dtype=bool) if loads.together is None else loads.together[nearest] & inside
    return GroundContact(loaded, ground, inside, together)


@dataclass(frozen=True, eq=False)
class _FootMotion:
    """Height (n, m) m and velocity (n, m, 3) m/s of the markers of a foot; NaN where not seen."""

    height: FloatArray
    velocity: FloatArray

    def slowest(self, clearance: float) -> FloatArray:
        """(n,) m/s speed of the slowest marker not higher than this clearance; infinite where none is."""
        speed = np.linalg.norm(self.velocity, axis=2)
        result: FloatArray = np.where(self.height <= clearance, speed, np.inf).min(axis=1)
        return result


def _foot_motion(markers: Markers) -> _FootMotion:
    positions = _short_gaps_filled(markers)
    span = max(1, round(_SPEED_SPAN_S * markers.rate_hz))
    frames = np.arange(len(positions))
    after, before = np.minimum(frames + span, len(frames) - 1), np.maximum(frames - span, 0)
    elapsed = (markers.time[after] - markers.time[before])[:, None, None]
    return _FootMotion(positions[:, :, 1], (positions[after] - positions[before]) / elapsed)


def _against_ground(moves: Sequence[_FootMotion], loaded: BoolArray) -> list[_FootMotion]:
    """Heights above each marker's own lowest, and velocities against the ground under the loaded feet.

    The ground's velocity is the median of the lowest marker's: zero on a floor, the belt's on a treadmill. A
    foot that is never loaded takes the other's.
    """
    against, ground = [], []
    for foot, move in enumerate(moves):
        stance = move.height[loaded[:, foot]]
        if not np.isfinite(stance).any() or not np.isfinite(stance).any(axis=0).all():
            stance = move.height
        height = move.height - np.nanpercentile(stance, 2, axis=0)
        frames = np.flatnonzero(loaded[:, foot] & np.isfinite(height).any(axis=1))
        against.append(height)
        if frames.size:
            velocity = move.velocity[frames, np.nanargmin(height[frames], axis=1)]
            velocity = velocity[np.isfinite(velocity).all(axis=1)]
            ground += [np.median(velocity, axis=0) * [1, 0, 1]] if len(velocity) else []
    velocities = ground if len(ground) == 2 else (ground or [np.zeros(3)]) * 2
    return [
        _FootMotion(height, move.velocity - velocity)
        for height, move, velocity in zip(against, moves, velocities, strict=True)
    ]


def _short_gaps_filled(markers: Markers) -> FloatArray:
    """Positions of the markers seen in at least half the frames, short gaps bridged by a line.

    Only for telling whether a foot is on the ground.
    """
    seen = markers.seen
    kept = np.flatnonzero(seen.mean(axis=0) >= 0.5)
    if not kept.size:
        raise MarkerSetError(
            f"the foot markers {', '.join(markers.labels)} are each seen in less than half of the frames; "
            "use a trial that shows the feet or give other markers",
            markers.labels,
        )
    positions = markers.positions[:, kept].copy()
    for column, marker in enumerate(kept):
        for first, last in runs(~seen[:, marker]):
            if markers.time[last] - markers.time[first] > _FILLED_GAP_S:
                continue
            for axis in range(3):
                positions[first : last + 1, column, axis] = np.interp(
                    markers.time[first : last + 1],
                    markers.time[seen[:, marker]],
                    markers.positions[seen[:, marker], marker, axis],
                )
    return positions


def _learned(moves: Sequence[_FootMotion], loaded: BoolArray) -> tuple[float, float, float]:
    """Clearance (m), landing and leaving speed (m/s) of this trial's loaded feet.

    Where no contact begins (or ends) within the trial, the largest speed of a loaded foot stands in.
    """
    lowest = [np.fmin.reduce(move.height[loaded[:, foot]], axis=1) for foot, move in enumerate(moves)]
    clearance = _LEAST_CLEARANCE_M + max(0.0, _largest(np.concatenate(lowest)))
    landing, leaving, loaded_speed = [], [], []
    for foot, move in enumerate(moves):
        speed = move.slowest(clearance)
        for first, last in runs(loaded[:, foot]):
            loaded_speed.append(speed[first : last + 1])
            if first > 0:
                landing.append(_halfway(speed[first - 1], speed[first]))
            if last < len(speed) - 1:
                leaving.append(_halfway(speed[last + 1], speed[last]))
    usual = _largest(np.concatenate(loaded_speed))
    land = max(_LEAST_SPEED_M_S, _usual(landing) or usual)
    return clearance, land, max(land, _usual(leaving) or usual)


def _halfway(unloaded: float, loaded: float) -> float:
    """Speed between an unloaded frame and the loaded frame beside it."""
    return (unloaded + loaded) / 2 if np.isfinite(unloaded) else loaded


def _largest(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else 0.0


def _usual(speeds: Sequence[float]) -> float:
    """The largest of speeds that is not far beyond the others: what was no landing must not teach how feet land."""
    values = np.array(speeds)
    finite = values[np.isfinite(values)]
    if finite.size >= _FEWEST_TO_JUDGE:
        finite = finite[finite <= _FAR_BEYOND * np.median(finite)]
    return _largest(finite)


def _planted(move: _FootMotion, clearance: float, landing: float, leaving: float) -> BoolArray:
    """(n,) True from landing to leaving, and where a marker is missing."""
    slowest = move.slowest(clearance)
    planted = np.zeros(len(slowest), dtype=bool)
    for first, last in runs(slowest <= leaving):
        below = np.flatnonzero(slowest[first : last + 1] <= landing)
        if below.size:
            planted[first + below[0] : last + 1] = True
    return planted | np.isnan(move.height).any(axis=1)


def _off_plates(planted: BoolArray, loaded: BoolArray, time: FloatArray) -> BoolArray:
    """`planted` without load: without the short stretches that touch a load, the others widened."""
    off = np.zeros_like(planted)
    for first, last in runs(planted & ~loaded):
        touches = (first > 0 and loaded[first - 1]) or (last < len(time) - 1 and loaded[last + 1])
        if not touches or time[last] - time[first] > CONTACT_SLACK_S:
            off |= (time >= time[first] - CONTACT_MARGIN_S) & (time <= time[last] + CONTACT_MARGIN_S)
    return off & ~loaded


def bridged(time: FloatArray, loaded: BoolArray) -> BoolArray:
    """The same mask with gaps below `BRIDGED_GAP_S` closed."""
    closed = loaded.copy()
    for first, last in runs(~loaded):
        within = first > 0 and last < len(time) - 1
        if within and time[last + 1] - time[first - 1] < BRIDGED_GAP_S:
            closed[first : last + 1] = True
    return closed
