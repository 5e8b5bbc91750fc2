"""What goes wrong with forces between the plates and the file: axes, signs, units, zeros, places, clocks."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads
from kinertia.trial.sampled_data import runs
from validation.marker_mistakes import Change
from validation.measured_person import MeasuredPerson, acting, loads_of


def loads(change: Callable[[PlateLoads], PlateLoads]) -> Change:
    """Return a fault that changes the loads of the walk."""
    return lambda person, rng: person.with_plates(change(person.plates))


def with_signs(x: float, y: float, z: float) -> Change:
    """Return a fault that multiplies force components, at the same points."""

    def change(plates: PlateLoads) -> PlateLoads:
        force, point, torque = acting(plates)
        return loads_of(plates, force * np.array([x, y, z]), point, torque)

    return loads(change)


def turned_about_vertical(degrees: float, alone: bool = False) -> Change:
    """Return a fault that rotates each plate about the vertical through its middle: force directions and points.

    `alone` rotates the plate that is stood on first, and no other.
    """
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()

    def change(plates: PlateLoads) -> PlateLoads:
        force, point, torque = acting(plates)
        middle = _middles(plates, point)
        turned = np.isin(np.arange(force.shape[1]), _by_time(plates)[:1]) | (not alone)
        force = np.where(turned[:, None], force @ turn.T, force)
        point = np.where(turned[:, None], middle + (point - middle) @ turn.T, point)
        return loads_of(plates, force, point, torque)

    return loads(change)


def directions_turned(degrees: float) -> Change:
    """Return a fault that rotates forces about the vertical at the same points."""
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()

    def change(plates: PlateLoads) -> PlateLoads:
        force, point, torque = acting(plates)
        return loads_of(plates, force @ turn.T, point, torque)

    return loads(change)


def scaled(force: float = 1.0, point: float = 1.0, plates: slice = slice(None)) -> Change:
    """Return a fault that scales forces with their torques, and points, on all plates or on some."""

    def change(loads: PlateLoads) -> PlateLoads:
        forces, points, torques = (part.copy() for part in acting(loads))
        forces[:, plates] *= force
        points[:, plates] *= point
        torques[:, plates] *= force
        return loads_of(loads, forces, points, torques)

    return loads(change)


def torques_in_n_mm(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
    """Multiply torques by a thousand; on plates with corners, all moments about the plate's middle."""
    plates = person.plates
    if plates.corners is not None:
        middle = plates.corners.mean(axis=1)
        about = plates.moment - np.cross(middle, plates.force)
        return person.with_plates(replace(plates, moment=1000.0 * about + np.cross(middle, plates.force)))
    force, point, torque = acting(plates)
    loaded = force[..., 1] > 5 * LOAD_THRESHOLD_N
    if np.median(np.abs(torque[..., 1][loaded])) < 0.01:  # the file has none
        return None
    return person.with_plates(loads_of(plates, force, point, 1000.0 * torque))


def moved(x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0) -> Change:
    """Return a fault that displaces centres of pressure, with the corners of the plates where the file has them."""

    def change(plates: PlateLoads) -> PlateLoads:
        force, point, torque = acting(plates)
        offset = np.array([x_m, y_m, z_m])
        corners = None if plates.corners is None else plates.corners + offset
        return replace(loads_of(plates, force, point + offset, torque), corners=corners)

    return loads(change)


def with_offset(x_n: float = 0.0, y_n: float = 0.0, z_n: float = 0.0) -> Change:
    """Return a fault that adds a zero offset to every plate, acting in its middle."""
    return _with_more(lambda time: np.array([x_n, y_n, z_n]) * np.ones((len(time), 1)))


def with_drift(last_n: float) -> Change:
    """Return a fault that lets the zero of every plate's vertical force drift from 0 to this."""
    return _with_more(lambda time: np.outer((time - time[0]) / (time[-1] - time[0]), [0.0, last_n, 0.0]))


def _with_more(extra: Callable[[FloatArray], FloatArray]) -> Change:
    def change(plates: PlateLoads) -> PlateLoads:
        middle = _middles(plates, acting(plates)[1])
        more = np.repeat(extra(plates.time)[:, None], len(plates.names), axis=1)
        return replace(plates, force=plates.force + more, moment=plates.moment + np.cross(middle, more))

    return loads(change)


