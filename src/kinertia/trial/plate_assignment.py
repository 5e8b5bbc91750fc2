"""Which foot stands on which plate, and in which frames all ground contact is measured.

Dynamics hold only where every foot on the ground stands on a plate that works. Both questions are answered from
the data: a load belongs to the foot that is nearest to its centre of pressure, and a foot without load is on the
ground by the heights and speeds of its markers (`kinertia.trial.ground_contact`).

A hand on a rail, a chair or a second person is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from kinertia.errors import TrialError
from kinertia.trial.data import FEET, BoolArray, FloatArray, FootLoads, Markers, Recording, Trial
from kinertia.trial.ground_contact import (
    BRIDGED_GAP_S,
    FootMarkers,
    GroundContact,
    bridged,
    ground_contact,
    measured_frames,
)
from kinertia.trial.sampled_time import TIME_TOLERANCE_S, nearest_samples, runs, span_s, windows, within

__all__ = ["BRIDGED_GAP_S", "FootMarkers", "assign_plates", "build_trial", "measured_frames"]

SHORTEST_CONTACT_S = 0.05
"""A load that lasts less than this within the recording is noise of an empty plate."""

FAR_FROM_FEET_M = 0.3
"""A centre of pressure this far from the middle of both feet is worth a note."""

SHARED_FRACTION = 0.15
"""A contact that spends at least this part of its time nearer to the other foot carries both feet in turn."""

DOUBLE_SUPPORT_S = 0.2
"""So long, in a slow walk, both feet are down when the load of one plate goes from one to the other."""

_MOSTLY_SHARED = 0.5
"""Share of the frames with both feet down and one plate loaded from which on that is why nothing is measured."""
_LISTED_SPANS = 4
_FOOT_NAMES = ("right", "left")


def build_trial(recording: Recording, feet: FootMarkers, window_s: tuple[float, float] | None = None) -> Trial:
    """Sort the loads by foot and find the measured frames.

    Args:
        recording: markers and force plates.
        feet: marker labels of each foot.
        window_s: first and last time (s) that the user vouches for, in place of what the data say.

    Raises:
        TrialError: fewer than two frames, no force plates, or no measured frame; the last message tells when each
            foot was on the ground and when on a plate.
        MarkerSetError: a foot label is not among the markers.
    """
    if len(recording.markers.time) < 2:
        raise TrialError(recording.name, "only one frame; expected a motion, or use the file as a static trial")
    loads, notes = assign_plates(recording, feet)
    contact = ground_contact(recording.markers, loads, feet, recording.belt)
    measured = contact.measured(recording.markers.time)
    if window_s is not None:
        spans = _spans(recording.markers.time, measured)
        time = recording.markers.time
        measured = contact.inside & within(time, *window_s)
        notes += (
            f"{recording.name}: the window {window_s[0]:.3f} to {window_s[1]:.3f} s was given by the user; "
            f"by the data, all ground contact is measured in {spans}",
        )
    if not measured.any():
        problem = "; ".join([_nothing_measured(recording.markers.time, loads, contact, window_s), *recording.left_out])
        raise TrialError(recording.name, problem)
    told = (*recording.notes, *notes)
    own = recording.virtual_sd_m, recording.belt, recording.vertical
    return Trial(recording.name, recording.markers, loads, measured, told, *own)


def assign_plates(recording: Recording, feet: FootMarkers) -> tuple[FootLoads, tuple[str, ...]]:
    """Give every load to the foot it is under, whatever the files claim.

    A contact is a run of loaded samples on one plate, with gaps below `BRIDGED_GAP_S` bridged; contacts
    shorter than `SHORTEST_CONTACT_S` are noise. It goes to the foot whose markers' mean is nearest to its
    centre of pressure (horizontally, load-weighted). A contact that carries the feet in turn is divided,
    sample by sample; while both feet stand on one plate, as in double support on a treadmill with one belt, the
    whole load counts for the nearer one, since only the sum is known: these samples are `together`.

    Returns:
        the loads by foot, on the plates' time base, and a note for each assumption.

    Raises:
        TrialError: the recording has no force plates.
        MarkerSetError: a foot label is not among the markers.
    """
    plates = recording.plates
    if plates is None:
        why = f" that can be used: {'; '.join(recording.left_out)}" if recording.left_out else ""
        raise TrialError(
            recording.name, f"no force plates{why}; give a force file (.mot, .sto) or a C3D file with plates"
        )
    centres = [_centre(recording.markers.select(feet[foot]), plates.time) for foot in FEET]
    covered = (plates.time >= recording.markers.time[0]) & (plates.time <= recording.markers.time[-1])
    force = np.zeros((len(plates.time), 2, 3))
    moment = np.zeros_like(force)
    most, on_plate = np.zeros((len(plates.time), 2)), np.full((len(plates.time), 2), -1)
    together = np.zeros(len(plates.time), dtype=bool)
    notes: list[str] = []
    for p, name in enumerate(plates.names):
        where = f"{recording.name}: {name}"
        contacts, noise = _contacts(plates.time, plates.force[:, p, 1] > 0)
        if noise:
            notes.append(f"{where} has {noise} loads shorter than {1000 * SHORTEST_CONTACT_S:g} ms, taken as noise")
        for first, last in contacts:
            piece = slice(first, last + 1)
            nearer, contact_notes = _nearer_foot(
                where,
                plates.time[piece],
                plates.force[piece, p],
                plates.moment[piece, p],
                [centre[piece] for centre in centres],
                covered[piece],
                plates.declared_feet[p],
                0.0 if plates.corners is None else float(plates.corners[p, :, 1].mean()),
            )
            notes += contact_notes
            together[piece] |= _changing(plates.time[piece], nearer)
            for foot in range(2):
                force[piece, foot] += np.where((nearer == foot)[:, None], plates.force[piece, p], 0.0)
                moment[piece, foot] += np.where((nearer == foot)[:, None], plates.moment[piece, p], 0.0)
                vertical = np.where(nearer == foot, plates.force[piece, p, 1], 0.0)
                on_plate[piece, foot] = np.where(vertical > most[piece, foot], p, on_plate[piece, foot])
                most[piece, foot] = np.maximum(most[piece, foot], vertical)
    noise_n = max(plates.noise_n or (0.0,))
    held = _held(plates.time, on_plate)
    both = together if together.any() else None
    return FootLoads(plates.time, force, moment, plates.names, held, noise_n, both, plates.corners), tuple(notes)


def _changing(time: FloatArray, nearer: npt.NDArray[np.int_]) -> BoolArray:
    """(k,) True around the samples at which the load of one contact goes from foot to foot (k,): both are down."""
    changes = (time[1:] + time[:-1])[np.diff(nearer) != 0] / 2
    if not changes.size:
        return np.zeros(len(time), dtype=bool)
    result: BoolArray = (
        np.abs(time - changes[nearest_samples(changes, time)]) <= DOUBLE_SUPPORT_S / 2 + TIME_TOLERANCE_S
    )
    return result


def _held(time: FloatArray, on_plate: npt.NDArray[np.int_]) -> npt.NDArray[np.int_]:
    """Plates of the nearest loaded sample where a foot (k, 2) is on none; the first plate for a foot never loaded."""
    result = np.zeros_like(on_plate)
    for foot in range(2):
        loaded = np.flatnonzero(on_plate[:, foot] >= 0)
        if len(loaded) > 1:
            result[:, foot] = on_plate[loaded[nearest_samples(time[loaded], time)], foot]
    return result


def _centre(markers: Markers, time: FloatArray) -> FloatArray:
    """Horizontal middle (k, 2) m of the markers at these times, held where none is seen."""
    seen = markers.seen
    some = seen.any(axis=1)
    if not some.any():
        return np.full((len(time), 2), np.nan)
    flat = np.where(seen[:, :, None], markers.positions, 0.0)[some][:, :, [0, 2]]
    middle = flat.sum(axis=1) / seen[some].sum(axis=1)[:, None]
    return np.column_stack([np.interp(time, markers.time[some], middle[:, axis]) for axis in range(2)])


def _contacts(time: FloatArray, loaded: BoolArray) -> tuple[list[tuple[int, int]], int]:
    """First and last sample of every contact, and the number of loads that were too short to be one."""
    spans = runs(bridged(time, loaded))
    real = [
        (first, last)
        for first, last in spans
        if span_s(time, first, last) >= SHORTEST_CONTACT_S or first == 0 or last == len(time) - 1
    ]
    return real, len(spans) - len(real)


def _nearer_foot(
    where: str,
    time: FloatArray,
    force: FloatArray,
    moment: FloatArray,
    centres: Sequence[FloatArray],
    covered: BoolArray,
    declared: str | None,
    height_m: float,
) -> tuple[npt.NDArray[np.int_], list[str]]:
    """Index of the foot (k,) that each sample of one contact belongs to, and notes."""
    weight = np.where(covered, force[:, 1], 0.0)
    if not weight.any():
        return np.full(len(time), -1), []
    load = np.where(force[:, 1] > 0, force[:, 1], np.inf)
    at_height = np.column_stack((moment[:, 2] + height_m * force[:, 0], height_m * force[:, 2] - moment[:, 0]))
    pressure = at_height / load[:, None]
    distance = np.stack([np.linalg.norm(pressure - centre, axis=1) for centre in centres], axis=1)
    distance = np.where(np.isfinite(distance), distance, 1e3)
    foot = int(np.argmin(weight @ distance))
    nearest = float(weight @ distance.min(axis=1) / weight.sum())
    span = f"from {time[0]:.3f} to {time[-1]:.3f} s"
    notes = []
    if nearest > FAR_FROM_FEET_M:
        notes.append(
            f"{where} is loaded {span} at {nearest:.2f} m from the nearest foot; check that it is the person's"
        )
    nearer = np.argmin(distance, axis=1)
    active = weight > 0
    if (nearer[active] != foot).mean() >= SHARED_FRACTION:
        notes.append(
            f"{where} carries both feet in turn {span}; each sample was given to the nearer foot, and "
            f"{DOUBLE_SUPPORT_S:g} s around each change count as not measured: of both feet only the sum is known"
        )
        return nearer, notes
    if declared is not None and declared != FEET[foot]:
        notes.append(
            f"{where} is declared for the {_FOOT_NAMES[FEET.index(declared)]} foot, but {span} its load is "
            f"under the {_FOOT_NAMES[foot]} foot and was given to it"
        )
    return np.full(len(time), foot), notes


def _spans(time: FloatArray, mask: BoolArray) -> str:
    spans = [f"{start:.3f} to {end:.3f} s" for start, end in sorted(windows(time, mask))]
    more = f" and {len(spans) - _LISTED_SPANS} times more" if len(spans) > _LISTED_SPANS else ""
    return ", ".join(spans[:_LISTED_SPANS]) + more or "no frame"


def _nothing_measured(
    time: FloatArray, loads: FootLoads, contact: GroundContact, window_s: tuple[float, float] | None
) -> str:
    if window_s is not None:
        return (
            f"the window {window_s[0]:.3f} to {window_s[1]:.3f} s holds no frame with forces (they cover "
            f"{_spans(time, contact.inside)}); give a window within them"
        )
    shared = contact.ground.all(axis=1) & (contact.loaded.sum(axis=1) == 1)
    if loads.together is not None and shared.mean() > _MOSTLY_SHARED:
        return (
            f"both feet stand on one plate in {100 * shared.mean():.0f} % of the frames, and only the sum of their "
            f"forces is known; use a trial in which each foot has a plate of its own, or stands alone for a while"
        )
    feet = "; ".join(
        f"{name} foot on the ground {_spans(time, contact.ground[:, foot])}, on a plate "
        f"{_spans(time, contact.loaded[:, foot])}"
        for foot, name in enumerate(_FOOT_NAMES)
    )
    return (
        f"in no frame does every foot on the ground stand on a loaded plate ({feet}); use a trial that hits the plates"
    )
