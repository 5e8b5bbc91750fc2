"""Are loads under the feet? Places and units of plates against foot markers.

On sound trials, measured in six laboratories and made by OpenSim, loads act within 40 mm of the line from heel to toe
(median over the load), and right and left are off that line by the same outwards, within 8 mm (26 mm with one plate
20 mm off).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.evidence.foot_ways import FootWay, foot_ways
from kinertia.diagnostics.evidence.load_contacts import BETWEEN_M, FAR_M, ONE_STEP_S, Contact, contacts_of, half_within
from kinertia.diagnostics.plates.exchanged_plates import exchanged_plates_trouble
from kinertia.diagnostics.plates.load_travel import load_travel_doubts
from kinertia.diagnostics.plates.turned_plates import turned_plates_trouble
from kinertia.diagnostics.timing.load_times import delay_trouble, rate_trouble
from kinertia.diagnostics.timing.other_clock import other_delay_trouble, other_rate_trouble
from kinertia.trial.data import PlateLoads, Recording
from kinertia.trial.sampled_time import span_s

_FAR_TOO_FAR_M = 5.0
_OFFSET_M = 0.03
_BEGIN_M, _END_M = -0.015, 0.06
"""There is no foot behind the marker at the back of the heel: on sound trials, from squats to forefoot runs, the first
twentieth of a load is 36 to 99 mm in front of it. The last one is at most 25 mm in front of the foremost marker, which
may be on the metatarsals."""
_BOTH_BACK_M, _BOTH_FORWARD_M = (0.02, -0.07), (0.13, 0.035)
"""Where the first twentieth of steps and their last one are both, on average, farther back, or farther forward, no way
of landing or pushing off is the reason. On nine sound trials they are 36 to 85 mm and -58 to 25 mm."""
_OUTSIDE_M, _OUTSIDE_SHARE = 0.14, 0.01
_MOSTLY = 0.5


@dataclass(frozen=True, eq=False)
class LoadPlaces:
    """Where loads and feet are.

    Attributes:
        plates: their loads.
        contacts: every load, with what it says of the feet.
        ways: of the right and the left foot.
    """

    plates: PlateLoads
    contacts: Sequence[Contact]
    ways: tuple[FootWay, FootWay]

    @classmethod
    def of(cls, recording: Recording, feet: Mapping[str, Sequence[str]]) -> LoadPlaces | None:
        """Of a motion; None without plates, or where a foot is hardly seen.

        Args:
            recording: the motion.
            feet: labels of the markers on each foot, "r" and "l".
        """
        if recording.plates is None or (ways := foot_ways(recording.markers, feet, recording.belt)) is None:
            return None
        return cls(recording.plates, contacts_of(recording.plates, ways), ways)

    def trouble(self) -> str:
        """Why loads cannot be those of these feet at this time; empty where they can."""
        if not self.contacts:
            return ""
        return (
            _unit_trouble(self.plates, self.contacts)
            or other_rate_trouble(self.plates, self.contacts, self.ways)
            or rate_trouble(self.plates, self.contacts, self.ways)
            or exchanged_plates_trouble(self.plates, self.contacts, self.ways)
            or delay_trouble(self.plates, self.contacts, self.ways)
            or turned_plates_trouble(self.plates, self.contacts, self.ways)
            or other_delay_trouble(self.plates, self.contacts, self.ways)
            or _place_trouble(self.contacts)
        )

    def doubts(self) -> list[str]:
        """Loads that do not travel along their foot, offsets of all plates together, and loads that belong to both
        feet, if `trouble` found nothing.
        """
        if travel := load_travel_doubts(self.plates, self.contacts, self.ways):
            return travel
        doubts = [_offset_doubt(self.contacts), _both_feet_doubt(self.plates, self.contacts, self.ways)]
        return [one for one in doubts if one]


def _unit_trouble(plates: PlateLoads, contacts: Sequence[Contact]) -> str:
    """Plates whose loads are all out of the laboratory: one alone, where each has columns of its own."""
    nearest: dict[int, float] = {}
    for contact in contacts:
        nearest[contact.plate] = min(half_within(contact), nearest.get(contact.plate, np.inf))
    far = [p for p, distance in nearest.items() if distance >= _FAR_TOO_FAR_M]
    if not far:
        return ""
    near = len(nearest) - len(far)
    which = f" of {' and '.join(plates.names[p] for p in far)}" if near else ""
    others = ", and those of the other plates are not" if near else ""
    return (
        f"the points{which} at which the forces act are {min(nearest[p] for p in far):.3g} m away from the feet{others}"
        ": they are in mm, or in other axes than the markers, or torques are in N mm; export points in m and torques "
        "in N m"
    )


def _place_trouble(contacts: Sequence[Contact]) -> str:
    """Loads that are under no foot."""
    # a load of both feet is under neither (`_both_feet_doubt`)
    far = [(one, half_within(one)) for one in contacts if not one.between]
    off = [(one, distance) for one, distance in far if distance > FAR_M]
    if not off or len(off) < len(far) / 2:
        return ""
    offsets = np.array([one.off_own_m for one, _ in far])
    mean = offsets.mean(axis=0)
    if np.abs(offsets - mean).max() < FAR_M / 2:
        return (
            f"all centres of pressure are off the feet by {1e3 * mean[0]:+.0f} mm along X and {1e3 * mean[1]:+.0f} mm "
            "along Z: cameras and plates have different origins (moved, or calibrated anew); correct the places of "
            "the plates"
        )
    return (
        f"centres of pressure are {1e3 * off[0][1]:.0f} mm away from the nearest foot: the forces are of another "
        "trial, or the axes or places of the plates are wrong; give the forces of this trial, or correct the plates"
    )


def _offset_doubt(contacts: Sequence[Contact]) -> str:
    """Right and left are off in the same direction of the laboratory."""
    means = [[one.off_own_m for one in contacts if one.foot == foot] for foot in range(2)]
    if not all(means):
        return ""
    mean = (np.mean(means[0], axis=0) + np.mean(means[1], axis=0)) / 2
    if np.linalg.norm(mean) <= _OFFSET_M:
        return _ends_doubt(contacts)
    return (
        f"centres of pressure of both feet are off the line from heel to toe by {1e3 * mean[0]:+.0f} mm along X and "
        f"{1e3 * mean[1]:+.0f} mm along Z: cameras and plates have different origins, or all plates are off; check the "
        f"places of the plates with a pole or by standing on a marker"
    )


def _ends_doubt(contacts: Sequence[Contact]) -> str:
    """Loads that begin behind the heel or end in front of the toes: what an offset along the foot does first."""
    # of two contacts both, lest a second foot on one plate counts
    ends = np.sort([one.ends_m for one in contacts], axis=0)
    behind, before = float(ends[len(ends) // 2, 0]), float(ends[(len(ends) - 1) // 2, 1])
    steps = [one.ends_m for one in contacts if np.isfinite(one.end_s - one.start_s)]
    if behind < _BEGIN_M:
        where = f"begin {-1e3 * behind:.0f} mm behind the heels' markers (usual are 35 to 100 mm in front of them)"
    elif before > _END_M:
        where = f"end {1e3 * before:.0f} mm in front of the foremost markers of the feet (usual are 25 at most)"
    elif steps and _shifted(first := float(np.mean(steps, axis=0)[0]), last := float(np.mean(steps, axis=0)[1])):
        where = (
            f"begin {1e3 * first:.0f} mm in front of the heels' markers and end {1e3 * last:+.0f} mm from the foremost "
            "markers of the feet (usual are 35 to 100 mm, and -60 to +25 mm)"
        )
    else:
        return ""
    return (
        f"centres of pressure {where}, of {len(contacts)} contacts: cameras and plates have different origins, "
        "or all plates are off along the walk; check the places of the plates with a pole or by standing on a marker"
    )


def _shifted(first_m: float, last_m: float) -> bool:
    """Whether steps both begin and end too far back, or too far forward."""
    (first_back, last_back), (first_forward, last_forward) = _BOTH_BACK_M, _BOTH_FORWARD_M
    return (first_m < first_back and last_m < last_back) or (first_m > first_forward and last_m > last_forward)


def _both_feet_doubt(plates: PlateLoads, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> str:
    """A load between the feet: both are on the plate, but only the sum of what they do is known. A foot that swings by
    its markers is on none.
    """
    spans = []
    for contact in contacts:
        distance = np.linalg.norm(contact.off_m, axis=2)
        between = (distance > BETWEEN_M).all(axis=0) & (np.prod(contact.off_m, axis=0).sum(axis=1) < 0)
        away = between | (distance[contact.foot] > _OUTSIDE_M)
        # on a treadmill's single belt the feet come in turn, and each sample is sorted (`plate_assignment`)
        if span_s(contact.time) > ONE_STEP_S:
            away = between
        away &= ways[1 - contact.foot].standing(contact.time)
        share = float(contact.weight[away].sum() / contact.weight.sum())
        if share > (_MOSTLY if span_s(contact.time) > ONE_STEP_S else _OUTSIDE_SHARE):
            when = contact.time[away]
            spans.append(f"{plates.names[contact.plate]} from {when[0]:.3f} to {when[-1]:.3f} s")
    if not spans:
        return ""
    return (
        f"the centre of pressure leaves the foot that stands on the plate: both feet are on it ({', '.join(spans)}), "
        "and what each does is not known; use a trial with one foot on each plate, or give a window without that time "
        "(window_s)"
    )