def on_one_plate(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
    """Put the foot of the second plate on the first for the first 0.08 s, in front of the other foot."""
    plates = person.plates
    order = _by_time(plates)
    if len(order) < 2:
        return None
    first, second = order[:2]
    loaded = np.flatnonzero(plates.force[:, second, 1] > LOAD_THRESHOLD_N)
    inside = (plates.time >= plates.time[loaded[0]]) & (plates.time < plates.time[loaded[0]] + 0.08)
    if not (plates.force[inside, first, 1] > LOAD_THRESHOLD_N).all():
        return None
    force, moment = plates.force.copy(), plates.moment.copy()
    for part in (force, moment):
        part[inside, first] += part[inside, second]
        part[inside, second] = 0.0
    return person.with_plates(replace(plates, force=force, moment=moment))


def plates_exchanged(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
    """Interchange the channels of two plates: each load lies at the other plate. Force files have no channels."""
    plates = person.plates
    order = _by_time(plates)
    if len(order) < 2 or plates.corners is None:
        return None
    force, point, torque = (part.copy() for part in acting(plates))
    first, second = order[:2]
    middle = _middles(plates, point)
    there = middle[:, second] - middle[:, first]
    point[:, first] += there
    point[:, second] -= there
    exchanged = loads_of(plates, force, point, torque)
    pair, other = [first, second], [second, first]
    force, moment = exchanged.force.copy(), exchanged.moment.copy()
    force[:, pair], moment[:, pair] = exchanged.force[:, other], exchanged.moment[:, other]
    return person.with_plates(replace(exchanged, force=force, moment=moment))


def late(delay_s: float) -> Change:
    """Return a fault that delays the forces."""

    def change(plates: PlateLoads) -> PlateLoads:
        rows = _earlier(plates, delay_s)
        return replace(plates, force=plates.force[rows], moment=plates.moment[rows])

    return loads(change)


def late_plate(delay_s: float) -> Change:
    """Return a fault that delays the forces of the plate that is stood on first."""

    def change(plates: PlateLoads) -> PlateLoads:
        rows, first = _earlier(plates, delay_s), _by_time(plates)[0]
        force, moment = plates.force.copy(), plates.moment.copy()
        force[:, first], moment[:, first] = plates.force[rows, first], plates.moment[rows, first]
        return replace(plates, force=force, moment=moment)

    return loads(change)


def _earlier(plates: PlateLoads, delay_s: float) -> npt.NDArray[np.int_]:
    """Return the row of the sample that was taken this much earlier than each."""
    step = float(plates.time[1] - plates.time[0])
    rows: npt.NDArray[np.int_] = np.arange(len(plates.time)) - round(delay_s / step)
    return np.clip(rows, 0, len(plates.time) - 1)


def of_another_trial(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
    """Replace the forces by those of a walk that began 0.3 s earlier, and 120 mm further on."""
    earlier = late(-0.3)(person, rng)
    return None if earlier is None else moved(x_m=0.12, z_m=0.02)(earlier, rng)


def vertical_reversed(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
    """Reverse the vertical force of the plate that is stood on first, as its channel has it; of a force file the
    component alone."""
    plates, first = person.plates, _by_time(person.plates)[0]
    force, point, torque = acting(plates)
    reversed_ = force.copy()
    reversed_[:, first, 1] *= -1.0
    if plates.corners is None:
        return person.with_plates(loads_of(plates, reversed_, point, torque))
    middle = plates.corners.mean(axis=1)[None]
    about = plates.moment - np.cross(middle, plates.force)
    return person.with_plates(replace(plates, force=reversed_, moment=about + np.cross(middle, reversed_)))


def about_middles(change: Callable[[FloatArray], FloatArray]) -> Change:
    """Return a fault that changes the moments (k, p, 3) N m about the plates' middles; force files have none."""

    def changed(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
        plates = person.plates
        if plates.corners is None:
            return None
        about = np.cross(plates.corners.mean(axis=1)[None], plates.force)
        return person.with_plates(replace(plates, moment=about + change(plates.moment - about)))

    return changed


def tilting_reversed(moment: FloatArray) -> FloatArray:
    """Reverse the horizontal moments: vertical channels 1 and 3, and 2 and 4 of type 3 plates are interchanged."""
    return moment * np.array([-1.0, 1.0, -1.0])


def across_dead(moment: FloatArray) -> FloatArray:
    """Leave out the moments about X."""
    return moment * np.array([0.0, 1.0, 1.0])


def lateral_and_vertical_moment_reversed(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
    """Reverse the forces along Z and the vertical moments about the plates' middles; in force files the torques."""
    plates, signs = person.plates, np.array([1.0, 1.0, -1.0])
    if plates.corners is None:
        force, point, torque = acting(plates)
        return person.with_plates(loads_of(plates, force * signs, point, torque * [1.0, -1.0, 1.0]))
    middle = plates.corners.mean(axis=1)[None]
    about = (plates.moment - np.cross(middle, plates.force)) * np.array([1.0, -1.0, 1.0])
    force = plates.force * signs
    return person.with_plates(replace(plates, force=force, moment=about + np.cross(middle, force)))


def leaking(share: float, alone: bool = True) -> Change:
    """Return a fault that adds a share of the vertical force to both horizontal ones, of the plate that is stood on
    first or of all, at the same points."""

    def change(plates: PlateLoads) -> PlateLoads:
        force, point, torque = acting(plates)
        wrong = np.isin(np.arange(force.shape[1]), _by_time(plates)[:1]) | (not alone)
        leaked = np.where(wrong[:, None], share * force[..., 1:2] * np.array([1.0, 0.0, 1.0]), 0.0)
        return loads_of(plates, force + leaked, point, torque)

    return loads(change)


def leaning(axis: str, degrees: float) -> Change:
    """Return a fault that tilts all forces about a horizontal axis through their points: gravity is not vertical."""
    turn = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()

    def change(plates: PlateLoads) -> PlateLoads:
        force, point, torque = acting(plates)
        return loads_of(plates, force @ turn.T, point, torque)

    return loads(change)


def at_rate(factor: float) -> Change:
    """Return a fault that states the forces at another rate than they were recorded at, from the same beginning."""

    def change(plates: PlateLoads) -> PlateLoads:
        start = plates.time[0]
        at = start + (plates.time - start) * factor
        rows = np.searchsorted(plates.time, at[at <= plates.time[-1]])
        rows = np.concatenate([rows, np.full(len(plates.time) - len(rows), len(plates.time) - 1)])
        return replace(plates, force=plates.force[rows], moment=plates.moment[rows])

    return loads(change)


def low_passed(cutoff_hz: float) -> Change:
    """Return a fault that filters loads with a zero-lag Butterworth filter of fourth order; small ones become zero."""

    def change(plates: PlateLoads) -> PlateLoads:
        rate_hz = 1.0 / float(np.median(np.diff(plates.time)))
        sections = butter(2, cutoff_hz, fs=rate_hz, output="sos")
        wrench = sosfiltfilt(sections, plates.wrench, axis=0)
        wrench = np.where(wrench[..., 1:2] > LOAD_THRESHOLD_N / 2, wrench, 0.0)
        return replace(plates, force=wrench[..., :3], moment=wrench[..., 3:])

    return loads(change)


def _by_time(plates: PlateLoads) -> list[int]:
    """Return loaded plates in the order of their first load."""
    firm = plates.force[..., 1] > 5 * LOAD_THRESHOLD_N
    return sorted(np.flatnonzero(firm.any(axis=0)).tolist(), key=lambda p: int(np.argmax(firm[:, p])))


def _middles(plates: PlateLoads, point: FloatArray) -> FloatArray:
    """Return the plates' middles (1, p, 3) m: from their corners, or from where they are loaded."""
    if plates.corners is not None:
        return np.asarray(plates.corners.mean(axis=1)[None])
    weight = np.where(plates.force[..., 1] > LOAD_THRESHOLD_N, plates.force[..., 1], 0.0)[..., None]
    return np.asarray((weight * point).sum(axis=0, keepdims=True) / np.maximum(weight.sum(axis=0, keepdims=True), 1.0))


def one_plate(change: Callable[[PlateLoads, FloatArray, FloatArray, FloatArray], tuple[FloatArray, ...]]) -> Change:
    """Return a fault that changes forces, points and torques (k, 3) of the plate that is stood on first."""

    def changed(plates: PlateLoads) -> PlateLoads:
        first = _by_time(plates)[0]
        parts = [part.copy() for part in acting(plates)]
        changed_parts = change(plates, *(part[:, first] for part in parts))
        for part, new in zip(parts, changed_parts, strict=True):
            part[:, first] = new
        return loads_of(plates, *parts)

    return loads(changed)


def spike(plates: PlateLoads, force: FloatArray, point: FloatArray, torque: FloatArray) -> tuple[FloatArray, ...]:
    """Add 2 kN to one sample in the middle of the load."""
    force[_middle(force), 1] += 2000.0
    return force, point, torque


def dropped(plates: PlateLoads, force: FloatArray, point: FloatArray, torque: FloatArray) -> tuple[FloatArray, ...]:
    """Set 50 ms in the middle of the load to zero."""
    gone = np.abs(plates.time - plates.time[_middle(force)]) <= 0.025
    return np.where(gone[:, None], 0.0, force), point, np.where(gone[:, None], 0.0, torque)


def vertical_alone(
    plates: PlateLoads, force: FloatArray, point: FloatArray, torque: FloatArray
) -> tuple[FloatArray, ...]:
    """Leave out horizontal forces."""
    return force * np.array([0.0, 1.0, 0.0]), point, torque


def fixed_point(plates: PlateLoads, force: FloatArray, point: FloatArray, torque: FloatArray) -> tuple[FloatArray, ...]:
    """Write one centre of pressure for each load."""
    for first, last in runs(force[:, 1] > LOAD_THRESHOLD_N):
        point[first : last + 1] = np.median(point[first : last + 1], axis=0)
    return force, point, torque


def _middle(force: FloatArray) -> int:
    """Return the middle sample of the longest load."""
    first, last = max(runs(force[:, 1] > 5 * LOAD_THRESHOLD_N), key=lambda run: run[1] - run[0])
    return (first + last) // 2
