"""Builds the body of stadium solids (Yeadon 1990, J Biomech 23:67): masses, centres, inertias from measurements.

The package `yeadon` makes the solids; here they become the segments of the built-in model. A solid lies between two
levels at which girth and width were measured. The segments are:

- upper arm: shoulder to elbow joint centre (A0 to A2); forearm: elbow to finger nails (A2 to A7), the hand with it;
- thigh: hip to knee joint centre (L0 to L3); shank: to the ankle (L3 to L5). All are cut across the limb's axis, which
  is the segment's y axis; a centre of mass is on it, since Yeadon's limbs are round;
- foot: L5 to L9. Yeadon's points its toes; it is rotated about the ankle so that its axis is the foot's x axis and the
  instep is up;
- pelvis: the trunk from the level of the hip joint centres (T0) to that of the lumbar joint, whose height the static
  trial gives: the solid that it is in is cut there, between cross-sections that change linearly from level to level;
- torso: all above, with neck and head.

Axes of the package are x to the left, y backwards, z up.

Yeadon (1990, J Biomech 23:67) builds the body from 95 of them, 58 if the two sides are assumed equal: 21 of trunk and
head, 18 of an arm, 19 of a leg. A level (T0 to T8, A0 to A7, L0 to L9) is the position of a measurement; the picture
that `kinertia init --measures` draws shows it.
"""

import contextlib
import csv
import io
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.resources import files
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any

import numpy as np

from kinertia.errors import PriorError, how_to_install
from kinertia.findings.finding import Severity, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.bsp import BodySegmentParameters, FloatArray, combine

KINDS = ("pelvis", "torso", "thigh_r", "shank_r", "foot_r", "upper_arm_r", "forearm_r")
"""Segments of a body with equal sides."""
DENSITY_KG_M3 = MappingProxyType(
    {
        "head": 1110.0,
        "shoulders": 1040.0,
        "thorax": 920.0,
        "abdomen": 1010.0,
        "upper_arm": 1070.0,
        "forearm": 1130.0,
        "hand": 1160.0,
        "thigh": 1050.0,
        "shank": 1090.0,
        "foot": 1100.0,
    }
)
"""Dempster's densities, which are the package's default."""
_TRUNK = ("abdomen", "abdomen", "thorax", "thorax", "shoulders", "head", "head", "head")
_FOREARM = ("forearm", "forearm", "hand", "hand", "hand")
_UPRIGHT = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
_POINTED = np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])
"""The package's axes in those of a segment, and of the foot."""
GIRTH_OVER_WIDTH = Limit(0.95 * 2.0), Limit(1.05 * np.pi)
"""Least and greatest ratio: 5 % beyond those of any stadium, 2 and pi; depths count as widths."""


def expect_yeadon() -> None:
    """Raise a PriorError with installation instructions if the package yeadon is missing."""
    if find_spec("yeadon") is None:
        raise PriorError(
            f"girths and lengths need the package yeadon, which is not installed: {how_to_install('measures')}"
        )


