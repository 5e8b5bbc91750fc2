"""Lists plate and synchronisation errors that were corrected, with what supports an accusation.

Of any error beyond two prior and two posterior deviations the instrument is the likely cause only where it also moves
a joint moment beyond that moment's own error bar and is contradicted by nobody (`instrument_support`). It may as well
be the model's else.

The estimate solves for what puts positions, gains and free moments right. Here all become errors, recorded minus true.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.calibration_entry import (
    DELAY,
    FREE_MOMENT,
    GAIN,
    INTERVAL_SD,
    POSITION,
    ROTATION,
    ZERO,
    CalibrationEntry,
)
from kinertia.estimation.simultaneous.instruments import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.plates import FLOOR_UNKNOWNS, PLATE_ERRORS, PLATE_UNKNOWNS, ZERO_UNKNOWNS
from kinertia.trial.plate_names import columns_of_several_trials

ANOTHER_TRIAL = "another trial"
OTHER_SIGN = "the estimate with free moments of the other sign"
OTHER_PEOPLE = "the session's other people"
_QUANTITIES = {
    "x": (POSITION, "x"),
    "z": (POSITION, "z"),
    "gain": (GAIN, None),
    "free moment": (FREE_MOMENT, None),
    "turn": (ROTATION, None),
    "zero x": (ZERO, "x"),
    "zero z": (ZERO, "z"),
}
"""Quantity and axis by unknown of the estimate."""
_UNITS = {**PLATE_ERRORS, **ZERO_UNKNOWNS}


@dataclass(frozen=True, eq=False, kw_only=True)
class FoundErrors:
    """Values that the estimate solved for, and their posterior deviations.

    Attributes:
        plates: per plate what is wrong with it (5,), in the order of PLATE_ERRORS, and the posterior deviations (5,).
        clock_s: the time offset and its posterior deviation, s.
        delays_s: per trial how much later its forces are than by the clock of all, and the posterior deviation, s; none
            of a single trial whose clock has been checked.
        zeros_n: per trial, per plate what it reads too much (2,), in the order of ZERO_UNKNOWNS, and the posterior
            deviations (2,).
        gains: per trial, per plate its whole gain in it, and the posterior deviation.
        instruments: what these trials say of plates and clock.
    """

    plates: dict[str, tuple[np.ndarray, np.ndarray]]
    clock_s: tuple[float, float]
    delays_s: tuple[tuple[float, float], ...]
    zeros_n: tuple[dict[str, tuple[np.ndarray, np.ndarray]], ...]
    gains: tuple[dict[str, tuple[float, float]], ...]
    instruments: InstrumentInformation


class Solved(NamedTuple):
    """An entry, with the place of its unknown among all instruments' and the value that the estimate solved for."""

    place: int
    value: float
    entry: CalibrationEntry


def instrument_errors(
    found: FoundErrors,
    prior: InstrumentPrior,
    trials: Sequence[str],
    support: tuple[np.ndarray, np.ndarray],
    own_place: int,
) -> tuple[CalibrationEntry, ...]:
    """All errors of instruments, found or not, each with its support.

    Args:
        found: by the estimator.
        prior: what was known of the instruments before.
        trials: names.
        support: `InstrumentSupport.moved` and `contradicted`, of all errors.
        own_place: of the first that trials have of their own among them; the laboratory's come first.
    """
    moved, contradicted = support
    elsewhere = _session_says_otherwise(found.instruments, prior)
    shared = list(laboratory_errors(found.plates, found.clock_s, prior))
    own = {(one.plate, one.quantity, one.axis): one for _, _, one in shared}
    errors = []
    for place, value, one in (*shared, *_of_trials(found, prior, trials, own_place)):
        columns = _same_column(one.plate, list(found.plates)) if one.trial is None else []
        others = [own[column, one.quantity, one.axis] for column in columns]
        by_trial = contradicted[place] or any(_apart(one, other) for other in others)
        said = ANOTHER_TRIAL if by_trial else OTHER_PEOPLE if place in elsewhere else None
        errors.append(replace(one, moved=float(moved[place]) * abs(value), contradicted_by=said))
    return tuple(errors)


