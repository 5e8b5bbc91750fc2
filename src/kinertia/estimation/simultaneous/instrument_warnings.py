"""What a fit says of plates and clock that are off: one sentence each."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinertia.estimation.simultaneous.plates import ZERO_UNKNOWNS

_NOTABLE = 2.0
GAIN = "gain"
FREE_MOMENT = "free moment"
"""What a plate adds to the vertical moment, among what is calibrated."""
CLOCK_OF = "clock of "
"""Before the name of a trial, what it has of its own besides the clock of all."""
_FEWEST_PLATES = 2
"""With the same gain or zero, for it to be called that of all: of a single plate it is as likely its own."""
_ONE_SIDED = 0.5
"""Share of the free moments' sizes above which their sum is not that of mirror images."""

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


def instrument_warnings(calibration: Mapping[str, Mapping[str, float | str]]) -> list[str]:
    """One sentence per plate, and one for the clock, with all that is off.

    Free moments that are mirror images and a gain that all plates have alike are not the plates': others say them.
    Zeros that all have alike come first.

    >>> entry = {"value": 0.012, "prior_sd": 0.003, "sd": 0.002, "unit": "m"}
    >>> instrument_warnings({"plate 1: x": entry})
    ['plate 1: x: +12.0 mm (expected within 3 mm); check the instruments']
    """
    off: dict[str, list[str]] = {}
    zeros = {what: common(calibration, what) for what in ZERO_UNKNOWNS}
    elsewhere = {FREE_MOMENT: mirrored_free_moments(calibration), GAIN: common(calibration, GAIN), **zeros}
    for name, entry in calibration.items():
        instrument, colon, what = name.partition(":")
        if colon and notable(entry) and not elsewhere.get(what.strip()):
            scale, unit = SHOWN_UNIT[str(entry["unit"])]
            value, sd = float(entry["value"]), float(entry["prior_sd"])
            said = f"{what}: {value * scale:+.1f} {unit} (expected within {sd * scale:.2g} {unit})"
            off.setdefault(instrument, []).append(said)
    shared = [_common_zero(what, list(values.values())) for what, values in zeros.items() if values]
    return [*shared, *(f"{instrument}:{','.join(said)}; check the instruments" for instrument, said in off.items())]


def _common_zero(what: str, values_n: list[float]) -> str:
    """What makes all plates read too much along one axis, and alike."""
    axis = what.removeprefix("zero ")
    shown = ", ".join(f"{value:+.1f}" for value in values_n)
    return (
        f"all plates read too much along {axis}, and alike ({shown} N): rather a force that no plate measures (a hand "
        "on a rail, a stick, somebody who pulls or pushes, a harness), or plates and cameras that are not level, "
        "than the zero of every plate; joint moments are wrong by what such a force does, and plates may be told to be "
        "elsewhere because of it: find the cause, and record again without it"
    )


def mirrored_free_moments(calibration: Mapping[str, Mapping[str, float | str]]) -> dict[str, float]:
    """What the plates' free moments lack, N m/N, if it is notable and goes to both sides alike; else nothing."""
    entries = {name.partition(":")[0]: e for name, e in calibration.items() if name.endswith(f": {FREE_MOMENT}")}
    lacking = {plate: float(entry["value"]) for plate, entry in entries.items()}
    off = [lacking[plate] for plate, entry in entries.items() if notable(entry)]
    if not off or not min(off) < 0.0 < max(off):
        return {}
    alike = abs(sum(lacking.values())) <= _ONE_SIDED * sum(map(abs, lacking.values()))
    return lacking if alike else {}


def common(calibration: Mapping[str, Mapping[str, float | str]], what: str) -> dict[str, float]:
    """Every plate's gain, or zero, if all are notably off to the same side and differ no more than plates do; else
    nothing.
    """
    entries = {name.partition(":")[0]: e for name, e in calibration.items() if name.endswith(f": {what}")}
    values = {plate: float(entry["value"]) for plate, entry in entries.items()}
    if len(values) < _FEWEST_PLATES or not all(map(notable, entries.values())):
        return {}
    apart, lowest, highest = _NOTABLE * np.sqrt(2), min(values.values()), max(values.values())
    usual = apart * min(float(entry["prior_sd"]) for entry in entries.values())
    return values if lowest * highest > 0.0 and highest - lowest <= usual else {}


def notable(entry: Mapping[str, float | str]) -> bool:
    """Whether what a fit found is more than an instrument is usually off."""
    return abs(float(entry["value"])) > _NOTABLE * float(entry["prior_sd"])
