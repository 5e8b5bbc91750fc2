"""Which single time correction, a rate or a delay, puts all loads under feet in stance?

A single contact cannot distinguish a wrong rate from a delay. But files that begin together and run at different rates
diverge, so the delay of a load grows from its beginning to its end, and from load to load.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.contact_fit import FITS_M, ContactFit, Feet, Hypothesis
from kinertia.diagnostics.evidence.plate_contacts import FAR_M, contacts_of, cop_horizontal
from kinertia.diagnostics.timing.contact_delays import USUAL_S
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import FloatArray, PlateLoads

_WRONG_S, _CLEARLY_BEST = 0.045, 0.5
_LEAST_RATE, _MOST_RATE, _RATE_STEP = 1.08, 2.5, 0.01
"""Range and step of rate factors; smaller errors show in the growing delay of many contacts (`contact_delays`)."""
_LONGEST_DELAY_S, _DELAY_STEP_S = 0.25, 0.01


@dataclass(frozen=True)
class _Best:
    """The rate, or the delay (s), that fits best, and the quality of the fit."""

    value: float
    fit: ContactFit


def fitted_rate_or_delay(context: RecordingContext) -> Iterator[Hypothesis]:
    """Report T201 where loads fit the feet at another rate and at no delay; T211 where they are under no foot until a
    delay is undone (on a belt, delayed loads move along). Loads of feet that reach beyond their plates begin late or
    end early.
    """
    plates, feet, contacts = context.whole_loads, context.foot_trajectories, context.whole_contacts
    if plates is None or context.plates is None or feet is None or not contacts:
        return
    read = ContactFit.of(contacts, feet)
    in_time = read.delay_rms_s <= _WRONG_S or len(contacts) < len(context.contacts)
    if in_time and read.far_m < FITS_M:
        return
    start = max(float(plates.time[0]), float(feet[0].time[0]))
    if all(foot.stance_spans for foot in feet):
        rates = np.exp(np.arange(-np.log(_MOST_RATE), np.log(_MOST_RATE) + _RATE_STEP, _RATE_STEP))
        rates = rates[np.abs(np.log(rates)) >= np.log(_LEAST_RATE)]
        rate = _best(plates, feet, rates, lambda time, factor: start + (time - start) / factor)
        if rate.fit.fits and rate.fit.delay_rms_s <= _CLEARLY_BEST * _best_delay(plates, feet).fit.delay_rms_s:
            found = finding(
                "T201",
                context.at(),
                ratio=Quantity(rate.value, "1", usual=(0.999, 1.001)),
                delay_s=Quantity((read.delay_rms_s, rate.fit.delay_rms_s), "s"),
                contacts=Quantity(len(contacts), "1"),
                method=Quantity("rate that fits all contacts"),
            )
            yield Hypothesis(found, replace(context.plates, time=start + (plates.time - start) / rate.value))
    if read.far_m < FAR_M:
        return
    delay = _best_delay(plates, feet)
    if delay.fit.fits and abs(delay.value) > _WRONG_S:
        found = finding(
            "T211",
            context.at(),
            delay_s=Quantity(delay.value, "s", limit=_WRONG_S, usual=USUAL_S),
            before_m=Quantity(read.far_m, "m"),
            after_m=Quantity(delay.fit.far_m, "m"),
            contacts=Quantity(len(contacts), "1"),
        )
        yield Hypothesis(found, replace(context.plates, time=plates.time - delay.value))


def _best_delay(plates: PlateLoads, feet: Feet) -> _Best:
    delays = np.linspace(-_LONGEST_DELAY_S, _LONGEST_DELAY_S, 2 * round(_LONGEST_DELAY_S / _DELAY_STEP_S) + 1)
    return _best(plates, feet, delays, lambda time, late: time - late)


def _best(
    plates: PlateLoads, feet: Feet, values: FloatArray, corrected: Callable[[FloatArray, float], FloatArray]
) -> _Best:
    """Return the value with the smallest delays, among those that put the loads under the feet if any do."""
    point = cop_horizontal(plates)
    tried = []
    for value in values:
        moved = replace(plates, time=corrected(plates.time, float(value)))
        tried.append(_Best(float(value), ContactFit.of(contacts_of(moved, feet, point), feet)))
    return min(tried, key=lambda one: (one.fit.far_m >= FITS_M, one.fit.delay_rms_s))
