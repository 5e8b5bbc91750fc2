"""Finds the frames in which all ground contact is measured, and where on the ground a foot's load acts.

A foot without load counts as on the ground by thresholds of this trial: the heights and speeds of foot markers when the
load on a plate begins or ends.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, BoolArray, FloatArray, FootLoads, Markers
from kinertia.trial.file_contents import Belt
from kinertia.trial.foot_motion import FootMotion, foot_motions
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, nearest_samples, runs, span_s, within

BRIDGED_GAP_S = 0.02
"""Gaps in a load shorter than this are bridged: it counts as one contact."""
CONTACT_SLACK_S = 0.04
"""Largest error of landing and leaving times derived from markers, compared with plates (typically 0.015 s)."""
CONTACT_MARGIN_S = 0.02
"""Ground contact off the plates is extended by this on both sides: a missed first contact makes the dynamics wrong."""
LONGEST_FLIGHT_S = 1.0
"""Longest plausible flight phase: beyond it something other than the feet supports the person."""
# Below these, markers of a stationary foot differ by noise only.
_LEAST_CLEARANCE_M = 0.01
_LEAST_SPEED_M_S = 0.1
_FEWEST_TO_JUDGE, _OUTLIER_FACTOR = 3, 3.0
"""With at least so many landings, one that is so many times as fast as usual is excluded."""
_STANCE, _SLOW_LANDING = 0.9, 2.0
"""With fewer, which may be slow by chance, a foot has landed that is as slow as in this share of the frames under load,
if it is at most so many times as fast as the landings."""
_STEP_S = 0.1
"""A load that begins and ends within less is of a toe that brushes over the plate: it shows no landing."""
_ALL_CARRIED = 0.85
"""While plates carry this share of their usual load, a foot that does not move is in the air."""
_BETWEEN, _BETWEEN_FRAMES = 0.3, 0.2
"""Share of the gap between the feet beyond which a centre of pressure may be of both, and of the frames in which it
is."""
FootMarkers = Mapping[str, Sequence[str]]
"""Labels of the markers on each foot (heel, toes, ankle), by "r" and "l"."""
FIRM_LOAD_N = 5 * LOAD_THRESHOLD_N
"""Vertical force below which a centre of pressure is too noisy to be judged."""


@dataclass(frozen=True, eq=False)
class GroundContact:
    """Ground contact of each foot in each marker frame.

    Attributes:
        loaded: (n, 2) True where the right, left foot stands on a loaded plate.
        ground: (n, 2) True where the foot is on the ground, loaded or not.
        inside: (n,) True within the recorded forces.
        on_shared_plate: (n,) True where one plate carries both feet, so that only the sum of their loads is known.
        between: (n, 2) True where the other foot is on the ground without load, and the centre of pressure lies between
            the feet: the plate may carry both.
    """

    loaded: BoolArray
    ground: BoolArray
    inside: BoolArray
    on_shared_plate: BoolArray
    between: BoolArray

    def measured(self, time: FloatArray) -> BoolArray:
        """Return the mask (n,) of frames with complete contact: every foot on the ground stands on a loaded plate."""
        measured = self.inside & ~self.on_shared_plate & np.asarray(self.loaded | ~self.ground).all(axis=1)
        flight = measured & ~self.ground.any(axis=1)
        for first, last in runs(flight):
            between = first > 0 and last < len(time) - 1 and measured[first - 1] and measured[last + 1]
            if not between or span_s(time, first, last) > LONGEST_FLIGHT_S:
                measured[first : last + 1] = False
        return measured

    @property
    def leg_known(self) -> BoolArray:
        """Mask (n, 2): the whole load on the right, left foot is known, since it is in the air or alone on plates."""
        whole = self.loaded & ~self.between
        result: BoolArray = (self.inside & ~self.on_shared_plate)[:, None] & (whole | ~self.ground)
        return result


def ground_contact(markers: Markers, loads: FootLoads, feet: FootMarkers, belt: Belt | None = None) -> GroundContact:
    """Determine which foot is on the ground, and which on a loaded plate.

    A loaded foot is on the ground by definition. A foot without load is on the ground while one of its markers
    is as low and as slow against the ground as the markers of loaded feet are in this trial: it lands when
    that speed falls to the speed seen where a plate starts to be loaded, or to that of most frames under load, and
    leaves when it rises to the speed seen where a plate ceases to be loaded. Up to `CONTACT_SLACK_S` of such ground
    contact right before or after a load is the markers' inaccuracy; what remains is widened by `CONTACT_MARGIN_S`.

    A foot without load that stands still, at any height, is on a step, a box or the frame of a treadmill if the plates
    carry less than usual meanwhile; from foot contact to foot off, as above.

    Frames outside the recorded forces are not measured. Frames in the air (no foot on the ground, no load) are measured
    only between measured frames, for up to `LONGEST_FLIGHT_S`: then plates have measured both take-off and landing. A
    foot whose markers are missing counts as on the ground.

    Speeds are relative to the ground under the loaded feet, so that the belt of a treadmill does no harm, or relative
    to the belt where its speed is stated.
    """
    nearest = nearest_samples(loads.time, markers.time)
    inside = within(markers.time, loads.time[0], loads.time[-1])
    loaded = np.stack(
        [bridged(loads.time, loads.force[:, foot, 1] >= LOAD_THRESHOLD_N)[nearest] & inside for foot in range(2)],
        axis=1,
    )
    ground = loaded.copy()
    moves = foot_motions([markers.select(feet[foot]) for foot in FEET], loaded, belt)
    if loaded.any():
        clearance, landing, leaving = _learned(moves, _steps(loaded, markers.time))
        resting = np.stack([move.still for move in moves], axis=1) & ~loaded
        carried = _carried(loads, nearest, loaded, np.logical_or.reduce(resting, axis=1))
        for foot, move in enumerate(moves):
            planted = move.planted(clearance, landing, leaving)
            for first, last in runs(resting[:, foot]):
                if carried[first : last + 1].mean() < _ALL_CARRIED:
                    planted |= _stand(move.over(first, last).planted(clearance, landing, leaving), first, last)
            ground[:, foot] |= _off_plates(planted, loaded[:, foot], markers.time)
    on_shared_plate = (
        np.zeros(len(inside), dtype=bool) if loads.on_shared_plate is None else loads.on_shared_plate[nearest] & inside
    )
    between = _between(markers, loads, feet, nearest, loaded, ground)
    return GroundContact(loaded, ground, inside, on_shared_plate, between)


def _between(
    markers: Markers,
    loads: FootLoads,
    feet: FootMarkers,
    nearest: npt.NDArray[np.int_],
    loaded: BoolArray,
    ground: BoolArray,
) -> BoolArray:
    """Return `GroundContact.between` (n, 2): whole spans in which both feet are on the ground and one is loaded.

    The centre of pressure of a foot that pushes off is beyond its foremost marker by a small share of the gap to the
    other foot, whose load is elsewhere.
    """
    result, points = np.zeros_like(loaded), [markers.select(feet[foot]).positions[:, :, [0, 2]] for foot in FEET]
    for foot in range(2):
        both = loaded[:, foot] & ground[:, 1 - foot] & ~loaded[:, 1 - foot]
        for first, last in runs(both):
            during = slice(first, last + 1)
            wrench = loads.wrench[nearest[during], foot]
            pressure = np.column_stack([wrench[:, 5], -wrench[:, 3]]) / np.maximum(wrench[:, 1:2], LOAD_THRESHOLD_N)
            share = _share_of_gap(pressure, points[foot][during], points[1 - foot][during])
            result[during, foot] = (share > _BETWEEN).mean() > _BETWEEN_FRAMES
    return result


def _share_of_gap(pressure: FloatArray, points: FloatArray, other: FloatArray) -> FloatArray:
    """Return how far (n,) of the way from one foot's nearest marker to the other's a centre of pressure (n, 2) is."""
    apart = np.linalg.norm(points[:, :, None] - other[:, None], axis=-1)
    pair = np.where(np.isfinite(apart), apart, np.inf).reshape(len(points), -1).argmin(axis=1)
    frames = np.arange(len(points))
    start, end = points[frames, pair // other.shape[1]], other[frames, pair % other.shape[1]]
    gap = end - start
    along = np.einsum("ni,ni->n", pressure - start, gap) / np.maximum(np.square(gap).sum(axis=1), 1e-6)
    result: FloatArray = np.nan_to_num(along)
    return result


def _steps(loaded: BoolArray, time: FloatArray) -> BoolArray:
    """Return `loaded` without loads that are too short for steps; all of them if none is long enough."""
    steps = loaded.copy()
    for foot in range(2):
        for first, last in runs(loaded[:, foot]):
            whole = first > 0 and last < len(time) - 1
            steps[first : last + 1, foot] = not whole or span_s(time, first, last) >= _STEP_S
    return steps if steps.any() else loaded


def _learned(moves: Sequence[FootMotion], loaded: BoolArray) -> tuple[float, float, float]:
    """Derive the clearance (m) and the speeds (m/s) at foot contact and foot off from the loaded feet of this trial.

    If no contact begins (or ends) within the trial, the largest speed of a loaded foot is used instead.
    """
    lowest = [np.fmin.reduce(move.height[loaded[:, foot]], axis=1) for foot, move in enumerate(moves)]
    clearance = _LEAST_CLEARANCE_M + max(0.0, _largest(np.concatenate(lowest)))
    landing, leaving, loaded_speed = [], [], []
    for foot, move in enumerate(moves):
        speed = move.slowest(clearance)
        for first, last in runs(loaded[:, foot]):
            loaded_speed.append(speed[first : last + 1])
            if first > 0:
                landing.append(_halfway(speed[first - 1], speed[first]))
            if last < len(speed) - 1:
                leaving.append(_halfway(speed[last + 1], speed[last]))
    speeds = np.concatenate(loaded_speed)
    speeds = speeds[np.isfinite(speeds)]  # a hidden foot has none
    usual = _largest(speeds)
    land = max(_LEAST_SPEED_M_S, _usual(landing) or usual)
    if len(landing) < _FEWEST_TO_JUDGE and speeds.size:
        land = max(land, min(_SLOW_LANDING * land, float(np.quantile(speeds, _STANCE))))
    return clearance, land, max(land, _usual(leaving) or usual)


def _halfway(unloaded: float, loaded: float) -> float:
    """Return the speed halfway between an unloaded frame and the adjacent loaded frame."""
    return (unloaded + loaded) / 2 if np.isfinite(unloaded) else loaded


def _largest(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else 0.0


def _usual(speeds: Sequence[float]) -> float:
    """Return the largest of the speeds that is not an outlier: something other than a landing must not set the
    threshold."""
    values = np.array(speeds)
    finite = values[np.isfinite(values)]
    if finite.size >= _FEWEST_TO_JUDGE:
        finite = finite[finite <= _OUTLIER_FACTOR * np.median(finite)]
    return _largest(finite)


def _carried(loads: FootLoads, nearest: npt.NDArray[np.int_], loaded: BoolArray, resting: BoolArray) -> FloatArray:
    """Return the vertical force (n,) of all plates, relative to its usual value while no foot can rest beside them."""
    force = loads.force[:, :, 1].sum(axis=1)[nearest]
    whole = loaded.any(axis=1) & ~resting
    result: FloatArray = force / np.median(force[whole if whole.any() else loaded.any(axis=1)])
    return result


def _stand(planted: BoolArray, first: int, last: int) -> BoolArray:
    """Return the part of `planted` whose runs overlap these frames."""
    stands = np.zeros_like(planted)
    for start, end in runs(planted):
        if start <= last and end >= first:
            stands[start : end + 1] = True
    return stands


def _off_plates(planted: BoolArray, loaded: BoolArray, time: FloatArray) -> BoolArray:
    """Return `planted` without load: without short intervals adjacent to a load, and with the others extended."""
    off, margin_s = np.zeros_like(planted), CONTACT_MARGIN_S + TIME_TOLERANCE_S
    for first, last in runs(planted & ~loaded):
        touches = (first > 0 and loaded[first - 1]) or (last < len(time) - 1 and loaded[last + 1])
        if not touches or span_s(time, first, last) > CONTACT_SLACK_S:
            off |= (time >= time[first] - margin_s) & (time <= time[last] + margin_s)
    return off & ~loaded


def bridged(time: FloatArray, loaded: BoolArray) -> BoolArray:
    """Return the mask with gaps below `BRIDGED_GAP_S` closed."""
    closed = loaded.copy()
    for first, last in runs(~loaded):
        within = first > 0 and last < len(time) - 1
        if within and span_s(time, first - 1, last + 1) < BRIDGED_GAP_S:
            closed[first : last + 1] = True
    return closed


def centre_of_pressure(wrench: np.ndarray, height_m: float = 0.0) -> np.ndarray:
    """Return the point (..., 3) m at this height (0: the ground) at which a wrench (..., 6) has no horizontal moment.

    Without vertical force there is no such point: the point above the origin is returned.
    """
    upward = np.where(wrench[..., 1] == 0.0, np.inf, wrench[..., 1])
    x = (wrench[..., 5] + height_m * wrench[..., 0]) / upward
    z = (height_m * wrench[..., 2] - wrench[..., 3]) / upward
    return np.stack([x, np.full_like(x, height_m), z], axis=-1)


def free_moment(wrench: np.ndarray) -> np.ndarray:
    """Return the moment (...) N m about the vertical through the centre of pressure of a wrench (..., 6)."""
    return (wrench[..., 3:] - np.cross(centre_of_pressure(wrench), wrench[..., :3]))[..., 1]


def with_turned_free_moments(loads: FootLoads) -> FootLoads:
    """Return the loads with the sign of the free moment about the vertical at each centre of pressure reversed."""
    carried = loads.force[..., 1] >= LOAD_THRESHOLD_N
    moment = loads.moment.copy()
    moment[..., 1] -= np.where(carried, 2.0 * free_moment(loads.wrench), 0.0)
    return replace(loads, moment=moment)


def held_centre_of_pressure(wrench: np.ndarray, least_n: float = LOAD_THRESHOLD_N) -> np.ndarray:
    """Return the centre of pressure (k, 3) m of one foot's load (k, 6); below `least_n` the nearest sample's above it.

    For a foot that is never loaded it is the origin.
    """
    firm = np.flatnonzero(wrench[:, 1] >= least_n)
    if not len(firm):
        return np.zeros((len(wrench), 3))
    nearest = firm[np.searchsorted((firm[1:] + firm[:-1]) / 2, np.arange(len(wrench)))]
    return centre_of_pressure(wrench[nearest])
