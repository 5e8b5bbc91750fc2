"""Assigns plates to feet, and finds the frames in which all ground contact is measured.

Dynamics hold only where every foot on the ground stands on a plate that works. Both questions are answered from
the data: a load belongs to the foot that is nearest to its centre of pressure, and whether a foot without load is on
the ground follows from the heights and speeds of its markers (`kinertia.trial.ground_contact`).

A hand on a rail, a chair or a second person is not detected here; loads far from both feet are left out before.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from kinertia.errors import TrialError
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.trial.data import FEET, BoolArray, FloatArray, FootLoads, Markers, Recording, Trial
from kinertia.trial.ground_contact import FootMarkers, GroundContact, bridged, ground_contact
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, nearest_samples, runs, span_s, windows, within

SHORTEST_CONTACT_S = 0.05
"""A load within the recording that lasts less than this is noise of an unloaded plate."""

FOOT_NAMES = ("right", "left")

SHARED_FRACTION = 0.15
"""A contact that spends at least this part of its time nearer to the other foot carries both feet in turn."""

DOUBLE_SUPPORT_S = 0.2
"""Duration of double support in a slow walk, while the load of one plate passes from one foot to the other."""

_MOSTLY_SHARED = 0.5
"""Share of the frames with both feet down and one plate loaded, above which this is why nothing is measured."""
_LISTED_SPANS = 4


def build_trial(recording: Recording, feet: FootMarkers, window_s: tuple[float, float] | None = None) -> Trial:
    """Assign the loads to feet and find the frames in which all ground contact is measured.

    Args:
        recording: markers and force plates.
        feet: marker labels of each foot.
        window_s: first and last time (s) stated by the user, in place of the detected frames.

    Raises:
        TrialError: T104, fewer than two frames; P271, no force plates; P278, no frame with complete contact, nor any
            with one foot whose load is known.
        MarkerSetError: a foot label is not among the markers.
    """
    time = recording.markers.time
    if len(time) < 2:
        raise TrialError.found(recording.name, "T104", frames=Quantity(len(time), "1"))
    loads, findings = assign_plates(recording, feet)
    contact = ground_contact(recording.markers, loads, feet, recording.belt)
    complete = contact.measured(time)
    measured = complete if window_s is None else contact.inside & within(time, *window_s)
    if not measured.any() and (window_s is not None or not (contact.leg_known & contact.loaded).any()):
        raise TrialError.of(recording.name, _nothing_measured(recording, loads, contact, window_s))
    if window_s is not None:
        stated = Quantity(f"{window_s[0]:.3f} to {window_s[1]:.3f} s")
        spans = Quantity(_spans(time, complete))
        findings += (finding("P274", Where(trial=recording.name, span_s=window_s), window=stated, spans=spans),)
    return Trial(
        recording.name,
        recording.markers,
        loads,
        measured,
        recording.notes,
        recording.virtual_sd_m,
        recording.belt,
        findings,
        recording.vertical,
        recording.events,
        recording.outputs,
        contact.leg_known if window_s is None else None,
        contact.ground,
    )


def no_forces(recording: Recording) -> Finding:
    """Make the finding P271 of a recording without usable plates."""
    left_out = Quantity("; ".join(recording.left_out) or "none")
    return finding("P271", Where(trial=recording.name), left_out=left_out)


def assign_plates(recording: Recording, feet: FootMarkers) -> tuple[FootLoads, tuple[Finding, ...]]:
    """Assign every load to the foot above it, regardless of what the files declare.

    A contact is a run of loaded samples on one plate, with gaps below `BRIDGED_GAP_S` bridged; contacts
    shorter than `SHORTEST_CONTACT_S` are noise. It is assigned to the foot whose mean marker position is nearest to its
    centre of pressure (horizontally, load-weighted). A contact that carries the feet in turn is divided sample by
    sample; while both feet stand on one plate, as in double support on a treadmill with one belt, the
    whole load counts for the nearer one, since only the sum is known: these samples are `on_shared_plate`.

    What the user states (`Recording.stated_contacts`) takes precedence, sample by sample.

    Returns:
        the loads by foot, on the plates' time base, and findings: P273 short loads, P275 feet in turn, P277 declared
        for the other foot, P286 stated by the user.

    Raises:
        TrialError: P271, the recording has no force plates.
        MarkerSetError: a foot label is not among the markers.
    """
    plates = recording.plates
    if plates is None:
        raise TrialError.of(recording.name, no_forces(recording))
    centres = [_centre(recording.markers.select(feet[foot]), plates.time) for foot in FEET]
    covered = (plates.time >= recording.markers.time[0]) & (plates.time <= recording.markers.time[-1])
    force = np.zeros((len(plates.time), 2, 3))
    moment = np.zeros_like(force)
    most, on_plate = np.zeros((len(plates.time), 2)), np.full((len(plates.time), 2), -1)
    on_shared_plate = np.zeros(len(plates.time), dtype=bool)
    findings: list[Finding] = []
    for p, name in enumerate(plates.names):
        where = Where(trial=recording.name, plate=name)
        contacts, noise = _contacts(plates.time, plates.force[:, p, 1] > 0)
        if noise:
            findings.append(finding("P273", where, count=Quantity(noise, "1")))
        height_m = 0.0 if plates.corners is None else float(plates.corners[p, :, 1].mean())
        feet_of = []
        for first, last in contacts:
            piece = slice(first, last + 1)
            nearer = _nearer_foot(
                plates.force[piece, p],
                plates.moment[piece, p],
                [centre[piece] for centre in centres],
                covered[piece],
                height_m,
            )
            nearer = _as_stated(recording, name, plates.time[piece], nearer)
            feet_of.append(nearer)
            on_shared_plate[piece] |= _changing(plates.time[piece], nearer)
            for foot in range(2):
                force[piece, foot] += np.where((nearer == foot)[:, None], plates.force[piece, p], 0.0)
                moment[piece, foot] += np.where((nearer == foot)[:, None], plates.moment[piece, p], 0.0)
                vertical = np.where(nearer == foot, plates.force[piece, p, 1], 0.0)
                on_plate[piece, foot] = np.where(vertical > most[piece, foot], p, on_plate[piece, foot])
                most[piece, foot] = np.maximum(most[piece, foot], vertical)
        findings += _sorted_otherwise(where, plates.time, contacts, feet_of, plates.declared_feet[p])
    findings += _stated(recording)
    noise_n = max(plates.noise_n or (0.0,))
    held = _held(plates.time, on_plate)
    both = on_shared_plate if on_shared_plate.any() else None
    return FootLoads(plates.time, force, moment, plates.names, held, noise_n, both, plates.corners), tuple(findings)


def _as_stated(
    recording: Recording, plate: str, time: FloatArray, nearer: npt.NDArray[np.int_]
) -> npt.NDArray[np.int_]:
    """Return the feet (k,) with those that the user states for this plate; -1 for no foot."""
    result = nearer.copy()
    for contact in recording.stated_contacts:
        if contact.plate == plate:
            result[within(time, *contact.span_s)] = -1 if contact.foot is None else contact.foot
    return result


def _stated(recording: Recording) -> list[Finding]:
    """Make P286 for each load whose foot the user states."""
    time = recording.markers.time
    found = []
    for contact in recording.stated_contacts:
        span = (max(contact.span_s[0], float(time[0])), min(contact.span_s[1], float(time[-1])))
        foot = "no foot" if contact.foot is None else f"the {FOOT_NAMES[contact.foot]} foot"
        where = Where(trial=recording.name, plate=contact.plate, span_s=span)
        found.append(finding("P286", where, foot=Quantity(foot)))
    return found


def _changing(time: FloatArray, nearer: npt.NDArray[np.int_]) -> BoolArray:
    """Return the mask (k,) of samples in double support: around those at which a contact passes to the other foot."""
    changes = (time[1:] + time[:-1])[np.diff(nearer) != 0] / 2
    if not changes.size:
        return np.zeros(len(time), dtype=bool)
    result: BoolArray = (
        np.abs(time - changes[nearest_samples(changes, time)]) <= DOUBLE_SUPPORT_S / 2 + TIME_TOLERANCE_S
    )
    return result


def _held(time: FloatArray, on_plate: npt.NDArray[np.int_]) -> npt.NDArray[np.int_]:
    """Replace -1 (a foot on no plate) in (k, 2) by the plate of the nearest loaded sample.

    A foot that is never loaded gets the first plate.
    """
    result = np.zeros_like(on_plate)
    for foot in range(2):
        loaded = np.flatnonzero(on_plate[:, foot] >= 0)
        if len(loaded) > 1:
            result[:, foot] = on_plate[loaded[nearest_samples(time[loaded], time)], foot]
    return result


def _centre(markers: Markers, time: FloatArray) -> FloatArray:
    """Return the horizontal mean position (k, 2) m of the markers at these times, interpolated where none is seen."""
    seen = markers.seen
    some = seen.any(axis=1)
    if not some.any():
        return np.full((len(time), 2), np.nan)
    flat = np.where(seen[:, :, None], markers.positions, 0.0)[some][:, :, [0, 2]]
    middle = flat.sum(axis=1) / seen[some].sum(axis=1)[:, None]
    return np.column_stack([np.interp(time, markers.time[some], middle[:, axis]) for axis in range(2)])


def _contacts(time: FloatArray, loaded: BoolArray) -> tuple[list[tuple[int, int]], int]:
    """Return first and last sample of every contact, and the number of loads that were too short to be one."""
    spans = runs(bridged(time, loaded))
    real = [
        (first, last)
        for first, last in spans
        if span_s(time, first, last) >= SHORTEST_CONTACT_S or first == 0 or last == len(time) - 1
    ]
    return real, len(spans) - len(real)


def _nearer_foot(
    force: FloatArray, moment: FloatArray, centres: Sequence[FloatArray], covered: BoolArray, height_m: float
) -> npt.NDArray[np.int_]:
    """Return the index (k,) of the foot that each sample of one contact belongs to; -1 where no marker is visible."""
    weight = np.where(covered, force[:, 1], 0.0)
    if not weight.any():
        return np.full(len(force), -1)
    load = np.where(force[:, 1] > 0, force[:, 1], np.inf)
    at_height = np.column_stack((moment[:, 2] + height_m * force[:, 0], height_m * force[:, 2] - moment[:, 0]))
    pressure = at_height / load[:, None]
    distance = np.stack([np.linalg.norm(pressure - centre, axis=1) for centre in centres], axis=1)
    distance = np.where(np.isfinite(distance), distance, 1e3)
    foot = int(np.argmin(weight @ distance))
    nearer = np.argmin(distance, axis=1)
    in_turn = (nearer[weight > 0] != foot).mean() >= SHARED_FRACTION
    return nearer if in_turn else np.full(len(force), foot)


def _sorted_otherwise(
    where: Where,
    time: FloatArray,
    contacts: Sequence[tuple[int, int]],
    feet: Sequence[npt.NDArray[np.int_]],
    declared: str | None,
) -> list[Finding]:
    """Make P275 for contacts (first and last sample) that pass from foot to foot, and P277 for undeclared feet.

    P277 stands for a contact under the other foot than the file declares.
    """
    findings, other = [], []
    for (first, last), foot in zip(contacts, feet, strict=True):
        span = (float(time[first]), float(time[last]))
        if foot.min() != foot.max():
            shared = Quantity(span_s(time, first, last), "s")
            findings.append(finding("P275", replace(where, span_s=span), span_s=shared))
        elif declared is not None and foot[0] >= 0 and FEET[foot[0]] != declared:
            other.append(span)
    if declared is not None and other:
        claimed = FEET.index(declared)
        findings.append(
            finding(
                "P277",
                replace(where, span_s=(other[0][0], other[-1][1])),
                contacts=Quantity(len(other), "1"),
                declared=Quantity(FOOT_NAMES[claimed]),
                foot=Quantity(FOOT_NAMES[1 - claimed]),
            )
        )
    return findings


def _spans(time: FloatArray, mask: BoolArray) -> str:
    spans = [f"{start:.3f} to {end:.3f} s" for start, end in sorted(windows(time, mask))]
    more = f" and {len(spans) - _LISTED_SPANS} times more" if len(spans) > _LISTED_SPANS else ""
    return ", ".join(spans[:_LISTED_SPANS]) + more or "no frame"


def _nothing_measured(
    recording: Recording, loads: FootLoads, contact: GroundContact, window_s: tuple[float, float] | None
) -> Finding:
    """Make P278, with the times of forces, of feet on the ground and on plates, and of both feet on one plate."""
    time, where = recording.markers.time, Where(trial=recording.name, span_s=window_s)
    left_out = {"left_out": Quantity("; ".join(recording.left_out))} if recording.left_out else {}
    if window_s is not None:
        during = Quantity(f"from {window_s[0]:.3f} to {window_s[1]:.3f} s")
        forces = {"forces": Quantity(_spans(time, contact.inside)), "during": during, **left_out}
        return with_evidence("P278", where, forces, causes=("a window in which there are no forces",))
    both = contact.ground.all(axis=1) & (contact.loaded.sum(axis=1) == 1)
    shared = float(both.mean()) if loads.on_shared_plate is not None else 0.0
    evidence = {"shared": Quantity(shared, "1", limit=_MOSTLY_SHARED)}
    for foot, name in enumerate(FOOT_NAMES):
        evidence[f"{name}_ground"] = Quantity(_spans(time, contact.ground[:, foot]))
        evidence[f"{name}_plate"] = Quantity(_spans(time, contact.loaded[:, foot]))
    one_plate = ["both feet on one plate, which measures their sum only"] if shared > _MOSTLY_SHARED else []
    return with_evidence(
        "P278", where, evidence | left_out | {"during": Quantity("of the trial")}, causes=tuple(one_plate)
    )
