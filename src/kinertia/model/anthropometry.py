"""Computes literature BSPs for a person's mass, height, sex and segment lengths.

Two tables, both scaled by total mass and segment lengths:

- `dumas` (default): Dumas, Chèze & Verriest (2007) with the corrected foot and the thorax/abdomen split;
  centres of mass in three dimensions and full inertia tensors. Use it where BSPs are estimated: with centres
  of mass on the segment axes, segment masses cannot be identified from gait.
- `deleva`: de Leva (1996), Table 4; centres of mass on the segments' long axes, no products of inertia.

The numbers are in `data/dumas2007.csv` and `data/deleva1996.csv`, with their units and endpoints.
"""

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files

import numpy as np

from kinertia.errors import SubjectError, problem_of
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.bsp import MIRROR_SIGNS, BodySegmentParameters, FloatArray, combine

SEGMENTS = (
    *("pelvis", "torso", "thigh_r", "shank_r", "foot_r", "thigh_l", "shank_l", "foot_l"),
    *("upper_arm_r", "forearm_r", "upper_arm_l", "forearm_l"),
)
"""The twelve segments with mass of the 27-DOF model; torso includes the head, forearm the hand."""

_DUMAS_STATURE_M = {"male": 1.77, "female": 1.61}
_DUMAS_TORSO_COM = {"male": (-0.036, -0.420, -0.002), "female": (-0.016, -0.436, -0.006)}
"""CoM of the 2007 table's one-piece torso, in torso lengths from the cervical joint."""
_DELEVA_STATURE_M = {"male": 1.741, "female": 1.735}


@dataclass(frozen=True)
class BodyGeometry:
    """Joint centres and segment lengths that the tables are scaled with, measured in a static trial.

    Attributes:
        lumbar_joint_m: (x, y, z) of the lumbar joint centre (L5/S1) in the pelvis frame (origin mid-ASIS), m.
        mid_hip_m: (x, y, z) of the midpoint of the hip joint centres in the pelvis frame, m.
        lengths_m: m, by name, where JC is a joint centre: `torso` lumbar JC to cervical JC; and with the
            suffixes `_r` and `_l`: `thigh` hip JC to knee JC; `shank` knee JC to ankle JC; `foot` ankle JC to
            the midpoint of metatarsal heads 1 and 5; `foot_total` heel to toe tip (only de Leva needs it);
            `upper_arm` shoulder JC to elbow JC; `forearm` elbow JC to wrist JC.

    Examples:
        >>> lengths = {f"{name}_{side}": 0.4 for side in "rl" for name in ("thigh", "shank")}
        >>> lengths |= {f"{name}_{side}": 0.28 for side in "rl" for name in ("upper_arm", "forearm", "foot_total")}
        >>> lengths |= {"foot_r": 0.15, "foot_l": 0.15, "torso": 0.48}
        >>> geometry = kinertia.BodyGeometry((-0.1, 0.03, 0.0), (-0.05, -0.08, 0.0), lengths)
        >>> round(kinertia.literature_bsp(70.0, 1.75, "male", geometry).total_mass_kg, 1)
        70.0
    """

    lumbar_joint_m: tuple[float, float, float]
    mid_hip_m: tuple[float, float, float]
    lengths_m: Mapping[str, float]


@dataclass(frozen=True)
class _Row:
    """A table row in ISB axes: mass / body mass; CoM / L; tensor / (m L^2); reference L (m) or NaN."""

    mass: float
    com: FloatArray
    gyration: FloatArray
    length_m: float


@dataclass(frozen=True)
class _Part:
    """A row placed in the frame of a model segment, as if on the right side: CoM = origin + com * length."""

    segment: str
    row: _Row
    origin_m: FloatArray
    length_m: float


BODY_MASS_KG = Limit(10.0, "kg"), Limit(300.0, "kg")
STATURE_M = Limit(0.5, "m"), Limit(2.5, "m")
"""Least and largest that are believed."""
_UNITS_OF_HEIGHT = {"millimetres": 300.0, "centimetres": 100.0, "inches": 20.0, "feet": 3.0}
"""Least height in each unit."""
_OTHER_UNIT = "another unit"