def laboratory_errors(
    plates: Mapping[str, tuple[np.ndarray, np.ndarray]], clock_s: tuple[float, float], prior: InstrumentPrior
) -> Iterator[Solved]:
    """Errors that all trials share, without support.

    Whoever is rotated is displaced a little, too: the cause first. A plate's position is its own and the floor's: what
    one moves, the other does, too.

    Args:
        plates: per plate (5,) values of PLATE_ERRORS, as the estimate solves for them, and (5,) their deviations.
        clock_s: the delay of the forces, and its deviation.
        prior: what was known of the instruments before.
    """
    floor = len(PLATE_UNKNOWNS) * len(plates)
    for values, sds in list(plates.values())[:1]:
        turn = list(FLOOR_UNKNOWNS).index("turn")
        yield _of_plate(floor + turn, "turn", values[-1], prior.floor["turn"].sd, sds[-1])
    places = count()
    for plate, (values, sds) in plates.items():
        for unknown, value, sd in zip(PLATE_UNKNOWNS, values, sds, strict=False):
            common_sd = prior.floor[unknown].sd if unknown in prior.floor else 0.0
            prior_sd = float(np.hypot(prior.plate[unknown].sd, common_sd))
            yield _of_plate(next(places), unknown, value, prior_sd, sd, plate=plate)
    yield _delay(floor + len(FLOOR_UNKNOWNS), clock_s, prior.clock_s.sd)


def _of_trials(found: FoundErrors, prior: InstrumentPrior, trials: Sequence[str], first: int) -> Iterator[Solved]:
    """Errors that trials have of their own; of gains, what a plate has in the trial altogether."""
    places = count(first)
    for trial, delay_s in zip(trials, found.delays_s, strict=False):
        yield _delay(next(places), delay_s, prior.delay_s.sd, trial)
    for trial, zeros in zip(trials, found.zeros_n, strict=True):
        for plate, (values, sds) in zeros.items():
            for unknown, value, sd in zip(ZERO_UNKNOWNS, values, sds, strict=True):
                yield _of_plate(next(places), unknown, value, prior.zero_n.sd, sd, plate=plate, trial=trial)
    gain_sd = float(np.hypot(prior.plate["gain"].sd, prior.trial_gain.sd))
    for trial, gains in zip(trials, found.gains, strict=True):
        for plate, (gain, sd) in gains.items():
            yield _of_plate(next(places), "gain", gain, gain_sd, sd, plate=plate, trial=trial)


def _of_plate(
    place: int,
    unknown: str,
    value: float,
    prior_sd: float,
    sd: float,
    plate: str | None = None,
    trial: str | None = None,
) -> Solved:
    quantity, axis = _QUANTITIES[unknown]
    error, error_sd = float(value), float(sd)
    if quantity == GAIN:
        error, error_sd = -error / (1.0 + error), error_sd / (1.0 + error) ** 2
    elif unknown in PLATE_UNKNOWNS:
        error = 0.0 - error
    entry = CalibrationEntry(
        kind="plate",
        plate=plate,
        trial=trial,
        quantity=quantity,
        axis=axis,
        value=error,
        prior_sd=prior_sd,
        sd=error_sd,
        unit=_UNITS[unknown],
    )
    return Solved(place, value, entry)


def _delay(place: int, delay_s: tuple[float, float], prior_sd: float, trial: str | None = None) -> Solved:
    value, sd = delay_s
    entry = CalibrationEntry(
        kind="synchronisation", trial=trial, quantity=DELAY, value=value, prior_sd=prior_sd, sd=sd, unit="s"
    )
    return Solved(place, value, entry)


def _same_column(plate: str | None, plates: Sequence[str]) -> list[str]:
    """Columns of the same name in the force files of other trials."""
    columns = [[plates[k] for k in column] for column in columns_of_several_trials(plates)]
    return [other for column in columns if plate in column for other in column if other != plate]


def _apart(one: CalibrationEntry, other: CalibrationEntry) -> bool:
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
