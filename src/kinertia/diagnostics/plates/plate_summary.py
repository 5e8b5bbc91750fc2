"""What can be said of force plates before any model: who stands on them and when, and whether they fit the scale.

The mean vertical force over whole strides is body weight: the body's vertical velocity is the same at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.evidence.strides import periods
from kinertia.diagnostics.plates.cop_on_plate import off_plate
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.trial.data import FEET, BoolArray, FloatArray, FootLoads, Recording, Trial
from kinertia.trial.ground_contact import FootMarkers, bridged
from kinertia.trial.plate_assignment import SHORTEST_CONTACT_S, assign_plates
from kinertia.trial.sampled_time import runs

_FOOT_NAMES = {"r": "right", "l": "left", None: "unknown foot"}
_LISTED = 4
_LONG_WINDOW_S = 2.0
"""A window without any step may stand for whole strides from this length on."""


@dataclass(frozen=True)
class Contact:
    """One foot (None where the markers do not tell which) on one plate."""

    foot: str | None
    start_s: float
    end_s: float


@dataclass(frozen=True)
class PlateCheck:
    """One plate.

    Attributes:
        name: as the recording has it.
        declared: the foot that the file claims, or None.
        peak_n: largest vertical force.
        contacts: in the order of time.
        outside_share: share of the firmly loaded samples whose centre of pressure is off the plate; None where the file
            has no corners or nothing is loaded.
        outside_m: how far off, 95th percentile of those samples; 0 where none is.
    """

    name: str
    declared: str | None
    peak_n: float
    contacts: tuple[Contact, ...]
    outside_share: float | None
    outside_m: float

    def stood_on(self) -> str:
        """Which foot when, in words; of many contacts their number."""
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


@dataclass(frozen=True)
class ForceMass:
    """Body mass by the mean vertical force over a time; `over` says what that time spans ("whole strides")."""

    mass_kg: float
    start_s: float
    end_s: float
    over: str


def check_plates(recording: Recording, feet: FootMarkers | None) -> tuple[PlateCheck, ...]:
    """Every plate of a recording; without foot markers the contacts are nobody's."""
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
    share, distance = off_plate(plates, p) or (None, 0.0)
    ordered = tuple(sorted(contacts, key=lambda contact: contact.start_s))
    return PlateCheck(plates.names[p], plates.declared_feet[p], float(vertical.max()), ordered, share, distance)


def _contacts(time: FloatArray, loaded: BoolArray, foot: str | None) -> list[Contact]:
    spans = [(float(time[first]), float(time[last])) for first, last in runs(bridged(time, loaded))]
    return [Contact(foot, start, end) for start, end in spans if end - start >= SHORTEST_CONTACT_S]


def mass_by_strides(trial: Trial, standing: bool = False) -> ForceMass | None:
    """Body mass by the mean vertical force over whole strides in the middle of the longest measured window, on a single
    belt of the longest in which both feet's together is known: of several plates a drifting zero looks like a foot.

    Landings and leavings of one foot are a stride apart (or several, where steps missed the plates), those of opposite
    feet a step; where one foot never touches the ground, they are hops. Gait repeats itself, so that the strides may
    begin anywhere. One who stands, or takes no step in `_LONG_WINDOW_S` or longer, is weighed over the whole window.
    None where the window holds nothing of these: one who jumps is faster at one end of it than at the other.
    """
    if not trial.measured.any():
        return None
    start, end = (trial.carried_windows() if len(trial.loads.plates) == 1 else trial.windows())[0]
    strides, steps = periods(trial.loads)
    fitting = [period for period in strides if period <= end - start]
    stepping = [period for period in steps if period <= end - start]
    if standing:
        span, over = end - start, "the whole time"
    elif not strides and not steps and end - start >= _LONG_WINDOW_S and not _in_the_air(trial.loads, start, end):
        span, over = end - start, "the whole window, without a step"
    elif fitting:
        span, over = max(fitting), "whole strides"
    elif stepping:
        step = float(np.median(stepping))
        span, over = (2 * step, "two steps") if 2 * step <= end - start else (step, "one step")
    else:
        return None
    first, last = (start + end - span) / 2, (start + end + span) / 2
    inside = (trial.loads.time >= first - 1e-9) & (trial.loads.time <= last + 1e-9)
    vertical = trial.loads.force[inside, :, 1]
    if over == "whole strides" and not vertical.any(axis=0).all():
        over = "whole hops"
    mean = float(vertical.sum(axis=1).mean())
    return ForceMass(mean / GRAVITY_M_S2, first, last, over)


def _in_the_air(loads: FootLoads, start_s: float, end_s: float) -> bool:
    """Whether no plate is loaded at some time."""
    inside = (loads.time >= start_s) & (loads.time <= end_s)
    return not bridged(loads.time, loads.force[:, :, 1].sum(axis=1) > 0)[inside].all()