def check_subject(mass_kg: float, height_m: float, sex: str) -> None:
    """Reject a mass (kg), height (m) or sex ("male" or "female") that is impossible.

    Raises:
        SubjectError: mass outside 10-300 kg, height outside 0.5-2.5 m, or another sex.
    """
    if not BODY_MASS_KG[0] <= mass_kg <= BODY_MASS_KG[1]:
        unit = "grams" if 1000.0 < mass_kg < np.inf else _OTHER_UNIT
        raise _implausible("mass_kg", "mass", mass_kg, Quantity(mass_kg, "kg"), unit)
    if not STATURE_M[0] <= height_m <= STATURE_M[1]:
        unit = next((name for name, least in _UNITS_OF_HEIGHT.items() if height_m > least), _OTHER_UNIT)
        raise _implausible("height_m", "stature", height_m, Quantity(height_m, "m"), unit)
    if sex not in _DUMAS_STATURE_M:
        raise _implausible("sex", "sex", sex, Quantity(str(sex)), "neither male nor female")


def _implausible(field: str, quantity: str, value: object, shown: Quantity, unit: str) -> SubjectError:
    found = finding("S102", Where(part=quantity), value=shown, quantity=Quantity(quantity), unit=Quantity(unit))
    return SubjectError(field, value, problem_of(found)).with_finding(found)


def reference_lengths(height_m: float, sex: str) -> dict[str, float]:
    """Return segment lengths (m) of the tables' reference subjects, scaled by stature; names as in `BodyGeometry`.

    They replace lengths that were not measured. Torso and foot are Dumas', the rest de Leva's.
    """
    dumas, deleva = _dumas_table(sex), _deleva_table(sex)
    torso = dumas["thorax"].length_m + dumas["abdomen"].length_m
    per_dumas = {"torso": torso, "foot": dumas["foot"].length_m}
    per_deleva = {name: deleva[name].length_m for name in ("thigh", "shank", "upper_arm", "forearm")}
    per_deleva["foot_total"] = deleva["foot"].length_m
    lengths = {name: height_m * length / _DUMAS_STATURE_M[sex] for name, length in per_dumas.items()}
    return lengths | {name: height_m * length / _DELEVA_STATURE_M[sex] for name, length in per_deleva.items()}


def literature_bsp(
    mass_kg: float, height_m: float, sex: str, geometry: BodyGeometry, source: str = "dumas"
) -> BodySegmentParameters:
    """Compute body segment parameters of the 27-DOF model's twelve segments (`SEGMENTS`) from the literature.

    Segment frames are those of the model (ISB: x anterior, y up, z right; origin at the proximal joint
    centre): pelvis at mid-ASIS; torso at the lumbar joint, y to the cervical joint; limbs at the proximal
    joint, y from the distal to the proximal joint; foot at the ankle joint, x from heel to toe and y up when
    standing. Left mirrors right; only lengths may differ between sides.

    Both tables: the hand (wrist to fingertip) continues the forearm along its axis, with parallel frames; its
    length is the stature times Hand 2 (WJC-DAC3) over the stature of de Leva's reference subject. Head and
    torso are one body.

    Deviations from the sources:

    - The mass fractions (Dumas: male 1.002, female 0.999; de Leva: 1.0000, 0.9999) are divided by their sum,
      so that the total mass is exactly `mass_kg`.
    - Dumas: thorax and abdomen lie in line along the torso's y axis, thorax 334/477 (male) or 322/429
      (female) of its length, and the head stands upright along y above the cervical joint, 0.278/1.77 (male)
      or 0.243/1.61 (female) of the stature high. In reality the thoracolumbar joint lies behind that line, so that
      stacked in line their CoM would be 4 % of the torso's length too far forward: both are moved together until it is
      where it is in the 2007 table's one-piece torso. (Its tensor is not used: no source for the female one; the one
      quoted from memory is not physically consistent.)
    - de Leva: pelvis is the lower trunk (omphalion to mid hip), torso the middle trunk, upper trunk (from
      cervicale, taken as the height of the cervical joint) and head. Their lengths are the reference
      subject's, scaled by the height of the cervical joint over the mid hip when the torso stands upright on
      the pelvis (head: by stature). The lower trunk's axis is the vertical through the mid hip, the others'
      is the torso's y axis. In de Leva's cut the omphalion is above the lumbar joint, so that the pelvis includes a
      slice of the belly.
    - de Leva's foot is measured from the heel, and no table gives the ankle's position between heel and toe tip. The
      foot is placed so that for the reference feet its CoM equals Dumas' in the sagittal plane: the ankle is 0.17
      (male) or 0.21 (female) of the foot's length before the heel, and the heel-toe axis 0.20 (male) or 0.31 (female)
      of `foot` below the ankle.

    Args:
        mass_kg: body mass, kg, 10-300.
        height_m: stature, m, 0.5-2.5.
        sex: "male" or "female".
        geometry: measured joint centres and lengths.
        source: "dumas" or "deleva".

    Raises:
        SubjectError: an argument is impossible, or a length that the source needs is missing.
    """
    check_subject(mass_kg, height_m, sex)
    if source not in _SOURCES:
        raise SubjectError("source", source, f"choose one of {', '.join(_SOURCES)}.")
    _check_geometry(geometry, height_m, source)
    parts = list(_SOURCES[source](height_m, sex, geometry))
    mass_scale = mass_kg / sum(part.row.mass for part in parts)
    bodies = []
    for segment in SEGMENTS:
        of_segment = [part for part in parts if part.segment == segment]
        mass = np.array([mass_scale * part.row.mass for part in of_segment])
        com = [part.origin_m + part.row.com * part.length_m for part in of_segment]
        inertia = [m * part.length_m**2 * part.row.gyration for m, part in zip(mass, of_segment, strict=True)]
        bodies.append(combine(mass, com, inertia))
    right = BodySegmentParameters(SEGMENTS, *(np.array(values) for values in zip(*bodies, strict=True)))
    left = np.array([segment.endswith("_l") for segment in SEGMENTS])
    return BodySegmentParameters.from_table(SEGMENTS, np.where(left[:, None], MIRROR_SIGNS, 1.0) * right.table())


