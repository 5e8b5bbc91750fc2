"""Which foot stands on which plate, and in which frames all ground contact is measured.

Dynamics hold only where every foot on the ground stands on a plate that works. Both questions are answered from the
data: a load belongs to the foot that is nearest to its centre of pressure, and a foot without load is taken to be on
the ground by the heights and speeds that its markers have when a plate is seen to be loaded or unloaded.

A hand on a rail, a chair or a second person is not seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from kinertia.errors import TrialError
from kinertia.trial import FEET, BoolArray, FloatArray, FootLoads, Markers, Recording, Trial, runs, windows

BRIDGED_GAP_S = 0.02
"""A load that vanishes for less than this is one contact."""

SHORTEST_CONTACT_S = 0.05
"""A load that lasts less than this within the recording is noise of an empty plate."""

FAR_FROM_FEET_M = 0.3
"""A centre of pressure this far from the middle of both feet is worth a note."""

SHARED_FRACTION = 0.15
"""A contact that spends at least this part of its time nearer to the other foot carries both feet in turn."""

CONTACT_SLACK_S = 0.04
"""Markers tell when a foot lands or leaves only to within about this time; plates tell it better."""

LONGEST_FLIGHT_S = 1.0
"""Nobody is in the air for longer: then something else than the feet carries the person."""

_LEAST_CLEARANCE_M = 0.01
_LEAST_SPEED_M_S = 0.1
_SPEED_SPAN_S = 0.01
_FILLED_GAP_S = 0.2
_FOOT_NAMES = ("right", "left")

FootMarkers = Mapping[str, Sequence[str]]
"""Labels of the markers on each foot (heel, toes, ankle), by "r" and "l"."""


def build_trial(recording: Recording, feet: FootMarkers, window_s: tuple[float, float] | None = None) -> Trial:
    """Sort the loads by foot and find the measured frames.

    Args:
        recording: markers and force plates.
        feet: marker labels of each foot.
        window_s: first and last time (s) that the user vouches for, in place of what the data say.

    Raises:
        TrialError: no force plates, no load in the recording, or no measured frame; the message tells when each foot
            was on the ground and when on a plate.
        MarkerSetError: a foot label is not among the markers.
    """
    loads, notes = assign_plates(recording, feet)
    contact = _ground_contact(recording.markers, loads, feet)
    measured = _measured(recording.markers.time, contact)
    if window_s is not None:
        found = _spans(recording.markers.time, measured)
        time = recording.markers.time
        measured = contact.inside & (time >= window_s[0] - 1e-6) & (time <= window_s[1] + 1e-6)
        notes += (
            f"{recording.name}: the window {window_s[0]:.3f} to {window_s[1]:.3f} s was given by the user; by the data, "
            f"all ground contact is measured in {found}",
        )
    if not measured.any():
        raise TrialError(recording.name, _nothing_measured(recording.markers.time, contact, window_s))
    return Trial(recording.name, recording.markers, loads, measured, (*recording.notes, *notes))


def assign_plates(recording: Recording, feet: FootMarkers) -> tuple[FootLoads, tuple[str, ...]]:
    """Give every load to the foot it is under, whatever the files claim.

    A contact is a run of loaded samples on one plate, with gaps below `BRIDGED_GAP_S` bridged; contacts shorter than
    `SHORTEST_CONTACT_S` are noise. It goes to the foot whose markers' mean is nearest to its centre of pressure
    (horizontally, load-weighted). A contact that carries the feet in turn is divided, sample by sample; while both
    feet stand on one plate the whole load counts for the nearer one, since only the sum is known.

    Returns:
        the loads by foot, on the plates' time base, and a note for each assumption.

    Raises:
        TrialError: the recording has no force plates.
        MarkerSetError: a foot label is not among the markers.
    """
    plates = recording.plates
    if plates is None:
        raise TrialError(recording.name, "no force plates; give a force file (.mot, .sto) or a C3D file with plates")
    centres = [_centre(recording.markers.select(feet[foot]), plates.time) for foot in FEET]
    covered = (plates.time >= recording.markers.time[0]) & (plates.time <= recording.markers.time[-1])
    force = np.zeros((len(plates.time), 2, 3))
    moment = np.zeros_like(force)
    notes: list[str] = []
    for p, name in enumerate(plates.names):
        where = f"{recording.name}: {name}"
        contacts, noise = _contacts(plates.time, plates.force[:, p, 1] > 0)
        if noise:
            notes.append(f"{where} has {noise} loads shorter than {1000 * SHORTEST_CONTACT_S:g} ms, taken as noise")
        for first, last in contacts:
            piece = slice(first, last + 1)
            nearer, told = _nearer_foot(
                where, plates.time[piece], plates.force[piece, p], plates.moment[piece, p],
                [centre[piece] for centre in centres], covered[piece], plates.declared_feet[p],
            )
            notes += told
            for foot in range(2):
                force[piece, foot] += np.where((nearer == foot)[:, None], plates.force[piece, p], 0.0)
                moment[piece, foot] += np.where((nearer == foot)[:, None], plates.moment[piece, p], 0.0)
    return FootLoads(plates.time, force, moment), tuple(notes)


def measured_frames(markers: Markers, loads: FootLoads, feet: FootMarkers) -> BoolArray:
    """(n,) True where every foot on the ground stands on a loaded plate, so that all ground contact is known.

    A loaded foot is on the ground by its load. A foot without load is on the ground while one of its markers is as
    low and as slow against the ground as the markers of loaded feet are in this trial: it lands when that speed falls to the speed seen
    where a plate starts to be loaded, and leaves when it rises to the speed seen where a plate ceases to be. Up to
    `CONTACT_SLACK_S` of such ground contact right before or after a load is the markers' inaccuracy.

    Frames outside the forces' time are not measured. Frames in the air (no foot on the ground, no load) are measured
    only between measured frames, for up to `LONGEST_FLIGHT_S`: then plates have seen both the take-off and the
    landing. A foot whose markers are missing counts as on the ground.

    Speeds are against the ground under the loaded feet, so that a treadmill's belt is no trouble.
    """
    return _measured(markers.time, _ground_contact(markers, loads, feet))


@dataclass(frozen=True, eq=False)
class _Contact:
    """Per marker frame: which foot is `loaded` (n, 2) by a plate, which on the `ground` (n, 2), which frames are
    `inside` (n,) the forces' time."""

    loaded: BoolArray
    ground: BoolArray
    inside: BoolArray


