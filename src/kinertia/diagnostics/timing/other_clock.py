"""Which single correction of time puts all loads under feet that stand: another rate, or another start?

A wrong rate and a late clock look alike to a single contact. But files that begin together and run at different rates
part as time goes on, so that loads end later than they begin, and later ones are later still.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.evidence.foot_ways import FootWay
from kinertia.diagnostics.evidence.load_contacts import FAR_M, Contact, contacts_of, half_within
from kinertia.trial.data import FloatArray, PlateLoads

_FITS_S, _FITS_M = 0.03, 0.08
"""Sound loads begin and end within 25 ms of landing and leaving (RMS over all that the trial shows), under the foot."""
_WRONG_S, _CLEARLY_BEST = 0.045, 0.5
_FEWEST_EDGES = 3
_LEAST_RATE, _MOST_RATE, _RATE_STEP = 1.08, 2.5, 0.01
"""Smaller differences of rates are told by how the delay of many contacts grows (`trial.load_times`)."""
_LONGEST_DELAY_S, _DELAY_STEP_S = 0.25, 0.01


@dataclass(frozen=True)
class _Fit:
    """How well loads fit the feet once time is corrected.

    Attributes:
        value: the rate, or the delay (s), that is taken back.
        late_s: RMS of how far loads begin and end from where feet land and leave; infinite where too few do.
        far_m: of the load that is farthest from the feet.
    """

    value: float
    late_s: float
    far_m: float

    @property
    def fits(self) -> bool:
        return self.late_s < _FITS_S and self.far_m < _FITS_M


def other_rate_trouble(plates: PlateLoads, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> str:
    """Forces that fit the feet at another rate, and at no other start; empty where they fit as they are, or do not."""
    read = _fit(1.0, contacts, ways)
    if (read.late_s <= _WRONG_S and read.far_m < _FITS_M) or not all(way.stands for way in ways):
        return ""
    start = max(float(plates.time[0]), float(ways[0].time[0]))
    rates = np.exp(np.arange(-np.log(_MOST_RATE), np.log(_MOST_RATE) + _RATE_STEP, _RATE_STEP))
    rate = _best(
        plates, ways, rates[np.abs(np.log(rates)) >= np.log(_LEAST_RATE)], lambda t, r: start + (t - start) / r
    )
    if not rate.fits or rate.late_s > _CLEARLY_BEST * _best_delay(plates, ways).late_s:
        return ""
    high, low = ("markers", "forces") if rate.value > 1 else ("forces", "markers")
    return (
        f"markers and forces do not run at the same speed, by a factor of about {rate.value:.2f}: with the time of the "
        f"forces divided by that, loads begin and end within {1e3 * rate.late_s:.0f} ms of where feet land and leave "
        "by their markers (RMS), and no late or early start does that; correct the frame rate of one of the files "
        f"(that of the {high} is stated too high, or that of the {low} too low)"
    )


def other_delay_trouble(plates: PlateLoads, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> str:
    """Forces that are under no foot, and under the feet once they come earlier or later; empty where not so."""
    if _fit(0.0, contacts, ways).far_m < FAR_M:
        return ""
    delay = _best_delay(plates, ways)
    if not delay.fits or abs(delay.value) <= _WRONG_S:
        return ""
    far = max(map(half_within, contacts))
    word = "late" if delay.value > 0 else "early"
    return (
        f"the forces are {1e3 * abs(delay.value):.0f} ms {word}: loads are up to {1e3 * far:.0f} mm off the feet, and "
        f"{1e3 * delay.far_m:.0f} mm once that is taken back, when they also begin and end with the feet's standing "
        "(a belt takes late loads along); correct the start of one of the files (trigger, delay of the analog "
        "channels), or give the forces of this trial if they are of another trial"
    )


def _best_delay(plates: PlateLoads, ways: tuple[FootWay, FootWay]) -> _Fit:
    delays = np.linspace(-_LONGEST_DELAY_S, _LONGEST_DELAY_S, 2 * round(_LONGEST_DELAY_S / _DELAY_STEP_S) + 1)
    return _best(plates, ways, delays, lambda time, late: time - late)


def _best(
    plates: PlateLoads,
    ways: tuple[FootWay, FootWay],
    values: FloatArray,
    corrected: Callable[[FloatArray, float], FloatArray],
) -> _Fit:
    """The one with the smallest delays, of those that leave loads under the feet if there are such."""
    fits = [
        _fit(float(value), contacts_of(replace(plates, time=corrected(plates.time, float(value))), ways), ways)
        for value in values
    ]
    return min(fits, key=lambda one: (one.far_m >= _FITS_M, one.late_s))


def _fit(value: float, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> _Fit:
    late = [edge for contact in contacts for edge in _late(contact, ways[contact.foot])]
    far = max(map(half_within, contacts), default=np.inf)
    enough = len(late) >= _FEWEST_EDGES
    return _Fit(value, float(np.sqrt(np.mean(np.square(late)))) if enough else np.inf, far)


def _late(contact: Contact, way: FootWay) -> list[float]:
    """s, of the beginning and of the end of a load, where both load and stand show it."""
    start, end = contact.time[0], contact.time[-1]
    overlaps = [(min(end, last) - max(start, first), first, last) for first, last, _ in way.stands]
    if not overlaps or max(overlaps)[0] <= 0:
        # a load while the foot swings is off by as much as anything
        return [float(end - start)]
    _, first, last = max(overlaps)
    edges = []
    if first > way.time[0] and np.isfinite(contact.start_s):
        edges.append(contact.start_s - first)
    if last < way.time[-1] and np.isfinite(contact.end_s):
        edges.append(contact.end_s - last)
    return [float(edge) for edge in edges]
