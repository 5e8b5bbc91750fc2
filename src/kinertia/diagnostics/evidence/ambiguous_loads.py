"""Finds loads that belong to no single foot: beyond the plates' edges, of both feet on one plate, under no foot."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.diagnostics.evidence.plate_contacts import (
    BETWEEN_M,
    COP_MIN_FORCE_N,
    FAR_M,
    ONE_STEP_S,
    Feet,
    PlateContact,
    cop_horizontal,
)
from kinertia.findings.quantity import Limit
from kinertia.model.marker_set import MarkerSet
from kinertia.motion.kinematics import FEWEST_FRAMES
from kinertia.trial.data import FEET, BoolArray, FloatArray, Markers, PlateLoads, Trial
from kinertia.trial.sampled_data import runs, span_s, within

OVERHANG_M, HALLUX_M = Limit(0.01, "m"), Limit(0.02, "m")
"""Distance of markers from the skin; and uncertainty of the position of a big toe without a marker."""
LITTLE_BEYOND_M = 0.03
"""Overhang of a heel that bears no notable load."""
_TOE_M = 0.05
"""Length that only toes do not exceed."""
_LIFTED_M = 0.01
"""A heel that is higher than where it is lowest by more is lifted. Under a big toe 36 mm beyond a plate a tenth of the
weight is missing 0.1 s later."""
_PRESSED_M = 0.05
"""A foot presses on the ground up to this far from its centre of pressure."""
NO_FOOT_M = Limit(0.015, "m", usual=(0.034, np.inf))
_FOOT_M, _GAP_M, _FIRM = 0.035, 0.01, 0.25
"""With the whole foot on a plate, the centre of pressure stays farther from the plate's edge than the first, and as a
rule farther than the second: on 27 plates, 34 mm and more while the load is above a quarter of its largest. With toes
beyond the edge it comes to 27 mm and nearer. Plates side by side are less than the third apart."""
_LOW_M = 0.03
"""A marker so near to where it is lowest during a contact is on the ground, not landing or lifted."""
OUTSIDE_M, _OUTSIDE_SHARE = Limit(0.14, "m"), 0.01
_MOSTLY = 0.5
OTHERS_SHARE = Limit(0.25)
"""The centre of pressure divides the line between both feet as they share the load. At foot off of feet without a toe
marker it is up to 0.19 of the way to the other foot, which stands on the floor."""
FOOT_ENDS = (("heel",), ("metatarsal", "toe"))
_LEAST_LENGTH_M = 0.08
"""Less than from heel to forefoot of a child of four years."""
STRAY_M = Limit(0.3, "m", usual=(0.0, 0.04))
"""A load that is farther from both feet than this is not a step of the person: no recording without faults has one."""
_SEEN = 0.5


class Overhang(NamedTuple):
    """A foot that stands on a plate and extends beyond its edge.

    Attributes:
        plate, foot: index of the plate; 0 right, 1 left.
        overhang_m: distance beyond the edge of the marker that is farthest out; where no marker is, an estimate by the
            centre of pressure.
        span_s: first and last time at which a marker is out while it is on the ground, or the load is near the edge.
        unmeasured_s: first and last time at which the part outside bears load; None if never. Toes do once the heel
            is lifted.
    """

    plate: int
    foot: int
    overhang_m: float
    span_s: tuple[float, float]
    unmeasured_s: tuple[float, float] | None


def beyond_edges(corners: FloatArray, place: FloatArray) -> FloatArray:
    """Return how far (m) horizontal positions (..., 2) are beyond a plate's edges (4, 3); negative on the plate."""
    flat = corners[:, [0, 2]]
    edges = np.roll(flat, -1, axis=0) - flat
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    normals *= np.sign(np.einsum("ek,ek->e", normals, flat - flat.mean(axis=0)))[:, None]  # outwards
    result: FloatArray = np.max(np.einsum("ek,...ek->...e", normals, place[..., None, :] - flat), axis=-1)
    return result