def _centre(markers: Markers, time: FloatArray) -> FloatArray:
    """Horizontal middle (k, 2) m of the markers at these times, held where none is seen."""
    seen = np.isfinite(markers.positions).all(axis=2)
    some = seen.any(axis=1)
    if not some.any():
        return np.full((len(time), 2), np.nan)
    flat = np.where(seen[:, :, None], markers.positions, 0.0)[some][:, :, [0, 2]]
    middle = flat.sum(axis=1) / seen[some].sum(axis=1)[:, None]
    return np.column_stack([np.interp(time, markers.time[some], middle[:, axis]) for axis in range(2)])


def _bridged(time: FloatArray, loaded: BoolArray) -> BoolArray:
    """The same mask with gaps below `BRIDGED_GAP_S` closed."""
    closed = loaded.copy()
    for first, last in runs(~loaded):
        within = first > 0 and last < len(time) - 1
        if within and time[last + 1] - time[first - 1] < BRIDGED_GAP_S:
            closed[first : last + 1] = True
    return closed


def _contacts(time: FloatArray, loaded: BoolArray) -> tuple[list[tuple[int, int]], int]:
    """First and last sample of every contact, and the number of loads that were too short to be one."""
    found = runs(_bridged(time, loaded))
    real = [
        (first, last)
        for first, last in found
        if time[last] - time[first] >= SHORTEST_CONTACT_S or first == 0 or last == len(time) - 1
    ]
    return real, len(found) - len(real)


