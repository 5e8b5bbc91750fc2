"""M14: are unit of length, vertical axis and floor right, going by the person's shape and by where the feet stand?

On six fault-free walks over 1.5 to 4.3 m the places where feet stand rise by up to 0.07 degrees along the walkway, and
lie on a line within 2 mm; cameras that are tilted by 3 degrees show 2.9 to 3.1.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.evidence.landmarks import feet_to_pelvis_m
from kinertia.diagnostics.plates.plate_positions import heights_on_plates
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity
from kinertia.trial.data import FloatArray
from kinertia.trial.marker_quality import UPRIGHT_SHARE, extent_m
from kinertia.trial.sampled_data import runs, span_s

_SMALLEST_M, _LARGEST_M = Limit(0.3, "m"), Limit(2.8, "m")
_UPRIGHT = 0.5
"""Cosine of 60 degrees: a sitting person has the pelvis partly beside the feet."""
_STILL_M_S, _SHORTEST_S = 0.15, 0.08
_LONGEST_M, _FEWEST_PLACES = 1.0, 3
_TILTED_RAD = Limit(np.radians(0.8), "rad", usual=(-np.radians(0.1), np.radians(0.1)))
_STEEP_RAD, _OFF_LINE_M = Limit(np.radians(10.0), "rad"), 0.006
"""Steeper are stairs, and jumps from a box."""
_LOWEST_M, _HIGHEST_M = Limit(0.005, "m", usual=(0.023, 0.044)), Limit(0.050, "m")
"""A marker's own radius is 5 mm and more: one beside a small toe was 5.7 mm above the floor. Soles are under both feet,
and markers on the side of a foot are low.

Usual is what fourteen people of eight laboratories have, barefoot and in running shoes. On top of shoes markers are 53
to 60 mm above the floor while standing, but 44 to 48 mm in motion.
"""
_WHILE_STANDING, _IN_MOTION = 50.0, 10.0
"""Percentiles of a marker's height: in motion it is as high as on standing feet for a part of the time only."""


@check("M141", "M142", smallest=_SMALLEST_M, largest=_LARGEST_M)
def unit_and_vertical(context: RecordingContext) -> Iterator[Finding]:
    """Report M141 and M142: wrong unit of length, or vertical axis by the markers' extent or the line from feet to
    pelvis."""
    extent = extent_m(context.markers)
    if extent.max() < _SMALLEST_M:  # of a person, or of the few labels that another set or model knows
        extent = extent_m(context.all_markers)
    if np.isnan(extent).any():
        return
    largest = float(extent.max())
    size = (float(extent[0]), float(extent[1]), float(extent[2]))
    if not _SMALLEST_M <= largest <= _LARGEST_M:
        limit = _SMALLEST_M if largest < _SMALLEST_M else _LARGEST_M
        yield finding("M141", context.at(), extent_m=Quantity(size, "m", limit=limit, usual=(_SMALLEST_M, _LARGEST_M)))
        return
    line = feet_to_pelvis_m(context.landmark_positions)
    lies = line is not None and line[1] <= _UPRIGHT * np.linalg.norm(line)
    if not lies and extent[1] >= UPRIGHT_SHARE * largest:
        return
    upwards = line if lies and line is not None else extent
    axis = int(np.argmax(np.abs(upwards)))
    name = context.along(axis)["file_axis"].lstrip("-")
    negative = context.along(axis)["file_axis"].startswith("-") != bool(upwards[axis] < 0)
    evidence = {"extent_m": Quantity(size, "m")}
    if line is not None:
        evidence["feet_to_pelvis_m"] = Quantity((float(line[0]), float(line[1]), float(line[2])), "m")
    expected = context.recording.vertical.lstrip("+")
    evidence |= {"up": Quantity(f"-{name}" if negative else name), "expected": Quantity(expected)}
    yield with_evidence("M142", context.at(), evidence)


