"""What a fit says of plates and clock that are off: one sentence each.

**Free moments that are mirror images.** In some measured walks the motion needs other free moments than the plates
measure, by 3 to 6 N m/kN, to one side under the right foot and to the other under the left; in single stance the
vertical moment is off by 1 to 3 N m before the estimate, too, likewise. Where turning their sign does not explain it
(`free_moment_sign`), two plates have no reason to err like that; the body has: it is what legs, trunk and arms that
turn against one another would need if their angular momentum were wrong by some tenths of a kg m2/s, as a trunk that
bends, or skin over pelvis and shoulders, may make it. A plate that is wrong shows under one foot, or under both to the
same side, as does the mean over whole strides (`trial.free_moment`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

MIRRORED_FREE_MOMENTS = "the motion needs other free moments than measured"
"""How the sentence about free moments that are mirror images begins."""
_NOTABLE = 2.0
_FREE = "free moment"
_ONE_SIDED = 0.5
"""Share of the free moments' sizes above which their sum is not that of mirror images."""

SHOWN_UNIT = {
    "m": (1e3, "mm"),
    "s": (1e3, "ms"),
    "1": (1e2, "%"),
    "rad": (180.0 / np.pi, "degrees"),
    "N m/N": (1e3, "N m/kN"),
}
"""Factor and unit in which people read a calibrated quantity."""


def instrument_warnings(calibration: Mapping[str, Mapping[str, float | str]]) -> list[str]:
    """One sentence per plate, and one for the clock, with all that is off.

    >>> entry = {"prior_sd": 0.0007, "sd": 0.002, "unit": "N m/N"}
    >>> named = {"plate 1: free moment": {"value": 0.005, **entry}, "plate 2: free moment": {"value": -0.006, **entry}}
    >>> instrument_warnings(named)[0].partition(":")[0]
    'the motion needs other free moments than measured, +5.0 (plate 1), -6.0 (plate 2) N m/kN'
    """
    off: dict[str, list[str]] = {}
    free = {name.partition(":")[0]: float(e["value"]) for name, e in calibration.items() if name.endswith(f": {_FREE}")}
    mirrored = _mirrored(np.array(list(free.values())), calibration)
    for name, entry in calibration.items():
        instrument, colon, what = name.partition(":")
        if colon and _notable(entry) and not (mirrored and what.strip() == _FREE):
            scale, unit = SHOWN_UNIT[str(entry["unit"])]
            value, sd = float(entry["value"]), float(entry["prior_sd"])
            said = f"{what}: {value * scale:+.1f} {unit} (expected within {sd * scale:.2g} {unit})"
            off.setdefault(instrument, []).append(said)
    sentences = [f"{instrument}:{','.join(said)}; check the instruments" for instrument, said in off.items()]
    if mirrored:
        listed = ", ".join(f"{value * 1e3:+.1f} ({plate})" for plate, value in free.items())
        sentences.append(
            f"{MIRRORED_FREE_MOMENTS}, {listed} N m/kN: mirror images, so rather a trunk "
            f"that is not rigid, or skin, than the plates; moments about the long axes of foot and leg are as uncertain"
        )
    return sentences


def _notable(entry: Mapping[str, float | str]) -> bool:
    return abs(float(entry["value"])) > _NOTABLE * float(entry["prior_sd"])


def _mirrored(values: np.ndarray, calibration: Mapping[str, Mapping[str, float | str]]) -> bool:
    """Whether free moments that are notable go to both sides alike."""
    notable = [float(e["value"]) for name, e in calibration.items() if name.endswith(f": {_FREE}") and _notable(e)]
    both = bool(notable) and min(notable) < 0.0 < max(notable)
    return both and abs(float(values.sum())) <= _ONE_SIDED * float(np.abs(values).sum())