class FootPoints(NamedTuple):
    """Points of one foot that may be beyond a plate's edge.

    Attributes:
        place: positions (n, m, 3) m.
        toe: (m,) which of the points are on toes.
        limit_m: (m,) m, distance beyond the edge from which a point counts as outside.
    """

    place: FloatArray
    toe: BoolArray
    limit_m: FloatArray

    @classmethod
    def of(cls, markers: Markers, labels: Sequence[str], toes: Collection[str], hallux: FloatArray | None) -> Self:
        """Collect the points of a foot: its markers, and the big toe where it has no marker."""
        known = [label for label in labels if label in markers.labels]
        place = markers.select(known).positions
        toe = [label in toes for label in known]
        limit_m = [OVERHANG_M] * len(known)
        if hallux is not None:
            place = np.concatenate([place, hallux[:, None]], axis=1)
            toe, limit_m = [*toe, True], [*limit_m, HALLUX_M]
        return cls(place, np.array(toe), np.array(limit_m))

    def at(self, rows: BoolArray) -> Self:
        """Return the points in some of the frames."""
        return self._replace(place=self.place[rows])


def overhangs(
    plates: PlateLoads, contacts: Sequence[PlateContact], time: FloatArray, feet: Sequence[FootPoints]
) -> list[Overhang]:
    """Find feet that stand on a plate, under its load, and extend beyond its edge onto no other plate.

    Args:
        plates: plates with corners; without corners nothing is found.
        contacts: loads on the plates.
        time: (n,) s, time of the feet.
        feet: the right and the left one.
    """
    found = []
    for contact in contacts:
        # where the load is not under the foot, the corners are not at the plate's true position
        if plates.corners is None or contact.distance_m > FAR_M / 2 or contact.in_turn or contact.between:
            continue
        inside = within(time, *_stance(contact))
        by_markers = _overhang(contact, plates.corners, time[inside], feet[contact.foot].at(inside))
        found += by_markers or _by_pressure(contact, plates.corners)
    return found


def _by_pressure(contact: PlateContact, corners: FloatArray) -> list[Overhang]:
    """Find an overhang that no marker shows, from a centre of pressure nearer to the edge than a whole foot allows."""
    firm = contact.weight > _FIRM * contact.weight.max()
    beyond = beyond_edges(corners[contact.plate], contact.place)[firm]
    if np.median(beyond) >= 0.0 or beyond.max() < -NO_FOOT_M:
        return []
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)

    def near(distance_m: float) -> BoolArray:
        """Return (k,) whether some place within this distance is outside all plates, not just in a gap between them."""
        around = contact.place[:, None] + (distance_m + _GAP_M) * ring
        outside = np.min([beyond_edges(corner, around) for corner in corners], axis=0)
        result: BoolArray = (outside > _GAP_M).any(axis=1)
        return result

    if not (near(NO_FOOT_M) & firm).any():
        return []
    unmeasured = near(_PRESSED_M)
    start, end = float(contact.time[unmeasured][0]), float(contact.time[unmeasured][-1])
    stances = [span[:2] for span in contact.trajectory.stance_spans if span[0] <= end and span[1] >= start]
    if unmeasured[0]:
        start = min([start, *(first for first, _ in stances)])
    if unmeasured[-1]:
        end = max([end, *(last for _, last in stances)])
    nearest = next(d for d in np.arange(0.001, NO_FOOT_M + 0.001, 0.001) if (near(float(d)) & firm).any())
    return [Overhang(contact.plate, contact.foot, _FOOT_M - float(nearest), (start, end), (start, end))]


def _stance(contact: PlateContact) -> tuple[float, float]:
    """Return the first and last time (s) of a load, or of the foot's stance where that lasts longer: a part of the foot
    beside the plate lands before the load begins, or leaves after it ends.
    """
    first, last = float(contact.time[0]), float(contact.time[-1])
    spans = [(start, end) for start, end, _ in contact.trajectory.stance_spans if start < last and end > first]
    return min([first, *(start for start, _ in spans)]), max([last, *(end for _, end in spans)])


