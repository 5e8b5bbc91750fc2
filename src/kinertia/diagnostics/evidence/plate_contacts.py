"""Pairs loads on plates with the feet near them, and measures how well they fit in place and time.

Each explanation of a misfit (another rate, a delay, plates interchanged, rotated or displaced) is judged by how well
the loads fit once it is undone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.findings.finding import Finding
from kinertia.findings.quantity import Limit
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads
from kinertia.trial.foot_motion import AROUND_LOAD_S
from kinertia.trial.ground_contact import bridged, centre_of_pressure
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, runs, span_s

COP_MIN_FORCE_N = 5 * LOAD_THRESHOLD_N
CONTACT_FORCE_N, SHORTEST_S = 50.0, 0.15
FAR_M = Limit(0.15, "m")
"""A load that is farther from both feet than this, for half of it, is under neither."""
ONE_STEP_S = 1.5
"""Longest load of a single step; longer ones are of both feet, in turn (walking on one belt) or at once (squats)."""
BETWEEN_M = 0.08
"""Distance from both feet beyond which most of a load of both at once (squats) lies, between them."""
_MOSTLY_NEAR, _LEAST_SHARE = 0.7, 0.2
"""While one foot takes over from the other, the load is under neither."""
END_SHARE = 0.05
_FITS_S, FITS_M = 0.03, 0.08
"""On fault-free trials loads begin and end within 25 ms of foot contact and foot off (RMS over all that the trial
shows), under the foot."""
_FEWEST_EDGES = 3
Feet = tuple[FootTrajectory, FootTrajectory]


@dataclass(frozen=True, eq=False)
class PlateContact:
    """One load on one plate.

    Attributes:
        plate: index of the plate.
        start_s, end_s: when the load is above `CONTACT_FORCE_N`; NaN for an end that the trial does not show.
        foot: the foot under which the load mostly is, 0 right, 1 left.
        trajectory: of that foot.
        weight: (k,) N, vertical force where it is reliable and the foot is visible.
        time: (k,) s.
        place: (k, 2) m, centre of pressure.
        offset_m: (2, k, 2) m, horizontally from each foot to the centre of pressure.
    """

    plate: int
    start_s: float
    end_s: float
    foot: int
    trajectory: FootTrajectory
    weight: FloatArray
    time: FloatArray
    place: FloatArray
    offset_m: FloatArray

    @property
    def is_step(self) -> bool:
        """Whether the trial shows the whole load and it lasts no longer than a step."""
        return 0.0 < round(self.end_s - self.start_s, 6) < ONE_STEP_S

    @property
    def in_turn(self) -> bool:
        """Whether the load passes from one foot to the other: steps on one long plate, or on a treadmill's belt."""
        distance = np.linalg.norm(self.offset_m, axis=2)
        of_right = float(self.weight[distance[0] < distance[1]].sum() / self.weight.sum())
        near = _quantile(distance.min(axis=0), self.weight, _MOSTLY_NEAR) < FAR_M / 2
        return near and _LEAST_SHARE < of_right < 1.0 - _LEAST_SHARE

    @property
    def between(self) -> bool:
        """Whether most of the load is between the feet, under neither: both stand on the plate."""
        opposite = np.prod(self.offset_m, axis=0).sum(axis=1) < 0
        apart = (np.linalg.norm(self.offset_m, axis=2) > BETWEEN_M).all(axis=0) & opposite
        return bool(self.weight[apart].sum() > self.weight.sum() / 2)

    @property
    def distance_m(self) -> float:
        """Median distance (m) of the load from the nearer foot."""
        return _quantile(np.minimum(*_length(self.offset_m)), self.weight, 0.5)

    @property
    def own_offset_m(self) -> FloatArray:
        """Mean offset (2,) m of the load from its foot along X and Z."""
        result: FloatArray = self.weight @ self.offset_m[self.foot] / self.weight.sum()
        return result

    @cached_property
    def ends_m(self) -> tuple[float, float]:
        """How far the first twentieth of the load is in front of the heel, and the last one in front of the toes."""
        of_heel, of_toes = self.trajectory.beyond(self.time, self.place)
        return _quantile(of_heel, self.weight, END_SHARE), _quantile(of_toes, self.weight, 1 - END_SHARE)

    def ahead_m(self, shares: Sequence[float]) -> FloatArray:
        """Return how far (k,) m in front of the heel loads act once these shares of the whole have acted."""
        acted = np.cumsum(self.weight) / self.weight.sum()
        return np.asarray(np.interp(shares, acted, self.trajectory.beyond(self.time, self.place)[0]))


