"""Computes the body's velocity and vertical acceleration from its markers and from the forces, and compares the two.

Vertical velocities tell these apart within two steps: a delay shifts them, a wrong rate shifts the last more than the
first, and a wrong gain of one plate adds to them whenever that plate is stood on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.diagnostics.evidence.landmarks import body_centre
from kinertia.diagnostics.evidence.plate_contacts import loads_on
from kinertia.findings.quantity import Limit, Quantity
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.smoothing import SmoothingError, smooth
from kinertia.trial.data import FloatArray, PlateLoads, Trial
from kinertia.trial.foot_motion import AROUND_LOAD_S
from kinertia.trial.marker_quality import Travel
from kinertia.trial.sampled_data import span_s, within

_PELVIS_HZ = 6.0
NEAR_END_S, LONG_WINDOW_S = 0.1, 1.3
"""So near to the ends of the recording velocities by markers are uncertain, which matters in windows shorter than the
second. Half of the first is left out of these."""
LEAST_WINDOW_S, _LEAST_SPECIFIC = 0.4, 0.2
LEAST_CHANGE_M_S, _FOLLOWS = 0.02, 0.7
"""Velocities whose changes have a smaller standard deviation carry no information on forces."""
HORIZONTAL = (0, 2)
"""Ground axes X and Z."""
DISTINGUISHABLE = 0.5
"""Across the walk a foot pushes to one side all the time: with the wrong sign it looks like another zero. On nine
trials what is true leaves 0.1 to 0.66 of what the other would, in one walk 0.7 to 1.7."""
MOST_ZERO_N = 25.0
"""Plates whose zeros are wrong by more show it while they are unloaded."""
CLEARLY_BEST = Limit(0.85)
"""A fault is identified where undoing it leaves less than this share of what undoing any other leaves."""
LARGEST_RESIDUAL = 0.22
"""Largest residual of a delay; a larger one has another fault as its reason."""
_STEPS = 5


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
        pelvis, centre, by_forces = (velocity[inside] for velocity in (self.pelvis, self.centre, self.by_forces))
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
    return np.concatenate([without_trend(part.time, series) for part, series in zip(parts, values, strict=True)])


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
        beside_s = NEAR_END_S / 2.0 if end - start < LONG_WINDOW_S else 0.0
        inside = within(trial.loads.time, max(start, first + beside_s), min(end, last - beside_s))
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


@dataclass(frozen=True)
class Scaled:
    """Gain error of one plate, or of all (None): its reading is `factor` times the truth; residual (m/s) without it."""

    plate: int | None
    factor: float
    residual: float


@dataclass(frozen=True, eq=False)
class VelocityResidual:
    """RMS difference (m/s) along one axis between the force-derived and the body's velocity, as recorded and with each
    supposed fault undone.

    Attributes:
        as_read: residual of the forces as recorded.
        all_reversed: residual if all plates have the wrong sign.
        without_trend: residual if all plates have the same zero offset.
        plate_reversed, plate_zeroed: (p,) residuals if one plate has the wrong sign, or a zero offset.
        zero_offset_n: (p,) N, that zero offset.
        all_zeroed: residual if every plate has a zero offset of its own; as read where one would exceed `MOST_ZERO_N`.
        scaled: residuals if all plates, or one, have a gain error.
    """

    as_read: float
    all_reversed: float
    without_trend: float
    plate_reversed: FloatArray
    plate_zeroed: FloatArray
    zero_offset_n: FloatArray
    all_zeroed: float
    scaled: tuple[Scaled, ...]

    @classmethod
    def of(cls, time: FloatArray, force: FloatArray, parts: Sequence[ForceVelocity], axis: int) -> Self:
        """Compute the residuals along X (0) or Z (2), of forces (k, p, 3) N of plates or feet over (k,) s."""
        body = _centred([(part.pelvis[:, axis] + part.centre[:, axis]) / 2 for part in parts])
        by_forces = _centred([part.by_forces[:, axis] for part in parts])
        off = by_forces - body
        reversed_, zeroed, zero_offset_n, scaled = [], [], [], [_scaled(None, off, by_forces)]
        newtons = []
        for p, own_force in enumerate(np.moveaxis(force, 1, 0)):
            plate_velocity, one_newton = (
                _centred([part.by(time, force_series) for part in parts])
                for force_series in (own_force[:, axis], (own_force[:, 1] > 0.0).astype(float))
            )
            newtons.append(one_newton)
            zero_offset_n.append(float(one_newton @ off) / max(float(one_newton @ one_newton), 1e-12))
            scaled.append(_scaled(p, off, plate_velocity))
            reversed_.append(np.std(off - 2.0 * plate_velocity))
            zeroed.append(np.std(off - zero_offset_n[-1] * one_newton))
        trends = joined_without_trend(parts, [part.by_forces[:, axis] - part.centre[:, axis] for part in parts])
        return cls(
            float(np.std(off)),
            float(np.std(by_forces + body)),
            float(np.std(trends)),
            np.array(reversed_),
            np.array(zeroed),
            np.array(zero_offset_n),
            _all_zeroed(off, np.column_stack(newtons)),
            tuple(scaled),
        )

    def evidence(self, residual: float, limit: float) -> Quantity:
        """Return the residuals before and after a fault is undone, as evidence, with their `limit`."""
        return Quantity((self.as_read, residual), "m/s", limit=limit)


def steady_scaled(
    time: FloatArray, force: FloatArray, parts: Sequence[ForceVelocity], axis: int
) -> tuple[float, tuple[Scaled, ...]]:
    """Compute residuals without the linear trend that zero offsets cause: the residual (m/s) of forces as recorded, and
    if all plates, or one, have a gain error. Arguments as of `VelocityResidual.of`.
    """
    by_forces = [part.by_forces[:, axis] for part in parts]
    moved = [(part.pelvis[:, axis] + part.centre[:, axis]) / 2 for part in parts]
    off = joined_without_trend(parts, by_forces) - joined_without_trend(parts, moved)
    by_plate = [[part.by(time, plate_force) for part in parts] for plate_force in force[..., axis].T]
    plates = [None, *range(len(by_plate))]
    readings = zip(plates, [by_forces, *by_plate], strict=True)
    return float(np.std(off)), tuple(
        _scaled(plate, off, joined_without_trend(parts, velocity)) for plate, velocity in readings
    )


def rotated_residual(parts: Sequence[ForceVelocity], angle: float) -> float:
    """Compute the residual (m/s) of both horizontal axes, forces rotated back by `angle` (rad) about the vertical."""
    # from Z to X is a positive rotation about Y
    by_forces, pelvis, centre = (
        _centred([getattr(part, name)[:, 2] + 1j * getattr(part, name)[:, 0] for part in parts])
        for name in ("by_forces", "pelvis", "centre")
    )
    return float(np.sqrt(np.mean(np.square(np.abs(by_forces * np.exp(-1j * angle) - (pelvis + centre) / 2)))))


def misread_plate_residuals(time: FloatArray, force: FloatArray, parts: Sequence[ForceVelocity]) -> FloatArray:
    """Compute the residuals (p, r) m/s of both horizontal axes if one plate's axes are rotated or exchanged.

    Args:
        time, force: (k,) s and (k, p, 3) N of plates.
        parts: windows of the trial.

    Returns:
        per plate the residual if its axes are exchanged with either sign, or rotated by 90 degrees either way.
    """
    body, by_forces = (
        _centred([velocity[:, 2] + 1j * velocity[:, 0] for velocity in of_parts])
        for of_parts in ([(part.pelvis + part.centre) / 2 for part in parts], [part.by_forces for part in parts])
    )
    residuals = []
    for own_force in np.moveaxis(force, 1, 0):
        plate_velocity = _centred(
            [part.by(time, own_force[:, 2]) + 1j * part.by(time, own_force[:, 0]) for part in parts]
        )
        true = (1j * plate_velocity.conj(), -1j * plate_velocity.conj(), 1j * plate_velocity, -1j * plate_velocity)
        residuals.append(
            [
                np.sqrt(np.mean(np.square(np.abs(by_forces - body - plate_velocity + true_velocity))))
                for true_velocity in true
            ]
        )
    return np.array(residuals)


def _all_zeroed(off: FloatArray, newtons: FloatArray) -> float:
    """Return the residual (m/s) of velocities (n,) without zero offsets of the plates, by what one newton of each does
    (n, p)."""
    zeros_n = np.linalg.lstsq(newtons, off, rcond=None)[0]
    possible = np.abs(zeros_n).max(initial=0.0) <= MOST_ZERO_N
    return float(np.std(off - newtons @ zeros_n if possible else off))


def _scaled(plate: int | None, off: FloatArray, velocity: FloatArray) -> Scaled:
    share = float(velocity @ off) / max(float(velocity @ velocity), 1e-12)
    return Scaled(plate, 1.0 / (1.0 - share) if share < 1.0 else np.inf, float(np.std(off - share * velocity)))


def _centred(windows: Sequence[np.ndarray]) -> np.ndarray:
    """Concatenate the windows, each less its mean."""
    return np.concatenate([values - values.mean() for values in windows])


@dataclass(frozen=True)
class VerticalVelocityFit:
    """Fit of shown(t) = factor * (forces(t + delay + rate_error * t) + gain * own(t)), up to a zero offset and a level.

    Attributes:
        delay_s, rate_error: delay of the forces in the middle, and its growth in seconds per second.
        gain: gain by which one plate reads more than the others.
        residual: unexplained share (residual SD over the SD of what is shown).
    """

    delay_s: float
    rate_error: float
    gain: float
    residual: float


def vertical_match(
    part: ForceVelocity, shown: FloatArray, plate_velocity: FloatArray | None = None, growing: bool = False
) -> VerticalVelocityFit | None:
    """Fit the vertical velocity by Gauss-Newton; None where the velocities do not follow the forces.

    Args:
        part: the force-derived velocity, over (n,) s.
        shown: (n, 3) m/s, of the pelvis or of the marker-based centre.
        plate_velocity: (n,) m/s due to one plate, if its gain may be wrong.
        growing: whether the delay may change over time.
    """
    after = part.time - part.time.mean()
    by_forces, accelerated = part.by_forces[:, 1], np.gradient(part.by_forces[:, 1], part.time)
    delay = rate_error = 0.0
    for _ in range(_STEPS):
        at = part.time + delay + rate_error * after
        inside = (at >= part.time[0]) & (at <= part.time[-1])
        if inside.sum() < len(at) / 2:
            return None
        pushed = np.interp(at[inside], part.time, accelerated)
        moved, since = np.interp(at[inside], part.time, by_forces), after[inside]
        columns = [moved, pushed, np.ones_like(since), since]
        columns += [since * pushed] if growing else []
        columns += [] if plate_velocity is None else [np.interp(at[inside], part.time, plate_velocity)]
        terms, wanted = np.stack(columns, axis=1), shown[inside, 1]
        solution = np.linalg.lstsq(terms, wanted, rcond=None)[0]
        if solution[0] <= 0.0:
            return None
        delay += float(solution[1] / solution[0])
        rate_error += float(solution[4] / solution[0]) if growing else 0.0
    gain = 0.0 if plate_velocity is None else float(solution[-1] / solution[0])
    left = float(np.std(wanted - terms @ solution) / max(float(np.std(wanted)), 1e-12))
    return VerticalVelocityFit(delay, rate_error, gain, left)


def vertical_match_of(
    part: ForceVelocity, plate_velocity: FloatArray | None = None, growing: bool = False
) -> Sequence[VerticalVelocityFit]:
    """Fit pelvis and marker-based centre of mass; empty where either does not follow the forces."""
    found = [vertical_match(part, shown, plate_velocity, growing) for shown in (part.pelvis, part.centre)]
    return [match for match in found if match is not None] if all(found) else []