def _nearer_foot(
    where: str,
    time: FloatArray,
    force: FloatArray,
    moment: FloatArray,
    centres: Sequence[FloatArray],
    covered: BoolArray,
    declared: str | None,
) -> tuple[npt.NDArray[np.int_], list[str]]:
    """Index of the foot (k,) that each sample of one contact belongs to, and notes."""
    weight = np.where(covered, force[:, 1], 0.0)
    if not weight.any():
        return np.full(len(time), -1), []
    load = np.where(force[:, 1] > 0, force[:, 1], np.inf)
    pressure = np.column_stack((moment[:, 2] / load, -moment[:, 0] / load))
    distance = np.stack([np.linalg.norm(pressure - centre, axis=1) for centre in centres], axis=1)
    distance = np.where(np.isfinite(distance), distance, 1e3)
    mean = weight @ distance / weight.sum()
    foot = int(np.argmin(mean))
    span = f"from {time[0]:.3f} to {time[-1]:.3f} s"
    notes = []
    if mean[foot] > FAR_FROM_FEET_M:
        notes.append(f"{where} is loaded {span} at {mean[foot]:.2f} m from the nearest foot; check that it is the person's")
    nearer = np.argmin(distance, axis=1)
    active = weight > 0
    if (nearer[active] != foot).mean() >= SHARED_FRACTION:
        notes.append(f"{where} carries both feet in turn {span}; each sample was given to the nearer foot")
        return nearer, notes
    if declared is not None and declared != FEET[foot]:
        notes.append(
            f"{where} is declared for the {_FOOT_NAMES[FEET.index(declared)]} foot, but {span} its load is under the "
            f"{_FOOT_NAMES[foot]} foot and was given to it"
        )
    return np.full(len(time), foot), notes


def _ground_contact(markers: Markers, loads: FootLoads, feet: FootMarkers) -> _Contact:
    nearest = np.clip(np.searchsorted(loads.time, markers.time), 1, len(loads.time) - 1)
    nearest -= markers.time - loads.time[nearest - 1] < loads.time[nearest] - markers.time
    inside = (markers.time >= loads.time[0] - 1e-6) & (markers.time <= loads.time[-1] + 1e-6)
    loaded = np.stack(
        [_bridged(loads.time, loads.force[:, foot, 1] > 0)[nearest] & inside for foot in range(2)], axis=1
    )
    ground = loaded.copy()
    moves = [_foot_motion(markers.select(feet[foot])) for foot in FEET]
    if loaded.any():
        moves = _against_ground(moves, loaded)
        clearance, landing, leaving = _learned(moves, loaded)
        for foot, move in enumerate(moves):
            planted = _planted(move, clearance, landing, leaving)
            ground[:, foot] |= _without_slack(planted, loaded[:, foot], markers.time)
    return _Contact(loaded, ground, inside)


@dataclass(frozen=True, eq=False)
class _FootMotion:
    """Height (n, m) m and velocity (n, m, 3) m/s of the markers of a foot; NaN where not seen."""

    height: FloatArray
    velocity: FloatArray

    def slowest(self, clearance: float) -> FloatArray:
        """(n,) m/s speed of the slowest marker not higher than this clearance; infinite where none is."""
        speed = np.linalg.norm(self.velocity, axis=2)
        return np.where(self.height <= clearance, speed, np.inf).min(axis=1)


def _foot_motion(markers: Markers) -> _FootMotion:
    positions = _short_gaps_filled(markers)
    span = max(1, round(_SPEED_SPAN_S * markers.rate_hz))
    frames = np.arange(len(positions))
    after, before = np.minimum(frames + span, len(frames) - 1), np.maximum(frames - span, 0)
    elapsed = (markers.time[after] - markers.time[before])[:, None, None]
    return _FootMotion(positions[:, :, 1], (positions[after] - positions[before]) / elapsed)


def _against_ground(moves: Sequence[_FootMotion], loaded: BoolArray) -> list[_FootMotion]:
    """The same motions with heights above each marker's lowest and velocities against the ground under loaded feet.

    The ground's velocity is the median of the lowest marker's: zero on a floor, the belt's on a treadmill. A foot that
    is never loaded takes the other's.
    """
    against, ground = [], []
    for foot, move in enumerate(moves):
        stance = move.height[loaded[:, foot]]
        if not np.isfinite(stance).any() or not np.isfinite(stance).any(axis=0).all():
            stance = move.height
        height = move.height - np.nanpercentile(stance, 2, axis=0)
        frames = np.flatnonzero(loaded[:, foot] & np.isfinite(height).any(axis=1))
        if frames.size:
            lowest = np.nanargmin(height[frames], axis=1)
            ground.append(np.nanmedian(move.velocity[frames, lowest], axis=0) * [1, 0, 1])
        against.append(height)
    velocities = ground if len(ground) == 2 else ground * 2
    return [
        _FootMotion(height, move.velocity - velocity)
        for height, move, velocity in zip(against, moves, velocities, strict=True)
    ]