def stadium_bsp(
    measures_m: FloatArray, lumbar_m: float, density_kg_m3: Mapping[str, float] = DENSITY_KG_M3
) -> BodySegmentParameters:
    """Compute the parameters of the segments `KINDS` of a person with these measurements.

    The pelvis is given from the middle of the hip joint centres, upright; all others from the model's origins. Centres
    of mass are on the segment's axis: girths contain no information on how far in front of it they are.

    Args:
        measures_m: (58,) in the order of `measures`.
        lumbar_m: height of the lumbar joint above the hip joint centres.
        density_kg_m3: of each part.

    Raises:
        PriorError: the package is missing, a level is not beyond the previous one, or the lumbar joint is not in the
            trunk below the nipples.
    """
    person = _person(tuple(measures_m.tolist()))
    for solid in (solid for segment in person.segments for solid in segment.solids):
        if not solid.height > 0.0:
            level = solid.label.partition(": ")[2]
            raise _impossible(f"the level after '{level}'", Quantity(solid.height, "m"), "a level beyond it")
    pelvis, torso = _cut_at(
        _dense([*person.P.solids, *person.T.solids, *person.C.solids], _TRUNK, density_kg_m3), lumbar_m
    )
    leg = _dense(person.J2.solids, ("shank",) * 2 + ("foot",) * 4, density_kg_m3)
    stacks = {
        "pelvis": _upwards(pelvis),
        "torso": _upwards(torso),
        "thigh_r": _downwards(_dense(person.J1.solids, ("thigh",) * 3, density_kg_m3)),
        "shank_r": _downwards(leg[:2]),
        "foot_r": _downwards(leg[2:]),
        "upper_arm_r": _downwards(_dense(person.A1.solids, ("upper_arm",) * 2, density_kg_m3)),
        "forearm_r": _downwards(_dense(person.A2.solids, _FOREARM, density_kg_m3)),
    }
    mass, com, inertia = (np.array(stack) for stack in zip(*(stacks[kind] for kind in KINDS), strict=True))
    axes = np.array([_POINTED if kind == "foot_r" else _UPRIGHT for kind in KINDS])
    return BodySegmentParameters(
        KINDS, mass, np.einsum("sij,sj->si", axes, com), axes @ inertia @ axes.transpose(0, 2, 1)
    )


@lru_cache(maxsize=1)
def _person(measures_m: tuple[float, ...]) -> Any:
    """Make the package's person with equal sides; its output on impossible cross-sections is suppressed.

    This package reports these cross-sections itself.
    """
    expect_yeadon()
    from yeadon import Human

    both = {key: value for measure, value in zip(measures(), measures_m, strict=True) for key in measure.keys}
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Human(both)


def _dense(solids: Sequence[Any], parts: Sequence[str], density_kg_m3: Mapping[str, float]) -> list[tuple[Any, float]]:
    """Pair each solid with its density: the package's own may have been changed, since all its people share them."""
    return [(solid, density_kg_m3[part]) for solid, part in zip(solids, parts, strict=True)]


def _cut_at(trunk: Sequence[tuple[Any, float]], height_m: float) -> tuple[list[Any], list[Any]]:
    """Return the solids below and above a height."""
    from yeadon.solid import Stadium, StadiumSolid

    bottom = 0.0
    for k, (solid, density) in enumerate(trunk[:3]):
        if bottom < height_m < bottom + solid.height:
            share = (height_m - bottom) / solid.height
            lower, upper = solid.stads
            thickness, radius = (
                (1.0 - share) * getattr(lower, name) + share * getattr(upper, name) for name in ("thickness", "radius")
            )
            middle = Stadium("Ls1: umbilicus", "thicknessradius", thickness, radius)
            parts = (lower, middle, height_m - bottom), (middle, upper, bottom + solid.height - height_m)
            below, above = ((StadiumSolid(solid.label, density, *part), density) for part in parts)
            return [*trunk[:k], below], [above, *trunk[k + 1 :]]
        bottom += solid.height
        if height_m == bottom:
            return list(trunk[: k + 1]), list(trunk[k + 1 :])
    what = "the height of the lumbar joint above the hips, by markers,"
    raise _impossible(what, Quantity(height_m, "m"), f"less than {bottom:.2f} m, the height of the nipples")


def _impossible(measure: str, value: Quantity, expected: str) -> PriorError:
    """Make the error S403 for measurements that no body has."""
    stated = {"measure": Quantity(measure), "value_m": value, "expected_m": Quantity(expected)}
    found = with_evidence("S403", Where(part=measure), stated, Severity.ERROR)
    return PriorError.of(found)


def _upwards(stack: Sequence[tuple[Any, float]]) -> tuple[float, np.ndarray, np.ndarray]:
    heights = [solid.height for solid, _ in stack]
    return _joined(stack, np.cumsum([0.0, *heights[:-1]]))


