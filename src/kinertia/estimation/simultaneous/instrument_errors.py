"""Errors of plates and synchronisation that an estimate found and put right, with what supports an accusation.

Of any error beyond two prior and two posterior deviations the instrument is the likely cause only where it also moves
a joint moment beyond that moment's own error bar and is contradicted by nobody (`instrument_support`). It may as well
be the model's else.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from kinertia.estimation.simultaneous.instrument_support import INTERVAL_SD
from kinertia.estimation.simultaneous.instruments import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.outcome import SimultaneousResult
from kinertia.estimation.simultaneous.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS, ZERO_UNKNOWNS
from kinertia.trial.plate_names import columns_of_several_trials, plate_of_trial

GAIN, FREE_MOMENT, ROTATION, DELAY = "gain", "free moment", "rotation", "delay"
GAIN_IN = "gain in "
"""Before the name of a trial, the whole gain of a plate in it, in `Posterior.calibration`."""
CLOCK_OF = "clock of "
"""Before the name of a trial, what it has of its own besides the delay of all."""
ANOTHER_TRIAL = "another trial"
OTHER_SIGN = "the estimate with free moments of the other sign"
OTHER_PEOPLE = "the session's other people"
SHOWN_UNIT = {
    "m": (1e3, "mm"),
    "s": (1e3, "ms"),
    "1": (1e2, "%"),
    "N": (1.0, "N"),
    "rad": (180.0 / np.pi, "degrees"),
    "N m/N": (1e3, "N m/kN"),
    "kg m": (1.0, "kg m"),
}
"""Factor and unit in which people read a calibrated quantity."""
_NOTABLE = 2.0


@dataclass(frozen=True)
class InstrumentError:
    """What a fit found of one instrument.

    Attributes:
        name: its key in `Posterior.calibration`.
        quantity: one of PLATE_UNKNOWNS, ZERO_UNKNOWNS, "rotation" or "delay".
        plate, trial: names; None of all.
        value: as the estimate applies it (SI): of positions, gains and free moments what puts the plate right.
        prior_sd, sd: deviations before and after.
        unit: "m", "1", "N m/N", "N", "rad" or "s".
        moved: by how many halves of its own 95 % interval the error, put back, moves the joint moment that it moves
            most.
        contradicted_by: who says otherwise; "" nobody.

    >>> gain = InstrumentError("plate left: gain", "gain", "left", None, 0.25, 0.01, 0.01, "1")
    >>> gain.error, gain.found, gain.supported
    (-0.2, True, True)
    """

    name: str
    quantity: str
    plate: str | None
    trial: str | None
    value: float
    prior_sd: float
    sd: float
    unit: str
    moved: float = np.inf
    contradicted_by: str = ""

    @property
    def error(self) -> float:
        """Recorded minus true; of a gain, recorded over true minus one."""
        if self.quantity == GAIN:
            return -self.value / (1.0 + self.value)
        return -self.value if self.quantity in PLATE_UNKNOWNS else self.value

    @property
    def notable(self) -> bool:
        """Whether it is more than an instrument is usually off."""
        return abs(self.value) > _NOTABLE * self.prior_sd

    @property
    def found(self) -> bool:
        """Whether it is also certain."""
        return self.notable and abs(self.value) > _NOTABLE * self.sd

    @property
    def supported(self) -> bool:
        """Whether it also matters, and is contradicted by nobody."""
        return self.found and self.moved > 1.0 and not self.contradicted_by

    @property
    def entry(self) -> dict[str, float | str]:
        """What `Posterior.calibration` has of it."""
        return {name: getattr(self, name) for name in ("value", "prior_sd", "sd", "unit", "moved", "contradicted_by")}


def instrument_errors(
    result: SimultaneousResult, prior: InstrumentPrior, trials: Sequence[str]
) -> tuple[InstrumentError, ...]:
    """All errors of instruments, found or not, each with its support.

    Args:
        result: of the estimator.
        prior: what was known of the instruments before.
        trials: names, in the order of the result's.
    """
    elsewhere = _session_says_otherwise(result.instruments, prior)
    numbered = list(_numbered(result, prior, trials))
    own = {(one.plate, one.quantity): one for _, one in numbered if one.trial is None}
    errors = []
    for place, one in numbered:
        columns = _same_column(one.plate, list(result.plates)) if one.trial is None else []
        by_trial = result.support.contradicted[place] or any(_apart(one, own[each, one.quantity]) for each in columns)
        said = ANOTHER_TRIAL if by_trial else OTHER_PEOPLE if place in elsewhere else ""
        errors.append(replace(one, moved=float(result.support.moved[place]) * abs(one.value), contradicted_by=said))
    return tuple(errors)


def _numbered(
    result: SimultaneousResult, prior: InstrumentPrior, trials: Sequence[str]
) -> Iterator[tuple[int, InstrumentError]]:
    """Errors with the places of their unknowns among all instruments'. Whoever is rotated is displaced a little, too:
    the cause first. A plate's position is its own and the floor's: what one moves, the other does, too.
    """
    floor = len(PLATE_UNKNOWNS) * len(result.plates)
    clock = floor + len(FLOOR_UNKNOWNS)
    for values, sds in list(result.plates.values())[:1]:
        found = float(values[-1]), prior.floor["turn"].sd, float(sds[-1]), "rad"
        place = floor + list(FLOOR_UNKNOWNS).index("turn")
        yield place, InstrumentError("plates: turned about the vertical by", ROTATION, None, None, *found)
    places = count()
    for plate, (values, sds) in result.plates.items():
        for (unknown, unit), value, sd in zip(PLATE_UNKNOWNS.items(), values, sds, strict=False):
            common_sd = prior.floor[unknown].sd if unknown in prior.floor else 0.0
            found = float(value), float(np.hypot(prior.plate[unknown].sd, common_sd)), float(sd), unit
            yield next(places), InstrumentError(f"{_plate(plate)}: {unknown}", unknown, plate, None, *found)
    late_s, late_sd = result.clock_s
    yield clock, InstrumentError("clock: forces late by", DELAY, None, None, late_s, prior.clock_s.sd, late_sd, "s")
    places = count(clock + 1)
    for trial, (later_s, sd) in zip(trials, result.delays_s, strict=False):
        name = f"{CLOCK_OF}{trial}: forces later than in the other trials by"
        yield next(places), InstrumentError(name, DELAY, None, trial, later_s, prior.delay_s.sd, sd, "s")
    trials_of = Counter(plate for zeros in result.zeros_n for plate in zeros)
    for trial, zeros in zip(trials, result.zeros_n, strict=True):
        for plate, (values, sds) in zeros.items():
            column = _plate(plate if trials_of[plate] == 1 else plate_of_trial(plate, trial))
            for (unknown, unit), value, sd in zip(ZERO_UNKNOWNS.items(), values, sds, strict=True):
                found = float(value), prior.zero_n.sd, float(sd), unit
                yield next(places), InstrumentError(f"{column}: {unknown}", unknown, plate, trial, *found)
    for trial, gains in zip(trials, result.gains, strict=True):
        for plate, (gain, sd) in gains.items():
            found = gain, float(np.hypot(prior.plate[GAIN].sd, prior.trial_gain.sd)), sd, "1"
            yield next(places), InstrumentError(f"{_plate(plate)}: {GAIN_IN}{trial}", GAIN, plate, trial, *found)


def _plate(name: str) -> str:
    return f"plate {name.removeprefix('plate ')}"


def _same_column(plate: str | None, plates: Sequence[str]) -> list[str]:
    """Columns of the same name in the force files of other trials."""
    columns = [[plates[k] for k in column] for column in columns_of_several_trials(plates)]
    return [other for column in columns if plate in column for other in column if other != plate]


def _apart(one: InstrumentError, other: InstrumentError) -> bool:
    return abs(one.value - other.value) > INTERVAL_SD * float(np.hypot(one.sd, other.sd))


def _session_says_otherwise(own: InstrumentInformation, prior: InstrumentPrior) -> set[int]:
    """Unknowns of the laboratory's of which these trials say what the session's other people do not."""
    if not prior.session:
        return set()
    (value, sd), (others, others_sd) = (_alone(each, prior) for each in (own, prior.of_session(own.plates)))
    return set(np.flatnonzero(np.abs(value - others) > INTERVAL_SD * np.hypot(sd, others_sd)).tolist())


def _alone(shown: InstrumentInformation, prior: InstrumentPrior) -> tuple[np.ndarray, np.ndarray]:
    """(k,), (k,) values and deviations by what some trials show, under priors of instruments that may all be faulty."""
    faulty = np.array([one.faulty_sd for one in prior.of_unknowns(shown.plates).own])
    covariance = np.linalg.inv(shown.information + np.diag(faulty**-2.0))
    return covariance @ shown.right, np.sqrt(np.diag(covariance))