def _short_gaps_filled(markers: Markers) -> FloatArray:
    """Positions of the markers seen in at least half the frames, gaps up to `_FILLED_GAP_S` bridged by a line.

    Only for telling whether a foot is on the ground.
    """
    seen = np.isfinite(markers.positions).all(axis=2)
    kept = np.flatnonzero(seen.mean(axis=0) >= 0.5)
    if not kept.size:
        raise TrialError("", f"the foot markers {', '.join(markers.labels)} are seen in less than half the frames")
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
    lowest = [np.nanmin(move.height, axis=1)[loaded[:, foot]] for foot, move in enumerate(moves)]
    clearance = _LEAST_CLEARANCE_M + max(0.0, *(float(np.nanmax(low)) for low in lowest if low.size))
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
    land = max(_LEAST_SPEED_M_S, _largest(np.array(landing)) or usual)
    return clearance, land, max(land, _largest(np.array(leaving)) or usual)


def _halfway(unloaded: float, loaded: float) -> float:
    """Speed between an unloaded frame and the loaded frame beside it."""
    return (unloaded + loaded) / 2 if np.isfinite(unloaded) else loaded


def _largest(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else 0.0


def _planted(move: _FootMotion, clearance: float, landing: float, leaving: float) -> BoolArray:
    """(n,) True from landing to leaving, and where a marker is missing and the others do not say otherwise."""
    slowest = move.slowest(clearance)
    planted = np.zeros(len(slowest), dtype=bool)
    for first, last in runs(slowest <= leaving):
        below = np.flatnonzero(slowest[first : last + 1] <= landing)
        if below.size:
            planted[first + below[0] : last + 1] = True
    return planted | np.isnan(move.height).any(axis=1)


def _without_slack(planted: BoolArray, loaded: BoolArray, time: FloatArray) -> BoolArray:
    """`planted` without the short stretches that touch a load."""
    kept = planted & ~loaded
    for first, last in runs(kept):
        touches = (first > 0 and loaded[first - 1]) or (last < len(time) - 1 and loaded[last + 1])
        if touches and time[last] - time[first] <= CONTACT_SLACK_S:
            kept[first : last + 1] = False
    return kept


def _measured(time: FloatArray, contact: _Contact) -> BoolArray:
    measured = contact.inside & (contact.loaded | ~contact.ground).all(axis=1)
    flight = measured & ~contact.ground.any(axis=1)
    for first, last in runs(flight):
        between = first > 0 and last < len(time) - 1 and measured[first - 1] and measured[last + 1]
        if not between or time[last] - time[first] > LONGEST_FLIGHT_S:
            measured[first : last + 1] = False
    return measured


def _spans(time: FloatArray, mask: BoolArray) -> str:
    spans = sorted(windows(time, mask))
    return ", ".join(f"{start:.3f} to {end:.3f} s" for start, end in spans) or "no frame"


def _nothing_measured(time: FloatArray, contact: _Contact, window_s: tuple[float, float] | None) -> str:
    if window_s is not None:
        return (
            f"the window {window_s[0]:.3f} to {window_s[1]:.3f} s holds no frame with forces (they cover "
            f"{_spans(time, contact.inside)}); give a window within them"
        )
    feet = "; ".join(
        f"{name} foot on the ground {_spans(time, contact.ground[:, foot])}, on a plate "
        f"{_spans(time, contact.loaded[:, foot])}"
        for foot, name in enumerate(_FOOT_NAMES)
    )
    return f"in no frame does every foot on the ground stand on a loaded plate ({feet}); use a trial that hits the plates"