def _check_geometry(geometry: BodyGeometry, height_m: float, source: str) -> None:
    names = ["thigh", "shank", "foot", "upper_arm", "forearm"] + ["foot_total"] * (source == "deleva")
    for name in ["torso", *(f"{name}_{side}" for name in names for side in "rl")]:
        length = geometry.lengths_m.get(name)
        if length is None:
            raise SubjectError(name, length, f"this length is missing; the '{source}' table needs it, in metres.")
        if not 0.0 < length < height_m:
            raise _implausible(name, f"length of {name}", length, Quantity(length, "m"), _OTHER_UNIT)
    rise = geometry.lumbar_joint_m[1] - geometry.mid_hip_m[1]
    if not 0.0 < rise < height_m:
        what = "height of the lumbar joint above the hips"
        raise _implausible("lumbar_joint_m", what, rise, Quantity(rise, "m"), "misplaced pelvis markers")


def _dumas_parts(height_m: float, sex: str, geometry: BodyGeometry) -> Iterator[_Part]:
    table, lengths = _dumas_table(sex), geometry.lengths_m
    torso = lengths["torso"]
    thorax = torso * table["thorax"].length_m / (table["thorax"].length_m + table["abdomen"].length_m)
    head = height_m * table["head"].length_m / _DUMAS_STATURE_M[sex]
    lumbar = np.array(geometry.lumbar_joint_m, dtype=float)
    pelvis = float(np.linalg.norm(lumbar - geometry.mid_hip_m))
    yield _Part("pelvis", table["pelvis"], lumbar, pelvis)
    trunk = [
        _Part("torso", table["abdomen"], _along_y(torso - thorax), torso - thorax),
        _Part("torso", table["thorax"], _along_y(torso), thorax),
    ]
    com = sum(p.row.mass * (p.origin_m + p.row.com * p.length_m) for p in trunk) / sum(p.row.mass for p in trunk)
    shift = _along_y(torso) + torso * np.array(_DUMAS_TORSO_COM[sex]) - com
    yield from (replace(part, origin_m=part.origin_m + shift) for part in trunk)
    yield _Part("torso", table["head"], _along_y(torso), head)
    for side in "rl":
        yield from _limb_parts(table, lengths, side, _hand_length(height_m, sex))
        yield _Part(f"foot_{side}", table["foot"], np.zeros(3), lengths[f"foot_{side}"])


