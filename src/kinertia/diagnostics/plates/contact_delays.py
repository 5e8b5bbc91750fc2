"""Do loads begin and end with stance, and which single time correction, rate or delay, makes them?

On fault-free trials, measured in six laboratories and made by OpenSim, loads begin and end within 25 ms of foot contact
and foot off, and last 0.96 to 1.22 times as long.

A single contact cannot distinguish a wrong rate from a delay. But files that begin together and run at different rates
diverge, so the delay of a load grows from its beginning to its end, and from load to load.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.body_motion import LARGEST_RESIDUAL, vertical_match_of
from kinertia.diagnostics.evidence.plate_contacts import (
    CONTACT_FORCE_N,
    FAR_M,
    FITS_M,
    ContactFit,
    Feet,
    Hypothesis,
    PlateContact,
    contacts_of,
    cop_horizontal,
    loads_on,
)
from kinertia.findings.finding import finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity
from kinertia.trial.data import FloatArray, PlateLoads

DELAY_S, LONGEST_DELAY_S = Limit(0.045, "s", usual=(-0.025, 0.025)), Limit(0.25, "s")
"""Clocks and filters delay by less than the latter; what is later began at another time."""
BOTH_ENDS_S = Limit(0.03, "s", usual=(-0.033, 0.026))
"""At either end; the usual range is of the beginnings. Where a foot drags, loads end up to 83 ms after it leaves."""
_IN_TIME_S = 0.03
"""Pelvis and marker-based centre of 24 fault-free recordings follow the forces by -15 to 27 ms, in windows of half a
second, too; of none does any seem in time with forces 50 ms early or late."""
RATES = (Limit(0.7, usual=(0.96, 1.22)), Limit(1.4, usual=(0.96, 1.22)))
LEAST_RATE_ERROR = Limit(0.004, usual=(-0.001, 0.001))
_FEWEST_CONTACTS, _CERTAIN, _EXCLUDED, _MOST_RATE_ERROR = 4, 6.0, 3.0, 0.1
"""Over 14 and 28 contacts of fault-free runs a delay grows by less than 0.001; with a rate that is wrong by 1 % by
0.01. A larger error than the last shows in the duration of loads."""
RATE_ERROR_OF_FEW, _CERTAIN_OF_FEW = Limit(0.05, usual=(-0.023, 0.023)), 2.5
"""The same of two or three contacts. On eight fault-free walks, and with forces 50 and 100 ms early or late, the delay
grows by up to 0.023; with a rate that is wrong by 10 % by 0.075 to 0.123."""
_DELAY_SD_S, _LEAP_S = 0.010, 0.06
"""A frame or so; and how much a delay cannot change from one contact to the next, unless it grows over a few."""
_CLEARLY_BEST = 0.5
_LEAST_RATE, _MOST_RATE, _RATE_STEP = 1.08, 2.5, 0.01
"""Range and step of rate factors; smaller errors show in the growing delay of many contacts (`contact_delays`)."""
_LONGEST_TRIED_S, _DELAY_STEP_S = 0.25, 0.01


def stance_durations(context: RecordingContext) -> Iterator[Hypothesis]:
    """Report T201: feet that stand half or twice as long by the markers as by the plates."""
    plates, feet, contacts = context.whole_loads, context.foot_trajectories, context.whole_contacts
    if plates is None or context.plates is None or feet is None:
        return
    last_row, walked = len(plates.time) - 1, [contact for contact in contacts if _several_steps(contact, plates)]
    loaded = [
        float(plates.time[last] - plates.time[first])
        for p in range(len(plates.names))
        for first, last in loads_on(plates, p)
        if first > 0 and last < last_row
        if not any(
            contact.plate == p and plates.time[first] <= contact.time[0] <= plates.time[last] for contact in walked
        )
    ]
    standing = _stances(contacts, feet)
    if not loaded or not standing:
        return
    by_plates, by_markers = float(np.median(loaded)), float(np.median(standing))
    ratio, frame_s = by_plates / by_markers, float(np.median(np.diff(feet[0].time)))
    # of 0.2 s at 25 frames a second a foot seems to stand for 0.16 to 0.24 s
    if (by_markers - frame_s) / by_plates < RATES[1] and (by_markers + frame_s) / by_plates > RATES[0]:
        return
    found = finding(
        "T201",
        context.at(),
        ratio=Quantity(ratio, "1", usual=RATES[0].usual),
        stance_s=Quantity((by_markers, by_plates), "s"),
        contacts=Quantity(len(loaded), "1"),
        method=Quantity("duration of stance by markers and by plates"),
    )
    start = float(plates.time[0])
    yield Hypothesis(found, replace(context.plates, time=start + (plates.time - start) / ratio))


def _stances(contacts: Sequence[PlateContact], feet: Feet) -> list[float]:
    """Return how long (s) feet stand while they are loaded, or all stance phases where none is loaded. Before and
    after, the person may stand on a box or turn round.
    """
    loaded = [(contact.foot, contact.time[0], contact.time[-1]) for contact in contacts]
    whole = [(k, start, end) for k, foot in enumerate(feet) for start, end, all_of_it in foot.stance_spans if all_of_it]
    of_steps = [
        end - start
        for k, start, end in whole
        if any(k == foot and start < last and end > first for foot, first, last in loaded)
    ]
    return of_steps or [end - start for _, start, end in whole]


def _several_steps(contact: PlateContact, plates: PlateLoads) -> bool:
    """Return whether the load goes from foot to foot while no other plate takes a foot."""
    meanwhile = (plates.time >= contact.time[0]) & (plates.time <= contact.time[-1])
    others = np.delete(plates.force[meanwhile, :, 1], contact.plate, axis=1)
    return contact.in_turn and not (others > CONTACT_FORCE_N).any()


def contact_delays(context: RecordingContext) -> Iterator[Hypothesis]:
    """Report T201, T211 and T212: loads that begin and end earlier or later than foot contact and foot-off:
    increasingly (T201), or equally (T211; T212 where no synchronisation is that late, or loads are under no foot even
    then).
    """
    plates, feet = context.plates, context.foot_trajectories
    if plates is None or feet is None:
        return
    delays = ContactDelays.of(context.whole_contacts, feet)
    if delays is None:
        return
    if delays.grows(float(plates.time[0])):
        yield _growing(context, plates, delays)
        return
    # both ends must agree: a plate that was left early, or a foot that drags, moves one end
    delay = delays.delay_s
    if abs(delay) <= DELAY_S or min(delays.median_s * np.sign(delay)) < BOTH_ENDS_S:
        return
    corrected = replace(plates, time=plates.time - delay)
    far_m = max((contact.distance_m for contact in contacts_of(corrected, feet)), default=np.inf)
    measured = {
        "delay_s": Quantity(delay, "s", limit=DELAY_S, usual=DELAY_S.usual),
        "begin_s": Quantity(float(delays.median_s[0]), "s"),
        "end_s": Quantity(float(delays.median_s[1]), "s"),
        "contacts": Quantity(len(delays.time), "1"),
    }
    if far_m > FAR_M / 2 or abs(delay) > LONGEST_DELAY_S:
        distance = Quantity(far_m, "m", limit=FAR_M / 2)
        yield Hypothesis(with_evidence("T212", context.at(), measured | {"distance_m": distance}), corrected)
        return
    if forces_keep_time(context):
        return
    causes = ["the trigger or start of one file", "a filter that delays"]
    if (rate := delays.by_rate(float(plates.time[0]))) is not None:
        measured["rate_alternative"] = Quantity(rate, "1")
        causes.append("a wrong sampling rate, which so few contacts do not exclude (T201)")
    yield Hypothesis(with_evidence("T211", context.at(), measured, causes=tuple(causes)), corrected)


def forces_keep_time(context: RecordingContext) -> bool:
    """Return whether vertical velocities show that the forces are not delayed."""
    pairs = [vertical_match_of(part) for part in context.velocities]
    late_s = [
        abs(match.delay_s)
        for both in pairs
        if len(both) > 1 and max(match.residual for match in both) <= LARGEST_RESIDUAL
        for match in both
    ]
    return bool(late_s) and max(late_s) < _IN_TIME_S


def _growing(context: RecordingContext, plates: PlateLoads, delays: "ContactDelays") -> Hypothesis:
    middle_s, rate_error = float(np.median(delays.time)), delays.rate_error
    first, last = (
        delays.delay_s + rate_error * (at - middle_s) for at in (float(delays.time.min()), float(delays.time.max()))
    )
    found = finding(
        "T201",
        context.at(),
        ratio=Quantity(1.0 / (1.0 - rate_error), "1", usual=(0.999, 1.001)),
        delay_s=Quantity((first, last), "s"),
        contacts=Quantity(len(delays.time), "1"),
        method=Quantity("growing delay of contacts"),
    )
    grown = delays.delay_s + rate_error * (plates.time - middle_s)
    return Hypothesis(found, replace(plates, time=plates.time - grown))


@dataclass(frozen=True, eq=False)
class ContactDelays:
    """Delays (n, 2) s of the start and end of loads after foot contact and foot-off, at times (n, 2) s of the plates.

    Attributes:
        rate_error, rate_error_sd: seconds per second by which the delay grows, and its SD; infinite of one contact.
    """

    time: FloatArray
    delays_s: FloatArray
    rate_error: float
    rate_error_sd: float

    @classmethod
    def of(cls, contacts: Sequence[PlateContact], feet: Feet) -> "ContactDelays | None":
        """Compute the delays of whole loads that overlap with a whole stance phase of their foot; None without any."""
        rows = []
        for foot, start_s, end_s in _steps(contacts):
            overlaps = [
                (min(end, end_s) - max(start, start_s), start, end)
                for start, end, whole in feet[foot].stance_spans
                if whole
            ]
            if overlaps and max(overlaps)[0] > 0:
                _, start, end = max(overlaps)
                rows.append((start_s, end_s, start_s - start, end_s - end))
        if not rows:
            return None
        time, late = np.split(np.array(sorted(rows)), 2, axis=1)
        return cls(time, late, *_rate_error(time, late))

    @property
    def median_s(self) -> FloatArray:
        """Median delays (2,) s of the starts and of the ends."""
        return np.asarray(np.median(self.delays_s, axis=0))

    @property
    def delay_s(self) -> float:
        """Mean (s) of the median delays of starts and ends."""
        return float(self.median_s.mean())

    def grows(self, start_s: float) -> bool:
        """Return whether the delay changes significantly over time; over few contacts, as in files that begin together
        at `start_s` and run at different rates.
        """
        growth, many = abs(self.rate_error), len(self.time) >= _FEWEST_CONTACTS
        begins_s = self.delay_s - self.rate_error * (float(np.median(self.time)) - start_s)
        together = many or abs(begins_s) < abs(self.delay_s)
        limit, certain = (LEAST_RATE_ERROR, _CERTAIN) if many else (RATE_ERROR_OF_FEW, _CERTAIN_OF_FEW)
        return bool(growth > limit and growth > certain * self.rate_error_sd and together)

    def by_rate(self, start_s: float) -> float | None:
        """Return the rate error that would explain the delay, of files that begin together and diverge; None where
        contacts exclude it.
        """
        rate_error = self.delay_s / max(float(np.median(self.time)) - start_s, 1e-9)
        if abs(rate_error) > _MOST_RATE_ERROR or abs(self.rate_error - rate_error) > _EXCLUDED * self.rate_error_sd:
            return None
        return rate_error / (1.0 - rate_error)


def _steps(contacts: Sequence[PlateContact]) -> list[tuple[int, float, float]]:
    """Return foot, start (s) and end (s) of whole loads; one of two plates that a foot loads together is one step."""
    steps: list[tuple[int, float, float]] = []
    # a load that passes from foot to foot begins with one of them and ends with the other
    whole = [contact for contact in contacts if not contact.in_turn and np.isfinite(contact.end_s - contact.start_s)]
    for foot, start_s, end_s in sorted((contact.foot, contact.start_s, contact.end_s) for contact in whole):
        together = bool(steps) and steps[-1][0] == foot and start_s < steps[-1][2]
        steps = (
            [*steps[:-1], (foot, steps[-1][1], max(steps[-1][2], end_s))]
            if together
            else [*steps, (foot, start_s, end_s)]
        )
    return steps


def _rate_error(time: FloatArray, late: FloatArray) -> tuple[float, float]:
    """Fit the rate error to starts and ends together, with its SD."""
    few = len(time) < _FEWEST_CONTACTS
    most_s = _LEAP_S + few * _MOST_RATE_ERROR * np.diff(time.mean(axis=1))
    steps = np.flatnonzero(np.abs(np.diff(late.mean(axis=1))) > most_s) + 1
    # a delay of more than half a step is measured from the wrong stance phase
    rows = max(np.split(np.arange(len(time)), steps), key=len)
    at = time[rows] - time[rows].mean(axis=0)
    spread = float((at * at).sum())
    if len(rows) < 2 or spread <= 0.0:
        return 0.0, np.inf
    off = late[rows] - late[rows].mean(axis=0)
    rate_error = float((at * off).sum()) / spread
    free = 2 * len(rows) - 3
    deviation = max(_DELAY_SD_S, float(np.sqrt(np.square(off - rate_error * at).sum() / free)))
    return rate_error, deviation / np.sqrt(spread)


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
    in_time = read.delay_rms_s <= DELAY_S or len(contacts) < len(context.contacts)
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
    if delay.fit.fits and abs(delay.value) > DELAY_S:
        found = finding(
            "T211",
            context.at(),
            delay_s=Quantity(delay.value, "s", limit=DELAY_S, usual=DELAY_S.usual),
            before_m=Quantity(read.far_m, "m"),
            after_m=Quantity(delay.fit.far_m, "m"),
            contacts=Quantity(len(contacts), "1"),
        )
        yield Hypothesis(found, replace(context.plates, time=plates.time - delay.value))


def _best_delay(plates: PlateLoads, feet: Feet) -> _Best:
    delays = np.linspace(-_LONGEST_TRIED_S, _LONGEST_TRIED_S, 2 * round(_LONGEST_TRIED_S / _DELAY_STEP_S) + 1)
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
    return min(tried, key=lambda candidate: (candidate.fit.far_m >= FITS_M, candidate.fit.delay_rms_s))
