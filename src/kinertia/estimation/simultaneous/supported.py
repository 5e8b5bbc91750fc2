"""Calibrated quantities with what supports an accusation of their instruments (`instrument_support`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from kinertia.estimation.simultaneous.instrument_support import INTERVAL_SD
from kinertia.estimation.simultaneous.instrument_warnings import GAIN_IN, Entry
from kinertia.estimation.simultaneous.instruments import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.outcome import SimultaneousResult
from kinertia.estimation.simultaneous.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS, ZERO_UNKNOWNS
from kinertia.trial.plate_names import columns_of_several_trials

ANOTHER_TRIAL = "another trial"
OTHER_SIGN = "the estimate with free moments of the other sign"
OTHER_PEOPLE = "the session's other people"


def with_support(
    calibration: Mapping[str, Entry], result: SimultaneousResult, prior: InstrumentPrior
) -> dict[str, dict[str, float | str]]:
    """The same entries, in the same order; those of instruments with `moved` and `contradicted_by`.

    Args:
        calibration: what a fit found, instruments after all else, in the order of their unknowns.
        result: the fit.
        prior: what was known of the instruments before.
    """
    found = {name: dict(entry) for name, entry in calibration.items()}
    names = dict(_places(calibration, result))
    elsewhere = _session_says_otherwise(result.instruments, prior)
    for name, place in names.items():
        entry = found[name]
        entry["moved"] = float(result.support.moved[place]) * abs(float(entry["value"]))
        by_trial = result.support.contradicted[place] or _same_column_says_otherwise(name, calibration, result)
        entry["contradicted_by"] = ANOTHER_TRIAL if by_trial else OTHER_PEOPLE if place in elsewhere else ""
    return found


def _places(calibration: Mapping[str, Entry], result: SimultaneousResult) -> Iterator[tuple[str, int]]:
    """Names of the instruments' entries, and where their unknowns stand among all instruments'. A plate's place is its
    own and the floor's: what one moves, the other does, too.
    """
    plates, names = list(result.plates), list(calibration)
    each, floor = len(PLATE_UNKNOWNS), len(PLATE_UNKNOWNS) * len(plates)
    clock = floor + len(FLOOR_UNKNOWNS)
    rows = [name for name in names if name.startswith(("plates:", "plate ", "clock"))]
    turned = [name for name in rows if name.startswith("plates:")]
    yield from zip(turned, [floor + list(FLOOR_UNKNOWNS).index("turn")], strict=False)
    own = [name for name in rows if name.rpartition(": ")[2] in PLATE_UNKNOWNS]
    yield from zip(own, range(each * len(plates)), strict=True)
    late = [name for name in rows if name.startswith("clock")]
    yield from zip(late, range(clock, clock + 1 + len(result.delays_s)), strict=False)
    zeros = [name for name in rows if name.rpartition(": ")[2] in ZERO_UNKNOWNS]
    first = clock + 1 + len(result.delays_s)
    yield from zip(zeros, range(first, first + len(zeros)), strict=True)
    gains = [name for name in rows if name.rpartition(": ")[2].startswith(GAIN_IN)]
    yield from zip(gains, range(first + len(zeros), first + len(zeros) + len(gains)), strict=True)


def _same_column_says_otherwise(name: str, calibration: Mapping[str, Entry], result: SimultaneousResult) -> bool:
    """Whether columns of the same name in the force files of other trials are found elsewhere."""
    plates = list(result.plates)
    instrument, _, what = name.rpartition(": ")
    shown = {f"plate {plate.removeprefix('plate ')}": k for k, plate in enumerate(plates)}
    if instrument not in shown or what not in PLATE_UNKNOWNS:
        return False
    for column in columns_of_several_trials(plates):
        if shown[instrument] in column:
            others = [list(shown)[k] for k in column if k != shown[instrument]]
            return any(_apart(calibration[name], calibration[f"{other}: {what}"]) for other in others)
    return False


def _apart(one: Entry, other: Entry) -> bool:
    away = abs(float(one["value"]) - float(other["value"]))
    return bool(away > INTERVAL_SD * np.hypot(float(one["sd"]), float(other["sd"])))


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


def directions(turned_deg: Sequence[float]) -> dict[str, str]:
    """How the laboratory's axes are called in the person's terms, from how far each trial was turned to face +X; by
    themselves where people walk along both.

    >>> directions([0.0, 180.0]), directions([90.0])
    ({'x': 'fore-aft', 'z': 'mediolaterally'}, {'x': 'mediolaterally', 'z': 'fore-aft'})
    >>> directions([0.0, 90.0])
    {'x': 'along x', 'z': 'along z'}
    """
    across = {round(angle / 90.0) % 2 for angle in turned_deg}
    if len(across) > 1:
        return {"x": "along x", "z": "along z"}
    names = ("mediolaterally", "fore-aft") if across == {1} else ("fore-aft", "mediolaterally")
    return dict(zip("xz", names, strict=True))