def _deleva_parts(height_m: float, sex: str, geometry: BodyGeometry) -> Iterator[_Part]:
    table, lengths = _deleva_table(sex), geometry.lengths_m
    torso = lengths["torso"]
    mid_hip = np.array(geometry.mid_hip_m, dtype=float)
    trunk = ("upper_trunk", "middle_trunk", "lower_trunk")
    scale = (geometry.lumbar_joint_m[1] - mid_hip[1] + torso) / sum(table[name].length_m for name in trunk)
    upper, middle, lower = (scale * table[name].length_m for name in trunk)
    head = height_m * table["head"].length_m / _DELEVA_STATURE_M[sex]
    yield _Part("pelvis", table["lower_trunk"], mid_hip + _along_y(lower), lower)
    yield _Part("torso", table["middle_trunk"], _along_y(torso - upper), middle)
    yield _Part("torso", table["upper_trunk"], _along_y(torso), upper)
    yield _Part("torso", table["head"], _along_y(torso + head), head)
    foot, dumas = table["foot"], _dumas_table(sex)["foot"]
    heel_to_ankle = foot.com[0] - dumas.com[0] * dumas.length_m / foot.length_m
    for side in "rl":
        yield from _limb_parts(table, lengths, side, _hand_length(height_m, sex))
        total = lengths[f"foot_total_{side}"]
        heel = np.array([-heel_to_ankle * total, dumas.com[1] * lengths[f"foot_{side}"], 0.0])
        yield _Part(f"foot_{side}", foot, heel, total)


_SOURCES = {"dumas": _dumas_parts, "deleva": _deleva_parts}


def _limb_parts(table: Mapping[str, _Row], lengths: Mapping[str, float], side: str, hand: float) -> Iterator[_Part]:
    for name in ("thigh", "shank", "upper_arm", "forearm"):
        yield _Part(f"{name}_{side}", table[name], np.zeros(3), lengths[f"{name}_{side}"])
    yield _Part(f"forearm_{side}", table["hand"], _along_y(-lengths[f"forearm_{side}"]), hand)


def _hand_length(height_m: float, sex: str) -> float:
    return height_m * _deleva_table(sex)["hand"].length_m / _DELEVA_STATURE_M[sex]


def _along_y(y: float) -> FloatArray:
    return np.array([0.0, y, 0.0])


@cache
def _dumas_table(sex: str) -> dict[str, _Row]:
    table = {}
    for name, row in _read("dumas2007.csv", sex).items():
        radii = np.array([row[key] for key in ("rxx", "ryy", "rzz", "rxy", "rxz", "ryz")]) / 100.0
        xx, yy, zz, xy, xz, yz = np.sign(radii) * radii**2
        gyration = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        com = np.array([row[key] for key in ("com_x", "com_y", "com_z")]) / 100.0
        table[name] = _Row(row["mass"] / 100.0, com, gyration, row["length"] / 1000.0)
    return table


@cache
def _deleva_table(sex: str) -> dict[str, _Row]:
    table = {}
    for name, row in _read("deleva1996.csv", sex).items():
        sagittal, transverse, longitudinal = row["r_sagittal"], row["r_transverse"], row["r_longitudinal"]
        if name == "foot":  # long axis x, heel to toe; the paper's sagittal column about z, transverse about y
            com, radii = [row["com"], 0.0, 0.0], [longitudinal, transverse, sagittal]
        else:  # long axis y, downwards
            com, radii = [0.0, -row["com"], 0.0], [sagittal, longitudinal, transverse]
        gyration = np.diag(np.square(radii))
        table[name] = _Row(row["mass"], np.array(com), gyration, row["length"] / 1000.0)
    return table


def _read(name: str, sex: str) -> dict[str, dict[str, float]]:
    """Read the numbers of the table's columns, by segment."""
    with files("kinertia.model").joinpath("data", name).open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(line for line in file if not line.startswith("#")) if row["sex"] == sex]
    words = ("sex", "segment", "endpoints")
    return {
        row["segment"]: {key: float(cell or "nan") for key, cell in row.items() if key not in words} for row in rows
    }
