"""Turns measured girths and lengths of the person into a prior of the body segment parameters.

They come from a form, as many as the laboratory had time for; lengths of thigh, shank and upper arm also come from the
joint centres of the static trial. The other measurements are expected to be as in five people of the same build,
`expected_measures`, and are correlated with the measured ones. Yeadon's geometric body built from all of them
(`kinertia.model.stadium_body`) then counts as a measurement of segment masses, of centres of mass along the segments
and of moments of inertia, with errors of

- the measurements, and the expectation where nothing was measured;
- the densities: the spread between Chandler's, Clauser's and Dempster's, the three sets of the package;
- the shape: no body consists of stadium solids (5 % of a mass, 8 % more of a moment; assumed here. The one of the five
  people who was weighed is 7 % lighter than his geometric body, with errors of all three kinds);
- the cuts: where a segment ends is a matter of definition, in which the tables differ by 14-16 % of the mass of thigh
  and upper arm; what one segment gains the next loses.

It gives no information on centres of mass across the segments, products of inertia, or differences between the sides;
for the pelvis, only on its mass together with the torso.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import product, zip_longest

import numpy as np

from kinertia.errors import PriorError
from kinertia.estimation.prior import BspPrior, updated
from kinertia.findings.finding import Finding, Severity, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.model.stadium_body import (
    DENSITY_KG_M3,
    GIRTH_OVER_WIDTH,
    KINDS,
    expect_yeadon,
    girths_with_widths,
    log_size,
    measures,
    stadium_bsp,
    usual_build,
)

_DENSITY_SD = {
    **{"head": 0.027, "shoulders": 0.10, "thorax": 0.09, "abdomen": 0.10, "upper_arm": 0.033, "forearm": 0.036},
    **{"hand": 0.037, "thigh": 0.016, "shank": 0.006, "foot": 0.007},
}
"""Relative standard deviation between the three sets that Yeadon (1990) lists."""
_SHAPE_SD, _MOMENT_SD, _CENTRE_SD_M = 0.05, 0.08, 0.008
_CUT_SD = 0.10
"""Relative to the distal segment's mass, at hip, ankle and shoulder."""
_LUMBAR_CUT_SD_M = 0.04
"""Standard deviation of the torso's lower end: the tables cut in oblique planes, and not all at this joint."""
_CUTS = (("thigh_r", "pelvis", 2.0), ("foot_r", "shank_r", 1.0), ("upper_arm_r", "torso", 2.0))
"""Distal segment, the segment that it is cut from, and the number of distal segments."""
_JOINT_LENGTH_SD_M = 0.01
_SHRINKAGE = 0.5
"""Share of the five people's correlations that is used."""
_KINDS_OF_PART = {
    "s": ("pelvis", "torso"),
    "a": ("upper_arm_r", "forearm_r"),
    "j": ("thigh_r", "shank_r", "foot_r"),
}
"""Segments by the letter in the package's keys."""
_STEP = 1e-4
_TELLS = ("mass", "com", "ixx", "iyy", "izz")
FAR_SD = 4.0
_FEW = 3


@dataclass(frozen=True, eq=False)
class MeasuredBody:
    """Parameters of a geometric body built from measurements, and their uncertainty.

    Attributes:
        values: (7, 5) mass (kg), centre of mass along the segment (m) and moments of inertia (kg m2) of `KINDS`.
        covariance: (35, 35) covariance of their errors.
        total_kg, total_sd_kg: mass of the whole body, and its standard deviation.
        findings: one for each measurement that is inconsistent with the others.
    """

    values: np.ndarray
    covariance: np.ndarray
    total_kg: float
    total_sd_kg: float
    findings: tuple[Finding, ...]


