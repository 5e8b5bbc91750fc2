"""Reads a person's mass, stature and body measures from a C3D file.

The format has no place for them. Vicon's Plug-in Gait writes them to PROCESSING (`Bodymass` in kg, `Height` and
`LKneeWidth` in mm), others to SUBJECTS or SUBJECT, in spellings and units of their own. Nothing is read from a file
with several people, since it is unknown whose data they are.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.c3d.ezc3d_library import parameter_values
from kinertia.model.marker_set import folded

_GROUPS = ("PROCESSING", "SUBJECT", "SUBJECTS", "SUBJECT_DATA", "PATIENT", "ANTHROPOMETRY", "ANTHROPOMETRICS")
"""The first that has a quantity counts."""
_MASS = re.compile(r"(body|subject|patient)?(mass|weight)")
_HEIGHT = re.compile(r"(body|subject|patient)?(height|stature)")
_SIDES = {"r": "R", "right": "R", "l": "L", "left": "L"}
_SIDE = "|".join(_SIDES)
_MEASURE = re.compile(rf"({_SIDE})?(knee|ankle|elbow|wrist|leg)(width|diameter|breadth|length)({_SIDE})?")
_OTHER_LENGTH = re.compile(r"(Width|Length|Distance|Thickness|ShoulderOffset|SoleDelta)$", re.IGNORECASE)
_SUBJECT = re.compile(r"^[A-Z]_")
_UNIT = re.compile(r"[\s_([]+(kg|mm|cm|m)[])]?\s*$", re.IGNORECASE)
_NUMBER = re.compile(r"\s*(\d+(?:[.,]\d+)?)\s*(kg|mm|cm|m)?\s*", re.IGNORECASE)
_PER_METRE = {"mm": 1000.0, "cm": 100.0, "m": 1.0}
_MASS_KG, _HEIGHT_M, _BMI = (8.0, 300.0), (0.5, 2.5), (7.0, 90.0)
"""Plausible ranges for people who walk, from children of one year on."""
_LIMITS_M = {
    "KneeWidth": (0.03, 0.2),
    "AnkleWidth": (0.02, 0.15),
    "ElbowWidth": (0.02, 0.15),
    "WristWidth": (0.015, 0.12),
    "LegLength": (0.2, 1.4),
}


@dataclass(frozen=True)
class SubjectData:
    """Mass (kg), stature (m) and further lengths (m) by key, Plug-in Gait's under its own names too (`RKneeWidth`);
    with findings.
    """

    mass_kg: float | None
    height_m: float | None
    measurements: dict[str, float]
    findings: list[Finding]


def subject_data(path: Path, parameters: Any) -> SubjectData:
    """Read the person's data from the file; implausible values are left out (F125).

    Args:
        path: the file, for findings.
        parameters: parameters of the file, as ezc3d has them.
    """
    given = dict(_numbers(parameters))
    masses = {key: value for key, value in given.items() if _of_subject(_MASS, key)}
    heights = {key: value for key, value in given.items() if _of_subject(_HEIGHT, key)}
    mass, _ = next(iter(masses.values()), (None, None))
    height, unit = next(iter(heights.values()), (None, None))
    if height is not None:
        unit = unit or ("m" if height < 3 else "cm" if height < 300 else "mm")
        height /= _PER_METRE[unit]
    found: list[Finding] = []
    if mass is not None and not (_within(mass, _MASS_KG) and _within(_bmi(mass, height), _BMI)):
        found.append(_implausible(path, "mass", Quantity(mass, "kg")))
        mass = None
    if height is not None and not _within(height, _HEIGHT_M):
        found.append(_implausible(path, "stature", Quantity(height, "m")))
        height = unit = None
    lengths, doubted = _lengths(path, {key: each for key, each in given.items() if key not in heights}, unit or "mm")
    if height is not None or lengths:
        found.append(finding("F124", Where(path.name), unit=Quantity(unit or "mm")))
    return SubjectData(mass, height, lengths, [*found, *doubted])


def _numbers(parameters: Any) -> Iterator[tuple[str, tuple[float, str | None]]]:
    """Yield each single positive number of the groups that describe a person, with the unit that it or its key has."""
    known: set[str] = set()
    for group in _GROUPS:
        for key in parameters.get(group, ()):
            if key == "__METADATA__" or key in known:
                continue
            values = parameter_values(parameters, group, key, [""])
            number = _number(values[0]) if np.size(values) == 1 else None
            if number is not None and number[0] > 0:
                known.add(key)
                named = _UNIT.search(key)
                yield key, (number[0], number[1] or (named[1].lower() if named else None))


def _number(value: Any) -> tuple[float, str | None] | None:
    if isinstance(value, (int, float, np.number)):
        return float(value), None
    written = _NUMBER.fullmatch(str(value))
    if written is None:
        return None
    return float(written[1].replace(",", ".")), written[2].lower() if written[2] else None


def _named(pattern: re.Pattern[str], key: str) -> re.Match[str] | None:
    return pattern.fullmatch(folded(_UNIT.sub("", key)))


def _of_subject(pattern: re.Pattern[str], key: str) -> bool:
    """Decide whether a key is this quantity; some programs write a subject's letter before it, A_BodyMass_kg."""
    return bool(_named(pattern, key) or _named(pattern, _SUBJECT.sub("", key)))


def _lengths(
    path: Path, given: Mapping[str, tuple[float, str | None]], unit: str
) -> tuple[dict[str, float], list[Finding]]:
    """Return lengths in m, and F125 for lengths that no unit makes plausible.

    Where the unit of the stature does not fit a joint width, the only one that does is taken.
    """
    lengths: dict[str, float] = {}
    doubted = []
    for key, (value, stated) in given.items():
        measure = _named(_MEASURE, key)
        kind = None if measure is None else _kind(measure)
        if kind is None:
            if _OTHER_LENGTH.search(key):
                lengths[key] = value / _PER_METRE[stated or unit]
            continue
        units = [stated] if stated else [unit, *_PER_METRE]
        fitting = [one for one in dict.fromkeys(units) if _within(value / _PER_METRE[one], _LIMITS_M[kind])]
        if not fitting:
            doubted.append(_implausible(path, key, Quantity(value / _PER_METRE[stated or unit], "m")))
            continue
        lengths[key] = value / _PER_METRE[fitting[0]]
        assert measure is not None
        side = _SIDES.get(measure[1] or measure[4] or "")
        for own in [side] if side else ["R", "L"]:
            lengths.setdefault(f"{own}{kind}", lengths[key])
    return lengths, doubted


def _kind(measure: re.Match[str]) -> str | None:
    kind = measure[2].capitalize() + ("Length" if measure[3] == "length" else "Width")
    return kind if kind in _LIMITS_M else None


def _within(value: float | None, limits: tuple[float, float]) -> bool:
    return value is None or limits[0] <= value <= limits[1]


def _bmi(mass_kg: float, height_m: float | None) -> float | None:
    return None if height_m is None or not _within(height_m, _HEIGHT_M) else mass_kg / height_m**2


def _implausible(path: Path, quantity: str, value: Quantity) -> Finding:
    return finding("F125", Where(path.name), value=value, quantity=Quantity(quantity))
