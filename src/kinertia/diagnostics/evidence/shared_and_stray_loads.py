"""Finds loads that both feet bear on one plate, and loads that are under no foot."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.evidence.contact_fit import Feet
from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.diagnostics.evidence.plate_contacts import BETWEEN_M, FAR_M, ONE_STEP_S, PlateContact
from kinertia.findings.limit import Limit
from kinertia.model.marker_set import MarkerSet
from kinertia.motion.kinematics import FEWEST_FRAMES
from kinertia.trial.data import FEET, BoolArray, PlateLoads, Trial
from kinertia.trial.sampled_data import runs, span_s, within

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
    own, other = np.linalg.norm(contact.offset_m, axis=2)[[contact.foot, 1 - contact.foot]]
    opposite = np.prod(contact.offset_m, axis=0).sum(axis=1) < 0
    away: BoolArray = np.minimum(own, other) > BETWEEN_M
    away &= opposite
    # on a treadmill's single belt the feet come in turn, and each sample is sorted (`plate_assignment`)
    if span_s(contact.time) <= ONE_STEP_S:
        away |= own > OUTSIDE_M
    away &= own > OTHERS_SHARE * (own + other)
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
    return min(one.length_m for one in feet) > _LEAST_LENGTH_M


def stray_contacts(
    contacts: Sequence[PlateContact], feet: tuple[FootTrajectory, FootTrajectory]
) -> tuple[PlateContact, ...]:
    """Return the loads far from both feet, while these are seen; none unless most loads are under feet, since plates or
    times may be wrong.
    """
    away = [one for one in contacts if one.distance_m > FAR_M and not one.between]
    if len(away) >= len(contacts) / 2:
        return ()
    return tuple(
        one for one in away if one.distance_m > STRAY_M and all(foot.seen(one.time).mean() > _SEEN for foot in feet)
    )


def without_loads(plates: PlateLoads, contacts: Sequence[PlateContact], others: Sequence[PlateContact]) -> PlateLoads:
    """Return the plates without these loads, as long as they last; what belongs to other loads stays."""
    if not contacts:
        return plates
    force, moment = plates.force.copy(), plates.moment.copy()
    for one in contacts:
        during = within(plates.time, one.time[0], one.time[-1])
        for first, last in runs(plates.force[:, one.plate, 1] > 0):
            span = slice(first, last + 1)
            during[span] |= during[span].any()
        for other in others:
            if other.plate == one.plate:
                during &= ~within(plates.time, other.time[0], other.time[-1])
        force[during, one.plate], moment[during, one.plate] = 0.0, 0.0
    return replace(plates, force=force, moment=moment)
