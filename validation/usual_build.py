"""Make the table of people's usual girths and lengths.

How large people's girths and lengths usually are; makes src/kinertia/model/data/usual_build.csv.

Its folder is misc/samplemeasurements of the source distribution of the package `yeadon` 2.0.1 (pip download --no-deps
--no-binary :all: yeadon==2.0.1): the measurements of five people, which are not part of this repository.
"""

from pathlib import Path

import numpy as np

from kinertia.model.bsp import FloatArray
from kinertia.model.stadium_body import (
    GIRTH_OVER_WIDTH,
    KINDS,
    UsualBuild,
    girths_with_widths,
    log_size,
    measures,
    stadium_bsp,
)

FILE = Path(__file__).resolve().parents[1] / "src" / "kinertia" / "model" / "data" / "usual_build.csv"
HEADER = """\
# Usual girths and lengths, fitted by validation/usual_build.py to the five people (misc/samplemeasurements) of the
# source distribution of the Python package yeadon 2.0.1. median_cm: of the five; log_shape: mean logarithm of measures
# (m), less that of what they are in proportion to (stature, or the root of mass over stature); log_sd: deviation
# between people; common: principal components of what varies together, in these deviations.
"""
PARTS_OF_STATURE = ("trunk_acromion_length", "head_crown_length", "leg_ankle_length")
ANKLE_HEIGHT = 0.039
"""Share of stature (Drillis & Contini 1966)."""
_ANY_CUT_M = 0.07
"""Where the trunk is cut makes no difference to the whole body's mass."""


def read_people(folder: Path) -> tuple[FloatArray, FloatArray]:
    """Read measures (people, 58) in m, the mean of both sides, and masses (people,) in kg, NaN where not weighed."""
    people, masses = [], []
    for path in sorted(folder.glob("*.txt")):
        found = {}
        for line in path.read_text(encoding="utf-8").splitlines():
            key, colon, value = line.partition("#")[0].partition(":")
            if colon:
                found[key.strip()] = float(value)
        unit_m = found["measurementconversionfactor"]
        people.append([unit_m * np.mean([found[key] for key in measure.keys]) for measure in measures()])
        weighed_kg = found.get("totalmass", -1.0)
        masses.append(weighed_kg if weighed_kg > 0.0 else np.nan)
    return np.array(people), np.array(masses)


def stature_m(measures_m: FloatArray) -> FloatArray:
    """Return statures (people,) from measures (people, 58)."""
    names = [measure.name for measure in measures()]
    total: FloatArray = measures_m[:, [names.index(name) for name in PARTS_OF_STATURE]].sum(axis=1)
    return total / (1.0 - ANKLE_HEIGHT)


def stadium_mass_kg(measures_m: FloatArray) -> float:
    """Return the mass (kg) of the whole body of stadiums with these measures (58,)."""
    return float(stadium_bsp(measures_m, _ANY_CUT_M).mass_kg @ [2.0 if kind.endswith("_r") else 1.0 for kind in KINDS])


def fitted(measures_m: FloatArray, mass_kg: FloatArray) -> UsualBuild:
    """Fit the usual build to people's measures (people, 58); people who were not weighed have the mass of stadiums.

    A few people show little of a spread: it is combined with the median of its kind, which counts as four people more.
    """
    values = measures_m.copy()
    mass = np.where(np.isnan(mass_kg), [stadium_mass_kg(value) for value in values], mass_kg)
    low, high = GIRTH_OVER_WIDTH
    for girth, width in girths_with_widths():  # errors in writing
        ratio = values[:, girth] / values[:, width]
        values[(ratio < 0.98 * low) | (ratio > 1.02 * high), width] = np.nan
    relative = np.log(values) - [log_size(m, h) for m, h in zip(mass, stature_m(measures_m), strict=True)]
    shape = np.nanmean(relative, axis=0)
    off = relative - shape
    count = np.sum(~np.isnan(off), axis=0)
    own_variance = np.nansum(np.square(off), axis=0)
    kinds = np.array([measure.kind for measure in measures()])
    pooled = np.zeros(len(kinds))
    for kind in set(kinds):
        which = kinds == kind
        pooled[which] = np.median(own_variance[which] / (count[which] - 1))
    variance = (own_variance + 4.0 * pooled) / (count + 3.0) * (1.0 + 1.0 / count)
    _, size, direction = np.linalg.svd(np.nan_to_num(off) / np.sqrt(own_variance), full_matrices=False)
    common = direction[:-1].T * size[:-1]  # deviations from a mean: one fewer than people
    common *= np.sign(common.sum(axis=0))
    return UsualBuild(np.median(measures_m, axis=0), shape, np.sqrt(variance), common)


def written(usual: UsualBuild) -> str:
    """Return the text of the file."""
    columns = {"median_cm": 100.0 * usual.median_m, "log_shape": usual.log_shape, "log_sd": usual.log_sd}
    columns |= {f"common_{k}": values for k, values in enumerate(usual.common.T, start=1)}
    rows = [
        [measure.name, *(f"{float(values[k]):.9g}" for values in columns.values())]
        for k, measure in enumerate(measures())
    ]
    return HEADER + "".join(",".join(row) + "\n" for row in [["name", *columns], *rows])


def main(folder: Path) -> None:
    """Write the file."""
    FILE.write_text(written(fitted(*read_people(folder))), encoding="utf-8")