def _overhang(contact: PlateContact, corners: FloatArray, time: FloatArray, foot: FootPoints) -> list[Overhang]:
    """Find the overhang of one foot (n frames of its stance) during one load on one of the plates (p, 4, 3)."""
    seen, loaded = np.isfinite(foot.place).all(axis=2), within(time, contact.time[0], contact.time[-1])
    height = np.where(seen, foot.place[..., 1], np.inf)
    low = height < height[loaded].min(axis=0, initial=np.inf) + _LOW_M
    beyond_plates = np.stack([beyond_edges(plate_corners, foot.place[..., [0, 2]]) for plate_corners in corners])
    beyond = np.where(seen, beyond_plates.min(axis=0), -np.inf)
    bearing = low & loaded[:, None]
    usual = np.array([np.median(beyond[on, k]) if on.any() else -np.inf for k, on in enumerate(bearing.T)])
    far = usual > foot.limit_m
    if not far.any() or not ((beyond_plates[contact.plate] < 0.0) & bearing).any():
        return []
    more = far & (~foot.toe | (usual > _TOE_M))
    out = (low & (beyond > foot.limit_m) & (more if more.any() else far)).any(axis=1)
    bears = out & _heel_lifted(foot, height, far) & (time >= contact.time[0]) if foot.toe[far].all() else out
    span_s = _span(time, out)
    assert span_s is not None
    measured = far & (foot.limit_m == OVERHANG_M)
    overhang_m = float(usual[measured if measured.any() else far].max())
    return [Overhang(contact.plate, contact.foot, overhang_m, span_s, _span(time, bears))]


def _heel_lifted(foot: FootPoints, height: FloatArray, toes: BoolArray) -> BoolArray:
    """Return (n,) whether the point farthest from the toes (m,) is lifted, given heights (n, m) of the points: from
    then on the toes bear load.
    """
    away = np.linalg.norm(foot.place - foot.place[:, toes].mean(axis=1, keepdims=True), axis=2)
    usual = np.where(np.isfinite(away).any(axis=0), np.nan_to_num(away).max(axis=0), -np.inf)
    heel = height[:, int(np.argmax(usual))]
    lifted: BoolArray = heel > heel.min() + _LIFTED_M
    return lifted


def _span(time: FloatArray, rows: BoolArray) -> tuple[float, float] | None:
    """Return the first and last of the selected times; None where none is selected."""
    return (float(time[rows][0]), float(time[rows][-1])) if rows.any() else None


class SharedLoad(NamedTuple):
    """A load that both feet bear on one plate for a while.

    Attributes:
        contact: the load.
        span_s: first and last time (s) at which both bear it.
        share, limit: share of the load at which they do, and the largest usual one.
    """

    contact: PlateContact
    span_s: tuple[float, float]
    share: float
    limit: float

    @property
    def unknown_s(self) -> tuple[float, float]:
        """Span (s) in which the load of each foot is unknown: until the load ends, since the second foot need not be
        wholly on the plate. Empty of a load longer than a step, which is sorted by foot sample by sample."""
        if span_s(self.contact.time) > ONE_STEP_S:
            return np.inf, -np.inf
        return self.span_s[0], float(np.nanmax([self.contact.end_s, self.contact.time[-1]]))


def shared_loads(contacts: Sequence[PlateContact], feet: Feet, marker_set: MarkerSet | None) -> Iterator[SharedLoad]:
    """Yield loads between the feet while both are on the ground; a foot that swings by its markers bears none."""
    for contact in contacts:
        away = _under_both(_to_toes(contact, feet, marker_set))
        for foot in feet:
            away &= foot.standing(contact.time)
        share = float(contact.weight[away].sum() / contact.weight.sum())
        limit = _MOSTLY if span_s(contact.time) > ONE_STEP_S else _OUTSIDE_SHARE
        if share > limit:
            when = contact.time[away]
            yield SharedLoad(contact, (float(when[0]), float(when[-1])), share, limit)


def without_legs(trial: Trial, spans: Iterable[tuple[tuple[float, float], int | slice]]) -> Trial | None:
    """Return the trial without these feet in these spans (s), in which their loads are unknown; None where hardly any
    measured frames are left."""
    legs = trial.known_legs.copy()
    for (start_s, end_s), feet in spans:
        legs[within(trial.markers.time, start_s, end_s), feet] = False
    measured = trial.measured & legs.all(axis=1)
    if measured.sum() < FEWEST_FRAMES <= trial.measured.sum():
        return None
    return trial if np.array_equal(legs, trial.known_legs) else replace(trial, measured=measured, leg_known=legs)


