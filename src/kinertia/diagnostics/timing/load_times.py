"""Do loads come when the feet stand? Clocks and rates of plates against foot markers.

On sound trials, measured in six laboratories and made by OpenSim, loads begin and end within 25 ms of the feet's
landing and leaving, and last 0.96 to 1.22 times as long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.evidence.foot_ways import FootWay
from kinertia.diagnostics.evidence.load_contacts import EDGE_N, FAR_M, SHORTEST_S, Contact, contacts_of, half_within
from kinertia.trial.data import FloatArray, PlateLoads
from kinertia.trial.ground_contact import bridged
from kinertia.trial.sampled_time import runs, span_s

_DELAY_S, _LONGEST_DELAY_S = 0.045, 0.25
"""Clocks and filters delay by less than the latter; what is later began at another time."""
_RATE = (0.7, 1.4)
_FEWEST_CONTACTS, _LEAST_GROWTH, _CERTAIN, _EXCLUDED, _MOST_GROWTH = 4, 0.004, 6.0, 3.0, 0.1
"""Over 14 and 28 contacts of sound runs a delay grows by less than 0.001; a rate that is 1 % off by 0.01. More than the
last shows in how long loads last."""
_LAG_SD_S, _LEAP_S = 0.010, 0.06
"""A frame or so; and how much a delay cannot change from one contact to the next."""


def rate_trouble(plates: PlateLoads, contacts: Sequence[Contact], ways: Sequence[FootWay]) -> str:
    """Feet stand half or twice as long by the markers as by the plates."""
    last_row, walked = len(plates.time) - 1, [one for one in contacts if _several_steps(one, plates)]
    loaded = [
        float(plates.time[last] - plates.time[first])
        for p, vertical in enumerate(plates.force[..., 1].T)
        for first, last in runs(bridged(plates.time, vertical > EDGE_N))
        if first > 0 and last < last_row and span_s(plates.time, first, last) >= SHORTEST_S
        if not any(one.plate == p and plates.time[first] <= one.time[0] <= plates.time[last] for one in walked)
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


def _several_steps(contact: Contact, plates: PlateLoads) -> bool:
    """Whether it goes from foot to foot, and no other plate takes a foot meanwhile."""
    meanwhile = (plates.time >= contact.time[0]) & (plates.time <= contact.time[-1])
    return contact.in_turn and not (np.delete(plates.force[meanwhile, :, 1], contact.plate, axis=1) > EDGE_N).any()


def delay_trouble(plates: PlateLoads, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> str:
    """Loads that begin and end earlier or later than the feet land and leave: ever more so, or by the same."""
    lags = _Lags.of(contacts, ways)
    if lags is None:
        return ""
    if lags.grows():
        return lags.sentence()
    # both ends say so: a plate that was left early, or a foot that drags, moves one
    delay = lags.delay_s
    if abs(delay) <= _DELAY_S or min(lags.middle_s * np.sign(delay)) < _DELAY_S / 2:
        return ""
    word = "late" if delay > 0 else "early"
    far = max(map(half_within, contacts_of(replace(plates, time=plates.time - delay), ways)), default=np.inf)
    begin, end = lags.middle_s
    shown = (
        f"loads begin {1e3 * begin:+.0f} ms and end {1e3 * end:+.0f} ms after feet land and leave by their markers "
        f"(median of {len(lags.time)})"
    )
    if far > FAR_M / 2 or abs(delay) > _LONGEST_DELAY_S:
        return (
            f"{shown}, and are up to {1e3 * far:.0f} mm off the feet when moved by that: they are of another trial, or "
            f"{1e3 * abs(delay):.0f} ms {word}; give the forces of this trial"
        )
    rate = lags.by_rate(float(plates.time[0]))
    return (
        f"the forces are {1e3 * abs(delay):.0f} ms {word}: {shown}; correct the start of one of the files (trigger, "
        f"delay of the analog channels), or give the forces of this trial if they are of another trial{rate}"
    )


@dataclass(frozen=True, eq=False)
class _Lags:
    """By how much loads begin and end later than feet land and leave (n, 2) s, at these times (n, 2) s of the plates.

    Attributes:
        growth, growth_sd: seconds per second, and its deviation; NaN of a single contact.
    """

    time: FloatArray
    late_s: FloatArray
    growth: float
    growth_sd: float

    @classmethod
    def of(cls, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> _Lags | None:
        """Of whole loads that overlap with a whole stand of their foot; None where there are none."""
        rows = []
        for contact in contacts:
            if not np.isfinite(contact.end_s - contact.start_s):
                continue
            overlaps = [
                (min(end, contact.end_s) - max(start, contact.start_s), start, end)
                for start, end, whole in ways[contact.foot].stands
                if whole
            ]
            if overlaps and max(overlaps)[0] > 0:
                _, start, end = max(overlaps)
                rows.append((contact.start_s, contact.end_s, contact.start_s - start, contact.end_s - end))
        if not rows:
            return None
        time, late = np.split(np.array(sorted(rows)), 2, axis=1)
        return cls(time, late, *_growth(time, late))

    @property
    def middle_s(self) -> FloatArray:
        """(2,) s, of the beginnings and of the ends."""
        return np.asarray(np.median(self.late_s, axis=0))

    @property
    def delay_s(self) -> float:
        """Mean of both."""
        return float(self.middle_s.mean())

    def grows(self) -> bool:
        """Whether the delay changes over time, and that is no chance."""
        return (
            len(self.time) >= _FEWEST_CONTACTS
            and abs(self.growth) > _LEAST_GROWTH
            and abs(self.growth) > _CERTAIN * self.growth_sd
        )

    def sentence(self) -> str:
        """What is wrong where it does."""
        first, last = float(self.time.min()), float(self.time.max())
        begin, end = (self.delay_s + self.growth * (at - float(np.median(self.time))) for at in (first, last))
        return (
            f"markers and forces do not run at the same speed, by a factor of {1 / (1 - self.growth):.3f}: loads come "
            f"{1e3 * begin:+.0f} ms after the feet at {first:.2f} s and {1e3 * end:+.0f} ms at {last:.2f} s "
            f"({len(self.time)} contacts; a late clock would delay all alike); correct the frame rate of one of the "
            "files"
        )

    def by_rate(self, start_s: float) -> str:
        """The other cause of a delay, where contacts do not exclude it: files that begin together and part."""
        growth = self.delay_s / max(float(np.median(self.time)) - start_s, 1e-9)
        if abs(growth) > _MOST_GROWTH or abs(self.growth - growth) > _EXCLUDED * self.growth_sd:
            return ""
        return (
            f"; or their rate is {100 * growth / (1 - growth):+.1f} % off, which so few contacts do not tell: see what "
            "both files say of their rates"
        )


def _growth(time: FloatArray, late: FloatArray) -> tuple[float, float]:
    """Of beginnings and ends alike, and its deviation."""
    steps = np.flatnonzero(np.abs(np.diff(late.mean(axis=1))) > _LEAP_S) + 1
    # a delay of more than half a step is told of the wrong stand
    rows = max(np.split(np.arange(len(time)), steps), key=len)
    at = time[rows] - time[rows].mean(axis=0)
    spread = float((at * at).sum())
    if len(rows) < 2 or spread <= 0.0:
        return 0.0, np.inf
    off = late[rows] - late[rows].mean(axis=0)
    growth = float((at * off).sum()) / spread
    free = 2 * len(rows) - 3
    deviation = max(_LAG_SD_S, float(np.sqrt(np.square(off - growth * at).sum() / free)))
    return growth, deviation / np.sqrt(spread)
