"""Summarises each force plate before any model: who stands on it and when."""

from dataclasses import dataclass, replace

from kinertia.diagnostics.plates.cop_path import off_plate
from kinertia.trial.data import FEET, BoolArray, FloatArray, Recording
from kinertia.trial.ground_contact import FootMarkers, bridged
from kinertia.trial.plate_assignment import SHORTEST_CONTACT_S, assign_plates
from kinertia.trial.sampled_data import runs

_FOOT_NAMES = {"r": "right", "l": "left", None: "unknown foot"}
_LISTED = 4


@dataclass(frozen=True)
class Contact:
    """Contact of one foot (None where the markers do not show which) with one plate."""

    foot: str | None
    start_s: float
    end_s: float


@dataclass(frozen=True)
class PlateCheck:
    """Summary of one force plate: its peak and who stands on it when.

    Attributes:
        name: as the recording has it.
        peak_n: largest vertical force.
        contacts: in the order of time.
        outside_share: share of reliably loaded samples whose centre of pressure is off the plate; None where the file
            has no corners or nothing is loaded.
    """

    name: str
    peak_n: float
    contacts: tuple[Contact, ...]
    outside_share: float | None

    def stood_on(self) -> str:
        """Describe which foot was on the plate when; of many contacts, their number."""
        if not self.contacts:
            return "none"
        phrases = []
        for foot in dict.fromkeys(contact.foot for contact in self.contacts):
            spans = [(contact.start_s, contact.end_s) for contact in self.contacts if contact.foot == foot]
            listed = ", ".join(f"{start:.2f}-{end:.2f}" for start, end in spans)
            if len(spans) > _LISTED:
                listed = f"{len(spans)} contacts, {spans[0][0]:.2f}-{spans[-1][1]:.2f}"
            phrases.append(f"{_FOOT_NAMES[foot]} {listed} s")
        return "; ".join(phrases)


def check_plates(recording: Recording, feet: FootMarkers | None) -> tuple[PlateCheck, ...]:
    """Summarise every plate of a recording; without foot markers the contacts have no foot."""
    if recording.plates is None:
        return ()
    return tuple(_check_plate(recording, p, feet) for p in range(len(recording.plates.names)))


def _check_plate(recording: Recording, p: int, feet: FootMarkers | None) -> PlateCheck:
    plates = recording.plates
    assert plates is not None
    vertical = plates.force[:, p, 1]
    if feet is None:
        contacts = _contacts(plates.time, vertical > 0, None)
    else:
        alone = replace(
            plates,
            names=plates.names[p : p + 1],
            force=plates.force[:, p : p + 1],
            moment=plates.moment[:, p : p + 1],
            declared_feet=plates.declared_feet[p : p + 1],
            corners=None,
        )
        loads = assign_plates(replace(recording, plates=alone), feet)[0]
        contacts = [
            contact
            for foot, name in enumerate(FEET)
            for contact in _contacts(loads.time, loads.force[:, foot, 1] > 0, name)
        ]
    share, _ = off_plate(plates, p) or (None, 0.0)
    ordered = tuple(sorted(contacts, key=lambda contact: contact.start_s))
    return PlateCheck(plates.names[p], float(vertical.max()), ordered, share)


def _contacts(time: FloatArray, loaded: BoolArray, foot: str | None) -> list[Contact]:
    spans = [(float(time[first]), float(time[last])) for first, last in runs(bridged(time, loaded))]
    return [Contact(foot, start, end) for start, end in spans if end - start >= SHORTEST_CONTACT_S]
