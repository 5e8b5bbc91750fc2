"""What a fit says of plates and clock that are off: warnings of those to check, and corrections that were applied.

An instrument is accused where its error is beyond two prior and two posterior deviations, moves a joint moment beyond
that moment's own error bar, and is contradicted by nobody (`instrument_support`). Any other error beyond two prior
deviations may as well be the model's: it is corrected and called apparent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from kinertia.estimation.simultaneous.plates import PLATE_UNKNOWNS, ZERO_UNKNOWNS

Entry = Mapping[str, float | str]
"""What is calibrated: value, prior_sd, sd, unit; of instruments moved (by how many halves of its own 95 % interval the
error, put back, moves the joint moment that it moves most) and contradicted_by ("" by nobody)."""

_NOTABLE = 2.0
_NOTHING: Entry = {"value": 0.0, "prior_sd": 1.0, "sd": 1.0, "unit": "1"}
GAIN = "gain"
GAIN_IN = "gain in "
"""Before the name of a trial, the whole gain of a plate in it: what it has in all trials, and there besides."""
FREE_MOMENT = "free moment"
"""What a plate adds to the vertical moment, among what is calibrated."""
CLOCK_OF = "clock of "
"""Before the name of a trial, what it has of its own besides the clock of all."""
ALONG: Mapping[str, str] = {"x": "along x", "z": "along z"}
"""How the axes of the plates are called where people do not all walk along one of them."""
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


def instrument_warnings(calibration: Mapping[str, Entry], along: Mapping[str, str] = ALONG) -> list[str]:
    """A warning for each error that accuses an instrument.

    Free moments that are mirror images and a gain that all plates have alike are not the plates': others say them.
    Zeros that all have alike come first.

    >>> entry = {"value": 0.012, "prior_sd": 0.003, "sd": 0.002, "unit": "m"}
    >>> instrument_warnings({"plate 1: x": entry})
    ['Plate 1: displaced along x, corrected by +12.0 mm (usual: within 3). Check where the plate stands']
    """
    zeros = [(what, common(calibration, what)) for what in ZERO_UNKNOWNS]
    shared = [_common_zero(what, list(values.values())) for what, values in zeros if values]
    accused = [_Error(name, entry, along) for name, entry in _own(calibration) if accuses(entry)]
    return [*shared, *(error.warning for error in accused)]


def instrument_corrections(calibration: Mapping[str, Entry], along: Mapping[str, str] = ALONG) -> list[str]:
    """A sentence for each error beyond the usual that accuses nothing.

    >>> entry = {"value": 0.0071, "prior_sd": 0.0023, "sd": 0.001, "unit": "s", "moved": 0.4}
    >>> instrument_corrections({"clock: forces late by": entry})
    ['Clock: forces apparently lag the markers by +7.1 ms (usual: within 2.3), corrected']
    """
    return [
        _Error(name, entry, along).correction
        for name, entry in _own(calibration)
        if notable(entry) and not accuses(entry)
    ]


def _own(calibration: Mapping[str, Entry]) -> Iterator[tuple[str, Entry]]:
    """Entries of instruments, without what several plates have alike.

    A gain that is certain is that of all trials; else it is what the plate has in each.
    """
    elsewhere: dict[str, dict[str, float]] = {what: common(calibration, what) for what in (GAIN, *ZERO_UNKNOWNS)}
    elsewhere[FREE_MOMENT] = mirrored_free_moments(calibration)
    for name, entry in calibration.items():
        instrument, colon, what = name.partition(": ")
        if not colon or elsewhere.get(GAIN if what.startswith(GAIN_IN) else what):
            continue
        of_all = accuses(calibration.get(f"{instrument}: {GAIN}", _NOTHING))
        single = any(each.startswith(f"{instrument}: {GAIN_IN}") for each in calibration)
        if (what.startswith(GAIN_IN) and of_all) or (what == GAIN and single and not of_all):
            continue
        yield name, entry


class _Error:
    """An error of an instrument in words."""

    def __init__(self, name: str, entry: Entry, along: Mapping[str, str]) -> None:
        instrument, _, what = name.partition(": ")
        factor, unit = SHOWN_UNIT[str(entry["unit"])]
        usual = f"{factor * float(entry['prior_sd']):.2g}"
        self._who = instrument[0].upper() + instrument[1:]
        size = f"by {factor * float(entry['value']):+.1f} {unit} (usual: within {usual})"
        # of a plate's own the value is what puts it right, of all else the error
        self._size = (
            f", corrected {size}" if what in PLATE_UNKNOWNS or what.startswith(GAIN_IN) else f" {size}, corrected"
        )
        self._certain, self._apparent, self._check = _words(what, along)
        self._moved = float(entry.get("moved", 0.0))
        self._contradicted = str(entry.get("contradicted_by", ""))

    @property
    def warning(self) -> str:
        """What is off, what it would do, and one thing to do."""
        effect = f". Left in, it moves joint moments by up to {self._moved:.1f} error bars" if self._moved else ""
        return f"{self._who}: {self._certain}{self._size}{effect}. {self._check}"

    @property
    def correction(self) -> str:
        """What was corrected, and who contradicts it."""
        beside = f"; {self._contradicted} says otherwise" if self._contradicted else ""
        return f"{self._who}: {self._apparent}{self._size}{beside}"


def _words(what: str, along: Mapping[str, str]) -> tuple[str, str, str]:
    """What an error is called where it is certain and where it is apparent, and what to check."""
    if what in along:
        where = f"displaced {along[what]}"
        return where, f"apparently {where}", "Check where the plate stands"
    if what in ZERO_UNKNOWNS:
        offset = f"offset of the horizontal force {along[what.removeprefix('zero ')]}"
        return offset, f"apparent {offset}", "Check that the plate is zeroed before every trial"
    if what.startswith(GAIN_IN):
        error = f"gain error in {what.removeprefix(GAIN_IN)}"
        return error, f"apparent {error}", "Check that the amplifier's settings were the same in all trials"
    if what == GAIN:
        return "gain error", "apparent gain error", "Check the plate with a known weight"
    if what == FREE_MOMENT:
        error = "vertical-moment error"
        return error, f"apparent {error}", "Check zero and calibration of the plate's vertical moment"
    if what.startswith("turned"):
        turned = "turned about the vertical"
        return turned, f"apparently {turned}", "Check the axes of plates and cameras"
    lag = "lag the markers more than in the other trials" if "in the other trials" in what else "lag the markers"
    return f"forces {lag}", f"forces apparently {lag}", "Check the camera-analogue synchronisation"


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


def mirrored_free_moments(calibration: Mapping[str, Entry]) -> dict[str, float]:
    """What the plates' free moments lack, N m/N, if it is notable and goes to both sides alike; else nothing."""
    entries = {name.partition(":")[0]: e for name, e in calibration.items() if name.endswith(f": {FREE_MOMENT}")}
    lacking = {plate: float(entry["value"]) for plate, entry in entries.items()}
    off = [lacking[plate] for plate, entry in entries.items() if notable(entry)]
    if not off or not min(off) < 0.0 < max(off):
        return {}
    alike = abs(sum(lacking.values())) <= _ONE_SIDED * sum(map(abs, lacking.values()))
    return lacking if alike else {}


def common(calibration: Mapping[str, Entry], what: str) -> dict[str, float]:
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


def notable(entry: Entry) -> bool:
    """Whether what a fit found is more than an instrument is usually off."""
    return abs(float(entry["value"])) > _NOTABLE * float(entry["prior_sd"])


def accuses(entry: Entry) -> bool:
    """Whether it is also certain, matters, and is contradicted by nobody."""
    certain = abs(float(entry["value"])) > _NOTABLE * float(entry["sd"])
    matters = float(entry.get("moved", np.inf)) > 1.0
    return notable(entry) and certain and matters and not entry.get("contradicted_by")
