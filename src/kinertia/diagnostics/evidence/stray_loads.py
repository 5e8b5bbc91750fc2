"""Finds loads that are under no foot, of another person or a thing, and takes them off the plates."""

from collections.abc import Sequence
from dataclasses import replace

from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.diagnostics.evidence.plate_contacts import FAR_M, PlateContact
from kinertia.trial.data import PlateLoads
from kinertia.trial.sampled_time import runs, within

STRAY_M = 0.3
"""A load that is farther from both feet than this is not a step of the person: no recording without faults has one."""
_SEEN = 0.5


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