def expected_measures(mass_kg: float, height_m: float, mass_sd_kg: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return mean (58,) and covariance (58, 58) of the logarithms of all measurements (m) of a person of this build.

    Lengths scale with stature, girths, widths and depths with the square root of mass over stature, as in geometrically
    similar bodies of one density; the residuals of five people give the spread. Five are few: each variance is averaged
    with the median of its kind, and correlations are halved.
    """
    shape, spread = _shape_and_spread()
    by_mass = (log_size(np.e, 1.0) - log_size(1.0, 1.0)) * mass_sd_kg / mass_kg
    return shape + log_size(mass_kg, height_m), spread + np.outer(by_mass, by_mass)


@cache
def _shape_and_spread() -> tuple[np.ndarray, np.ndarray]:
    usual = usual_build()
    correlation = _SHRINKAGE * usual.common @ usual.common.T + (1.0 - _SHRINKAGE) * np.eye(len(usual.common))
    return usual.log_shape, correlation * np.outer(usual.log_sd, usual.log_sd)


_HOW_MANY = np.array([2.0 if kind.endswith("_r") else 1.0 for kind in KINDS])


def measured_body(
    stated: Mapping[str, tuple[float, float]],
    lengths_m: Mapping[str, float],
    lumbar_m: float,
    mass_kg: float,
    height_m: float,
    mass_sd_kg: float = 0.0,
) -> MeasuredBody:
    """Compute the parameters of a person's geometric body from measurements, with their uncertainty.

    Args:
        stated: value and standard deviation (m) of the measurements made, by name.
        lengths_m: by name, from joint centres.
        lumbar_m: height of the lumbar joint above the hip joint centres.
        mass_kg, height_m, mass_sd_kg: of the person alone, and the mass's standard deviation.

    Raises:
        PriorError: the package yeadon is missing, or the measurements are impossible for a person.
    """
    expect_yeadon()
    names = [measure.name for measure in measures()]
    expected, spread = expected_measures(mass_kg, height_m, mass_sd_kg)
    rows = [(names.index(name), value, sd / value) for name, (value, sd) in stated.items()]
    rows += [(names.index(name), value, _JOINT_LENGTH_SD_M / value) for name, value in lengths_m.items()]
    places, values, sd = (np.array(column) for column in zip(*rows, strict=True))
    seen, noise = np.eye(len(names))[places], np.diag(np.square(sd))
    logs, left = updated(expected, spread, seen, np.log(values), noise)
    implausible = _implausible(stated, seen @ expected, seen @ spread @ seen.T + noise, np.log(values))
    try:
        return _with_errors(logs, left, lumbar_m, implausible)
    except PriorError as error:
        if implausible:  # the likelier cause, in the words of the form
            blocking = [finding.at(Severity.ERROR) for finding in implausible]
            reasons = "; ".join(finding.message for finding in blocking[:_FEW])
            raise PriorError(f"no body has these girths and lengths: {reasons}", found=blocking[0]) from error
        raise


def _implausible(
    stated: Mapping[str, tuple[float, float]], expected: np.ndarray, covariance: np.ndarray, values: np.ndarray
) -> tuple[Finding, ...]:
    """Make S403 for measurements that are far from what the others imply, and for impossible cross-sections."""
    information = np.linalg.inv(covariance)
    away = information @ (values - expected) / np.sqrt(np.diag(information))
    others = values - information @ (values - expected) / np.diag(information)
    found = [
        _unlike(name, Quantity(value, "m"), Quantity(float(np.exp(others[k])), "m"), distance_sd=_in_sd(away[k]))
        for k, (name, (value, _)) in enumerate(stated.items())
        if abs(away[k]) > FAR_SD
    ]
    for girth, width in girths_with_widths():
        girth_name, width_name = (measures()[place].name for place in (girth, width))
        if girth_name in stated and width_name in stated:
            ratio = stated[girth_name][0] / stated[width_name][0]
            low, high = GIRTH_OVER_WIDTH
            if not low < ratio < high:
                measure = f"{girth_name}, as a multiple of {width_name},"
                found.append(_unlike(measure, Quantity(ratio, "1"), Quantity("2 to 3.14"), ratio=Quantity(ratio, "1")))
    return tuple(found)


def _in_sd(distance: float) -> Quantity:
    return Quantity(float(abs(distance)), "1", limit=FAR_SD)


def _unlike(measure: str, value: Quantity, expected: Quantity, **by: Quantity) -> Finding:
    evidence = {"value_m": value, "expected_m": expected, "measure": Quantity(measure), **by}
    return with_evidence("S403", Where(part=measure), evidence)


def _with_errors(logs: np.ndarray, covariance: np.ndarray, lumbar_m: float, found: tuple[Finding, ...]) -> MeasuredBody:
    """Build the body of measurements whose logarithms have this mean and covariance."""
    middle = np.exp(logs)
    values = _predicted(middle, lumbar_m)
    by_measure = _slopes(middle, lumbar_m, values)
    errors = by_measure @ covariance @ by_measure.T
    columns = [
        _DENSITY_SD[part] * (_predicted(middle, lumbar_m, {**DENSITY_KG_M3, part: 1.01 * density}) - values) / 0.01
        for part, density in DENSITY_KG_M3.items()
    ]
    columns.append(_LUMBAR_CUT_SD_M * (_predicted(middle, lumbar_m + _STEP) - values) / _STEP)
    columns += _of_shapes_and_cuts(values)
    shape_errors = np.array([column.ravel() for column in columns]).T
    errors += shape_errors @ shape_errors.T
    mass = slice(0, None, len(_TELLS))
    total_sd = float(np.sqrt(_HOW_MANY @ errors[mass, mass] @ _HOW_MANY))
    return MeasuredBody(values, errors, float(values[:, 0] @ _HOW_MANY), total_sd, found)


def _slopes(measures_m: np.ndarray, lumbar_m: float, values: np.ndarray) -> np.ndarray:
    """Return the derivatives (35, 58) of the body's parameters with respect to the logarithm of each measurement.

    Trunk, arm and leg do not depend on one another, so one measurement of each is changed at a time; but the thigh
    begins with the lowest cross-section of the trunk.
    """
    keys = [measure.key for measure in measures()]
    hips = [k for k, key in enumerate(keys) if key.startswith("Ls0")]
    by_part = [[k for k, key in enumerate(keys) if key[1] == part and k not in hips] for part in _KINDS_OF_PART]
    together = [[k] for k in hips] + [[k for k in pair if k is not None] for pair in zip_longest(*by_part)]
    slopes = np.zeros((*values.shape, len(keys)))
    for which in together:
        moved = measures_m.copy()
        moved[which] *= np.exp(_STEP)
        change = (_predicted(moved, lumbar_m) - values) / _STEP
        for k in which:
            kinds = KINDS if k in hips else _KINDS_OF_PART[keys[k][1]]
            rows = [KINDS.index(kind) for kind in kinds]
            slopes[rows, :, k] = change[rows]
    return slopes.reshape(values.size, len(keys))


def _of_shapes_and_cuts(values: np.ndarray) -> list[np.ndarray]:
    """Return the effects (7, 5) of the independent errors of shape and cuts, one standard deviation each."""
    columns = []
    extensive = np.array([1.0, 0.0, 1.0, 1.0, 1.0])
    for k in range(len(KINDS)):
        size = np.zeros_like(values)
        size[k] = _SHAPE_SD * values[k] * extensive
        columns.append(size)
        for j, sd in enumerate((_CENTRE_SD_M, *_MOMENT_SD * values[k, 2:]), start=1):
            of_shape = np.zeros_like(values)
            of_shape[k, j] = sd
            columns.append(of_shape)
    for distal, proximal, count in _CUTS:
        i, j = KINDS.index(distal), KINDS.index(proximal)
        moved = np.zeros_like(values)
        moved[i] = _CUT_SD * values[i] * extensive
        moved[j] = -count * moved[i, 0] / values[j, 0] * values[j] * extensive
        columns.append(moved)
    return columns


def _predicted(
    measures_m: np.ndarray, lumbar_m: float, density_kg_m3: Mapping[str, float] = DENSITY_KG_M3
) -> np.ndarray:
    """Return the parameters (7, 5) of a geometric body of stadium solids."""
    table = stadium_bsp(measures_m, lumbar_m, density_kg_m3).table()
    return table[np.arange(len(KINDS))[:, None], [[_column(kind, name) for name in _TELLS] for kind in KINDS]]


def _column(kind: str, measured: str) -> int:
    along = "com_x" if kind == "foot_r" else "com_y"
    return PARAMETERS.index(along if measured == "com" else measured)


def with_measures(
    prior: BspPrior,
    skeleton: Skeleton,
    stated: Mapping[str, tuple[float, float]],
    mass_kg: float,
    height_m: float,
    artificial: Collection[str] = (),
    mass_sd_kg: float = 0.0,
) -> tuple[BspPrior, MeasuredBody]:
    """Update the prior of the built-in model with a person's measurements; return it with the geometric body.

    Args:
        prior, skeleton: of the person.
        stated: value and standard deviation (m) by name, of the mean of both sides.
        mass_kg, height_m: of the person alone.
        artificial: segments that are prostheses, on which nothing was measured.
        mass_sd_kg: standard deviation of the mass, where something was weighed with the person.

    Raises:
        PriorError: another model, the package yeadon is missing, or the measurements are impossible for a person.
    """
    names = prior.mean.segments
    if missing := [kind for kind in KINDS if kind not in names]:
        inputs = {"one": Quantity("[prior] measures"), "other": Quantity(f"a model without {missing[0]}")}
        found = with_evidence("S405", Where(), inputs)
        raise PriorError.of(found)
    lengths_m, hip, lumbar = _joint_lengths(skeleton)
    body = measured_body(stated, lengths_m, float(lumbar[1] - hip[1]), mass_kg, height_m, mass_sd_kg)
    seen = np.zeros((body.values.size, 10 * len(names)))
    for i, kind in enumerate(KINDS):
        both = [name for name in names if name in (kind, kind.removesuffix("_r") + "_l") and name not in artificial]
        for name, (j, measured) in product(both, enumerate(_TELLS)):
            seen[len(_TELLS) * i + j, 10 * names.index(name) + _column(kind, measured)] = 1.0 / len(both)
    kept = _with_whole_trunk()
    kept = kept[(kept @ seen).any(axis=1)]  # where both sides are prostheses nothing was measured
    seen, values, errors = kept @ seen, kept @ body.values.ravel(), kept @ body.covariance @ kept.T
    # in standard deviations, since kilograms and kg m2 differ in magnitude
    prior_sd, off = prior.sd.ravel(), np.sqrt(np.diag(errors))
    moved, covariance = updated(
        np.zeros(len(prior_sd)),
        prior.covariance / np.outer(prior_sd, prior_sd),
        seen * prior_sd / off[:, None],
        (values - seen @ prior.mean.table().ravel()) / off,
        errors / np.outer(off, off),
    )
    mean = BodySegmentParameters.from_table(names, prior.mean.table() + (prior_sd * moved).reshape(-1, 10))
    return replace(prior, mean=mean, covariance=covariance * np.outer(prior_sd, prior_sd)), body


def _with_whole_trunk() -> np.ndarray:
    """Return the matrix (30, 35) from the geometric body's parameters to those that a prior can be compared with.

    The position of the cut does not change the mass of pelvis and torso together. It does change the mass of the
    pelvis: that of the tables is 1.5 times the mass between the levels of hip and lumbar joints.
    """
    every = np.eye(len(KINDS) * len(_TELLS))
    pelvis, torso = (len(_TELLS) * KINDS.index(kind) for kind in ("pelvis", "torso"))
    every[torso, pelvis] = 1.0
    return np.delete(every, range(pelvis, pelvis + len(_TELLS)), axis=0)


def _joint_lengths(skeleton: Skeleton) -> tuple[dict[str, float], np.ndarray, np.ndarray]:
    """Return the mean lengths between joint centres of both sides, and hip midpoint and lumbar joint in the pelvis."""
    at = {joint.child: joint.translation for joint in skeleton.joints}
    thigh, shank, arm = (
        float(np.mean([np.linalg.norm(at[f"{child}_{side}"]) for side in "rl"]))
        for child in ("shank", "talus", "forearm")
    )
    lengths = {"leg_knee_length": thigh, "leg_ankle_length": thigh + shank, "arm_elbow_length": arm}
    return lengths, 0.5 * (at["thigh_r"] + at["thigh_l"]), at["torso"]