def _to_toes(contact: PlateContact, feet: Feet, marker_set: MarkerSet | None) -> PlateContact:
    """Return the load with its distance to the end of the toes, for feet that have no marker there."""
    named = {} if marker_set is None else marker_set.landmarks
    whole = [foot if f"toe_{side}" in named else foot.with_toes() for side, foot in zip(FEET, feet, strict=True)]
    return replace(contact, offset_m=np.stack([foot.offset_m(contact.time, contact.place) for foot in whole]))


def _under_both(contact: PlateContact) -> BoolArray:
    """Return (k,) where the load is between the feet, or away from its own foot while the other bears a good part of
    it."""
    apart_m, other = np.linalg.norm(contact.offset_m, axis=2)[[contact.foot, 1 - contact.foot]]
    opposite = np.prod(contact.offset_m, axis=0).sum(axis=1) < 0
    away: BoolArray = np.minimum(apart_m, other) > BETWEEN_M
    away &= opposite
    # on a treadmill's single belt the feet come in turn, and each sample is sorted (`plate_assignment`)
    if span_s(contact.time) <= ONE_STEP_S:
        away |= apart_m > OUTSIDE_M
    away &= apart_m > OTHERS_SHARE * (apart_m + other)
    return away


def shows_whole_feet(feet: Feet | None, marker_set: MarkerSet | None, seen: Collection[str]) -> bool:
    """Return whether heel and forefoot of both feet are among the visible labels: loads are between them, and foot off
    is not heel off."""
    if feet is None or marker_set is None:
        return False
    for side in FEET:
        for names in FOOT_ENDS:
            labels = {label for name in names for label in marker_set.landmarks.get(f"{name}_{side}", ())}
            if labels and not labels & set(seen):
                return False
    return min(foot.length_m for foot in feet) > _LEAST_LENGTH_M


def stray_contacts(
    contacts: Sequence[PlateContact], feet: tuple[FootTrajectory, FootTrajectory]
) -> tuple[PlateContact, ...]:
    """Return the loads far from both feet, while these are seen; none unless most loads are under feet, since plates or
    times may be wrong.
    """
    away = [contact for contact in contacts if contact.distance_m > FAR_M and not contact.between]
    if len(away) >= len(contacts) / 2:
        return ()
    return tuple(
        contact
        for contact in away
        if contact.distance_m > STRAY_M and all(foot.seen(contact.time).mean() > _SEEN for foot in feet)
    )


def without_loads(plates: PlateLoads, contacts: Sequence[PlateContact], others: Sequence[PlateContact]) -> PlateLoads:
    """Return the plates without these loads, as long as they last; what belongs to other loads stays."""
    if not contacts:
        return plates
    force, moment = plates.force.copy(), plates.moment.copy()
    for contact in contacts:
        during = within(plates.time, contact.time[0], contact.time[-1])
        for first, last in runs(plates.force[:, contact.plate, 1] > 0):
            span = slice(first, last + 1)
            during[span] |= during[span].any()
        for other in others:
            if other.plate == contact.plate:
                during &= ~within(plates.time, other.time[0], other.time[-1])
        force[during, contact.plate], moment[during, contact.plate] = 0.0, 0.0
    return replace(plates, force=force, moment=moment)


def off_plate(plates: PlateLoads, p: int) -> tuple[float, float] | None:
    """Return the share of the load of plate `p`, where it is reliable, whose centre of pressure is off it, and how far
    (m, 95th percentile; 0 where none is); None where the file has no corners or nothing is loaded.
    """
    loaded = plates.force[:, p, 1] > COP_MIN_FORCE_N
    if plates.corners is None or not loaded.any():
        return None
    beyond = beyond_edges(plates.corners[p], cop_horizontal(plates)[loaded, p])
    off = beyond > 0
    load = plates.force[loaded, p, 1]
    return float(load[off].sum() / load.sum()), float(np.percentile(beyond[off], 95)) if off.any() else 0.0