def contacts_of(
    plates: PlateLoads, feet: tuple[FootTrajectory, FootTrajectory], point: FloatArray | None = None
) -> list[PlateContact]:
    """Find loads of at least `SHORTEST_S` while markers are visible, except those whose foot is mostly hidden.

    `point` is their `cop_horizontal`, where it is known.
    """
    first_s, last_s = feet[0].time[0] - TIME_TOLERANCE_S, feet[0].time[-1] + TIME_TOLERANCE_S
    point = cop_horizontal(plates) if point is None else point
    contacts = []
    for p in range(len(plates.names)):
        vertical = plates.force[:, p, 1]
        for first, last in loads_on(plates, p):
            start, end = float(plates.time[first]), float(plates.time[last])
            rows = np.arange(first, last + 1)
            time = plates.time[rows]
            rows = rows[(vertical[rows] > COP_MIN_FORCE_N) & (time >= first_s) & (time <= last_s)]
            if len(rows) < 3:
                continue
            off = np.stack([trajectory.offset_m(plates.time[rows], point[rows, p]) for trajectory in feet])
            near = [float(vertical[rows] @ _length(offset_m)) for offset_m in off]
            foot = int(np.argmin(near))
            seen = feet[foot].seen(plates.time[rows])
            if vertical[rows][seen].sum() < vertical[rows].sum() / 2:
                continue
            rows, off = rows[seen], off[:, seen]
            weight, time, place = vertical[rows], plates.time[rows], point[rows, p]
            begins, ends = first > 0 and start > first_s, last < len(plates.time) - 1 and end < last_s
            begin_s, end_s = start if begins else np.nan, end if ends else np.nan
            contacts.append(PlateContact(p, begin_s, end_s, foot, feet[foot], weight, time, place, off))
    return contacts


def loads_on(plates: PlateLoads, p: int) -> list[tuple[int, int]]:
    """Return the first and last sample of every load of at least `SHORTEST_S` on plate `p`."""
    loaded = runs(bridged(plates.time, plates.force[:, p, 1] > CONTACT_FORCE_N))
    return [(first, last) for first, last in loaded if span_s(plates.time, first, last) >= SHORTEST_S]


def contact_span_s(plates: PlateLoads) -> tuple[float, float] | None:
    """Find the first and last time (s) of the part used with loads on plates; None where no one steps on them.

    Before and after it people come and go: feet leave the cameras' view or markers are lost, which does not matter.
    """
    loads = [load for p in range(len(plates.names)) for load in loads_on(plates, p)]
    if not loads:
        return None
    first, last = min(load[0] for load in loads), max(load[1] for load in loads)
    return float(plates.time[first]) - AROUND_LOAD_S, float(plates.time[last]) + AROUND_LOAD_S


def cop_horizontal(plates: PlateLoads) -> FloatArray:
    """Return centres of pressure (k, p, 2) m (x, z), at the plates' height where it is known."""
    height = 0.0 if plates.corners is None else plates.corners[:, :, 1].mean(axis=1)[None, :, None]
    force, moment = plates.force, plates.moment
    lifted = moment - np.cross(np.array([0.0, 1.0, 0.0]) * height, force)
    return centre_of_pressure(np.concatenate([force, lifted], axis=2))[..., [0, 2]]


def displaced(plates: PlateLoads, by_m: FloatArray) -> PlateLoads:
    """Return the plates with centres of pressure displaced by `by_m` (x, z), which broadcasts to (k, p, 2)."""
    by = np.broadcast_to(by_m, (*plates.force.shape[:2], 2))
    lever = np.stack([by[..., 0], np.zeros(by.shape[:2]), by[..., 1]], axis=-1)
    return replace(plates, moment=plates.moment + np.cross(lever, plates.force))


def _length(offset: FloatArray) -> FloatArray:
    """Return the lengths (...) of vectors (..., 2), in less time than `np.linalg.norm`."""
    return np.sqrt(offset[..., 0] ** 2 + offset[..., 1] ** 2)


def _quantile(values: FloatArray, weight: FloatArray, share: float) -> float:
    """Return the weighted quantile: the value below which this share of the weight lies."""
    order = np.argsort(values)
    passed = np.cumsum(weight[order]) / weight.sum()
    return float(values[order][min(int(np.searchsorted(passed, share)), len(order) - 1)])


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
        return cls(rms_s, max((contact.distance_m for contact in contacts), default=np.inf))

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
            np.sqrt(np.average(np.square(contact.place - expected).sum(axis=1), weights=contact.weight))
            for contact in contacts
            if contact.is_step
            for expected in (feet[contact.foot].expected_cop(contact.time, contact.weight),)
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
