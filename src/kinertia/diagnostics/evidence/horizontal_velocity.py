"""Computes the body's velocity from its markers and from the horizontal forces, and whether these brake first."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.evidence.body_centre import body_centre
from kinertia.diagnostics.evidence.plate_contacts import loads_on
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.smoothing import SmoothingError, smooth
from kinertia.trial.data import FloatArray, PlateLoads, Trial
from kinertia.trial.foot_motion import AROUND_LOAD_S
from kinertia.trial.marker_quality import Travel
from kinertia.trial.sampled_data import span_s, within

_PELVIS_HZ = 6.0
LEAST_WINDOW_S, _LEAST_SPECIFIC = 0.4, 0.2
LEAST_CHANGE_M_S, _FOLLOWS = 0.02, 0.7
"""Velocities whose changes have a smaller standard deviation carry no information on forces."""


@dataclass(frozen=True, eq=False)
class ForceVelocity:
    """Velocities (n, 3) m/s over (n,) s of the pelvis, of the marker-based centre, and of a body of this mass under the
    measured forces.
    """

    time: FloatArray
    pelvis: FloatArray
    centre: FloatArray
    by_forces: FloatArray
    mass_kg: float

    def cut(self, start_s: float, end_s: float) -> "ForceVelocity":
        """Return the part with start_s <= time <= end_s."""
        inside = within(self.time, start_s, end_s)
        pelvis, centre, by_forces = (each[inside] for each in (self.pelvis, self.centre, self.by_forces))
        return ForceVelocity(self.time[inside], pelvis, centre, by_forces, self.mass_kg)

    def by(self, time: FloatArray, force: FloatArray) -> FloatArray:
        """Return the velocity (n,) m/s that a force (k,) N over time (k,) s gives this mass."""
        force = np.interp(self.time, time, force)
        impulse = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(self.time))
        return np.concatenate(([0.0], impulse)) / self.mass_kg


@dataclass(frozen=True, eq=False)
class VelocityChanges:
    """Velocities (n, 3) m/s of all windows, one after the other, each without its linear trend."""

    pelvis: FloatArray
    centre: FloatArray
    by_forces: FloatArray

    @classmethod
    def of(cls, parts: Sequence[ForceVelocity]) -> "VelocityChanges":
        """Join the velocities of these windows."""
        pelvis, centre, by_forces = (
            joined_without_trend(parts, [getattr(part, name) for part in parts])
            for name in ("pelvis", "centre", "by_forces")
        )
        return cls(pelvis, centre, by_forces)

    def vertical_ratio(self, shown: FloatArray) -> float | None:
        """Return the ratio of the force-derived vertical velocity to the one shown (n, 3); None where the two do not
        correlate.
        """
        up, by_forces = shown[:, 1], self.by_forces[:, 1]
        if min(up.std(), by_forces.std()) < LEAST_CHANGE_M_S or np.corrcoef(up, by_forces)[0, 1] < _FOLLOWS:
            return None
        return float((up * by_forces).sum() / (up * up).sum())


def without_trend(time: FloatArray, values: FloatArray) -> FloatArray:
    """Return values (n,) or (n, k) over times (n,) s, less the straight line fitted to each column."""
    after = time - time.mean()
    slope, level = np.polyfit(after, values, 1)
    result: FloatArray = values - np.multiply.outer(after, slope) - level
    return result


def joined_without_trend(parts: Sequence[ForceVelocity], values: Sequence[FloatArray]) -> FloatArray:
    """Join values (n,) or (n, k) of all windows, each without its linear trend."""
    return np.concatenate([without_trend(part.time, each) for part, each in zip(parts, values, strict=True)])


def force_velocities(trial: Trial, owners: Mapping[str, str]) -> list[ForceVelocity]:
    """Compute body velocities in every long enough window in which the total force is known."""
    windows = trial.total_force_windows()
    if not windows:
        return []
    markers = trial.markers.cut(
        min(start for start, _ in windows) - AROUND_LOAD_S, max(end for _, end in windows) + AROUND_LOAD_S
    )
    worn = [label for label in markers.labels if owners.get(label) == "pelvis"]
    whole = body_centre(owners, markers)
    if not worn or whole is None:
        return []
    place = markers.select(worn).positions.mean(axis=1)
    seen = np.isfinite(place).all(axis=1)
    if not seen.any():
        return []
    try:
        pelvis_m, centre_m = (smooth(markers.time[seen], part[seen], _PELVIS_HZ) for part in (place, whole))
    except SmoothingError:
        return []
    first, last = markers.time[seen][[0, -1]]
    parts = []
    for start, end in windows:
        inside = within(trial.loads.time, max(start, first), min(end, last))
        time, force = trial.loads.time[inside], trial.loads.force[inside].sum(axis=1)
        if len(time) < 10 or span_s(time) < LEAST_WINDOW_S or not force[:, 1].mean() > 0:
            continue
        centre = centre_m(time, 1)
        # a person who lands, or jumps off, is faster upwards at the end
        specific = GRAVITY_M_S2 + float(centre[-1, 1] - centre[0, 1]) / span_s(time)
        if specific < _LEAST_SPECIFIC * GRAVITY_M_S2:
            continue
        mass_kg = float(force[:, 1].mean()) / specific
        impulse = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(time)[:, None], axis=0)
        by_forces = np.concatenate((np.zeros((1, 3)), impulse)) / mass_kg
        parts.append(ForceVelocity(time, pelvis_m(time, 1), centre, by_forces, mass_kg))
    return parts


def push_share(plates: PlateLoads, p: int, travel: Travel) -> float | None:
    """Return by how much larger the mean force along the walk is in the second half of the loads on plate `p` than in
    the first, over the mean vertical force: 0.08 to 0.31 in 12 people, negative where it is reversed. None without
    travel or load.
    """
    if travel.kind != "walks":
        return None
    direction = np.radians(travel.direction_deg)
    forwards = np.array([np.cos(direction), 0.0, -np.sin(direction)])
    shares = [_push_share(plates.force[first : last + 1, p], forwards) for first, last in loads_on(plates, p)]
    return float(np.mean(shares)) if shares else None


def _push_share(force: FloatArray, forwards: FloatArray) -> float:
    along = force @ forwards
    half = len(along) // 2
    return float((along[half:].mean() - along[:half].mean()) / force[:, 1].mean())
