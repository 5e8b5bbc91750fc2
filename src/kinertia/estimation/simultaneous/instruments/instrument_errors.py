"""Lists plate and synchronisation errors that were corrected, and whether the instrument is the likely cause.

For an error beyond two prior and two posterior standard deviations the instrument is the likely cause only if the error
also changes a joint moment by more than the moment's own uncertainty and no other estimate contradicts it
(`instrument_support`). Otherwise the model may as well be the cause.

The estimate solves for corrections of positions, gains and free moments. Here all become errors, recorded minus true.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import count
from typing import Any, Literal, NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.instruments.plates import (
    FLOOR_UNKNOWNS,
    PLATE_ERRORS,
    PLATE_UNKNOWNS,
    ZERO_UNKNOWNS,
)
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation, InstrumentPrior
from kinertia.findings.display import plate_text
from kinertia.trial.trial_input import columns_of_several_trials

POSITION, GAIN, FREE_MOMENT, ZERO, ROTATION, DELAY = (
    "position", "gain", "free moment", "zero offset", "rotation", "delay",
)  # fmt: skip
"""Quantities of instruments, each an error: recorded minus true; for a gain, recorded over true minus 1."""
CENTRE, AXIS, BENDING = "centre change", "axis change", "bending"
"""Quantities of the body. A change is the estimate minus the model's value."""
SHOWN_UNIT = {
    "m": (1e3, "mm"),
    "s": (1e3, "ms"),
    "1": (1e2, "%"),
    "N": (1.0, "N"),
    "N m": (1.0, "N m"),
    "rad": (180.0 / np.pi, "degrees"),
    "N m/N": (1e3, "N m/kN"),
    "kg m": (1.0, "kg m"),
}
"""Factor and unit in which a calibrated quantity is shown."""
INTERVAL_SD = 1.96
"""Half of a 95 % interval, in standard deviations."""
NOTABLE = 2.0
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
"""Quantity and axis of each unknown of the estimate."""
_CORRECTIONS = ("x", "z", "free moment")
"""Unknowns that the estimate adds to what was recorded: the errors are their opposites."""
_UNITS = {**PLATE_ERRORS, **ZERO_UNKNOWNS}


@dataclass(frozen=True, kw_only=True)
class CalibrationEntry:
    """Estimate of one calibrated quantity, in SI units.

    Attributes:
        kind: kind of instrument or body part.
        plate: name; None for all plates together, and if it is not a plate.
        joint: name.
        trial: name; None if all trials share the quantity.
        quantity: one of the constants of this module.
        axis: "x" forward, "y" up or "z" to the right; "1" or "2" of two directions across the axis of a joint.
        value: an error for instruments, a change for joints.
        prior_sd, sd: standard deviations before and after.
        unit: a key of SHOWN_UNIT.
        moved: for instruments, the effect of the uncorrected error on the most affected joint moment, in half-widths of
            the moment's own 95 % interval.
        contradicted_by: other estimate that finds another error of the instrument; None if there is none.

    >>> gain = CalibrationEntry(
    ...     kind="plate", plate="left", quantity=GAIN, value=-0.2, prior_sd=0.01, sd=0.01, unit="1", moved=3.0
    ... )
    >>> str(gain), gain.found, gain.supported
    ('plate left: gain', True, True)
    """

    kind: Literal["plate", "synchronisation", "joint", "trunk"]
    plate: str | None = None
    joint: str | None = None
    trial: str | None = None
    quantity: str
    axis: str | None = None
    value: float
    prior_sd: float
    sd: float
    unit: str
    moved: float | None = None
    contradicted_by: str | None = None

    @property
    def of_instrument(self) -> bool:
        """Whether it is an error of plates or synchronisation."""
        return self.kind in ("plate", "synchronisation")

    @property
    def key(self) -> tuple[str | None, ...]:
        """Identifier of the quantity among all entries of a fit."""
        return self.kind, self.plate, self.joint, self.trial, self.quantity, self.axis

    @property
    def notable(self) -> bool:
        """Whether the error exceeds two prior standard deviations."""
        return abs(self.value) > NOTABLE * self.prior_sd

    @property
    def found(self) -> bool:
        """Whether the error also exceeds two posterior standard deviations."""
        return self.notable and abs(self.value) > NOTABLE * self.sd

    @property
    def moves_moments(self) -> bool:
        """Whether the error exceeds two posterior standard deviations and affects joint moments beyond their bars."""
        return abs(self.value) > NOTABLE * self.sd and self.moved is not None and self.moved > 1.0

    @property
    def supported(self) -> bool:
        """Whether the error also affects joint moments and is contradicted by no other estimate."""
        return self.notable and self.moves_moments and not self.contradicted_by

    def __str__(self) -> str:
        item = item_text(self.kind, self.plate, self.joint)
        return f"{item}: {quantity_text(self.quantity, self.axis, self.trial)}"