def _downwards(stack: Sequence[tuple[Any, float]]) -> tuple[float, np.ndarray, np.ndarray]:
    return _joined(stack, -np.cumsum([solid.height for solid, _ in stack]))


def _joined(stack: Sequence[tuple[Any, float]], bottoms_m: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Combine solids whose lower ends are at these heights into one body."""
    factors = np.array([density / solid.density for solid, density in stack])
    mass = factors * [solid.mass for solid, _ in stack]
    com = np.zeros((len(stack), 3))
    com[:, 2] = bottoms_m + [float(solid.rel_center_of_mass[2, 0]) for solid, _ in stack]
    inertia = factors[:, None, None] * np.array([solid.rel_inertia for solid, _ in stack])
    return combine(mass, com, inertia)


@dataclass(frozen=True)
class Measure:
    """One measurement.

    Attributes:
        name: as in the form.
        key: as in the package `yeadon`, for limbs on the left.
        level: position, as in the picture.
        kind: "length", "girth", "width" or "depth".
        sd_m: standard deviation of a careful measurement: chosen here, about twice the repeatability of trained people
            (1 % of a girth is the usual target of courses in anthropometry), and more if a joint centre must be
            guessed.
        first: whether it is one of the most informative for the time that it takes.
        what: description.
    """

    name: str
    key: str
    level: str
    kind: str
    sd_m: float
    first: bool
    what: str

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the measurement in the package, for limbs on both sides."""
        mirrored = {"a": "b", "j": "k"}.get(self.key[1])
        return (self.key,) if mirrored is None else (self.key, f"L{mirrored}{self.key[2:]}")


@dataclass(frozen=True, eq=False)
class UsualBuild:
    """Mean and variation of the measurements of people of one stature and mass, in the order of `measures`.

    Attributes:
        median_m: (n,) of the people behind the other figures.
        log_shape: (n,) mean of the logarithms of measures (m), less `log_size`.
        log_sd: (n,) standard deviation between people of one size, and of the mean.
        common: (n, k) correlated variation, in principal components; the rows' squares sum to one.
    """

    median_m: FloatArray
    log_shape: FloatArray
    log_sd: FloatArray
    common: FloatArray


@cache
def measures() -> tuple[Measure, ...]:
    """Return all measurements, from the hips up, then an arm and a leg downwards."""
    return tuple(
        Measure(row["name"], row["key"], row["level"], row["kind"], float(row["sd_mm"]) / 1e3, bool(row["first"]), text)
        for row in _rows("measures.csv")
        for text in [row["what"]]
    )


@cache
def girths_with_widths() -> tuple[tuple[int, int], ...]:
    """Return the indices in `measures` of each girth and of the width or depth of the same cross-section."""
    places = {measure.key: k for k, measure in enumerate(measures())}
    pairs = [(key, f"{key[:-1]}{other}") for key in places if key.endswith("p") for other in "wd"]
    return tuple((places[girth], places[width]) for girth, width in pairs if width in places)


def log_size(mass_kg: float, height_m: float) -> FloatArray:
    """Return the logarithm (58,) of the size that each measurement is proportional to.

    It is the stature, or the square root of mass over stature.
    """
    along = np.array([measure.kind == "length" for measure in measures()])
    size: FloatArray = np.where(along, np.log(height_m), 0.5 * np.log(mass_kg / height_m))
    return size


@cache
def usual_build() -> UsualBuild:
    """Return the build fitted to the five people that come with the package `yeadon` (four men, a woman)."""
    rows = {row["name"]: row for row in _rows("usual_build.csv")}
    columns = {
        column: np.array([float(rows[measure.name][column]) for measure in measures()])
        for column in next(iter(rows.values()))
        if column != "name"
    }
    common = [values for column, values in columns.items() if column.startswith("common")]
    return UsualBuild(columns["median_cm"] / 100.0, columns["log_shape"], columns["log_sd"], np.transpose(common))


def _rows(name: str) -> list[dict[str, str]]:
    with files("kinertia.model").joinpath("data", name).open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))
