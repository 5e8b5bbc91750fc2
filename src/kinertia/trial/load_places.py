"""Are loads under the feet, and there when the feet stand? Clocks, places and units of plates against foot markers.

On sound trials, measured in six laboratories and made by OpenSim, loads begin and end within 25 ms of the feet's
landing and leaving, last 0.96 to 1.22 times as long, act within 40 mm of the line from heel to toe (median over the
load), and right and left are off that line by the same outwards, within 8 mm (26 mm with one plate 20 mm off).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads, Recording, runs
from kinertia.trial.foot_ways import FootWay, foot_ways
from kinertia.trial.ground_contact import bridged

_FIRM_N = 5 * LOAD_THRESHOLD_N
_EDGE_N = 50.0
_SHORTEST_S = 0.15
_DELAY_S, _LONGEST_DELAY_S = 0.045, 0.25
"""Clocks and filters delay by less than the latter; what is later began at another time."""
_RATE = (0.7, 1.4)
_FAR_M = 0.15
"""Half of a load farther than this from both feet is under neither."""
_FAR_TOO_FAR_M = 5.0
_OFFSET_M = 0.03
_END = 0.05
_BEGIN_M, _END_M = -0.015, 0.06
"""There is no foot behind the marker at the back of the heel: on sound trials, from squats to forefoot runs, the first
twentieth of a load is 36 to 99 mm in front of it. The last one is at most 25 mm in front of the foremost marker, which
may be on the metatarsals."""
_BOTH_BACK_M, _BOTH_FORWARD_M = (0.02, -0.07), (0.13, 0.035)
"""Where the first twentieth of steps and their last one are both, on average, farther back, or farther forward, no way
of landing or pushing off is the reason. On nine sound trials they are 36 to 85 mm and -58 to 25 mm."""
_OUTSIDE_M, _OUTSIDE_SHARE = 0.14, 0.01
_BOTH_M, _ONE_STEP_S, _MOSTLY = 0.08, 1.5, 0.5
"""Loads that last longer than a step are of both feet, in turn (walking on one belt) or at once (squats): then most of
the load is between them, farther than this from both."""


@dataclass(frozen=True, eq=False)
class _Contact:
    """One load on one plate.

    Attributes:
        plate: its index.
        start_s, end_s: when it is above `_EDGE_N`; NaN for an end that the trial does not show.
        foot: 0 right, 1 left, under which it mostly is.
        weight: (k,) N, its vertical force where that is firm.
        time: (k,) s.
        off_m: (2, k, 2) m, horizontally from each foot to the centre of pressure.
        ends_m: how far the first twentieth of the load is in front of the heel, and the last one in front of the toes.
    """

    plate: int
    start_s: float
    end_s: float
    foot: int
    weight: FloatArray
    time: FloatArray
    off_m: FloatArray
    ends_m: tuple[float, float]

    @property
    def off_own_m(self) -> FloatArray:
        """(2,) m, mean distance of the load from its foot along X and Z."""
        result: FloatArray = self.weight @ self.off_m[self.foot] / self.weight.sum()
        return result


def load_places_trouble(recording: Recording, feet: Mapping[str, Sequence[str]]) -> str:
    """Why loads cannot be those of these feet at this time; empty where they can.

    Args:
        recording: a motion with plates.
        feet: labels of the markers on each foot, "r" and "l".
    """
    ways = foot_ways(recording.markers, feet, recording.belt)
    if ways is None or recording.plates is None:
        return ""
    contacts = _contacts(recording.plates, ways)
    if not contacts:
        return ""
    return (
        _unit_trouble(contacts)
        or _rate_trouble(recording.plates, ways)
        or _exchange_trouble(recording.plates, contacts, ways)
        or _time_trouble(recording.plates, contacts, ways)
        or _place_trouble(contacts)
    )


def load_places_doubts(recording: Recording, feet: Mapping[str, Sequence[str]]) -> list[str]:
    """Offsets of all plates together, and loads that belong to both feet, if `load_places_trouble` found nothing."""
    ways = foot_ways(recording.markers, feet, recording.belt)
    if ways is None or recording.plates is None:
        return []
    contacts = _contacts(recording.plates, ways)
    doubts = [_offset_doubt(contacts), _both_feet_doubt(recording.plates, contacts, ways)]
    return [one for one in doubts if one]


def _contacts(plates: PlateLoads, ways: tuple[FootWay, FootWay]) -> list[_Contact]:
    """Loads of at least `_SHORTEST_S` while markers are there."""
    first_s, last_s = ways[0].time[0], ways[0].time[-1]
    point = _points(plates)
    contacts = []
    for p in range(len(plates.names)):
        vertical = plates.force[:, p, 1]
        for first, last in runs(bridged(plates.time, vertical > _EDGE_N)):
            start, end = float(plates.time[first]), float(plates.time[last])
            rows = np.arange(first, last + 1)
            time = plates.time[rows]
            rows = rows[(vertical[rows] > _FIRM_N) & (time >= first_s) & (time <= last_s)]
            if end - start < _SHORTEST_S or len(rows) < 3:
                continue
            off = np.stack([way.off_foot(plates.time[rows], point[rows, p]) for way in ways])
            near = [float(vertical[rows] @ np.linalg.norm(one, axis=1)) for one in off]
            foot = int(np.argmin(near))
            ahead = ways[foot].beyond(plates.time[rows], point[rows, p])
            ends_m = (_quantile(ahead[0], vertical[rows], _END), _quantile(ahead[1], vertical[rows], 1 - _END))
            begins, ends = first > 0 and start > first_s, last < len(plates.time) - 1 and end < last_s
            contacts.append(
                _Contact(
                    p,
                    start if begins else np.nan,
                    end if ends else np.nan,
                    foot,
                    vertical[rows],
                    plates.time[rows],
                    off,
                    ends_m,
                )
            )
    return contacts


def _points(plates: PlateLoads) -> FloatArray:
    """(k, p, 2) m, centres of pressure (x, z), at the plates' height where that is known."""
    height = 0.0 if plates.corners is None else plates.corners[:, :, 1].mean(axis=1)[None, :, None]
    force, moment = plates.force, plates.moment
    lifted = moment - np.cross(np.array([0.0, 1.0, 0.0]) * height, force)
    return centre_of_pressure(np.concatenate([force, lifted], axis=2))[..., [0, 2]]