def item_text(kind: str, plate: str | None, joint: str | None = None) -> str:
    """Return the label of what has a quantity: "plate left", "all plates", "hip_r", "synchronisation"."""
    return plate_text(plate) if kind == "plate" else joint or kind


def quantity_text(quantity: str, axis: str | None, trial: str | None = None) -> str:
    """Return the label of a quantity with its axis and, if specific to one, its trial: "position x", "gain in walk"."""
    along = f"{quantity} {axis}" if axis else quantity
    return f"{along} in {trial}" if trial else along


def calibration_columns(entries: Iterable[CalibrationEntry]) -> dict[str, list[Any]]:
    """Return the table of calibrated quantities, by column."""
    entries = list(entries)
    return {field.name: [getattr(entry, field.name) for entry in entries] for field in fields(CalibrationEntry)}


@dataclass(frozen=True, eq=False, kw_only=True)
class FoundErrors:
    """Values that the estimate solved for, with their posterior standard deviations.

    Attributes:
        plates: per plate its errors (5,), in the order of PLATE_ERRORS, and their posterior standard deviations (5,).
        delay_s: the synchronisation delay and its posterior standard deviation, s.
        delays_s: per trial the additional delay of its forces, and its posterior standard deviation, s; of a single
            trial the total delay, or none if its synchronisation has been checked.
        zeros_n: per trial and plate the zero offsets (2,), in the order of ZERO_UNKNOWNS, and their posterior standard
            deviations (2,).
        gains: per trial and plate the total gain in the trial, and its posterior standard deviation.
        instruments: information of these trials on plates and synchronisation.
    """

    plates: dict[str, tuple[np.ndarray, np.ndarray]]
    delay_s: tuple[float, float]
    delays_s: tuple[tuple[float, float], ...]
    zeros_n: tuple[dict[str, tuple[np.ndarray, np.ndarray]], ...]
    gains: tuple[dict[str, tuple[float, float]], ...]
    instruments: InstrumentInformation


class Solved(NamedTuple):
    """An entry, with the index of its unknown among all instruments' and the value that the estimate solved for."""

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
    """List all errors of instruments, significant or not, each with its support.

    Args:
        found: values from the estimator.
        prior: of the instruments.
        trials: names.
        support: `InstrumentSupport.moved` and `contradicted`, of all errors.
        own_place: index of the first error that is specific to a trial; the laboratory's come first.
    """
    moved, contradicted = support
    elsewhere = _session_says_otherwise(found.instruments, prior)
    shared = list(laboratory_errors(found.plates, found.delay_s, prior))
    by_key = {(entry.plate, entry.quantity, entry.axis): entry for _, _, entry in shared}
    errors = []
    for place, value, entry in (*shared, *_of_trials(found, prior, trials, own_place)):
        columns = _same_column(entry.plate, list(found.plates)) if entry.trial is None else []
        others = [by_key[column, entry.quantity, entry.axis] for column in columns]
        by_trial = contradicted[place] or any(_apart(entry, other) for other in others)
        said = ANOTHER_TRIAL if by_trial else OTHER_PEOPLE if place in elsewhere else None
        errors.append(replace(entry, moved=float(moved[place]) * abs(value), contradicted_by=said))
    return tuple(errors)


