"""Measures how well loads fit the feet: whether they act under them, and begin and end when the feet do.

Each explanation of a misfit (another rate, a delay, plates interchanged, rotated or displaced) is judged by how well
the loads fit once it is undone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.diagnostics.evidence.plate_contacts import PlateContact, contacts_of
from kinertia.findings.finding import Finding
from kinertia.trial.data import PlateLoads

_FITS_S, FITS_M = 0.03, 0.08
"""On fault-free trials loads begin and end within 25 ms of foot contact and foot off (RMS over all that the trial
shows), under the foot."""
_FEWEST_EDGES = 3

Feet = tuple[FootTrajectory, FootTrajectory]


@dataclass(frozen=True)
class ContactFit:
    """Agreement of the loads on plates with the feet, in time and place.

    Attributes:
        delay_rms_s: RMS delay of the beginning and end of loads from foot contact and foot off; infinite where too few
            are known.
        far_m: distance from the feet of the load that is farthest from them.
    """

    delay_rms_s: float
    far_m: float

    @classmethod
    def of(cls, contacts: Sequence[PlateContact], feet: Feet) -> Self:
        """Compute the agreement over all contacts of a trial."""
        delays = [delay for contact in contacts for delay in _delays(contact, feet[contact.foot])]
        enough = len(delays) >= _FEWEST_EDGES
        rms_s = float(np.sqrt(np.mean(np.square(delays)))) if enough else np.inf
        return cls(rms_s, max((one.distance_m for one in contacts), default=np.inf))

    @property
    def fits(self) -> bool:
        """Whether loads and feet agree as well as on fault-free trials."""
        return self.delay_rms_s < _FITS_S and self.far_m < FITS_M

    @property
    def misfit(self) -> float:
        """Ratio of delay or distance to the limit of fault-free trials, the larger one; 1 where both are within it."""
        known_s = self.delay_rms_s if np.isfinite(self.delay_rms_s) else 0.0
        return max(1.0, known_s / _FITS_S, self.far_m / FITS_M)


class Hypothesis(NamedTuple):
    """One explanation of loads that do not fit the feet: its finding, and the loads with the fault undone (None where
    nothing undoes it).
    """

    finding: Finding
    corrected: PlateLoads | None

    def misfit(self, feet: Feet) -> tuple[float, float]:
        """Return the `ContactFit.misfit` of the corrected loads, and to the centimetre how far the worst step is from
        its expected centre of pressure (m, RMS), which ranks what fits; infinite without corrected loads, the
        second also without steps."""
        if self.corrected is None:
            return np.inf, np.inf
        contacts = contacts_of(self.corrected, feet)
        off_m = [
            np.sqrt(np.average(np.square(one.place - expected).sum(axis=1), weights=one.weight))
            for one in contacts
            if one.is_step
            for expected in (feet[one.foot].expected_cop(one.time, one.weight),)
        ]
        return ContactFit.of(contacts, feet).misfit, round(float(max(off_m, default=np.inf)), 2)


def _delays(contact: PlateContact, foot: FootTrajectory) -> list[float]:
    """Return the delays (s) of the start and the end of a load, where both the load and the stance phase show them."""
    start, end = contact.time[0], contact.time[-1]
    overlaps = [(min(end, last) - max(start, first), first, last) for first, last, _ in foot.stance_spans]
    if not overlaps or max(overlaps)[0] <= 0:
        # a load while the foot swings has no stance phase to compare with: its whole duration is the error
        return [float(end - start)]
    _, first, last = max(overlaps)
    delays = []
    if first > foot.time[0] and np.isfinite(contact.start_s):
        delays.append(contact.start_s - first)
    if last < foot.time[-1] and np.isfinite(contact.end_s):
        delays.append(contact.end_s - last)
    return [float(delay) for delay in delays]
