"""What a fit says of plates and clock that are off: one sentence each."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

_NOTABLE = 2.0
GAIN = "gain"
FREE_MOMENT = "free moment"
"""What a plate adds to the vertical moment, among what is calibrated."""
CLOCK_OF = "clock of "
"""Before the name of a trial, what it has of its own besides the clock of all."""
_FEWEST_PLATES = 2
"""With the same gain, for it to be called that of all: of a single plate it is as likely its own."""
_ONE_SIDED = 0.5
"""Share of the free moments' sizes above which their sum is not that of mirror images."""

SHOWN_UNIT = {
    "m": (1e3, "mm"),
    "s": (1e3, "ms"),
    "1": (1e2, "%"),
    "N": (1.0, "N"),
    "rad": (180.0 / np.pi, "degrees"),
    "N m/N": (1e3, "N m/kN"),
}
"""Factor and unit in which people read a calibrated quantity."""


def instrument_warnings(calibration: Mapping[str, Mapping[str, float | str]]) -> list[str]:
    """One sentence per plate, and one for the clock, with all that is off.

    Free moments that are mirror images and a gain that all plates have alike are not the plates': others say them.

    >>> entry = {"value": 0.012, "prior_sd": 0.003, "sd": 0.002, "unit": "m"}
    >>> instrument_warnings({"plate 1: x": entry})
    ['plate 1: x: +12.0 mm (expected within 3 mm); check the instruments']
    """
    off: dict[str, list[str]] = {}
    elsewhere = {FREE_MOMENT: mirrored_free_moments(calibration), GAIN: common_gain(calibration)}
    for name, entry in calibration.items():
        instrument, colon, what = name.partition(":")
        if colon and notable(entry) and not elsewhere.get(what.strip()):
            scale, unit = SHOWN_UNIT[str(entry["unit"])]
            value, sd = float(entry["value"]), float(entry["prior_sd"])
            said = f"{what}: {value * scale:+.1f} {unit} (expected within {sd * scale:.2g} {unit})"
            off.setdefault(instrument, []).append(said)
    return [f"{instrument}:{','.join(said)}; check the instruments" for instrument, said in off.items()]


def mirrored_free_moments(calibration: Mapping[str, Mapping[str, float | str]]) -> dict[str, float]:
    """What the plates' free moments lack, N m/N, if it is notable and goes to both sides alike; else nothing."""
    entries = {name.partition(":")[0]: e for name, e in calibration.items() if name.endswith(f": {FREE_MOMENT}")}
    lacking = {plate: float(entry["value"]) for plate, entry in entries.items()}
    off = [lacking[plate] for plate, entry in entries.items() if notable(entry)]
    if not off or not min(off) < 0.0 < max(off):
        return {}
    alike = abs(sum(lacking.values())) <= _ONE_SIDED * sum(map(abs, lacking.values()))
    return lacking if alike else {}


def common_gain(calibration: Mapping[str, Mapping[str, float | str]]) -> dict[str, float]:
    """Every plate's gain, if all are notably off to the same side and differ no more than plates do; else nothing."""
    entries = {name.partition(":")[0]: e for name, e in calibration.items() if name.endswith(f": {GAIN}")}
    gains = {plate: float(entry["value"]) for plate, entry in entries.items()}
    if len(gains) < _FEWEST_PLATES or not all(map(notable, entries.values())):
        return {}
    apart, lowest, highest = _NOTABLE * np.sqrt(2), min(gains.values()), max(gains.values())
    usual = apart * min(float(entry["prior_sd"]) for entry in entries.values())
    return gains if lowest * highest > 0.0 and highest - lowest <= usual else {}


def notable(entry: Mapping[str, float | str]) -> bool:
    """Whether what a fit found is more than an instrument is usually off."""
    return abs(float(entry["value"])) > _NOTABLE * float(entry["prior_sd"])