def laboratory_errors(
    plates: Mapping[str, tuple[np.ndarray, np.ndarray]], delay_s: tuple[float, float], prior: InstrumentPrior
) -> Iterator[Solved]:
    """Yield the errors that all trials share, without support.

    A rotation also displaces plates a little, so rotations come first, as the cause. A plate's position and rotation
    are the sums of its own and the common ones: a shift of one is a shift of the other.

    Args:
        plates: per plate (5,) values of PLATE_ERRORS, as the estimate solves for them, and (5,) their standard
            deviations.
        delay_s: the delay of the forces, and its standard deviation.
        prior: of the instruments.
    """
    places, errors = count(), []
    for plate, (values, sds) in plates.items():
        for unknown, value, sd in zip(PLATE_UNKNOWNS, values, sds, strict=True):
            common_sd = prior.floor[unknown].sd if unknown in prior.floor else 0.0
            prior_sd = float(np.hypot(prior.plate[unknown].sd, common_sd))
            errors.append(_of_plate(next(places), unknown, value, prior_sd, sd, plate=plate))
    yield from sorted(errors, key=lambda error: error.entry.quantity != ROTATION)
    yield _delay(len(errors) + len(FLOOR_UNKNOWNS), delay_s, prior.delay_s.sd)


def _of_trials(found: FoundErrors, prior: InstrumentPrior, trials: Sequence[str], first: int) -> Iterator[Solved]:
    """Yield the errors that are specific to trials; for gains, a plate's total gain error in the trial.

    The delay of a single trial is its total, too: nothing separates its own from that of all trials.
    """
    places = count(first)
    shared_sd = prior.delay_s.sd if len(found.delays_s) == 1 else 0.0
    for trial, trial_delay_s in zip(trials, found.delays_s, strict=False):
        yield _delay(next(places), trial_delay_s, float(np.hypot(prior.trial_delay_s.sd, shared_sd)), trial)
    for trial, zeros in zip(trials, found.zeros_n, strict=True):
        for plate, (values, sds) in zeros.items():
            for unknown, value, sd in zip(ZERO_UNKNOWNS, values, sds, strict=True):
                yield _of_plate(next(places), unknown, value, prior.zero_offset_n.sd, sd, plate=plate, trial=trial)
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
    elif unknown in _CORRECTIONS:
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


def _delay(place: int, trial_delay_s: tuple[float, float], prior_sd: float, trial: str | None = None) -> Solved:
    value, sd = trial_delay_s
    entry = CalibrationEntry(
        kind="synchronisation", trial=trial, quantity=DELAY, value=value, prior_sd=prior_sd, sd=sd, unit="s"
    )
    return Solved(place, value, entry)


def _same_column(plate: str | None, plates: Sequence[str]) -> list[str]:
    """Return the columns of the same name in the force files of other trials."""
    columns = [[plates[k] for k in column] for column in columns_of_several_trials(plates)]
    return [other for column in columns if plate in column for other in column if other != plate]


def _apart(calibration_entry: CalibrationEntry, other: CalibrationEntry) -> bool:
    return abs(calibration_entry.value - other.value) > INTERVAL_SD * float(np.hypot(calibration_entry.sd, other.sd))


def _session_says_otherwise(of_person: InstrumentInformation, prior: InstrumentPrior) -> set[int]:
    """Return the laboratory's unknowns for which these trials and the session's other people disagree."""
    if not prior.session:
        return set()
    (value, sd), (others, others_sd) = (
        _alone(information, prior) for information in (of_person, prior.of_session(of_person.plates))
    )
    return set(np.flatnonzero(np.abs(value - others) > INTERVAL_SD * np.hypot(sd, others_sd)).tolist())


def _alone(shown: InstrumentInformation, prior: InstrumentPrior) -> tuple[np.ndarray, np.ndarray]:
    """Return values (k,) and standard deviations (k,) from some trials alone, if any instrument may be faulty."""
    faulty = np.array([prior_of_error.faulty_sd for prior_of_error in prior.of_unknowns(shown.plates).individual])
    covariance = np.linalg.inv(shown.information + np.diag(faulty**-2.0))
    return covariance @ shown.rhs, np.sqrt(np.diag(covariance))