@check("M144", unless=("M141", "M142"), tilted=_TILTED_RAD, steep=_STEEP_RAD)
def floor_slope(context: RecordingContext) -> Iterator[Finding]:
    """Report M144: a floor that rises (positive) or falls along the walk; not tested on a treadmill."""
    if context.feet is None or context.recording.belt is not None:
        return
    markers = context.all_markers
    if len(markers.time) < 2:
        return
    labels = [label for labels_of_foot in context.feet.values() for label in labels_of_foot]
    stances = [_stances(markers.time, markers.positions[:, markers.labels.index(label)]) for label in labels]
    of_marker = np.repeat(np.arange(len(labels)), [len(stance) for stance in stances])
    if len(of_marker) < _FEWEST_PLACES + len(labels):
        return
    place = np.concatenate(stances)
    level = place[:, [0, 2]] - place[:, [0, 2]].mean(axis=0)
    way = np.linalg.svd(level, full_matrices=False)[2][0]
    forward = np.radians(context.travel.direction_deg)
    if way @ [np.cos(forward), -np.sin(forward)] < 0:
        way = -way
    along = level @ way
    if np.ptp(along) < _LONGEST_M:
        return
    # every marker is as high above the floor as it is
    terms = np.column_stack([along, *(of_marker == k for k in range(len(labels)) if (of_marker == k).any())])
    fitted, *_ = np.linalg.lstsq(terms, place[:, 1], rcond=None)
    residual = float(np.sqrt(np.square(place[:, 1] - terms @ fitted).mean()))
    slope = float(np.arctan(fitted[0]))
    if not _TILTED_RAD < abs(slope) < _STEEP_RAD or residual > _OFF_LINE_M:
        return
    yield finding(
        "M144",
        context.at(**context.along(context.axes.fore_aft)),
        slope_rad=Quantity(slope, "rad", limit=_TILTED_RAD, usual=_TILTED_RAD.usual),
        residual_m=Quantity(residual, "m", limit=_OFF_LINE_M),
        length_m=Quantity(float(np.ptp(along)), "m"),
    )


def _stances(time: FloatArray, position: FloatArray) -> FloatArray:
    """Return the positions (s, 3) m of one marker while its foot stands."""
    speed = np.linalg.norm(np.gradient(position, time, axis=0), axis=1)
    still = [
        position[first : last + 1].mean(axis=0)
        for first, last in runs(np.nan_to_num(speed, nan=np.inf) < _STILL_M_S)
        if span_s(time, first, last) >= _SHORTEST_S
    ]
    return np.array(still).reshape(-1, 3)


@check("M143", lowest=_LOWEST_M, highest=_HIGHEST_M)
def floor(context: PersonContext) -> Iterator[Finding]:
    """Report M143: feet that stand above or below the floor, by the lowest marker of toes, metatarsals and heels.

    It is an INFO where the trials show the floor, or a plate, at its height: the person then stands on something, or in
    thick soles.
    """
    static = context.static
    lowest = None if static is None else _lowest(static, _WHILE_STANDING)
    if static is None or lowest is None:
        return
    label, height_m = lowest
    low, high = _LOWEST_M, _HIGHEST_M
    if low <= height_m <= high:
        return
    in_trials = [lowest_m for trial in context.trials for lowest_m in _heights_in_motion(trial)]
    shared = all(own_m < low if height_m < low else own_m > high for own_m in in_trials)
    height = Quantity(height_m, "m", limit=low if height_m < low else high, usual=_LOWEST_M.usual)
    found = finding("M143", static.at(markers=(label,)), height_m=height)
    yield found if shared else replace(found, severity=Severity.INFO)


def _heights_in_motion(trial: RecordingContext) -> list[float]:
    """Return how high (m) the lowest foot marker is above each plate, and above the floor; empty if unknown."""
    on_plates = [lowest - surface for lowest, surface in heights_on_plates(trial).values()]
    lowest = _lowest(trial, _IN_MOTION)
    return [height_m for height_m in (*on_plates, *([] if lowest is None else [lowest[1]])) if np.isfinite(height_m)]


def _lowest(context: RecordingContext, percentile: float) -> tuple[str, float] | None:
    """Return label and height (m) of the lowest foot marker; None where heels or metatarsals are no landmarks."""
    if context.marker_set is None:
        return None
    names = [f"{name}_{side}" for name in ("heel", "metatarsal", "toe") for side in "rl"]
    of_landmark = [context.marker_set.landmarks.get(name, ()) for name in names]
    present = context.all_markers.labels
    labels = list(
        dict.fromkeys(label for labels_of_landmark in of_landmark for label in labels_of_landmark if label in present)
    )
    heights = context.all_markers.select(labels).positions[..., 1]
    shown = np.isfinite(heights).any(axis=0)
    if not all(of_landmark[:4]) or not shown.any():
        return None
    low = np.where(shown, np.nanpercentile(np.where(shown, heights, 0.0), percentile, axis=0), np.inf)
    lowest = int(np.argmin(low))
    return labels[lowest], float(low[lowest])
