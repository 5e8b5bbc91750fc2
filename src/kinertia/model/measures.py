"""Lists the measurements that Yeadon's body is built from, with their typical sizes.

Yeadon (1990, J Biomech 23:67) builds the body from 95 of them, 58 if the two sides are assumed equal: 21 of trunk and
head, 18 of an arm, 19 of a leg. A level (T0 to T8, A0 to A7, L0 to L9) is the position of a measurement; the picture
that `kinertia init --measures` draws shows it.
"""

import csv
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from kinertia.model.bsp import FloatArray

GIRTH_OVER_WIDTH = (2.0, np.pi)
"""Least and greatest ratio in any stadium; depths count as widths."""


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
        other = {"a": "b", "j": "k"}.get(self.key[1])
        return (self.key,) if other is None else (self.key, f"L{other}{self.key[2:]}")


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
    along = np.array([one.kind == "length" for one in measures()])
    size: FloatArray = np.where(along, np.log(height_m), 0.5 * np.log(mass_kg / height_m))
    return size


@cache
def usual_build() -> UsualBuild:
    """Return the build fitted to the five people that come with the package `yeadon` (four men, a woman)."""
    rows = {row["name"]: row for row in _rows("usual_build.csv")}
    columns = {
        column: np.array([float(rows[one.name][column]) for one in measures()])
        for column in next(iter(rows.values()))
        if column != "name"
    }
    common = [values for column, values in columns.items() if column.startswith("common")]
    return UsualBuild(columns["median_cm"] / 100.0, columns["log_shape"], columns["log_sd"], np.transpose(common))


def _rows(name: str) -> list[dict[str, str]]:
    with files("kinertia.model").joinpath("data", name).open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))