def _unit_trouble(contacts: Sequence[_Contact]) -> str:
    far = min(_half_within(contact) for contact in contacts)
    if far < _FAR_TOO_FAR_M:
        return ""
    return (
        f"the points at which the forces act are {far:.3g} m away from the feet: they are in mm, or in other axes than "
        "the markers, or torques are in N mm; export points in m and torques in N m"
    )


def _half_within(contact: _Contact) -> float:
    """m from the nearer foot, within which half of the load is."""
    return _quantile(np.linalg.norm(contact.off_m, axis=2).min(axis=0), contact.weight, 0.5)


def _quantile(values: FloatArray, weight: FloatArray, share: float) -> float:
    """The value below which this share of the weight is."""
    order = np.argsort(values)
    passed = np.cumsum(weight[order]) / weight.sum()
    return float(values[order][min(int(np.searchsorted(passed, share)), len(order) - 1)])


def _rate_trouble(plates: PlateLoads, ways: Sequence[FootWay]) -> str:
    """Feet stand half or twice as long by the markers as by the plates."""
    last_row = len(plates.time) - 1
    loaded = [
        float(plates.time[last] - plates.time[first])
        for vertical in plates.force[..., 1].T
        for first, last in runs(bridged(plates.time, vertical > _EDGE_N))
        if first > 0 and last < last_row and plates.time[last] - plates.time[first] >= _SHORTEST_S
    ]
    standing = [end - start for way in ways for start, end, whole in way.stands if whole]
    if not loaded or not standing:
        return ""
    by_plates, by_markers = float(np.median(loaded)), float(np.median(standing))
    if _RATE[0] < by_markers / by_plates < _RATE[1]:
        return ""
    return (
        f"by the markers a foot stands for {by_markers:.2f} s, by the plates for {by_plates:.2f} s: markers and forces "
        f"do not run at the same speed; the frame rate of one of them is wrong (by {by_markers / by_plates:.2g}): "
        "correct it"
    )


def _exchange_trouble(plates: PlateLoads, contacts: Sequence[_Contact], ways: tuple[FootWay, FootWay]) -> str:
    """Loads that are under no foot where they are, but under one where another plate is."""
    used = sorted({contact.plate for contact in contacts})
    whole = [_half_within(one) for one in contacts]
    if len(used) < 2 or max(whole) <= _FAR_M:
        return ""
    point = _points(plates)
    middle = _middles(plates, point, used)
    best = (max(whole), (0, 0))
    for one, other in permutations(used, 2):
        if one > other:
            continue
        moved = point.copy()
        moved[:, one] += middle[other] - middle[one]
        moved[:, other] += middle[one] - middle[other]
        far = []
        for contact in contacts:
            rows = np.searchsorted(plates.time, contact.time)
            off = np.stack([way.off_foot(contact.time, moved[rows, contact.plate]) for way in ways])
            far.append(_half_within(replace(contact, off_m=off)))
        if max(far) < best[0]:
            best = (max(far), (one, other))
    if best[0] > _FAR_M / 2:
        return ""
    names = " and ".join(plates.names[p] for p in best[1])
    return (
        f"the loads of {names} are {1e3 * max(whole):.0f} mm from the feet, and {1e3 * best[0]:.0f} mm once they are "
        f"exchanged: their channels or their corners are exchanged; correct the order of the plates"
    )


def _middles(plates: PlateLoads, point: FloatArray, used: Sequence[int]) -> dict[int, FloatArray]:
    if plates.corners is not None:
        return {p: plates.corners[p].mean(axis=0)[[0, 2]] for p in used}
    firm = {p: plates.force[:, p, 1] > _FIRM_N for p in used}
    return {p: np.average(point[firm[p], p], axis=0, weights=plates.force[firm[p], p, 1]) for p in used}


def _time_trouble(plates: PlateLoads, contacts: Sequence[_Contact], ways: tuple[FootWay, FootWay]) -> str:
    """Loads that begin and end earlier or later than the feet land and leave."""
    late = []
    for contact in contacts:
        if not np.isfinite(contact.end_s - contact.start_s):
            continue
        overlaps = [
            (min(end, contact.end_s) - max(start, contact.start_s), (contact.start_s - start, contact.end_s - end))
            for start, end, whole in ways[contact.foot].stands
            if whole
        ]
        if overlaps and max(overlaps)[0] > 0:
            late.append(max(overlaps)[1])
    if not late:
        return ""
    begin, end = (float(np.median([one[k] for one in late])) for k in range(2))
    delay = (begin + end) / 2
    # both ends say so: a plate that was left early, or a foot that drags, moves one
    if abs(delay) <= _DELAY_S or min(begin * np.sign(delay), end * np.sign(delay)) < _DELAY_S / 2:
        return ""
    word = "late" if delay > 0 else "early"
    far = max(map(_half_within, _contacts(replace(plates, time=plates.time - delay), ways)), default=np.inf)
    lags = (
        f"loads begin {1e3 * begin:+.0f} ms and end {1e3 * end:+.0f} ms after feet land and leave by their markers "
        f"(median of {len(late)})"
    )
    if far > _FAR_M / 2 or abs(delay) > _LONGEST_DELAY_S:
        return (
            f"{lags}, and are up to {1e3 * far:.0f} mm off the feet when moved by that: they are of another trial, or "
            f"{1e3 * abs(delay):.0f} ms {word}; give the forces of this trial"
        )
    return (
        f"the forces are {1e3 * abs(delay):.0f} ms {word}: {lags}; correct the start of one of the files (trigger, "
        "delay of the analog channels), or give the forces of this trial if they are of another trial"
    )


def _place_trouble(contacts: Sequence[_Contact]) -> str:
    """Loads that are under no foot."""
    far = [(one, _half_within(one)) for one in contacts]
    off = [(one, distance) for one, distance in far if distance > _FAR_M]
    if not off or len(off) < len(far) / 2:
        return ""
    offsets = np.array([one.off_own_m for one, _ in far])
    mean = offsets.mean(axis=0)
    if np.abs(offsets - mean).max() < _FAR_M / 2:
        return (
            f"all centres of pressure are off the feet by {1e3 * mean[0]:+.0f} mm along X and {1e3 * mean[1]:+.0f} mm "
            "along Z: cameras and plates have different origins (moved, or calibrated anew); correct the places of "
            "the plates"
        )
    return (
        f"centres of pressure are {1e3 * off[0][1]:.0f} mm away from the nearest foot: the forces are of another "
        "trial, or the axes or places of the plates are wrong; give the forces of this trial, or correct the plates"
    )


def _offset_doubt(contacts: Sequence[_Contact]) -> str:
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


def _ends_doubt(contacts: Sequence[_Contact]) -> str:
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


def _both_feet_doubt(plates: PlateLoads, contacts: Sequence[_Contact], ways: tuple[FootWay, FootWay]) -> str:
    """A load between the feet: both are on the plate, but only the sum of what they do is known. A foot that swings by
    its markers is on none.
    """
    spans = []
    for contact in contacts:
        distance = np.linalg.norm(contact.off_m, axis=2)
        between = (distance > _BOTH_M).all(axis=0) & (np.prod(contact.off_m, axis=0).sum(axis=1) < 0)
        away = between | (distance[contact.foot] > _OUTSIDE_M)
        # on a treadmill's single belt the feet come in turn, and each sample is sorted (`plate_assignment`)
        if contact.time[-1] - contact.time[0] > _ONE_STEP_S:
            away = between
        away &= ways[1 - contact.foot].standing(contact.time)
        share = float(contact.weight[away].sum() / contact.weight.sum())
        if share > (_MOSTLY if contact.time[-1] - contact.time[0] > _ONE_STEP_S else _OUTSIDE_SHARE):
            when = contact.time[away]
            spans.append(f"{plates.names[contact.plate]} from {when[0]:.3f} to {when[-1]:.3f} s")
    if not spans:
        return ""
    return (
        f"the centre of pressure leaves the foot that stands on the plate: both feet are on it ({', '.join(spans)}), "
        "and what each does is not known; use a trial with one foot on each plate, or give a window without that time "
        "(window_s)"
    )
